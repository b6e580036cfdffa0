"""Arithmetic on many series side by side in vector registers: the compiler does not vectorise it by itself.

A matrix of series ``(orders, columns)`` stores the columns of an order next to one another. An operation on
all columns, order after order, takes whole vectors of columns at a time. A processor stalls when it reads as
one vector data that it has just written as several. So the columns of the state are read as wide as
``store_row`` writes them, and the columns of tangent vectors four at a time.
"""

import numpy as np
from numba import types
from numba.extending import overload

from hybrid.kernels.arithmetic.lanes import HERE, matrix_of
from hybrid.kernels.instructions.registers import (
    NUMBER,
    built_in,
    everywhere,
    multiply_add,
    read,
    whole_registers,
    write,
)
from hybrid.kernels.types.codes import NARROW, WIDE
from hybrid.kernels.types.numba_door.building import (
    alloca_once_value,
    for_range,
    for_range_slice,
    intrinsic,
    unpack_tuple,
)


def convolve(series, order, left, first, width):
    """Begin the convolutions of ``order``, which is odd, and of the next order.

    Sums of ``series[k - j, left] * series[j, c]`` go into ``series[k, c]``, for both orders ``k`` and for
    ``width`` columns ``c`` from ``first`` on. They have all terms with ``j <= order - 2`` and with
    ``2 <= k - j <= order - 2``: no row from ``order - 1`` on is read. ``width`` is a multiple of 4, which the
    compiler knows.
    """
    _write(series, order, first, convolved(series, order, [left], [first], [width], known=0))


def convolve_pairs(series, order, left, first, width):
    """As ``convolve``, but each column has its own factor: the factors begin at column ``left``."""
    _write(series, order, first, convolved_pairs(series, order, [left], [first], [width], known=0))


def convolved(series, order, lefts, firsts, widths, known):
    """The sums of ``convolve`` as registers of four numbers, those of ``order`` first; nothing is written.

    There are several blocks of columns, each with its own factor. If the factors are ``known``, their rows
    are complete: ``0 <= j <= order - 2`` for both orders.
    """
    return _sums(series, order, lefts, firsts, widths, known, lambda width: slice(0, 1))


def convolved_pairs(series, order, lefts, firsts, widths, known):
    """The sums of ``convolve_pairs`` as registers of four numbers."""
    return _sums(series, order, lefts, firsts, widths, known, lambda width: slice(0, width))


def _sums(series, order, lefts, firsts, widths, known, columns):
    registers = []
    for k in (order, order + 1):
        for left, first, width in zip(lefts, firsts, widths, strict=True):
            sums = np.zeros(width)
            for j in range(0 if known else 2 + k - order, order - 1):
                sums += series[k - j, left:][columns(width)] * series[j, first : first + width]
            registers += [sums[place : place + NARROW] for place in range(0, width, NARROW)]
    return registers


def _write(series, order, first, registers):
    half = len(registers) // 2
    for k, fours in enumerate((registers[:half], registers[half:])):
        series[order + k, first : first + NARROW * half] = np.concatenate(fours)


def add_ends(series, order, distance, left, first, width):
    """Add to the sums of ``convolve`` the two terms in which a factor has the order ``distance``.

    If both factors have, the two terms are one.
    """
    _add_ends(series, order, distance, slice(left, left + 1), slice(first, first + width))


def add_ends_of_pairs(series, order, distance, left, first, width):
    """As ``add_ends``, for the sums of ``convolve_pairs``."""
    _add_ends(series, order, distance, slice(left, left + width), slice(first, first + width))


def _add_ends(series, order, distance, factors, columns):
    sums = series[distance, factors] * series[order - distance, columns]
    if order > 2 * distance:
        sums = sums + series[order - distance, factors] * series[distance, columns]
    series[order, columns] += sums


def evaluate(series, order, s, first, width):
    """Values at ``s`` of ``width`` series from column ``first`` on, into ``series[order + 1]``.

    ``width`` is a multiple of 4, and the order is at least 1.
    """
    total = series[order, first : first + width].copy()
    for o in range(order - 1, -1, -1):
        total = total * s + series[o, first : first + width]
    series[order + 1, first : first + width] = total


def evaluate_with_sizes(series, order, s, first, width):
    """As ``evaluate``; the sums of the terms' magnitudes go into ``series[order + 2]``; ``s >= 0``."""
    evaluate(series, order, s, first, width)
    total = abs(series[order, first : first + width])
    for o in range(order - 1, -1, -1):
        total = total * s + abs(series[o, first : first + width])
    series[order + 2, first : first + width] = total


def combine(series, order, table, width, numbers):
    """Every order of the first ``width`` columns as a combination of blocks of ``width`` columns.

    The blocks begin at column ``table``. Each number of the tuple ``numbers`` is the weight of one block.
    """
    rows = series[: order + 1, table : table + width * len(numbers)]
    series[: order + 1, :width] = np.tensordot(rows.reshape(order + 1, -1, width), numbers, (1, 0))


def combine_tangents(series, order, table, width, first, n):
    """Orders 1 and up of four tangent vectors from order 0 and the first ``n`` blocks of a table."""
    rows = series[1 : order + 1, table : table + width * n].reshape(order, n, width)[:, :, :n]
    vectors = series[0, first : first + NARROW * n].reshape(n, NARROW)
    series[1 : order + 1, first : first + NARROW * n] = np.einsum("oji,jl->oil", rows, vectors).reshape(
        order, -1
    )


def spread_tangents(y, n, series, first, stride):
    """Copy tangent vectors from ``y (n (1 + k),)`` into order 0 of their series.

    A block holds four vectors, component by component. The first block begins at column ``first``, the next
    block ``stride`` columns further.
    """
    count = len(y) // n - 1
    for vector in range(whole_registers(count, NARROW)):
        column = first + vector // NARROW * stride + vector % NARROW
        for i in range(n):
            series[0, column + NARROW * i] = y[n * (1 + vector) + i] if vector < count else 0.0


def gather_tangents(series, order, n, first, stride, y):
    """The inverse of ``spread_tangents``, from row ``order``."""
    for vector in range(len(y) // n - 1):
        column = first + vector // NARROW * stride + vector % NARROW
        for i in range(n):
            y[n * (1 + vector) + i] = series[order, column + NARROW * i]


@overload(gather_tangents, jit_options=HERE)
def _overload_gather_tangents(series, order, n, first, stride, y):
    return lambda series, order, n, first, stride, y: _gather(series, order, n, first, stride, y)


@intrinsic
def _gather(typing_context, series, order, n, first, stride, y):
    """``gather_tangents`` without a look at the signs of its indices."""

    def generate(context, builder, signature, arguments):
        matrix, order, n, first, stride, vector = arguments
        rows = matrix_of(context, builder, series, matrix)
        target = context.make_array(y)(context, builder, vector)
        [length] = unpack_tuple(builder, target.shape)
        number = n.type
        lanes = number(NARROW)
        count = builder.sub(builder.sdiv(length, n), number(1))
        with for_range(builder, count, intp=number) as each:
            block, lane = builder.sdiv(each.index, lanes), builder.srem(each.index, lanes)
            column = builder.add(builder.add(first, builder.mul(block, stride)), lane)
            source = rows.address(order, column)
            ahead = builder.mul(n, builder.add(each.index, number(1)))
            begin = builder.gep(target.data, [ahead], source_etype=NUMBER)
            with for_range(builder, n, intp=number) as component:
                place = builder.gep(source, [builder.mul(component.index, lanes)], source_etype=NUMBER)
                value = builder.load(place, typ=NUMBER)
                builder.store(value, builder.gep(begin, [component.index], source_etype=NUMBER))
        return context.get_dummy_value()

    return types.void(series, types.intp, types.intp, types.intp, types.intp, y), generate


@overload(evaluate, jit_options=HERE)
def _overload_evaluate(series, order, s, first, width):
    def in_registers(series, order, s, first, width):
        # The sums in one loop are independent, so they run in parallel.
        four = width // (4 * NARROW) * 4 * NARROW
        _evaluate_in_registers(series, order, s, first, four, NARROW, 4, False)
        two = (width - four) // (2 * NARROW) * 2 * NARROW
        _evaluate_in_registers(series, order, s, first + four, two, NARROW, 2, False)
        _evaluate_in_registers(series, order, s, first + four + two, width - four - two, NARROW, 1, False)

    return in_registers


@overload(evaluate_with_sizes, jit_options=HERE)
def _overload_evaluate_with_sizes(series, order, s, first, width):
    def in_registers(series, order, s, first, width):
        wide = width // WIDE * WIDE
        _evaluate_in_registers(series, order, s, first, wide, WIDE, 1, True)
        _evaluate_in_registers(series, order, s, first + wide, width - wide, NARROW, 1, True)

    return in_registers


def _as_known(*kinds):
    """Types of the integer arguments of an intrinsic; literals stay literals.

    Numba looks up compiled code by these types alone: without literals, it would take the code for another
    width.
    """
    return tuple(kind if isinstance(kind, types.Literal) else types.intp for kind in kinds)


@intrinsic(prefer_literal=True)
def _evaluate_in_registers(typing_context, series, order, s, first, width, lanes, at_once, sizes):
    """Horner's scheme in ``s**2``, for even and odd terms separately.

    Each turn of the loop works on ``at_once`` registers of ``lanes`` columns each. Every step of Horner's
    scheme waits for the previous step: in ``s**2`` there are half as many steps.
    """
    known = _as_known(first, width, lanes, at_once, sizes)
    lanes, at_once, with_sizes = (each.literal_value for each in (lanes, at_once, sizes))

    def generate(context, builder, signature, arguments):
        matrix, order, s, first, width, *_ = arguments
        rows = matrix_of(context, builder, series, matrix)
        number = order.type
        factor = everywhere(builder, s, lanes)
        square = everywhere(builder, builder.fmul(s, s), lanes)
        places = [lanes * i for i in range(at_once)]
        is_even = builder.icmp_signed("==", builder.and_(order, number(1)), number(0))
        pairs = builder.ashr(builder.sub(order, number(1)), number(1))

        def terms_of(row):
            terms = [read(builder, rows.beside(row, place), lanes) for place in places]
            sizes = [built_in(builder, "fabs", lanes, term) for term in terms] if with_sizes else []
            return terms + sizes

        def one_turn(column):
            walker = rows.walker(order, column)
            # One sum begins with the last term, the other with the last but one.
            last, other = (
                [alloca_once_value(builder, term) for term in terms_of(rows.walk(walker, -1))]
                for _ in range(2)
            )

            def add_terms(totals):
                for total, term in zip(totals, terms_of(rows.walk(walker, -1)), strict=True):
                    builder.store(multiply_add(builder, builder.load(total), square, term), total)

            with for_range(builder, pairs, intp=number):
                add_terms(last)
                add_terms(other)
            with builder.if_then(is_even):
                add_terms(last)
            results = []
            for one, two in zip(last, other, strict=True):
                ends = builder.load(one), builder.load(two)
                even, odd = builder.select(is_even, *ends), builder.select(is_even, *reversed(ends))
                results.append(multiply_add(builder, odd, factor, even))
            for i, result in enumerate(results):
                below = builder.add(order, number(1 + i // at_once))
                write(builder, result, rows.address(below, builder.add(column, number(places[i % at_once]))))

        end = builder.add(first, width)
        turn = number(lanes * at_once)
        with for_range_slice(builder, first, end, turn, number) as (column, _):
            one_turn(column)
        return context.get_dummy_value()

    return types.void(series, types.intp, types.float64, *known), generate
