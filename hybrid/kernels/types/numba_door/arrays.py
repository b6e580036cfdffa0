"""Arrays as functions of machine code are handed them: the address of the first number, and the lengths.

Numba's own structure of an array has seven words, which all go over the stack.
"""

from functools import cache

from llvmlite import ir

# Places of the two parts.
DATA, SHAPE = 0, 1


@cache
def array_kind(axes):
    """The type of an array with that number of axes."""
    return ir.LiteralStructType([ir.PointerType(), ir.ArrayType(ir.IntType(64), axes)])


def array_of_parts(builder, data, lengths):
    """An array from the address of its first number and its lengths."""
    value = builder.insert_value(array_kind(len(lengths))(ir.Undefined), data, DATA)
    for axis, length in enumerate(lengths):
        value = builder.insert_value(value, length, [SHAPE, axis])
    return value


def parts_of(builder, array, axes):
    """The address of the first number of an array, and its lengths."""
    lengths = [builder.extract_value(array, [SHAPE, axis]) for axis in range(axes)]
    return builder.extract_value(array, DATA), lengths
