"""Runs generated text twice: as Python and as machine code."""

import ctypes

import numpy as np
from hybrid.expression.code import IMPORTS

from hybrid.compiler.llvm.engine import load
from hybrid.compiler.llvm.lowering import MATRIX_SIGNATURE, SERIES_SIGNATURE, VECTOR_SIGNATURE, parsed
from hybrid.compiler.llvm.machine import machine_code

SIGNATURES = (VECTOR_SIGNATURE, MATRIX_SIGNATURE, SERIES_SIGNATURE)


def both(lines, kind=SERIES_SIGNATURE, *, fused=False):
    """Two functions with the same arguments that run a text as Python and as machine code."""
    head = f"def function({', '.join(kind.names)}):\n"
    source = head + "".join(f"    {line}\n" for line in lines)
    scope = {}
    exec(IMPORTS + source, scope)
    code = machine_code([(parsed(source)["function"], kind, fused)])
    return scope["function"], called(load(code, ["function"])["function"])


def called(compiled):
    """A compiled function that can be called with numbers and arrays."""

    def call(*arguments):
        words = [word for argument in arguments for word in _words(argument)]
        kinds = [ctypes.c_double if isinstance(word, float) else ctypes.c_int64 for word in words]
        ctypes.CFUNCTYPE(None, *kinds)(compiled.address)(*words)

    return call


def _words(argument):
    """The words of an argument: a number, or an array's owner, sizes and data address."""
    if not isinstance(argument, np.ndarray):
        return [argument]
    return [0, 0, argument.size, argument.itemsize, argument.ctypes.data, *argument.shape, *argument.strides]
