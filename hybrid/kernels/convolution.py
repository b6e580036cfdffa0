"""The inner sums of convolutions: one series against many others at once, in vector registers."""

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from hybrid.kernels.codes import NARROW

# Columns summed in one turn.
WIDE = 2 * NARROW
FUSED = ("contract",)


def convolve(series, order, left, first, width):
    """Sums of ``series[j, left] * series[order - j, c]`` over ``0 < j < order``, into ``series[order, c]``.

    The columns ``c`` are ``width``, a multiple of 4, from ``first`` on; each is as good as a loop of its own.
    The two terms at the ends of a convolution are those that hold the coefficients of this order.
    """
    sums = np.zeros(width)
    for j in range(1, order):
        sums += series[j, left] * series[order - j, first : first + width]
    series[order, first : first + width] = sums


@overload(convolve, jit_options={"_nrt": False, "forceinline": True})
def _convolve(series, order, left, first, width):
    return lambda series, order, left, first, width: _in_registers(series, order, left, first, width)


@intrinsic
def _in_registers(typing_context, series, order, left, first, width):
    """``convolve`` as vector instructions, which the compiler does not find by itself."""
    indices = (types.intp,) * 4
    return types.void(series, *indices), _generate


def _generate(context, builder, signature, arguments):
    series, order, left, first, width = arguments
    array = context.make_array(signature.args[0])(context, builder, series)
    _, columns = cgutils.unpack_tuple(builder, array.shape)
    number = context.get_value_type(types.intp)
    zero, one = number(0), number(1)

    def sums(column, lanes):
        vector = ir.VectorType(ir.DoubleType(), lanes)
        nothing, everywhere = vector([0.0] * lanes), ir.VectorType(ir.IntType(32), lanes)([0] * lanes)

        def place(index):
            return builder.bitcast(builder.gep(array.data, [index]), vector.as_pointer())

        def add_term(total, index, other):
            factor = builder.load(builder.gep(array.data, [index]))
            factor = builder.insert_element(nothing, factor, ir.IntType(32)(0))
            factor = builder.shuffle_vector(factor, nothing, everywhere)
            product = builder.fmul(factor, builder.load(place(other), align=8), flags=FUSED)
            builder.store(builder.fadd(builder.load(total), product, flags=FUSED), total)

        # Two terms in a turn, each with a sum of its own: a sum waits for the one before it. The lowest
        # orders of the columns come first: what was written last is the slowest to read.
        even, odd = (cgutils.alloca_once_value(builder, nothing) for _ in range(2))
        terms = builder.sub(order, one)
        index = cgutils.alloca_once_value(builder, builder.add(builder.mul(terms, columns), left))
        other = cgutils.alloca_once_value(builder, builder.add(columns, column))

        def next_term(total):
            add_term(total, builder.load(index), builder.load(other))
            builder.store(builder.sub(builder.load(index), columns), index)
            builder.store(builder.add(builder.load(other), columns), other)

        with cgutils.for_range(builder, builder.ashr(terms, one), intp=number):
            next_term(even)
            next_term(odd)
        with builder.if_then(builder.icmp_signed("==", builder.and_(terms, one), one)):
            next_term(even)
        total = builder.fadd(builder.load(even), builder.load(odd))
        builder.store(total, place(builder.add(builder.mul(order, columns), column)), align=8)

    end = builder.add(first, width)
    narrow = builder.and_(width, number(WIDE - NARROW))
    middle = builder.sub(end, narrow)
    with cgutils.for_range_slice(builder, first, middle, number(WIDE), number) as (column, _):
        sums(column, WIDE)
    with builder.if_then(builder.icmp_signed(">", narrow, zero)):
        sums(middle, NARROW)
    return context.get_dummy_value()
