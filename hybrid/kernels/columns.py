"""Arithmetic on many series side by side in vector registers, which the compiler does not find by itself.

A matrix of series ``(orders, columns)`` has its columns next to one another in memory. What is done to all of
them alike, order after order, takes whole vectors of columns at a time.
"""

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload, register_jitable

from hybrid.kernels.codes import NARROW
from hybrid.kernels.lanes import FUSED, HERE, WIDE, built_in, everywhere, read, vector_of, write

# Sums that grow side by side: each term waits for the one before it in the same sum.
SUMS_AT_ONCE = 4


def convolve(series, order, inset, left, first, width):
    """Sums of ``series[j, left] * series[order - j, c]`` over ``inset <= j <= order - inset``.

    They go into ``series[order, c]``; the columns ``c`` are ``width``, a multiple of 4 known to the compiler,
    from ``first`` on. The terms left out at both ends are those with the coefficients of the highest orders.
    """
    sums = np.zeros(width)
    for j in range(inset, order - inset + 1):
        sums += series[j, left] * series[order - j, first : first + width]
    series[order, first : first + width] = sums


def evaluate(series, order, s, first, width):
    """Values at ``s`` of ``width`` series, a multiple of 4, from ``first`` on, into ``series[order + 1]``."""
    total = series[order, first : first + width].copy()
    for o in range(order - 1, -1, -1):
        total = total * s + series[o, first : first + width]
    series[order + 1, first : first + width] = total


def evaluate_with_sizes(series, order, s, first, width):
    """As ``evaluate``, and the sums of the magnitudes of all terms into ``series[order + 2]``; ``s >= 0``."""
    evaluate(series, order, s, first, width)
    total = abs(series[order, first : first + width])
    for o in range(order - 1, -1, -1):
        total = total * s + abs(series[o, first : first + width])
    series[order + 2, first : first + width] = total


@register_jitable
def spread_tangents(y, n, series, first, stride):
    """Tangent vectors from ``y (n (1 + k),)`` into order zero of their series: four at a time, by component.

    Those of four vectors begin at ``first``, those of the next four ``stride`` columns further.
    """
    count = len(y) // n - 1
    for vector in range((count + NARROW - 1) // NARROW * NARROW):
        column = first + vector // NARROW * stride + vector % NARROW
        for i in range(n):
            series[0, column + NARROW * i] = y[n * (1 + vector) + i] if vector < count else 0.0


@register_jitable
def gather_tangents(series, order, n, first, stride, y):
    """The inverse of ``spread_tangents`` from row ``order``."""
    for vector in range(len(y) // n - 1):
        column = first + vector // NARROW * stride + vector % NARROW
        for i in range(n):
            y[n * (1 + vector) + i] = series[order, column + NARROW * i]


@overload(convolve, jit_options=HERE)
def _convolve(series, order, inset, left, first, width):
    return lambda series, order, inset, left, first, width: _convolve_in_registers(
        series, order, inset, left, first, width
    )


@overload(evaluate, jit_options=HERE)
def _evaluate(series, order, s, first, width):
    return lambda series, order, s, first, width: _evaluate_in_registers(
        series, order, s, first, width, False
    )


@overload(evaluate_with_sizes, jit_options=HERE)
def _evaluate_with_sizes(series, order, s, first, width):
    return lambda series, order, s, first, width: _evaluate_in_registers(series, order, s, first, width, True)


class _Matrix:
    """Writes the instructions that walk through the rows of a matrix."""

    def __init__(self, context, builder, matrix_type, matrix):
        array = context.make_array(matrix_type)(context, builder, matrix)
        self.builder = builder
        self.data = array.data
        self.columns = cgutils.unpack_tuple(builder, array.shape)[1]

    def address(self, row, column):
        """Address of an entry."""
        builder = self.builder
        return builder.gep(self.data, [builder.add(builder.mul(row, self.columns), column)])

    def walker(self, row, column):
        """A variable that holds the address of an entry."""
        return cgutils.alloca_once_value(self.builder, self.address(row, column))

    def walk(self, walker, rows):
        """Move on by a number of rows."""
        builder = self.builder
        here = builder.load(walker)
        builder.store(builder.gep(here, [builder.mul(self.columns, self.columns.type(rows))]), walker)
        return here


def _add_product(builder, total, a, b):
    product = builder.fmul(a, b, flags=FUSED)
    builder.store(builder.fadd(builder.load(total), product, flags=FUSED), total)


def _registers(width):
    """How many columns each register takes, the widest first."""
    return [WIDE] * (width // WIDE) + [NARROW] * (width % WIDE // NARROW)


@intrinsic(prefer_literal=True)
def _convolve_in_registers(typing_context, series, order, inset, left, first, width):
    if not isinstance(width, types.IntegerLiteral):
        return None
    widths = _registers(width.literal_value)
    sums_at_once = max(1, SUMS_AT_ONCE // len(widths))

    def generate(context, builder, signature, arguments):
        matrix, order, inset, left, first, _ = arguments
        rows = _Matrix(context, builder, signature.args[0], matrix)
        number = order.type
        # The lowest orders of the columns come first: what was written last is the slowest to read.
        factor = rows.walker(builder.sub(order, inset), left)
        other = rows.walker(inset, first)
        totals = [
            [cgutils.alloca_once_value(builder, vector_of(each)([0.0] * each)) for each in widths]
            for _ in range(sums_at_once)
        ]

        def add_term(row_of_totals):
            a = builder.load(rows.walk(factor, -1))
            b = rows.walk(other, 1)
            for place, (each, total) in enumerate(zip(widths, row_of_totals, strict=True)):
                there = builder.gep(b, [number(sum(widths[:place]))])
                _add_product(builder, total, everywhere(builder, a, each), read(builder, there, each))

        terms = builder.add(builder.sub(order, builder.add(inset, inset)), number(1))
        terms = builder.select(builder.icmp_signed(">", terms, number(0)), terms, number(0))
        with cgutils.for_range(builder, builder.udiv(terms, number(sums_at_once)), intp=number):
            for each in totals:
                add_term(each)
        if sums_at_once > 1:
            with cgutils.for_range(builder, builder.urem(terms, number(sums_at_once)), intp=number):
                add_term(totals[0])
        target = rows.address(order, first)
        for place in range(len(widths)):
            parts = [builder.load(each[place]) for each in totals]
            while len(parts) > 1:
                parts = [builder.fadd(*parts[i : i + 2]) for i in range(0, len(parts), 2)]
            write(builder, parts[0], builder.gep(target, [number(sum(widths[:place]))]))
        return context.get_dummy_value()

    return types.void(series, *(types.intp,) * 5), generate


@intrinsic(prefer_literal=True)
def _evaluate_in_registers(typing_context, series, order, s, first, width, sizes):
    with_sizes = sizes.literal_value

    def generate(context, builder, signature, arguments):
        matrix, order, s, first, width, _ = arguments
        rows = _Matrix(context, builder, signature.args[0], matrix)
        number = order.type

        def column_of_values(column, lanes):
            walker = rows.walker(order, column)
            factor = everywhere(builder, s, lanes)
            top = read(builder, rows.walk(walker, -1), lanes)
            value = cgutils.alloca_once_value(builder, top)
            size = cgutils.alloca_once_value(builder, built_in(builder, "fabs", lanes, top))
            with cgutils.for_range(builder, order, intp=number):
                term = read(builder, rows.walk(walker, -1), lanes)
                sums = [(value, term)]
                if with_sizes:
                    sums.append((size, built_in(builder, "fabs", lanes, term)))
                for total, next_term in sums:
                    product = builder.fmul(builder.load(total), factor, flags=FUSED)
                    builder.store(builder.fadd(product, next_term, flags=FUSED), total)
            for total, below in ((value, 1), (size, 2))[: 2 if with_sizes else 1]:
                write(builder, builder.load(total), rows.address(builder.add(order, number(below)), column))

        narrow = builder.and_(width, number(WIDE - NARROW))
        middle = builder.sub(builder.add(first, width), narrow)
        with cgutils.for_range_slice(builder, first, middle, number(WIDE), number) as (column, _):
            column_of_values(column, WIDE)
        with builder.if_then(builder.icmp_signed(">", narrow, number(0))):
            column_of_values(middle, NARROW)
        return context.get_dummy_value()

    return types.void(series, types.intp, types.float64, types.intp, types.intp, types.boolean), generate
