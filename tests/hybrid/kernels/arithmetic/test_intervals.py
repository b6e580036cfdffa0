"""The range and the slope of every function lie within their bounds, at any point of any interval."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.arithmetic import intervals
from hybrid.kernels.arithmetic import operations as op

_range, _slope = intervals.range_of, intervals.slope_of
_product, _quotient, _whole, _fixed = (
    intervals.product,
    intervals.quotient,
    intervals.whole_power,
    intervals.fixed_power,
)
_angle = intervals.angle


@njit
def bounds(code, low, high):
    least, most = _range(code, low, high)
    below, above = _slope(code, low, high, least, most)
    return least, most, below, above


@njit
def product(a, b, c, d):
    return _product(a, b, c, d)


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
@settings(suppress_health_check=[HealthCheck.filter_too_much])
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
@settings(suppress_health_check=[HealthCheck.filter_too_much])
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


def test_what_may_jump_has_a_slope_without_bound():
    assert bounds(op.SIGN, -1.0, 1.0) == (-1.0, 1.0, 0.0, math.inf)
    assert bounds(op.FLOOR, 0.25, 0.75) == (0.0, 0.0, 0.0, 0.0)
    assert bounds(op.TAN, 1.5, 1.6)[:2] == (-math.inf, math.inf)
