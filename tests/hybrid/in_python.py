"""What the functions of registers compute, on arrays: the plain definitions of those that are compiled.

Four numbers in a register are an array ``(4,)``.
"""

import math

import numpy as np

from hybrid.compiler.llvm.registers import widths
from hybrid.kernels.instructions.registers import whole_registers
from hybrid.kernels.types.codes import HEAD, NARROW
from hybrid.kernels.types.layout import UPPER_HALF


def load(matrix, row, column):
    """Four entries of a row."""
    return matrix[row, column : column + NARROW].copy()


def four(a, b, c, d):
    """Four numbers side by side."""
    return np.array([a, b, c, d])


def store(matrix, row, column, lanes):
    """Write four entries of a row, from a register or from one number for all."""
    matrix[row, column : column + NARROW] = lanes


def store_down(matrix, row, column, stride, lanes):
    """Write four entries of a row that are ``stride`` columns apart."""
    matrix[row, column : column + NARROW * stride : stride] = lanes


def store_row(matrix, row, column, numbers):
    """Write a tuple of numbers side by side, in registers padded with zeros; or registers of four numbers."""
    numbers = np.concatenate([np.atleast_1d(each) for each in numbers])
    filled = sum(widths(len(numbers)))
    matrix[row, column : column + filled] = [*numbers, *[0.0] * (filled - len(numbers))]


def square_root(lanes):
    """Square root of each number."""
    return np.sqrt(lanes)


def magnitude(lanes):
    """Absolute value of each number."""
    return abs(lanes)


def four_times(number):
    """The same number in every lane."""
    return np.full(NARROW, number)


def larger(a, b):
    """The larger number in each lane; ``b`` where one is nan."""
    return np.where(a > b, a, b)


def largest(lanes):
    """The largest of the four numbers."""
    return max(lanes)


def largest_of_each(a, b, c, d):
    """The largest number of each of four registers, as one register."""
    return np.array([max(a), max(b), max(c), max(d)])


def places():
    """The places of the numbers in a register, as numbers from 0 on."""
    return np.arange(float(NARROW))


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


def divided_dot_product(factors, highs, lows, by):
    """The sum of ``factors[i] (highs[i] + lows[i])``, divided by ``by``: rounded value and rounding error.

    The factors and ``by`` are single numbers; all else is four numbers at once.
    """
    total, rest = np.zeros(NARROW), np.zeros(NARROW)
    for factor, high, low in zip(factors, highs, lows, strict=True):
        product = factor * high
        longer = total + product
        part = longer - total
        rest += (total - (longer - part)) + (product - part)
        rest += _lost(factor, high, product) + factor * low
        total = longer
    quotient = total / by
    low = (rest - _lost(by, quotient, total)) / by
    whole = quotient + low
    return whole, low - (whole - quotient)


def _lost(factor, lanes, product):
    """Rounding error of ``product``, which is ``factor * lanes`` rounded."""
    (a, b), (c, d) = _halves(factor), _halves(lanes)
    return (a * c - product) + a * d + b * c + b * d


def _halves(number):
    upper = UPPER_HALF * number - (UPPER_HALF * number - number)
    return upper, number - upper


def table(p, first, knots, degree, order, u):
    """The value of a table whose numbers begin at ``first``, or a derivative of its pieces."""
    passed = np.searchsorted(p[first + HEAD : first + HEAD + knots], u, side="right")
    away = u - p[first + HEAD + max(passed - 1, 0)]
    row = first + HEAD + knots + passed * (degree + 1)
    return sum(math.perm(k, order) * p[row + k] * away ** (k - order) for k in range(order, degree + 1))
