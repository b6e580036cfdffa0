"""Numbers side by side in one vector register, as types of the compiler: their arithmetic.

An operand that is a number stands for itself in every place.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import models, overload, register_model

from hybrid.kernels.instructions.registers import FUSED, built_in, everywhere, vector_of
from hybrid.kernels.types.numba_door.building import intrinsic
from hybrid.kernels.types.numba_door.part_compiler import PartCompiler

# These functions are small and run at every order: without inlining, the call would cost as much as the work.
HERE: Any = {
    "_nrt": False,
    "no_cpython_wrapper": True,
    "no_cfunc_wrapper": True,
    "forceinline": True,
    "pipeline_class": PartCompiler,
}
# A float is ``2 ** (exponent - BIAS)`` times its mantissa; the mantissa is in the lower bits.
BIAS, BITS_OF_MANTISSA = 1023, 52


class WideType(types.Type):
    """The numba type of so many numbers side by side."""

    def __init__(self, width):
        super().__init__(f"Wide{width}")
        self.width = width


@register_model(WideType)
class _Register(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, vector_of(kind.width))


def whole_numbers(width):
    """The type of a register of whole numbers."""
    return ir.VectorType(ir.IntType(64), width)


def in_registers(builder, width, kinds, arguments):
    """Arguments as registers: a number stands for itself in every place."""
    return [
        argument if isinstance(kind, WideType) else everywhere(builder, argument, width)
        for kind, argument in zip(kinds, arguments, strict=True)
    ]


def in_every_place(kind):
    """The function that gives one number in every place of a register of a type."""

    def typed(typing_context, number):
        def generate(context, builder, signature, arguments):
            return everywhere(builder, arguments[0], kind.width)

        return kind(types.float64), generate

    return intrinsic(typed)


def of_several(count, write, result=None):
    """The function of so many operands that ``write`` writes; its result is a register if nothing else."""

    def typed(kinds):
        [kind, *_] = [each for each in kinds if isinstance(each, WideType)]
        kinds = [each if isinstance(each, WideType) else types.float64 for each in kinds]

        def generate(context, builder, signature, arguments):
            return write(builder, *in_registers(builder, kind.width, kinds, arguments))

        return (result or kind)(*kinds), generate

    if count == 1:
        return intrinsic(lambda typing_context, a: typed([a]))
    if count == 2:
        return intrinsic(lambda typing_context, a, b: typed([a, b]))
    return intrinsic(lambda typing_context, a, b, c: typed([a, b, c]))


def _built_in(name, count):
    """A function that the compiler provides for registers."""
    return of_several(
        count, lambda builder, *registers: built_in(builder, name, registers[0].type.count, *registers)
    )


def larger_of(builder, a, b):
    """The instructions of ``larger``."""
    return builder.select(builder.fcmp_ordered(">", a, b), a, b)


# Absolute values and square roots, whole parts, ``a * b + c``.
magnitude, square_root = _built_in("fabs", 1), _built_in("sqrt", 1)
whole_part, fused = _built_in("floor", 1), _built_in("fmuladd", 3)
# The larger or the smaller number in each place; ``b`` where one is nan.
larger = of_several(2, larger_of)
smaller = of_several(2, lambda builder, a, b: builder.select(builder.fcmp_ordered("<", a, b), a, b))
_negative = of_several(1, lambda builder, a: builder.fneg(a))


@overload(operator.neg, jit_options=HERE)
def _overload_negative(a):
    return (lambda a: _negative(a)) if isinstance(a, WideType) else None


def overload_operator(operation, function):
    """Let an operator of two registers, or of a register and a number, be a function."""

    @overload(operation, jit_options=HERE)
    def choose(a, b):
        if isinstance(a, WideType) or isinstance(b, WideType):
            return lambda a, b: function(a, b)
        return None


def _operation(instruction):
    return of_several(2, lambda builder, a, b: getattr(builder, instruction)(a, b, flags=FUSED))


for _operator, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    overload_operator(_operator, _operation(_instruction))


@intrinsic
def bits_of_floats(typing_context, numbers):
    """The bits of positive floats, as numbers: all but the last few."""

    def generate(context, builder, signature, arguments):
        bits = builder.bitcast(arguments[0], whole_numbers(numbers.width))
        return builder.sitofp(bits, vector_of(numbers.width))

    return numbers(numbers), generate


@intrinsic
def from_bits(typing_context, numbers):
    """The floats whose bits, as whole numbers, are these numbers."""

    def generate(context, builder, signature, arguments):
        whole = whole_numbers(numbers.width)
        return builder.bitcast(builder.fptosi(arguments[0], whole), vector_of(numbers.width))

    return numbers(numbers), generate
