"""Tables: number of knots, degree, knots, coefficients piece by piece, behind the parameters of a model."""

import math

from numba import njit

from hybrid.kernels.types.codes import HEAD
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Jumps below this share of the values at the knot are rounding.
SMALL = 1e-9
# Rounding of a cubic, in units of that of its terms.
ROUNDING_OF_TABLE = 8.0 * EPSILON
# The first and the last piece end here.
FAR = 1e300


@njit(**KERNEL)
def knots_passed(numbers, first, stop, u):
    """How many of the increasing ``numbers[first:stop]`` are ``u`` or less."""
    low, high = first, stop
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] <= u:
            low = middle + 1
        else:
            high = middle
    return low - first


@njit(**INLINE)
def _coefficient(data, row, degree, order, k):
    """Coefficient ``k`` of a derivative of a piece."""
    if k + order > degree:
        return 0.0
    total = data[row + k + order]
    for factor in range(k + 1, k + order + 1):
        total *= factor
    return total


@njit(**KERNEL)
def _bounds_of_piece(data, row, degree, order, left, right):
    """Bounds of a derivative of a piece between two distances from its knot: Bernstein's coefficients."""
    a, b = _coefficient(data, row, degree, order, 0), _coefficient(data, row, degree, order, 1)
    c, d = _coefficient(data, row, degree, order, 2), _coefficient(data, row, degree, order, 3)
    h, far = right - left, max(abs(left), abs(right))
    value = a + left * (b + left * (c + left * d))
    slope, bend, third = (
        (b + left * (2.0 * c + 3.0 * left * d)) * h,
        (c + 3.0 * left * d) * h * h,
        d * h * h * h,
    )
    one, two = value + slope / 3.0, value + (2.0 * slope + bend) / 3.0
    end = value + slope + bend + third
    slack = ROUNDING_OF_TABLE * (abs(a) + far * (abs(b) + far * (abs(c) + far * abs(d))))
    return min(min(value, one), min(two, end)) - slack, max(max(value, one), max(two, end)) + slack


@njit(**KERNEL)
def table_bounds(data, first, order, low, high):
    """Bounds of a table, or of a derivative, between two arguments; and whether it jumps between them."""
    count, degree = int(data[first]), int(data[first + 1])
    if not low <= high:
        return -math.inf, math.inf, True
    knots, least, most, jumps, last = first + HEAD, math.inf, -math.inf, False, 0.0
    begin, end = knots_passed(data, knots, knots + count, low), knots_passed(data, knots, knots + count, high)
    for piece in range(begin, end + 1):
        anchor, row = data[knots + max(piece - 1, 0)], knots + count + piece * (degree + 1)
        left, right = max(low, -FAR), min(high, FAR)
        if piece > begin:
            left = data[knots + piece - 1]
            start = _coefficient(data, row, degree, order, 0)
            jumps = jumps or abs(start - last) > SMALL * max(abs(start), abs(last))
        if piece < end:
            right = data[knots + piece]
        below, above = _bounds_of_piece(data, row, degree, order, left - anchor, right - anchor)
        least, most = min(least, below), max(most, above)
        away, last = right - anchor, 0.0
        for k in range(degree - order, -1, -1):
            last = last * away + _coefficient(data, row, degree, order, k)
    if math.isnan(least) or math.isnan(most):
        return -math.inf, math.inf, jumps
    return least, most, jumps
