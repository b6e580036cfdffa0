"""LLVM's instructions for series side by side in vector registers (``hybrid.kernels.arithmetic.columns``)."""

from __future__ import annotations

from typing import Any

from hybrid.compiler.llvm.registers import parted
from hybrid.kernels.instructions.loops import loop, variable
from hybrid.kernels.instructions.registers import DOUBLE, everywhere, multiply_add, read, vector_of, write
from hybrid.kernels.types.codes import NARROW, WIDE

# In one sum, each term waits for the previous term: so there are two partial sums, of even and odd rows.
PARTS = 2


def _registers(width: Any, widest: Any) -> Any:
    """First column and width of each register, the widest registers first."""
    whole = width // widest * widest
    wide = [(place, widest) for place in range(0, whole, widest)]
    return wide + [(place, NARROW) for place in range(whole, width, NARROW)]


def write_convolution(
    builder: Any, rows: Any, order: Any, left: Any, first: Any, width: Any, pairs: bool = False
) -> Any:
    """The instructions of ``convolve``: begin the convolutions of ``order``, which is odd, and of the next.

    Sums of ``rows[k - j, left] * rows[j, c]`` go into ``rows[k, c]``, for both orders ``k`` and for ``width``
    columns ``c`` from ``first`` on. They have all terms with ``j <= order - 2`` and with
    ``2 <= k - j <= order - 2``: no row from ``order - 1`` on is read. ``width`` is a multiple of 4. Those of
    ``convolve_pairs`` differ in that each column has a factor of its own: they begin at column ``left``.
    """
    number = order.type
    targets = [rows.address(each, first) for each in (order, builder.add(order, number(1)))]
    for _, place, sums in _convolution(builder, rows, order, [(left, first, width)], False, pairs):
        for target, total in zip(targets, sums, strict=True):
            write(builder, total, rows.beside(target, place))


def write_convolved(
    builder: Any, rows: Any, order: Any, lefts: Any, firsts: Any, sizes: Any, known: Any, pairs: bool = False
) -> Any:
    """The instructions of ``convolved``: the sums of ``convolve`` as registers of four, ``order`` first.

    There are several blocks of columns, each with its own factor. If the factors are ``known``, their rows
    are complete: ``0 <= j <= order - 2`` for both orders.
    """
    blocks = [*zip(lefts, firsts, sizes, strict=True)]
    of_order, of_next = [], []
    for *_, sums in _convolution(builder, rows, order, blocks, known, pairs):
        of_order += parted(builder, sums[0])
        of_next += parted(builder, sums[1])
    return of_order + of_next


def _convolution(builder: Any, rows: Any, order: Any, blocks: Any, known: Any, pairs: Any) -> Any:
    """The instructions for the sums of convolutions of two orders.

    Yields, for each register, the number of its block, its first column there, and the two sums.
    """
    widest, room = builder.vectors
    waiting = [(i, *each) for i, (_, _, width) in enumerate(blocks) for each in _registers(width, widest)]
    while waiting:
        # As many as have room in the registers: two orders in parts, and two factors.
        count, needed, seen = 0, 0, set()
        for i, place, _ in waiting:
            factor = (blocks[i][0], place) if pairs else blocks[i][0]
            needed += 2 * PARTS + (0 if factor in seen else 2)
            seen.add(factor)
            if count and needed > room:
                break
            count += 1
        yield from _sums_at_once(builder, rows, order, blocks, waiting[:count], known, pairs)
        waiting = waiting[count:]


def _sums_at_once(
    builder: Any, rows: Any, order: Any, blocks: Any, registers: Any, known: Any, pairs: Any
) -> Any:
    """One loop over the rows: each row is read once for both orders, since reading takes most of the time."""
    number = order.type
    begin, one = number(0 if known else 2), number(1)
    others = {i: rows.walker(begin, blocks[i][1]) for i in sorted({i for i, _, _ in registers})}
    # What each register is multiplied by: registers may share it.
    keys = [(blocks[i][0], place if pairs else 0, width) for i, place, width in registers]
    factors = {left: rows.walker(builder.sub(order, begin), left) for left, _, _ in keys}

    def factors_at(addresses: Any) -> Any:
        if pairs:
            return {
                (left, place, width): read(builder, rows.beside(addresses[left], place), width)
                for left, place, width in dict.fromkeys(keys)
            }
        singles = {left: builder.load(address, typ=DOUBLE) for left, address in addresses.items()}
        return {key: everywhere(builder, singles[key[0]], key[2]) for key in dict.fromkeys(keys)}

    nothing = [vector_of(width)([0.0] * width) for *_, width in registers]
    # The factor that the next order has where this order has the one of the row before.
    before = dict(zip(keys, nothing, strict=True))
    if known:
        before = factors_at({left: rows.address(builder.add(order, one), left) for left in factors})
    before = {key: variable(builder, each) for key, each in before.items()}
    totals = [[[variable(builder, each) for each in nothing] for _ in range(2)] for _ in range(PARTS)]
    terms = builder.sub(builder.sub(order, one), begin)
    with loop(builder, number(0), builder.ashr(terms, one), one):
        for this, next_one in totals:
            sources = {i: rows.walk(other, 1) for i, other in others.items()}
            newer = factors_at({left: rows.walk(factor, -1) for left, factor in factors.items()})
            for k, (i, place, width) in enumerate(registers):
                term = read(builder, rows.beside(sources[i], place), width)
                two = (this[k], newer[keys[k]]), (next_one[k], builder.load(before[keys[k]]))
                for total, factor in two:
                    builder.store(multiply_add(builder, factor, term, builder.load(total)), total)
            for key, factor in newer.items():
                builder.store(factor, before[key])
    for k, (i, place, _) in enumerate(registers):
        parts = [[builder.load(part[which][k]) for part in totals] for which in range(2)]
        yield i, place, [builder.fadd(*each) for each in parts]


def write_ends(
    builder: Any, rows: Any, order: Any, distance: Any, left: Any, first: Any, width: Any, pairs: bool = False
) -> Any:
    """The instructions of ``add_ends``: add the two terms in which a factor has the order ``distance``.

    If both factors have, the two terms are one.
    """
    number = order.type
    near, far = number(distance), builder.sub(order, number(distance))
    differ = builder.icmp_signed(">", order, number(2 * distance))
    here, one, last = (rows.address(row, first) for row in (order, near, far))
    left_one, left_last = (rows.address(row, left) for row in (near, far))
    for place, lanes in _registers(width, builder.vectors.widest):
        nothing = vector_of(lanes)([0.0] * lanes)
        if pairs:
            low, high = (read(builder, rows.beside(each, place), lanes) for each in (left_one, left_last))
        else:
            ends = (builder.load(each, typ=DOUBLE) for each in (left_one, left_last))
            low, high = (everywhere(builder, each, lanes) for each in ends)
        high = builder.select(differ, high, nothing)
        total = read(builder, rows.beside(here, place), lanes)
        total = multiply_add(builder, high, read(builder, rows.beside(one, place), lanes), total)
        total = multiply_add(builder, low, read(builder, rows.beside(last, place), lanes), total)
        write(builder, total, rows.beside(here, place))


def _weighted_sum(builder: Any, factors: Any, terms: Any) -> Any:
    total = builder.fmul(factors[0], terms[0])
    for factor, term in zip(factors[1:], terms[1:], strict=True):
        total = multiply_add(builder, factor, term, total)
    return total


def write_combination(builder: Any, rows: Any, order: Any, table: Any, width: Any, numbers: Any) -> Any:
    """The instructions of ``combine``: every order of the first columns as a combination of blocks.

    The blocks begin at column ``table``. Each of the ``numbers`` is the weight of one block.
    """
    number = order.type
    target, source = rows.walker(number(0), number(0)), rows.walker(number(0), table)
    with loop(builder, number(0), builder.add(order, number(1)), number(1)):
        here, there = rows.walk(target, 1), rows.walk(source, 1)
        for place, lanes in _registers(width, WIDE):
            factors = [everywhere(builder, each, lanes) for each in numbers]
            blocks = [rows.beside(there, width * c + place) for c in range(len(numbers))]
            terms = [read(builder, block, lanes) for block in blocks]
            write(builder, _weighted_sum(builder, factors, terms), rows.beside(here, place))


def write_combination_of_tangents(
    builder: Any, rows: Any, order: Any, table: Any, width: Any, first: Any, n: Any
) -> Any:
    """The instructions of ``combine_tangents``: orders 1 and up of four tangent vectors from order 0.

    Their factors are the first ``n`` columns of ``n`` blocks of a table.
    """
    number = order.type
    start = rows.address(number(0), first)
    vectors = [read(builder, rows.beside(start, NARROW * j), NARROW) for j in range(n)]
    target, source = rows.walker(number(1), first), rows.walker(number(1), table)
    with loop(builder, number(0), order, number(1)):
        here, there = rows.walk(target, 1), rows.walk(source, 1)
        for i in range(n):
            entries = [builder.load(rows.beside(there, width * j + i), typ=DOUBLE) for j in range(n)]
            factors = [everywhere(builder, entry, NARROW) for entry in entries]
            write(builder, _weighted_sum(builder, factors, vectors), rows.beside(here, NARROW * i))


def write_spread(builder: Any, y: Any, length: Any, n: Any, rows: Any, first: Any, stride: Any) -> Any:
    """The instructions of ``spread_tangents``: copy tangent vectors from ``y`` into order 0 of their series.

    A block holds four vectors, component by component; lanes without a vector are zero. The first block
    begins at column ``first``, the next block ``stride`` columns further.
    """
    number = first.type
    count = builder.sub(builder.sdiv(length, number(n)), number(1))
    groups = builder.sdiv(builder.add(count, number(NARROW - 1)), number(NARROW))
    with loop(builder, number(0), groups, number(1)) as group:
        for lane in range(NARROW):
            vector = builder.add(builder.mul(group, number(NARROW)), number(lane))
            is_one = builder.icmp_signed("<", vector, count)
            column = builder.add(builder.add(first, builder.mul(group, stride)), number(lane))
            source = builder.select(is_one, builder.mul(number(n), builder.add(vector, number(1))), number(0))
            start = builder.gep(y, [source], source_etype=DOUBLE)
            target = rows.address(number(0), column)
            with loop(builder, number(0), number(n), number(1)) as i:
                value = builder.load(builder.gep(start, [i], source_etype=DOUBLE), typ=DOUBLE)
                value = builder.select(is_one, value, value.type(0.0))
                place = builder.gep(target, [builder.mul(i, number(NARROW))], source_etype=DOUBLE)
                builder.store(value, place)
