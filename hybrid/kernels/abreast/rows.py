"""One number of each run that is abreast, in one register, as a type of the compiler.

``Rows`` have the arithmetic of registers, and comparisons with each other and with numbers. A comparison is a
``Mask``, one truth value of each run. No operation mixes the numbers of different runs, so what a run
computes does not depend on the runs beside it.
"""

import operator

from llvmlite import ir
from numba import types
from numba.extending import models, register_model

from hybrid.kernels.arithmetic.wide import (
    WideType,
    in_every_place,
    in_registers,
    of_several,
    overload_operator,
)
from hybrid.kernels.instructions.registers import DOUBLE, read, write
from hybrid.kernels.types.codes import ABREAST
from hybrid.kernels.types.numba_door.building import intrinsic, unpack_tuple

MASK_KIND = ir.VectorType(ir.IntType(1), ABREAST)


class MaskType(types.Type):
    """The numba type of one truth value of each run."""

    def __init__(self):
        super().__init__("Mask")


ROWS, MASK = WideType(ABREAST), MaskType()
in_every_run = in_every_place(ROWS)


@register_model(MaskType)
class _Mask(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, MASK_KIND)


def address_in(context, builder, kind, array, indices):
    """Where the numbers of an entry of an array begin: each entry has one number of each run."""
    made = context.make_array(kind)(context, builder, array)
    *rows, last = indices
    place = builder.mul(last, last.type(ABREAST))
    for row in rows:
        place = builder.add(place, builder.mul(row, unpack_tuple(builder, made.shape)[1]))
    return builder.gep(made.data, [place], source_etype=DOUBLE)


@intrinsic
def rows_at(typing_context, array, place):
    """Entry ``place`` of a vector, which has one number of each run."""

    def generate(context, builder, signature, arguments):
        address = address_in(context, builder, array, arguments[0], arguments[1:])
        return read(builder, address, ABREAST)

    return ROWS(array, types.intp), generate


@intrinsic
def entry_at(typing_context, array, row, column):
    """An entry of a matrix, which has one number of each run."""

    def generate(context, builder, signature, arguments):
        address = address_in(context, builder, array, arguments[0], arguments[1:])
        return read(builder, address, ABREAST)

    return ROWS(array, types.intp, types.intp), generate


@intrinsic
def put_rows(typing_context, array, place, rows):
    """Write entry ``place`` of a vector."""

    def generate(context, builder, signature, arguments):
        address = address_in(context, builder, array, arguments[0], arguments[1:2])
        write(builder, in_registers(builder, ABREAST, [rows], arguments[2:])[0], address)
        return context.get_dummy_value()

    return types.void(array, types.intp, rows if rows == ROWS else types.float64), generate


@intrinsic
def put_entry(typing_context, array, row, column, rows):
    """Write an entry of a matrix."""

    def generate(context, builder, signature, arguments):
        address = address_in(context, builder, array, arguments[0], arguments[1:3])
        write(builder, in_registers(builder, ABREAST, [rows], arguments[3:])[0], address)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, rows if rows == ROWS else types.float64), generate


@intrinsic
def where(typing_context, mask, a, b):
    """``a`` in the runs of a mask, ``b`` in the others."""
    kinds = [each if each == ROWS else types.float64 for each in (a, b)]

    def generate(context, builder, signature, arguments):
        return builder.select(arguments[0], *in_registers(builder, ABREAST, kinds, arguments[1:]))

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


for _operator, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    overload_operator(
        _operator,
        of_several(2, lambda builder, a, b, symbol=_symbol: builder.fcmp_ordered(symbol, a, b), result=MASK),
    )
