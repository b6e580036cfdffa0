"""LLVM's instructions for series side by side in vector registers (``hybrid.kernels.arithmetic.columns``)."""

from llvmlite import ir

from hybrid.kernels.instructions.loops import loop, variable
from hybrid.kernels.instructions.registers import NUMBER, everywhere, multiply_add, read, vector_of, write
from hybrid.kernels.types.codes import NARROW, WIDE

# Number of partial sums: in one sum, each term waits for the previous term. All sums together take at most
# this many of the sixteen registers of four numbers.
AT_ONCE = 4
MOST_REGISTERS = 12


def _registers(width, widest):
    """First column and width of each register, the widest registers first."""
    whole = width // widest * widest
    wide = [(place, widest) for place in range(0, whole, widest)]
    return wide + [(place, NARROW) for place in range(whole, width, NARROW)]


def write_convolution(builder, rows, order, inset, left, first, width, widest, pairs=False):
    """The instructions of ``convolve``, or of ``convolve_pairs``."""
    target = rows.address(order, first)
    for place, total in _convolution(builder, rows, order, inset, left, first, width, widest, pairs):
        write(builder, total, rows.beside(target, place))


def write_convolved(builder, rows, order, inset, left, first, width, widest):
    """The instructions of ``convolved``; returns the registers."""
    found = []
    for _, total in _convolution(builder, rows, order, inset, left, first, width, widest, False):
        for lane in range(0, total.type.count, NARROW):
            lanes = ir.Constant(ir.VectorType(ir.IntType(32), NARROW), list(range(lane, lane + NARROW)))
            found.append(builder.shuffle_vector(total, total.type(ir.Undefined), lanes))
    return found


def _convolution(builder, rows, order, inset, left, first, width, widest, pairs):
    """The instructions for the sums of a convolution; yields each register with its first column."""
    registers = _registers(width, widest)
    sums_at_once = AT_ONCE
    while sums_at_once > 1 and sums_at_once * width > MOST_REGISTERS * NARROW:
        sums_at_once //= 2
    number = order.type
    # Start with the lowest orders of the columns: the orders written last are the slowest to read.
    factor = rows.walker(builder.sub(order, inset), left)
    other = rows.walker(inset, first)
    totals = [
        [variable(builder, vector_of(each)([0.0] * each)) for _, each in registers]
        for _ in range(sums_at_once)
    ]

    def add_term(row_of_totals):
        a, b = rows.walk(factor, -1), rows.walk(other, 1)
        for (place, each), total in zip(registers, row_of_totals, strict=True):
            term = read(builder, rows.beside(b, place), each)
            if pairs:
                times = read(builder, rows.beside(a, place), each)
            else:
                times = everywhere(builder, builder.load(a, typ=NUMBER), each)
            builder.store(multiply_add(builder, times, term, builder.load(total)), total)

    terms = builder.add(builder.sub(order, builder.add(inset, inset)), number(1))
    terms = builder.select(builder.icmp_signed(">", terms, number(0)), terms, number(0))
    with loop(builder, number(0), builder.udiv(terms, number(sums_at_once)), number(1)):
        for each in totals:
            add_term(each)
    if sums_at_once > 1:
        with loop(builder, number(0), builder.urem(terms, number(sums_at_once)), number(1)):
            add_term(totals[0])
    for i, (place, _) in enumerate(registers):
        parts = [builder.load(each[i]) for each in totals]
        while len(parts) > 1:
            parts = [builder.fadd(*parts[j : j + 2]) for j in range(0, len(parts), 2)]
        yield place, parts[0]


def write_ends(builder, rows, order, left, first, width, widest, pairs=False):
    """The instructions of ``add_ends``, or of ``add_ends_of_pairs``."""
    number = order.type
    below = builder.sub(order, number(1))
    differ = builder.icmp_signed(">", order, number(2))
    here, one, last = (rows.address(row, first) for row in (order, number(1), below))
    left_one, left_last = (rows.address(row, left) for row in (number(1), below))
    for place, lanes in _registers(width, widest):
        nothing = vector_of(lanes)([0.0] * lanes)
        if pairs:
            low, high = (read(builder, rows.beside(each, place), lanes) for each in (left_one, left_last))
        else:
            ends = (builder.load(each, typ=NUMBER) for each in (left_one, left_last))
            low, high = (everywhere(builder, each, lanes) for each in ends)
        high = builder.select(differ, high, nothing)
        total = read(builder, rows.beside(here, place), lanes)
        total = multiply_add(builder, high, read(builder, rows.beside(one, place), lanes), total)
        total = multiply_add(builder, low, read(builder, rows.beside(last, place), lanes), total)
        write(builder, total, rows.beside(here, place))


def _weighted_sum(builder, factors, terms):
    total = builder.fmul(factors[0], terms[0])
    for factor, term in zip(factors[1:], terms[1:], strict=True):
        total = multiply_add(builder, factor, term, total)
    return total


def write_combination(builder, rows, order, table, width, numbers):
    """The instructions of ``combine``."""
    number = order.type
    target, source = rows.walker(number(0), number(0)), rows.walker(number(0), table)
    with loop(builder, number(0), builder.add(order, number(1)), number(1)):
        here, there = rows.walk(target, 1), rows.walk(source, 1)
        for place, lanes in _registers(width, WIDE):
            factors = [everywhere(builder, each, lanes) for each in numbers]
            blocks = [rows.beside(there, width * c + place) for c in range(len(numbers))]
            terms = [read(builder, block, lanes) for block in blocks]
            write(builder, _weighted_sum(builder, factors, terms), rows.beside(here, place))


def write_combination_of_tangents(builder, rows, order, table, width, first, n):
    """The instructions of ``combine_tangents``."""
    number = order.type
    start = rows.address(number(0), first)
    vectors = [read(builder, rows.beside(start, NARROW * j), NARROW) for j in range(n)]
    target, source = rows.walker(number(1), first), rows.walker(number(1), table)
    with loop(builder, number(0), order, number(1)):
        here, there = rows.walk(target, 1), rows.walk(source, 1)
        for i in range(n):
            entries = [builder.load(rows.beside(there, width * j + i), typ=NUMBER) for j in range(n)]
            factors = [everywhere(builder, entry, NARROW) for entry in entries]
            write(builder, _weighted_sum(builder, factors, vectors), rows.beside(here, NARROW * i))


def write_spread(builder, y, length, n, rows, first, stride):
    """The instructions of ``spread_tangents``; lanes without a vector are zero."""
    number = first.type
    count = builder.sub(builder.sdiv(length, number(n)), number(1))
    groups = builder.sdiv(builder.add(count, number(NARROW - 1)), number(NARROW))
    with loop(builder, number(0), groups, number(1)) as group:
        for lane in range(NARROW):
            vector = builder.add(builder.mul(group, number(NARROW)), number(lane))
            is_one = builder.icmp_signed("<", vector, count)
            column = builder.add(builder.add(first, builder.mul(group, stride)), number(lane))
            source = builder.select(is_one, builder.mul(number(n), builder.add(vector, number(1))), number(0))
            start = builder.gep(y, [source], source_etype=NUMBER)
            target = rows.address(number(0), column)
            with loop(builder, number(0), number(n), number(1)) as i:
                value = builder.load(builder.gep(start, [i], source_etype=NUMBER), typ=NUMBER)
                value = builder.select(is_one, value, value.type(0.0))
                place = builder.gep(target, [builder.mul(i, number(NARROW))], source_etype=NUMBER)
                builder.store(value, place)
