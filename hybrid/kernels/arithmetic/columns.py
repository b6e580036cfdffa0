"""Arithmetic on many series side by side in vector registers: the compiler does not vectorise it by itself.

A matrix of series ``(orders, columns)`` stores the columns of an order next to one another. An operation on
all columns, order after order, takes whole vectors of columns at a time. A processor stalls when it reads as
one vector data that it has just written as several. So the columns of the state are read as wide as
``store_row`` writes them, and the columns of tangent vectors four at a time.
"""

from numba import njit, types

from hybrid.kernels.arithmetic.lanes import matrix_of
from hybrid.kernels.instructions.registers import (
    DOUBLE,
    built_in,
    everywhere,
    multiply_add,
    read,
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
from hybrid.kernels.types.options import INLINE


@intrinsic
def gather_tangents(typing_context, series, order, n, first, stride, y):
    """Copy row ``order`` of the series of tangent vectors into ``y (n (1 + k),)``.

    It undoes ``spread_tangents``. This is an intrinsic because it need not look at the signs of its indices.
    """

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
            begin = builder.gep(target.data, [ahead], source_etype=DOUBLE)
            with for_range(builder, n, intp=number) as component:
                place = builder.gep(source, [builder.mul(component.index, lanes)], source_etype=DOUBLE)
                value = builder.load(place, typ=DOUBLE)
                builder.store(value, builder.gep(begin, [component.index], source_etype=DOUBLE))
        return context.get_dummy_value()

    return types.void(series, types.intp, types.intp, types.intp, types.intp, y), generate


@njit(**INLINE)
def evaluate(series, order, s, first, width):
    """Values at ``s`` of ``width`` series from column ``first`` on, into ``series[order + 1]``.

    ``width`` is a multiple of 4, and the order is at least 1.
    """
    # The sums in one loop are independent, so they run in parallel.
    four = width // (4 * NARROW) * 4 * NARROW
    _evaluate_in_registers(series, order, s, first, four, NARROW, 4, False)
    two = (width - four) // (2 * NARROW) * 2 * NARROW
    _evaluate_in_registers(series, order, s, first + four, two, NARROW, 2, False)
    _evaluate_in_registers(series, order, s, first + four + two, width - four - two, NARROW, 1, False)


@njit(**INLINE)
def evaluate_with_sizes(series, order, s, first, width):
    """As ``evaluate``; the sums of the terms' magnitudes go into ``series[order + 2]``; ``s >= 0``."""
    wide = width // WIDE * WIDE
    _evaluate_in_registers(series, order, s, first, wide, WIDE, 1, True)
    _evaluate_in_registers(series, order, s, first + wide, width - wide, NARROW, 1, True)


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
