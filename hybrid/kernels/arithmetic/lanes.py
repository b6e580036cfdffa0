"""Four numbers in one vector register: arithmetic on four tangent vectors at once."""

from llvmlite import ir
from numba import types
from numba.extending import register_jitable

from hybrid.kernels.arithmetic.wide import WideType, in_every_place, in_registers, larger_of
from hybrid.kernels.instructions.registers import (
    Matrix,
    read,
    vector_of,
    whole_registers,
    write,
)
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.numba_door.building import intrinsic, unpack_tuple

LANES = WideType(NARROW)
four_times = in_every_place(LANES)

register_jitable(whole_registers)


def matrix_of(context, builder, kind, matrix):
    """The ``Matrix`` of a numba array."""
    array = context.make_array(kind)(context, builder, matrix)
    return Matrix(builder, array.data, unpack_tuple(builder, array.shape)[1])


@intrinsic
def load(typing_context, matrix, row, column):
    """Four entries of a row."""

    def generate(context, builder, signature, arguments):
        address = matrix_of(context, builder, matrix, arguments[0]).address(*arguments[1:])
        return read(builder, address, NARROW)

    return LANES(matrix, types.intp, types.intp), generate


@intrinsic
def store(typing_context, matrix, row, column, lanes):
    """Write four entries of a row, from a register or from one number for all."""
    kind = LANES if lanes == LANES else types.float64

    def generate(context, builder, signature, arguments):
        array, row, column, value = arguments
        [vector] = in_registers(builder, NARROW, [kind], [value])
        write(builder, vector, matrix_of(context, builder, matrix, array).address(row, column))
        return context.get_dummy_value()

    return types.void(matrix, types.intp, types.intp, kind), generate


@intrinsic
def largest(typing_context, lanes):
    """The largest of the four numbers."""

    def generate(context, builder, signature, arguments):
        parts = [builder.extract_element(arguments[0], ir.IntType(32)(i)) for i in range(NARROW)]
        while len(parts) > 1:
            parts = [larger_of(builder, *parts[i : i + 2]) for i in range(0, len(parts), 2)]
        return parts[0]

    return types.float64(LANES), generate


@intrinsic
def largest_of_each(typing_context, a, b, c, d):
    """The largest number of each of four registers, as one register."""

    def generate(context, builder, signature, arguments):
        def chosen(one, other, *places):
            mask = ir.Constant(ir.VectorType(ir.IntType(32), NARROW), list(places))
            return builder.shuffle_vector(one, other, mask)

        def larger_of_pairs(one, other):
            return larger_of(builder, chosen(one, other, 0, 4, 2, 6), chosen(one, other, 1, 5, 3, 7))

        low, high = larger_of_pairs(*arguments[:2]), larger_of_pairs(*arguments[2:])
        return larger_of(builder, chosen(low, high, 0, 1, 4, 5), chosen(low, high, 2, 3, 6, 7))

    return LANES(LANES, LANES, LANES, LANES), generate


@intrinsic
def places(typing_context):
    """The places of the numbers in a register, as numbers from 0 on."""

    def generate(context, builder, signature, arguments):
        return vector_of(NARROW)([float(place) for place in range(NARROW)])

    return LANES(), generate
