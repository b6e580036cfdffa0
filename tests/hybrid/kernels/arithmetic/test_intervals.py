"""The range and the slope of every function lie within their bounds, at any point of any interval."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.arithmetic import intervals
from hybrid.kernels.arithmetic import operations as op

_range, _slope = intervals.range_of, intervals.slope_of
_added, _product, _quotient, _whole, _fixed = (
    intervals.added,
    intervals.product,
    intervals.quotient,
    intervals.whole_power,
    intervals.fixed_power,
)
_angle, _truth, _comparison = intervals.angle, intervals.truth, intervals.comparison


@njit
def bounds(code, low, high):
    least, most = _range(code, low, high)
    below, above = _slope(code, low, high, least, most)
    return least, most, below, above


@njit
def product(a, b, c, d):
    return _product(a, b, c, d)


@njit
def added(a, b, c, d):
    return _added(a, b, c, d)


@njit
def quotient(a, b, c, d):
    return _quotient(a, b, c, d)


@njit
def whole_power(a, b, exponent):
    return _whole(a, b, exponent)


@njit
def fixed_power(a, b, exponent):
    return _fixed(a, b, exponent)


@njit
def angle(a, b, c, d):
    return _angle(a, b, c, d)


@njit
def truth(low, high):
    return _truth(low, high)


@njit
def comparison(code, a, b, c, d):
    return _comparison(code, a, b, c, d)


# Each function with its derivative; None if the derivative is zero except at jumps.
FUNCTIONS = {
    op.EXP: (math.exp, math.exp),
    op.LOG: (math.log, lambda u: 1 / u),
    op.SQRT: (math.sqrt, lambda u: 0.5 / math.sqrt(u)),
    op.CUBE_ROOT: (math.cbrt, lambda u: 1 / (3 * math.cbrt(u) ** 2)),
    op.SIN: (math.sin, math.cos),
    op.COS: (math.cos, lambda u: -math.sin(u)),
    op.TAN: (math.tan, lambda u: 1 + math.tan(u) ** 2),
    op.ASIN: (math.asin, lambda u: 1 / math.sqrt(1 - u * u)),
    op.ACOS: (math.acos, lambda u: -1 / math.sqrt(1 - u * u)),
    op.ATAN: (math.atan, lambda u: 1 / (1 + u * u)),
    op.SINH: (math.sinh, math.cosh),
    op.COSH: (math.cosh, math.sinh),
    op.TANH: (math.tanh, lambda u: 1 / math.cosh(u) ** 2),
    op.ASINH: (math.asinh, lambda u: 1 / math.sqrt(1 + u * u)),
    op.ACOSH: (math.acosh, lambda u: 1 / math.sqrt(u * u - 1)),
    op.ATANH: (math.atanh, lambda u: 1 / (1 - u * u)),
    op.LOG1P: (math.log1p, lambda u: 1 / (1 + u)),
    op.EXPM1: (math.expm1, math.exp),
    op.ABSOLUTE: (abs, lambda u: math.copysign(1.0, u)),
    op.FLOOR: (math.floor, None),
    op.CEILING: (math.ceil, None),
    op.TRUNCATE: (math.trunc, None),
    op.ROUND: (round, None),
    op.ERF: (math.erf, lambda u: 2.0 / math.sqrt(math.pi) * math.exp(-u * u)),
    op.ERFC: (math.erfc, lambda u: -2.0 / math.sqrt(math.pi) * math.exp(-u * u)),
    op.SIGN: (lambda u: float(np.sign(u)), None),
    op.STEP: (lambda u: float(np.heaviside(u, 0.5)), None),
    op.NOT: (lambda u: float(not u), None),
}
SIZES = (1e-12, 1e-3, 0.5, 1.0, 3.0, 50.0, 700.0)


def intervals():
    """An interval and a point of it: tiny, moderate or wide, at zero or away from it."""
    size = st.sampled_from(SIZES)
    part = st.floats(-1.0, 1.0)
    ends = st.tuples(size, part, size, part).map(lambda v: sorted((v[0] * v[1], v[0] * v[1] + v[2] * v[3])))
    return st.tuples(ends, st.floats(0.0, 1.0)).map(
        lambda v: (*v[0], min(max(v[0][0] + v[1] * (v[0][1] - v[0][0]), v[0][0]), v[0][1]))
    )


@pytest.mark.parametrize("code", FUNCTIONS)
@settings(max_examples=30, suppress_health_check=[HealthCheck.filter_too_much])
@given(intervals())
def test_a_function_lies_within_its_bounds(code, case):
    low, high, u = case
    function, derivative = FUNCTIONS[code]
    try:
        value = function(u)
    except (ValueError, OverflowError):
        assume(False)
    least, most, below, above = bounds(code, low, high)
    # The reference is rounded, too.
    slack = 1e-15 * abs(value)
    assert least - slack <= value <= most + slack
    if derivative is None:
        return
    try:
        slope = derivative(u)
    except (ValueError, ZeroDivisionError, OverflowError):
        return
    slack = 1e-13 * abs(slope)
    assert below - slack <= slope <= above + slack


@pytest.mark.parametrize("code", FUNCTIONS)
@settings(max_examples=30, suppress_health_check=[HealthCheck.filter_too_much])
@given(intervals())
def test_a_difference_is_at_most_the_slope_times_the_distance(code, case):
    low, _, u = case
    function, _ = FUNCTIONS[code]
    try:
        rise = function(u) - function(low)
    except (ValueError, OverflowError):
        assume(False)
    assume(u > low)
    _, _, below, above = bounds(code, low, u)
    slack = 1e-14 * (abs(function(u)) + abs(function(low)))
    assert below * (u - low) - slack <= rise
    assert rise <= (above * (u - low) if above else 0.0) + slack


# Where the extremes of a function or of its slope may be, besides the ends of an interval.
TURNS = np.array([0.0, *(np.pi / 2 * np.arange(-8, 9))])
moderate = st.tuples(
    st.floats(-6.0, 6.0).map(lambda v: round(v, 2)), st.sampled_from([1e-9, 0.1, 1.0, 5.0])
).map(lambda v: (v[0], v[0] + v[1]))


def extremes(function, low, high):
    """Least and largest value at the ends, at turns between, and next to them; None without a value there."""
    places = [low, high, *TURNS[(low < TURNS) & (high > TURNS)]]
    try:
        values = [function(place) for place in places]
    except (ValueError, ZeroDivisionError, OverflowError):
        return None
    return min(values), max(values)


@pytest.mark.parametrize("code", FUNCTIONS)
@settings(max_examples=40, suppress_health_check=[HealthCheck.filter_too_much])
@given(moderate, st.floats(-0.9, 0.9), st.floats(-0.9, 0.9))
def test_bounds_are_no_wider_than_rounding_makes_them(code, interval, one, other):
    low, high = sorted((one, other)) if code in (op.ASIN, op.ACOS, op.ATANH) else interval
    if code in (op.LOG, op.SQRT, op.ACOSH, op.LOG1P):
        # Into the domain, which begins at 0, at 1 or at -1.
        low, high = low + 7.001, high + 7.001
        if code == op.LOG1P:
            low, high = low - 1.9, high - 1.9
    function, derivative = FUNCTIONS[code]
    least, most, below, above = bounds(code, low, high)
    if code in (op.SIN, op.COS):
        # No sine is larger than 1, not even by rounding.
        assert -1.0 <= min(least, below) <= max(most, above) <= 1.0
    if code == op.TAN and math.floor(low / math.pi - 0.5) != math.floor(high / math.pi - 0.5):
        assert (least, most, below, above) == (-math.inf, math.inf, -math.inf, math.inf)
        return
    exact = extremes(function, low, high)
    slack = 3e-14 * max(map(abs, exact)) + 2e-15
    assert exact[0] - slack <= least <= exact[0] + slack
    assert exact[1] - slack <= most <= exact[1] + slack
    if derivative is None:
        # A jump downwards has any slope, one upwards none that is negative.
        steady = least == most
        steepest = (-math.inf if code == op.NOT else 0.0, math.inf)
        assert (below, above) == ((0.0, 0.0) if steady else steepest)
        return
    if code == op.ABSOLUTE and low <= 0.0 <= high:
        assert (below, above) == (-1.0 if low < 0.0 else below, 1.0 if high > 0.0 else above)
        return
    if code == op.CUBE_ROOT and low <= 0.0 <= high:
        assert above == math.inf
        return
    exact = extremes(derivative, low, high)
    slack = 1e-12 * max(map(abs, exact)) + 2e-15
    assert exact[0] - slack <= below <= exact[0] + slack
    assert exact[1] - slack <= above <= exact[1] + slack


@pytest.mark.parametrize("code", [op.LOG, op.SQRT, op.ACOSH, op.LOG1P, op.ASIN, op.ACOS, op.ATANH])
def test_only_the_part_of_an_interval_in_the_domain_counts(code):
    """The domain ends at 0, 1, -1, or at both -1 and 1; outside nothing is known."""
    end = {op.LOG: 0.0, op.SQRT: 0.0, op.ACOSH: 1.0, op.LOG1P: -1.0}.get(code, -1.0)
    assert bounds(code, end - 2.0, end - 1.0)[:2] == (-math.inf, math.inf)
    function = FUNCTIONS[code][0]
    least, most, below, above = bounds(code, end - 1.0, end + 0.5)
    at_end = {op.LOG: -math.inf, op.LOG1P: -math.inf, op.ATANH: -math.inf}
    expected = sorted([at_end[code] if code in at_end else function(end), function(end + 0.5)])
    np.testing.assert_allclose([least, most], expected, rtol=1e-14)
    # The slope has no bound at the end of the domain.
    steepest = -math.inf if code == op.ACOS else math.inf
    assert steepest in (below, above)
    if code in (op.ASIN, op.ACOS, op.ATANH):
        assert bounds(code, 1.5, 2.5)[:2] == (-math.inf, math.inf)
        mirrored = bounds(code, 0.5, 2.0)
        shift = math.pi if code == op.ACOS else 0.0
        np.testing.assert_allclose(mirrored[:2], [shift - most, shift - least], rtol=0, atol=1e-14)
        np.testing.assert_allclose(mirrored[2:], [below, above], rtol=1e-14)


# Functions whose values are not numbers of the machine, on the interval where each is tested.
EXACT = {
    op.EXP: (mpmath.exp, -6.0, 6.0), op.LOG: (mpmath.log, 0.1, 9.0), op.SQRT: (mpmath.sqrt, 0.1, 9.0),
    op.CUBE_ROOT: (lambda u: mpmath.sign(u) * mpmath.cbrt(abs(u)), -9.0, 9.0),
    op.SIN: (mpmath.sin, -30.0, 30.0),
    op.COS: (mpmath.cos, -30.0, 30.0), op.TAN: (mpmath.tan, -30.0, 30.0), op.ASIN: (mpmath.asin, -1.0, 1.0),
    op.ACOS: (mpmath.acos, -1.0, 1.0), op.ATAN: (mpmath.atan, -9.0, 9.0), op.SINH: (mpmath.sinh, -6.0, 6.0),
    op.COSH: (mpmath.cosh, -6.0, 6.0), op.TANH: (mpmath.tanh, -6.0, 6.0), op.ASINH: (mpmath.asinh, -9.0, 9.0),
    op.ACOSH: (mpmath.acosh, 1.1, 9.0), op.ATANH: (mpmath.atanh, -1.0, 1.0),
    op.LOG1P: (mpmath.log1p, -0.9, 9.0),
    op.EXPM1: (mpmath.expm1, -6.0, 6.0),
    op.ERF: (mpmath.erf, -3.0, 3.0), op.ERFC: (mpmath.erfc, -3.0, 6.0),
}  # fmt: skip


@pytest.mark.parametrize("code", EXACT)
def test_the_exact_value_lies_strictly_within_the_bounds_of_a_point(code):
    """Bounds are rounded outwards: the exact value is never a number of the machine."""
    exact, low, high = EXACT[code]
    with mpmath.workdps(40):
        for u in np.random.default_rng(code).uniform(low, high, 60):
            least, most, below, above = bounds(code, u, u)
            assert least < exact(mpmath.mpf(u)) < most
            if code != op.ABSOLUTE:
                assert (
                    below - 4e-16 * abs(below)
                    <= mpmath.diff(exact, mpmath.mpf(u))
                    <= above + 4e-16 * abs(above)
                )


def test_exact_powers_products_sums_and_quotients_lie_within_the_bounds_of_points():
    with mpmath.workdps(40):
        for u, v in np.random.default_rng(0).uniform(0.1, 9.0, (60, 2)):
            one, other = mpmath.mpf(u), mpmath.mpf(v)
            for (least, most), exact in [
                (product(u, u, -v, -v), -one * other),
                (quotient(u, u, -v, -v), -one / other),
                (angle(u, u, -v, -v), mpmath.atan2(one, -other)),
                (whole_power(-u, -u, 3), -(one**3)),
                (whole_power(u, u, -3), one**-3),
                (whole_power(-u, -u, 2), one**2),
                (fixed_power(u, u, -0.7), one ** mpmath.mpf(-0.7)),
                (fixed_power(u, u, 0.7), one ** mpmath.mpf(0.7)),
            ]:
                assert least < exact < most


@given(moderate, moderate)
def test_products_quotients_and_angles_are_no_wider_than_their_corners(one, other):
    corners = [(u, v) for u in one for v in other]
    slack = 1e-14 * max(abs(u * v) for u, v in corners)
    least, most = product(*one, *other)
    assert least >= min(u * v for u, v in corners) - slack
    assert most <= max(u * v for u, v in corners) + slack
    least, most = quotient(*one, *other)
    if other[0] < 0.0 < other[1]:
        assert (least, most) == (-math.inf, math.inf)
    elif 0.0 not in other:
        slack = 1e-14 * max(abs(u / v) for u, v in corners)
        assert least >= min(u / v for u, v in corners) - slack
        assert most <= max(u / v for u, v in corners) + slack
    least, most = angle(*one, *other)
    if one[0] <= 0.0 <= one[1] and other[0] <= 0.0:
        assert (least, most) == (-math.pi, math.pi)
    else:
        angles = [math.atan2(u, v) for u, v in corners]
        np.testing.assert_allclose([least, most], [min(angles), max(angles)], rtol=1e-14)


def test_quotients_by_an_interval_that_ends_at_zero():
    np.testing.assert_allclose(quotient(1.0, 2.0, 0.0, 4.0), (0.25, math.inf), rtol=1e-14)
    np.testing.assert_allclose(quotient(1.0, 2.0, -4.0, 0.0), (-math.inf, -0.25), rtol=1e-14)
    assert quotient(1.0, 2.0, 0.0, 0.0) == (-math.inf, math.inf)


@given(moderate, st.integers(-3, 6), st.sampled_from([0.25, 1.5, -0.5, -1.5]))
def test_powers_are_no_wider_than_they_must(interval, whole, exponent):
    low, high = interval
    least, most = whole_power(low, high, whole)
    around_zero = low <= 0.0 <= high
    if whole >= 0:
        values = [low**whole, high**whole, *([0.0**whole] if around_zero else [])]
        slack = 1e-14 * max(map(abs, values))
        assert min(values) - slack <= least <= min(values)
        assert max(values) <= most <= max(values) + slack
    elif not around_zero:
        np.testing.assert_allclose([least, most], sorted([low**whole, high**whole]), rtol=1e-13)
    least, most = fixed_power(low, high, exponent)
    if high < 0.0:
        assert (least, most) == (-math.inf, math.inf)
    elif high > 0.0:
        ends = [low**exponent if low > 0.0 else (0.0 if exponent > 0.0 else math.inf), high**exponent]
        np.testing.assert_allclose([least, most], sorted(ends), rtol=1e-13)


@pytest.mark.parametrize("turn", [0, 1, 2, 7, 100, 12345])
def test_a_pole_of_the_tangent_between_two_neighbouring_numbers_is_seen(turn):
    for sign in (-1.0, 1.0):
        pole = sign * (turn + 0.5) * math.pi
        beside = [math.nextafter(pole, -math.inf), math.nextafter(pole, math.inf)]
        assert bounds(op.TAN, *beside) == (-math.inf, math.inf, -math.inf, math.inf)


def test_nothing_is_known_of_sines_far_from_zero():
    for code in (op.SIN, op.COS):
        assert bounds(code, 1e15, 1e15)[:2] == (-1.0, 1.0)
        assert bounds(code, -1e15, -1e15)[:2] == (-1.0, 1.0)
    assert bounds(op.TAN, 1e15, 1e15)[:2] == (-math.inf, math.inf)


def test_truths():
    assert truth(0.0, 0.0) == 0.0
    assert [truth(*ends) for ends in [(0.5, 2.0), (-2.0, -0.5)]] == [1.0, 1.0]
    assert [truth(*ends) for ends in [(-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)]] == [0.5, 0.5, 0.5]


small = st.sampled_from([-1.0, 0.0, 1.0, 2.0])
short = st.tuples(small, small).map(sorted)


@pytest.mark.parametrize("code", [op.LESS, op.LESS_EQUAL, op.EQUAL, op.AND, op.OR])
@given(short, short)
def test_comparisons_are_as_certain_as_they_can_be(code, one, other):
    relation = {
        op.LESS: np.less, op.LESS_EQUAL: np.less_equal, op.EQUAL: np.equal,
        op.AND: np.logical_and, op.OR: np.logical_or,
    }[code]  # fmt: skip
    places = [
        sorted({low, high, (low + high) / 2, *(v for v in (0.0, 1.0) if low <= v <= high)})
        for low, high in (one, other)
    ]
    truths = {float(relation(u, v)) for u in places[0] for v in places[1]}
    if (
        one[0] < one[1]
        and other[0] < other[1]
        and code == op.EQUAL
        and one[0] <= other[1]
        and other[0] <= one[1]
    ):
        truths = {0.0, 1.0}
    assert comparison(code, *one, *other) == (min(truths), max(truths))


@given(intervals(), intervals())
def test_products_quotients_and_angles(one, other):
    a, b, u = one
    c, d, v = other
    least, most = product(a, b, c, d)
    assert least <= u * v <= most
    least, most = quotient(a, b, c, d)
    if v != 0.0:
        assert least <= u / v <= most
    least, most = angle(a, b, c, d)
    assert least <= math.atan2(u, v) <= most


@given(intervals(), st.integers(-6, 7))
def test_whole_powers(case, exponent):
    low, high, u = case
    assume(u != 0.0 or exponent >= 0)
    least, most = whole_power(low, high, exponent)
    try:
        value = u**exponent
    except OverflowError:
        assume(False)
    assert least <= value <= most


@given(intervals(), st.sampled_from([0.25, 1.5, 2.5, -0.5, -1.5, 1 / 3]))
def test_fixed_powers_of_what_is_not_negative(case, exponent):
    low, high, u = case
    assume(u > 0.0 or (u == 0.0 and exponent > 0))
    least, most = fixed_power(low, high, exponent)
    slack = 1e-15 * u**exponent
    assert least - slack <= u**exponent <= most + slack


def test_exact_zeros_stay_exact():
    assert bounds(op.SIN, 0.0, 0.0)[:2] == (0.0, 0.0)
    assert product(0.0, 0.0, -math.inf, math.inf) == (0.0, 0.0)
    assert bounds(op.ABSOLUTE, -1.0, 2.0) == (0.0, 2.0, -1.0, 1.0)
    assert whole_power(-1e-9, 1e-9, 3)[0] < 0.0 < whole_power(-1e-9, 1e-9, 3)[1]


def test_arithmetic_on_whole_numbers_has_no_rounding():
    """So a floor, or a comparison, of what was computed from whole numbers is certain."""
    for a, b in [(3.0, 7.0), (-12.0, 4.0), (0.5, 6.0), (1e6, 9.0)]:
        assert product(a, a, b, b) == (a * b, a * b)
        assert quotient(a * b, a * b, b, b) == (a, a)
        assert added(a, a, b, b) == (a + b, a + b)
    assert product(1.0, 2.0, -3.0, 5.0) == (-6.0, 10.0)
    assert added(1.0, 2.0, -3.0, 5.0) == (-2.0, 7.0)
    for least, most in [quotient(1.0, 1.0, 3.0, 3.0), product(0.1, 0.1, 3.0, 3.0), added(0.1, 0.1, 0.2, 0.2)]:
        assert least < most


def test_what_may_jump_has_a_slope_without_bound():
    assert bounds(op.SIGN, -1.0, 1.0) == (-1.0, 1.0, 0.0, math.inf)
    assert bounds(op.FLOOR, 0.25, 0.75) == (0.0, 0.0, 0.0, 0.0)
    assert bounds(op.TAN, 1.5, 1.6)[:2] == (-math.inf, math.inf)
