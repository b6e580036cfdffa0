"""One number of each run that is abreast, in one register, as a type of the compiler.

``Rows`` have arithmetic and comparisons with each other and with numbers. A comparison is a ``Mask``, one
truth value of each run. No operation mixes the numbers of different runs, so what a run computes does not
depend on the runs beside it.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import njit, types
from numba.extending import models, overload, register_model

from hybrid.kernels.arithmetic.lanes import HERE
from hybrid.kernels.instructions.registers import FUSED, NUMBER, built_in, everywhere, read, vector_of, write
from hybrid.kernels.types.codes import ABREAST
from hybrid.kernels.types.numba_door.building import intrinsic, unpack_tuple
from hybrid.kernels.types.options import INLINE

WHOLE = ir.VectorType(ir.IntType(64), ABREAST)
BITS_OF_MANTISSA, BIAS = 52, 1023


class RowsType(types.Type):
    """The numba type of one number of each run."""

    def __init__(self):
        super().__init__("Rows")


class MaskType(types.Type):
    """The numba type of one truth value of each run."""

    def __init__(self):
        super().__init__("Mask")


ROWS, MASK = RowsType(), MaskType()


@register_model(RowsType)
class _Rows(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, vector_of(ABREAST))


@register_model(MaskType)
class _Mask(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.VectorType(ir.IntType(1), ABREAST))


def _in_rows(builder, kinds, arguments):
    """The arguments as registers: a number stands for itself in every run."""
    return [
        argument if kind == ROWS else everywhere(builder, argument, ABREAST)
        for kind, argument in zip(kinds, arguments, strict=True)
    ]


def _address(context, builder, kind, array, indices):
    """Where the numbers of an entry of an array begin: each entry has one number of each run."""
    made = context.make_array(kind)(context, builder, array)
    *rows, last = indices
    place = builder.mul(last, last.type(ABREAST))
    for row in rows:
        place = builder.add(place, builder.mul(row, unpack_tuple(builder, made.shape)[1]))
    return builder.gep(made.data, [place], source_etype=NUMBER)


@intrinsic
def rows_at(typing_context, array, place):
    """Entry ``place`` of a vector, which has one number of each run."""

    def generate(context, builder, signature, arguments):
        address = _address(context, builder, array, arguments[0], arguments[1:])
        return read(builder, address, ABREAST)

    return ROWS(array, types.intp), generate


@intrinsic
def entry_at(typing_context, array, row, column):
    """An entry of a matrix, which has one number of each run."""

    def generate(context, builder, signature, arguments):
        address = _address(context, builder, array, arguments[0], arguments[1:])
        return read(builder, address, ABREAST)

    return ROWS(array, types.intp, types.intp), generate


@intrinsic
def put_rows(typing_context, array, place, rows):
    """Write entry ``place`` of a vector."""

    def generate(context, builder, signature, arguments):
        address = _address(context, builder, array, arguments[0], arguments[1:2])
        write(builder, _in_rows(builder, [rows], arguments[2:])[0], address)
        return context.get_dummy_value()

    return types.void(array, types.intp, rows if rows == ROWS else types.float64), generate


@intrinsic
def put_entry(typing_context, array, row, column, rows):
    """Write an entry of a matrix."""

    def generate(context, builder, signature, arguments):
        address = _address(context, builder, array, arguments[0], arguments[1:3])
        write(builder, _in_rows(builder, [rows], arguments[3:])[0], address)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, rows if rows == ROWS else types.float64), generate


@intrinsic
def in_every_run(typing_context, number):
    """One number in every run."""

    def generate(context, builder, signature, arguments):
        return everywhere(builder, arguments[0], ABREAST)

    return ROWS(types.float64), generate


@intrinsic
def where(typing_context, mask, a, b):
    """``a`` in the runs of a mask, ``b`` in the others."""
    kinds = [each if each == ROWS else types.float64 for each in (a, b)]

    def generate(context, builder, signature, arguments):
        return builder.select(arguments[0], *_in_rows(builder, kinds, arguments[1:]))

    return ROWS(MASK, *kinds), generate


@intrinsic
def both(typing_context, a, b):
    """The runs that two masks have in common."""

    def generate(context, builder, signature, arguments):
        return builder.and_(*arguments)

    return MASK(MASK, MASK), generate


@intrinsic
def either(typing_context, a, b):
    """The runs of one mask or another."""

    def generate(context, builder, signature, arguments):
        return builder.or_(*arguments)

    return MASK(MASK, MASK), generate


@intrinsic
def without(typing_context, a, b):
    """The runs of the mask ``a`` that are not in ``b``."""

    def generate(context, builder, signature, arguments):
        every = MASK_KIND([ir.IntType(1)(1)] * ABREAST)
        return builder.and_(arguments[0], builder.xor(arguments[1], every))

    return MASK(MASK, MASK), generate


MASK_KIND = ir.VectorType(ir.IntType(1), ABREAST)


@intrinsic
def bits_of(typing_context, mask):
    """A mask as a number: bit ``i`` is the truth of run ``i``."""

    def generate(context, builder, signature, arguments):
        return builder.zext(builder.bitcast(arguments[0], ir.IntType(ABREAST)), ir.IntType(64))

    return types.int64(MASK), generate


@intrinsic
def mask_of(typing_context, bits):
    """The mask of a number."""

    def generate(context, builder, signature, arguments):
        return builder.bitcast(builder.trunc(arguments[0], ir.IntType(ABREAST)), MASK_KIND)

    return MASK(types.int64), generate


def _of_two(result, write):
    """The function of two operands, each one number of each run or one for all, that ``write`` writes."""

    @intrinsic
    def operate(typing_context, a, b):
        kinds = [each if each == ROWS else types.float64 for each in (a, b)]

        def generate(context, builder, signature, arguments):
            return write(builder, *_in_rows(builder, kinds, arguments))

        return result(*kinds), generate

    return operate


def _operation(instruction):
    return _of_two(ROWS, lambda builder, a, b: getattr(builder, instruction)(a, b, flags=FUSED))


def _comparison(symbol):
    return _of_two(MASK, lambda builder, a, b: builder.fcmp_ordered(symbol, a, b))


def _choice(symbol):
    """The larger or the smaller number of each run; ``b`` where one is nan."""
    return _of_two(ROWS, lambda builder, a, b: builder.select(builder.fcmp_ordered(symbol, a, b), a, b))


larger, smaller = _choice(">"), _choice("<")


def _function(name):
    @intrinsic
    def call(typing_context, rows):
        def generate(context, builder, signature, arguments):
            return built_in(builder, name, ABREAST, *arguments)

        return ROWS(ROWS), generate

    return call


magnitude, square_root = _function("fabs"), _function("sqrt")


@intrinsic
def fused(typing_context, a, b, c):
    """``a * b + c`` in each run."""
    kinds = [each if each == ROWS else types.float64 for each in (a, b, c)]

    def generate(context, builder, signature, arguments):
        return built_in(builder, "fmuladd", ABREAST, *_in_rows(builder, kinds, arguments))

    return ROWS(*kinds), generate


@intrinsic
def _exponent_and_mantissa(typing_context, rows):
    """The exponents of positive numbers, and their mantissas minus 1."""

    def generate(context, builder, signature, arguments):
        bits = builder.bitcast(arguments[0], WHOLE)
        exponent = builder.lshr(bits, WHOLE([BITS_OF_MANTISSA] * ABREAST))
        # A small integer in the last bits of the float 2**52 adds its value to the float.
        large = (BIAS + BITS_OF_MANTISSA) << BITS_OF_MANTISSA
        exponent = builder.fsub(
            builder.bitcast(builder.or_(exponent, WHOLE([large] * ABREAST)), vector_of(ABREAST)),
            vector_of(ABREAST)([2.0**BITS_OF_MANTISSA + BIAS] * ABREAST),
        )
        mantissa = builder.and_(bits, WHOLE([(1 << BITS_OF_MANTISSA) - 1] * ABREAST))
        mantissa = builder.or_(mantissa, WHOLE([BIAS << BITS_OF_MANTISSA] * ABREAST))
        mantissa = builder.bitcast(mantissa, vector_of(ABREAST))
        mantissa = builder.fsub(mantissa, vector_of(ABREAST)([1.0] * ABREAST))
        return context.make_tuple(builder, signature.return_type, (exponent, mantissa))

    return types.UniTuple(ROWS, 2)(ROWS), generate


@intrinsic
def _from_bits(typing_context, rows):
    """The floats whose bits, as whole numbers, are these numbers."""

    def generate(context, builder, signature, arguments):
        return builder.bitcast(builder.fptosi(arguments[0], WHOLE), vector_of(ABREAST))

    return ROWS(ROWS), generate


_whole_part = _function("floor")


@intrinsic
def _negative(typing_context, rows):
    def generate(context, builder, signature, arguments):
        return builder.fneg(arguments[0])

    return ROWS(ROWS), generate


@overload(operator.neg, jit_options=HERE)
def _overload_negative(rows):
    return (lambda rows: _negative(rows)) if rows == ROWS else None


def _overload(operation, function):
    @overload(operation, jit_options=HERE)
    def choose(a, b):
        if ROWS in (a, b):
            return lambda a, b: function(a, b)
        return None


_PAIRS: Any = (
    (operator.add, _operation("fadd")),
    (operator.sub, _operation("fsub")),
    (operator.mul, _operation("fmul")),
    (operator.truediv, _operation("fdiv")),
    (operator.lt, _comparison("<")),
    (operator.le, _comparison("<=")),
    (operator.gt, _comparison(">")),
    (operator.ge, _comparison(">=")),
)
for _operator, _intrinsic in _PAIRS:
    _overload(_operator, _intrinsic)


# ``log2(1 + m) = m + BULGE m (1 - m)``, within 0.008.
BULGE = 0.346


@njit(**INLINE)
def binary_logarithms_of(rows):
    """About ``log2`` of each number; -1023 for zero, 1024 or more for infinity and nan."""
    exponent, mantissa = _exponent_and_mantissa(rows)
    return exponent + mantissa + BULGE * (mantissa * (1.0 - mantissa))


@njit(**INLINE)
def powers_of_two(x):
    """About ``2 ** x`` of each number; ``x`` is limited to -1000 to 1000."""
    x = smaller(larger(x, -1000.0), 1000.0) + float(BIAS)
    whole = _whole_part(x)
    rest = x - whole
    return _from_bits((whole + rest - BULGE * (rest * (1.0 - rest))) * 2.0**BITS_OF_MANTISSA)
