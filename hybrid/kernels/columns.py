"""Arithmetic on many series side by side in vector registers, which the compiler does not find by itself.

A matrix of series ``(orders, columns)`` has its columns next to one another in memory. What is done to all of
them alike, order after order, takes whole vectors of columns at a time.
"""

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload

from hybrid.kernels.codes import NARROW

# Columns taken in one turn.
WIDE = 2 * NARROW
FUSED = ("contract",)
# Small and called at every order: the call would cost as much as the work.
HERE = {"_nrt": False, "forceinline": True}


def convolve(series, order, left, first, width):
    """Sums of ``series[j, left] * series[order - j, c]`` over ``0 < j < order``, into ``series[order, c]``.

    The columns ``c`` are ``width``, a multiple of 4, from ``first`` on; each is as good as a loop of its own.
    The two terms at the ends of a convolution are those that hold the coefficients of this order.
    """
    sums = np.zeros(width)
    for j in range(1, order):
        sums += series[j, left] * series[order - j, first : first + width]
    series[order, first : first + width] = sums


def evaluate(series, order, s, width, sizes):
    """Values at ``s`` of the first ``width`` series, a multiple of 4, into ``series[order + 1]``.

    With ``sizes`` it is the sums of the magnitudes of their terms, for ``s`` that is not negative.
    """
    terms = abs(series) if sizes else series
    total = terms[order, :width].copy()
    for o in range(order - 1, -1, -1):
        total = total * s + terms[o, :width]
    series[order + 1, :width] = total


@overload(convolve, jit_options=HERE)
def _convolve(series, order, left, first, width):
    return lambda series, order, left, first, width: _convolve_in_registers(series, order, left, first, width)


@overload(evaluate, jit_options=HERE)
def _evaluate(series, order, s, width, sizes):
    return lambda series, order, s, width, sizes: _evaluate_in_registers(series, order, s, width, sizes)


class _Vectors:
    """Writes instructions for vectors of one number of columns of a matrix."""

    def __init__(self, context, builder, matrix_type, matrix, lanes):
        array = context.make_array(matrix_type)(context, builder, matrix)
        self.data = array.data
        self.builder = builder
        self.columns = cgutils.unpack_tuple(builder, array.shape)[1]
        self.kind = ir.VectorType(ir.DoubleType(), lanes)
        self.zero = self.kind([0.0] * lanes)
        self.lanes = lanes

    def row(self, order):
        """Index of the first entry of a row."""
        return self.builder.mul(order, self.columns)

    def number(self, index):
        """The entry of that index."""
        return self.builder.load(self.builder.gep(self.data, [index]))

    def everywhere(self, number):
        """One number in every lane."""
        lanes = ir.VectorType(ir.IntType(32), self.lanes)
        vector = self.builder.insert_element(self.zero, number, ir.IntType(32)(0))
        return self.builder.shuffle_vector(vector, self.zero, lanes([0] * self.lanes))

    def _place(self, index):
        return self.builder.bitcast(self.builder.gep(self.data, [index]), self.kind.as_pointer())

    def load(self, index):
        """The vector that begins at an index."""
        return self.builder.load(self._place(index), align=8)

    def store(self, vector, index):
        """Write a vector to where it begins."""
        self.builder.store(vector, self._place(index), align=8)

    def multiply_add(self, a, b, c):
        """``a * b + c``."""
        return self.builder.fadd(c, self.builder.fmul(a, b, flags=FUSED), flags=FUSED)

    def magnitude(self, vector):
        """Absolute values."""
        kind = ir.FunctionType(self.kind, [self.kind])
        function = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.fabs.v{self.lanes}f64")
        return self.builder.call(function, [vector])


def _in_turns(context, builder, matrix_type, matrix, first, width, write):
    """Call ``write(vectors, column)`` for whole turns of columns, and once more for what is left."""
    number = context.get_value_type(types.intp)
    wide, narrow = (_Vectors(context, builder, matrix_type, matrix, lanes) for lanes in (WIDE, NARROW))
    left_over = builder.and_(width, number(WIDE - NARROW))
    middle = builder.sub(builder.add(first, width), left_over)
    with cgutils.for_range_slice(builder, first, middle, number(WIDE), number) as (column, _):
        write(wide, column)
    with builder.if_then(builder.icmp_signed(">", left_over, number(0))):
        write(narrow, middle)
    return context.get_dummy_value()


@intrinsic
def _convolve_in_registers(typing_context, series, order, left, first, width):
    def generate(context, builder, signature, arguments):
        matrix, order, left, first, width = arguments
        one = order.type(1)

        def write(vectors, column):
            # Two terms in a turn, each with a sum of its own: a sum waits for the one before it. The lowest
            # orders of the columns come first: what was written last is the slowest to read.
            even, odd = (cgutils.alloca_once_value(builder, vectors.zero) for _ in range(2))
            terms = builder.sub(order, one)
            factor = cgutils.alloca_once_value(builder, builder.add(vectors.row(terms), left))
            other = cgutils.alloca_once_value(builder, builder.add(vectors.row(one), column))

            def add_term(total):
                a = vectors.everywhere(vectors.number(builder.load(factor)))
                b = vectors.load(builder.load(other))
                builder.store(vectors.multiply_add(a, b, builder.load(total)), total)
                builder.store(builder.sub(builder.load(factor), vectors.columns), factor)
                builder.store(builder.add(builder.load(other), vectors.columns), other)

            with cgutils.for_range(builder, builder.ashr(terms, one), intp=order.type):
                add_term(even)
                add_term(odd)
            with builder.if_then(builder.icmp_signed("==", builder.and_(terms, one), one)):
                add_term(even)
            total = builder.fadd(builder.load(even), builder.load(odd))
            vectors.store(total, builder.add(vectors.row(order), column))

        return _in_turns(context, builder, signature.args[0], matrix, first, width, write)

    return types.void(series, *(types.intp,) * 4), generate


@intrinsic
def _evaluate_in_registers(typing_context, series, order, s, width, sizes):
    def generate(context, builder, signature, arguments):
        matrix, order, s, width, sizes = arguments
        one = order.type(1)

        def write(vectors, column):
            place = cgutils.alloca_once_value(builder, builder.add(vectors.row(order), column))
            factor = vectors.everywhere(s)

            def term():
                vector = vectors.load(builder.load(place))
                return builder.select(sizes, vectors.magnitude(vector), vector)

            total = cgutils.alloca_once_value(builder, term())
            with cgutils.for_range(builder, order, intp=order.type):
                builder.store(builder.sub(builder.load(place), vectors.columns), place)
                builder.store(vectors.multiply_add(builder.load(total), factor, term()), total)
            vectors.store(builder.load(total), builder.add(vectors.row(builder.add(order, one)), column))

        return _in_turns(context, builder, signature.args[0], matrix, order.type(0), width, write)

    return types.void(series, types.intp, types.float64, types.intp, types.boolean), generate
