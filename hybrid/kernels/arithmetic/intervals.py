"""Interval arithmetic: bounds for a range and for a slope, rounded outwards.

An interval is two numbers: its ends. The whole line stands for a value that is undefined somewhere on the
interval, and for the slope of a function that may jump. Zero times infinity is zero here: an infinite end
means that the numbers have no bound, but each of them is finite and gives zero.
"""

import math

import numpy as np
from numba import njit

from hybrid.kernels.arithmetic import operations as op
from hybrid.kernels.types.options import INLINE, KERNEL

# Relative error of an operation or of a function of the C library, with a margin.
ROUNDING = 4.5e-16
# A cube root is a power with a rounded exponent.
ROUNDING_OF_CUBE_ROOT = 2e-14
HUGE = 1.7976931348623157e308
PI = math.pi
# Sums of multiples of 1 / GRID up to this size have 53 binary digits at most.
GRID, LARGEST_ON_GRID = 2.0**20, 2.0**31
# The slope of the error function at zero.
SLOPE_OF_ERF = 2.0 / math.sqrt(math.pi)
# The sine of an argument beyond this has no digits left.
MOST_TURNS = 1e14


@njit(**INLINE)
def widened(low, high, share):
    """The interval with each end moved outwards by a share of itself; exact zeros stay."""
    if not low <= high:
        return -math.inf, math.inf
    low, high = min(low, HUGE), max(high, -HUGE)
    return low - share * abs(low), high + share * abs(high)


@njit(**INLINE)
def _times(a, b):
    return a * b if a != 0.0 and b != 0.0 else 0.0


@njit(**INLINE)
def exact_product(a, b, c, d):
    """``[a, b] * [c, d]``."""
    one, two, three, four = _times(a, c), _times(a, d), _times(b, c), _times(b, d)
    return min(min(one, two), min(three, four)), max(max(one, two), max(three, four))


@njit(**INLINE)
def _are_short(a, b):
    """Whether two numbers have 24 binary digits at most, as whole numbers up to 16 million have.

    The product of two such numbers is exact.
    """
    return abs(a) + abs(b) < math.inf and np.float32(a) == a and np.float32(b) == b


@njit(**INLINE)
def product(a, b, c, d):
    """``[a, b] * [c, d]``, rounded outwards; the product of whole numbers is exact."""
    low, high = exact_product(a, b, c, d)
    if _are_short(a, b) and _are_short(c, d):
        return low, high
    return widened(low, high, ROUNDING)


@njit(**INLINE)
def _is_on_grid(a):
    """Whether a number is one of those, whole numbers among them, whose sums are exact."""
    return abs(a) < LARGEST_ON_GRID and np.floor(GRID * a) == GRID * a


@njit(**INLINE)
def added(a, b, c, d):
    """``[a, b] + [c, d]``, rounded outwards; the sum of whole numbers is exact."""
    if _is_on_grid(a) and _is_on_grid(b) and _is_on_grid(c) and _is_on_grid(d):
        return a + c, b + d
    return widened(a + c, b + d, ROUNDING)


@njit(**KERNEL)
def quotient(a, b, c, d):
    """``[a, b] / [c, d]``; the whole line if the divisor changes sign."""
    if (c < 0.0 < d) or (c == 0.0 and d == 0.0):
        return -math.inf, math.inf
    if a == b and c == d:
        found = a / c
        if _are_short(found, c) and found * c == a:
            return found, found
    least = 1.0 / d if d != 0.0 else -math.inf
    most = 1.0 / c if c != 0.0 else math.inf
    low, high = exact_product(a, b, least, most)
    return widened(low, high, 2.0 * ROUNDING)


@njit(**INLINE)
def hull(a, b, c, d):
    """The smallest interval that contains both."""
    return min(a, c), max(b, d)


@njit(**KERNEL)
def whole_power(low, high, exponent):
    """``[low, high] ** exponent`` for a whole exponent."""
    if exponent < 0:
        below, above = whole_power_of_positive(low, high, -exponent)
        return quotient(1.0, 1.0, below, above)
    return whole_power_of_positive(low, high, exponent)


@njit(**KERNEL)
def whole_power_of_positive(low, high, exponent):
    """As ``whole_power``, for an exponent that is not negative."""
    if exponent == 0:
        return 1.0, 1.0
    one, other = low ** float(exponent), high ** float(exponent)
    if exponent % 2 == 1:
        return widened(one, other, 2.0 * ROUNDING)
    largest = max(one, other)
    if low <= 0.0 <= high:
        return widened(0.0, largest, 2.0 * ROUNDING)
    return widened(min(one, other), largest, 2.0 * ROUNDING)


@njit(**KERNEL)
def fixed_power(low, high, exponent):
    """``[low, high] ** exponent`` for bases that are not negative; the part below zero is left out."""
    if high < 0.0:
        return -math.inf, math.inf
    low = max(low, 0.0)
    if exponent >= 0.0:
        return widened(low**exponent, high**exponent, 4.0 * ROUNDING)
    most = low**exponent if low > 0.0 else math.inf
    return widened(high**exponent if high > 0.0 else math.inf, most, 4.0 * ROUNDING)


@njit(**KERNEL)
def cosine(low, high):
    """Range of the cosine."""
    if not high - low < 2.0 * PI or abs(low) > MOST_TURNS or abs(high) > MOST_TURNS:
        return -1.0, 1.0
    least, most = min(math.cos(low), math.cos(high)), max(math.cos(low), math.cos(high))
    slack = ROUNDING * (abs(low) + abs(high))
    # A multiple of pi inside the interval is a turning point.
    first = math.ceil((low - slack) / PI)
    while first * PI <= high + slack:
        if first % 2.0 == 0.0:
            most = 1.0
        else:
            least = -1.0
        first += 1.0
    return max(least - ROUNDING, -1.0), min(most + ROUNDING, 1.0)


@njit(**KERNEL)
def sine(low, high):
    """Range of the sine."""
    if low == 0.0 == high:
        return 0.0, 0.0
    if not high - low < 2.0 * PI or abs(low) > MOST_TURNS or abs(high) > MOST_TURNS:
        return -1.0, 1.0
    one, other = math.sin(low), math.sin(high)
    least, most = widened(min(one, other), max(one, other), ROUNDING)
    slack = ROUNDING * (abs(low) + abs(high))
    first = math.ceil((low - slack) / PI - 0.5)
    while (first + 0.5) * PI <= high + slack:
        if first % 2.0 == 0.0:
            most = 1.0
        else:
            least = -1.0
        first += 1.0
    return max(least, -1.0), min(most, 1.0)


@njit(**KERNEL)
def tangent_of(low, high):
    """Range of the tangent; the whole line around a pole."""
    if not high - low < PI or abs(low) > MOST_TURNS or abs(high) > MOST_TURNS:
        return -math.inf, math.inf
    slack = ROUNDING * (abs(low) + abs(high))
    if math.floor((low - slack) / PI - 0.5) != math.floor((high + slack) / PI - 0.5):
        return -math.inf, math.inf
    return widened(math.tan(low), math.tan(high), 2.0 * ROUNDING)


@njit(**INLINE)
def _cube_root(u):
    return math.copysign(abs(u) ** (1.0 / 3.0), u)


@njit(**KERNEL)
def angle(a, b, c, d):
    """Range of ``atan2`` for ``y`` in ``[a, b]`` and ``x`` in ``[c, d]``."""
    if a <= 0.0 <= b and c <= 0.0:
        return -PI, PI
    one, two, three, four = math.atan2(a, c), math.atan2(a, d), math.atan2(b, c), math.atan2(b, d)
    return widened(min(min(one, two), min(three, four)), max(max(one, two), max(three, four)), ROUNDING)


@njit(**KERNEL)
def truth(low, high):
    """1 if all numbers of the interval are true, 0 if all are false, else 0.5."""
    if low == 0.0 == high:
        return 0.0
    return 1.0 if low > 0.0 or high < 0.0 else 0.5


@njit(**INLINE)
def _certain(value):
    """The interval of a truth value; 0.5 stands for an unknown truth value."""
    if value == 0.5:
        return 0.0, 1.0
    return value, value


@njit(**KERNEL)
def comparison(code, a, b, c, d):
    """Truth of ``LESS``, ``LESS_EQUAL``, ``EQUAL``, ``AND`` and ``OR``, as an interval."""
    if code == op.LESS:
        return _certain(1.0 if b < c else (0.0 if a >= d else 0.5))
    if code == op.LESS_EQUAL:
        return _certain(1.0 if b <= c else (0.0 if a > d else 0.5))
    if code == op.EQUAL:
        same = a == b == c == d
        return _certain(1.0 if same else (0.0 if b < c or d < a else 0.5))
    one, other = truth(a, b), truth(c, d)
    return _certain(min(one, other) if code == op.AND else max(one, other))


@njit(**KERNEL)
def range_of(code, low, high):
    """Range of a function of one operand."""
    if code == op.EXP:
        return widened(math.exp(low), math.exp(high), ROUNDING)
    if code == op.TANH:
        return widened(math.tanh(low), math.tanh(high), ROUNDING)
    if code == op.SIN:
        return sine(low, high)
    if code == op.COS:
        return cosine(low, high)
    if code == op.ABSOLUTE:
        least = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
        return least, max(abs(low), abs(high))
    if code == op.SQRT:
        if high < 0.0:
            return -math.inf, math.inf
        return widened(math.sqrt(max(low, 0.0)), math.sqrt(high), ROUNDING)
    if code == op.LOG:
        if high <= 0.0:
            return -math.inf, math.inf
        return widened(math.log(low) if low > 0.0 else -math.inf, math.log(high), ROUNDING)
    if code == op.LOG1P:
        if high <= -1.0:
            return -math.inf, math.inf
        return widened(math.log1p(low) if low > -1.0 else -math.inf, math.log1p(high), ROUNDING)
    if code == op.EXPM1:
        return widened(math.expm1(low), math.expm1(high), ROUNDING)
    if code == op.ATAN:
        return widened(math.atan(low), math.atan(high), ROUNDING)
    if code == op.CUBE_ROOT:
        return widened(_cube_root(low), _cube_root(high), ROUNDING_OF_CUBE_ROOT)
    if code == op.SINH:
        return widened(math.sinh(low), math.sinh(high), ROUNDING)
    if code == op.COSH:
        one, other = math.cosh(low), math.cosh(high)
        return widened(1.0 if low <= 0.0 <= high else min(one, other), max(one, other), ROUNDING)
    if code == op.ASINH:
        return widened(math.asinh(low), math.asinh(high), 2.0 * ROUNDING)
    return range_of_rare(code, low, high)


@njit(**KERNEL)
def range_of_rare(code, low, high):
    """As ``range_of``, for functions that are rare in guards."""
    if code == op.TAN:
        return tangent_of(low, high)
    if code == op.FLOOR:
        return np.floor(low), np.floor(high)
    if code == op.CEILING:
        return np.ceil(low), np.ceil(high)
    if code == op.TRUNCATE:
        return np.trunc(low), np.trunc(high)
    if code == op.ROUND:
        return np.rint(low), np.rint(high)
    if code == op.ERF:
        return widened(math.erf(low), math.erf(high), 2.0 * ROUNDING)
    if code == op.ERFC:
        return widened(math.erfc(high), math.erfc(low), 16.0 * ROUNDING)
    if code == op.SIGN:
        return float((low > 0.0) - (low < 0.0)), float((high > 0.0) - (high < 0.0))
    if code == op.STEP:
        return 0.5 + 0.5 * ((low > 0.0) - (low < 0.0)), 0.5 + 0.5 * ((high > 0.0) - (high < 0.0))
    if code == op.NOT:
        return _certain(1.0 - truth(low, high))
    if code == op.ACOSH:
        if high < 1.0:
            return -math.inf, math.inf
        return widened(math.acosh(max(low, 1.0)), math.acosh(high), 2.0 * ROUNDING)
    # The remaining functions are defined between -1 and 1.
    if high < -1.0 or low > 1.0:
        return -math.inf, math.inf
    low, high = max(low, -1.0), min(high, 1.0)
    if code == op.ASIN:
        return widened(math.asin(low), math.asin(high), ROUNDING)
    if code == op.ACOS:
        return widened(math.acos(high), math.acos(low), ROUNDING)
    least = math.atanh(low) if low > -1.0 else -math.inf
    return widened(least, math.atanh(high) if high < 1.0 else math.inf, 2.0 * ROUNDING)


@njit(**KERNEL)
def slope_of(code, low, high, least, most):
    """Bounds for the slope of a function of one operand; its range there is ``[least, most]``.

    A function that jumps upwards inside the interval has slopes from zero to infinity.
    """
    if code == op.EXP:
        return least, most
    if code == op.TANH:
        below, above = whole_power(least, most, 2)
        return max(1.0 - above, 0.0), min(1.0 - below, 1.0)
    if code == op.SIN:
        return cosine(low, high)
    if code == op.COS:
        below, above = sine(low, high)
        return -above, -below
    if code == op.ABSOLUTE:
        return 1.0 if low > 0.0 else -1.0, -1.0 if high < 0.0 else 1.0
    if code == op.SQRT:
        return quotient(0.5, 0.5, least, most)
    if code == op.LOG:
        return quotient(1.0, 1.0, max(low, 0.0), high)
    if code == op.LOG1P:
        below, above = added(1.0, 1.0, low, high)
        return quotient(1.0, 1.0, max(below, 0.0), above)
    if code == op.EXPM1:
        below, above = added(1.0, 1.0, least, most)
        return max(below, 0.0), above
    if code == op.ATAN:
        below, above = whole_power(low, high, 2)
        return quotient(1.0, 1.0, 1.0 + below, 1.0 + above)
    if code == op.CUBE_ROOT:
        below, above = whole_power(least, most, 2)
        return quotient(1.0, 1.0, 3.0 * below, 3.0 * above)
    if code == op.SINH:
        return range_of(op.COSH, low, high)
    if code == op.COSH:
        return range_of(op.SINH, low, high)
    if code == op.ASINH:
        below, above = whole_power(low, high, 2)
        return quotient(1.0, 1.0, math.sqrt(1.0 + below), math.sqrt(1.0 + above))
    return slope_of_rare(code, low, high, least, most)


@njit(**KERNEL)
def slope_of_rare(code, low, high, least, most):
    """As ``slope_of``, for functions that are rare in guards."""
    if code == op.TAN:
        if least == -math.inf:
            # The tangent jumps down at its pole.
            return -math.inf, math.inf
        below, above = whole_power(least, most, 2)
        return 1.0 + below, 1.0 + above
    if code == op.NOT:
        return (0.0, 0.0) if least == most else (-math.inf, math.inf)
    if op.FLOOR <= code <= op.STEP:
        return 0.0, 0.0 if least == most else math.inf
    below, above = whole_power(low, high, 2)
    if code == op.ERF or code == op.ERFC:
        below, above = range_of(op.EXP, -above, -below)
        below, above = product(below, above, SLOPE_OF_ERF, SLOPE_OF_ERF)
        return (below, above) if code == op.ERF else (-above, -below)
    if code == op.ACOSH:
        return quotient(1.0, 1.0, math.sqrt(max(below - 1.0, 0.0)), math.sqrt(max(above - 1.0, 0.0)))
    below, above = max(1.0 - above, 0.0), max(1.0 - below, 0.0)
    if code == op.ATANH:
        return quotient(1.0, 1.0, below, above)
    below, above = quotient(1.0, 1.0, math.sqrt(below), math.sqrt(above))
    return (below, above) if code == op.ASIN else (-above, -below)
