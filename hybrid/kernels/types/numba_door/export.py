"""Machine code of the kernels that Python calls or hands to other kernels.

In an object file, a kernel is two functions. Other kernels call the first one, which takes the
arguments as the compiler passes them. Python calls the second one, which takes the address of a table with
the words of all arguments and returns a word. Neither function needs the compiler's run-time library, so a
process that finds the file on disk never imports the compiler.
"""

from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import types
from numba.core.compiler_lock import global_compiler_lock

from hybrid.kernels.types.kinds import BY_WORDS, Pair, is_bundle, width_of
from hybrid.kernels.types.numba_door.arrays import array_kind, array_of_parts, parts_of
from hybrid.kernels.types.numba_door.lowering import array_of
from hybrid.kernels.types.numba_door.numba_types import numba_type, signature_of, word_in
from hybrid.kernels.types.numba_door.part_compiler import WholeLibrary

WORD = ir.IntType(64)


class _ExportLibrary(WholeLibrary):
    """A library whose machine code goes into a file, not into this process."""

    def machine_code(self):
        """The contents of an object file."""
        return self._codegen._tm.emit_object(self._final_module)


class Export(NamedTuple):
    """A kernel that a module exports, and the kinds of its signature."""

    kernel: Any
    result: Any
    arguments: tuple[Any, ...]


def exports_of(module):
    """The kernels that a module exports, by name."""
    return {
        name: Export(each, *each.exported)
        for name, each in vars(module).items()
        if hasattr(each, "exported") and each.py_func.__module__ == module.__name__
    }


@global_compiler_lock
def object_code(exports):
    """Compile kernels that were exported together; the contents of one object file.

    Functions that several of them call are compiled once.
    """
    library: Any = None
    for name, (kernel, result, arguments) in exports.items():
        signature = signature_of(result, *arguments)
        kernel.compile(signature)
        compiled = kernel.overloads[signature.args]
        context = compiled.target_context
        library = library or _ExportLibrary(context.codegen(), name)
        library.add_linking_library(compiled.library)
        module = context.create_module(name)
        function = _write_typed(context, module, name, compiled.fndesc)
        if not (isinstance(result, Pair) or any(map(is_bundle, arguments))):
            _write_by_words(context, module, function, result, arguments)
        library.add_ir_module(module)
    library.finalize()
    return library.machine_code()


def _write_typed(context, module, name, described):
    """The function that other kernels call. Kernels raise nothing, so their status is not looked at."""
    result, arguments = described.restype, described.argtypes
    convention = context.call_conv
    called = ir.Function(module, convention.get_function_type(result, arguments), described.llvm_func_name)
    kinds = [
        array_kind(each.ndim) if isinstance(each, types.Array) else context.get_value_type(each)
        for each in arguments
    ]
    function = ir.Function(module, ir.FunctionType(context.get_value_type(result), kinds), name)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    values = [
        array_of(context, builder, kind, *parts_of(builder, each, kind.ndim))
        if isinstance(kind, types.Array)
        else each
        for kind, each in zip(arguments, function.args, strict=True)
    ]
    _, value = convention.call_function(builder, called, result, arguments, values)
    builder.ret(value)
    return function


def _write_by_words(context, module, called, result, arguments):
    """The function that Python calls: it reads the arguments from a table, whose address it is given."""
    kind = ir.FunctionType(WORD, [ir.PointerType()])
    function = ir.Function(module, kind, called.name + BY_WORDS)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    [table] = function.args
    values, place = [], 0
    for argument in arguments:
        values.append(_argument(context, builder, table, place, numba_type(argument)))
        place += width_of(argument)
    value = builder.call(called, values)
    if result is None:
        value = WORD(0)
    elif value.type == ir.DoubleType():
        value = builder.bitcast(value, WORD)
    elif value.type != WORD:
        value = builder.zext(value, WORD)
    builder.ret(value)


def _argument(context, builder, table, place, kind):
    def word(offset, llvm_type):
        return word_in(context, builder, table, place + offset, llvm_type)

    if isinstance(kind, types.Array):
        lengths = [word(1 + axis, WORD) for axis in range(kind.ndim)]
        return array_of_parts(builder, word(0, ir.PointerType()), lengths)
    if kind == types.boolean:
        return builder.trunc(word(0, WORD), ir.IntType(1))
    return word(0, context.get_value_type(kind))
