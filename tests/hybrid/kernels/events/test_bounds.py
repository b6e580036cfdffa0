"""Bounds of random expressions along a path: they enclose the expression, and no more than they must."""

import math
import operator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from hybrid.kernels.arithmetic import operations as op
from hybrid.kernels.events import bounds
from hybrid.kernels.types.codes import (
    HIGH,
    HIGH_MIDDLE,
    LEAST_SLOPE,
    LOW,
    LOW_MIDDLE,
    MOST_SLOPE,
    REGISTERS,
)
from hybrid.kernels.types.layout import Path, Programs

_bound, _spread = bounds.bound_guard, bounds.spread_by_rounding

PARAMETERS = (1.75, -0.6)
# Time along a step: from ``START`` on, at this pace.
START, PACE = 0.25, 0.5
# Arguments of the functions below are near 1, where all of them are smooth and have slopes of about 1.
SMOOTH = {
    op.EXP: np.exp, op.LOG: np.log, op.SQRT: np.sqrt, op.CUBE_ROOT: np.cbrt, op.SIN: np.sin, op.COS: np.cos,
    op.ATAN: np.arctan, op.SINH: np.sinh, op.COSH: np.cosh, op.TANH: np.tanh, op.ASINH: np.arcsinh,
    op.LOG1P: np.log1p, op.EXPM1: np.expm1, op.ABSOLUTE: np.abs,
}  # fmt: skip
BINARY = {
    op.SUM: operator.add, op.PRODUCT: operator.mul, op.QUOTIENT: operator.truediv, op.ANGLE: np.arctan2,
    op.MAXIMUM: np.maximum, op.MINIMUM: np.minimum,
}  # fmt: skip
JUMPING = {op.FLOOR: np.floor, op.CEILING: np.ceil, op.TRUNCATE: np.trunc, op.SIGN: np.sign}
TRUTHS = {
    op.LESS: np.less, op.LESS_EQUAL: np.less_equal, op.EQUAL: np.equal,
    op.AND: np.logical_and, op.OR: np.logical_or,
}  # fmt: skip


@njit
def _row(programs, path, clock, middle, radius, registers):
    along = Path(path, path.shape[0] - 1, clock, START, PACE, middle + radius, True, 1)
    return _bound(programs, 0, along, middle, radius, registers)


@njit
def _distance(programs, t, clock, x, scale, share, registers):
    return _spread(programs, 0, t, clock, x, scale, share, registers)


class Expression:
    """Rows of a program, and the same expression in NumPy."""

    def __init__(self, rows, numbers, parts=(None,)):
        self.rows, self.parts = rows, parts
        self.programs = Programs(
            rows=np.array(rows, dtype=np.int64).reshape(-1, 4),
            checked=np.zeros(len(rows), dtype=np.int64),
            numbers=np.array(numbers, dtype=float),
            first=np.array([0, len(rows)], dtype=np.int64),
            parameters=np.array(PARAMETERS),
        )
        self.registers = np.full((len(rows), REGISTERS), np.nan)

    def bounds(self, path, middle, radius, clock=-1):
        """The six numbers known of the whole expression."""
        last = _row(self.programs, path, clock, middle, radius, self.registers)
        assert last == len(self.rows) - 1
        return self.registers[last].copy()

    def along(self, path, places, clock=-1):
        """Values at places of the path."""
        return self.parts_along(path, places, clock)[-1]

    def parts_along(self, path, places, clock):
        """Values of all subexpressions at places of the path."""
        states = [np.polynomial.polynomial.polyval(places, column) for column in path.T]
        t = START + (PACE * places if clock < 0 else states[clock])
        with np.errstate(all="ignore"):
            return [part(t, states) for part in self.parts]

    def distance(self, t, clock, x, scale, share):
        """How far rounding of its arguments can move the expression."""
        return _distance(self.programs, t, clock, np.array(x), np.array(scale), share, self.registers)


@st.composite
def expressions(draw, functions=SMOOTH, depth=3):
    """A random expression of three components of the state, time, parameters and numbers."""
    rows, numbers, values = [], [], []

    def add(row, value):
        rows.append(row)
        values.append(value)
        return len(rows) - 1

    def leaf():
        kind = draw(st.sampled_from([op.STATE, op.STATE, op.STATE, op.TIME, op.PARAMETER, op.NUMBER]))
        if kind == op.NUMBER:
            numbers.append(draw(st.sampled_from([0.75, -1.5, 2.0])))
            place, number = len(numbers) - 1, numbers[-1]
            return add((kind, place, 0, 0), lambda t, x: number + 0.0 * t)
        if kind == op.TIME:
            return add((kind, 0, 0, 0), lambda t, x: t)
        place = draw(st.integers(0, 2 if kind == op.STATE else 1))
        if kind == op.STATE:
            return add((kind, place, 0, 0), lambda t, x: x[place])
        return add((kind, place, 0, 0), lambda t, x: PARAMETERS[place] + 0.0 * t)

    def node(level):
        if level == 0:
            return leaf()
        choice = draw(st.sampled_from(["one", "two", "two", "whole", "fixed"]))
        a = node(level - 1)
        before = values[a]
        if choice == "one":
            code = draw(st.sampled_from(list(functions)))
            function = functions[code]
            return add((code, a, 0, 0), lambda t, x: function(before(t, x)))
        if choice == "two":
            code, b = draw(st.sampled_from(list(BINARY))), node(level - 1)
            join, other = BINARY[code], values[b]
            return add((code, a, b, 0), lambda t, x: join(before(t, x), other(t, x)))
        if choice == "whole":
            exponent = draw(st.sampled_from([-2, -1, 2, 3, 4]))
            return add((op.WHOLE_POWER, a, exponent, 0), lambda t, x: before(t, x) ** float(exponent))
        numbers.append(draw(st.sampled_from([1.5, 2.5, -0.5])))
        place, power = len(numbers) - 1, numbers[-1]
        return add((op.FIXED_POWER, a, place, 0), lambda t, x: before(t, x) ** power)

    node(depth)
    return Expression(rows, numbers, values)


coefficient = st.floats(-1.0, 1.0).map(lambda c: round(c, 3))
paths = st.lists(st.lists(coefficient, min_size=5, max_size=5), min_size=3, max_size=3).map(
    lambda columns: np.array([[1.0 + 0.3 * c[0], *c[1:]] for c in columns]).T.copy()
)
pieces = st.tuples(st.floats(0.05, 0.9), st.sampled_from([1e-6, 1e-3, 0.05]))


@settings(max_examples=80)
@given(expressions({**SMOOTH, **JUMPING}), paths, pieces, st.sampled_from([-1, 2]))
def test_values_slopes_and_middles_are_enclosed(expression, path, piece, clock):
    middle, radius = piece
    row = expression.bounds(path, middle, radius, clock)
    places = middle + radius * np.linspace(-1.0, 1.0, 21)
    values, (center,) = (
        expression.along(path, places, clock),
        expression.along(path, np.array([middle]), clock),
    )
    if not np.all(np.isfinite(values)):
        return
    slopes = np.diff(values) / np.diff(places)
    slack = 1e-13 * (1.0 + abs(values).max())
    assert row[LOW] - slack <= values.min() <= values.max() <= row[HIGH] + slack
    assert row[LOW_MIDDLE] - slack <= center <= row[HIGH_MIDDLE] + slack
    slack /= radius / 10
    assert row[LEAST_SLOPE] - slack <= slopes.min() <= slopes.max() <= row[MOST_SLOPE] + slack


@settings(max_examples=80)
@given(expressions(), paths, st.floats(0.05, 0.9), st.sampled_from([-1, 2]))
def test_bounds_of_one_place_are_its_value_and_slope(expression, path, place, clock):
    around = expression.parts_along(path, place + 1e-6 * np.arange(-1.0, 2.0), clock)
    if not np.all(np.abs(around) < 30.0):
        return
    left, values, right = np.array(around).T
    slopes = (right - left) / 2e-6
    # Away from kinks and poles of any part.
    if np.any(np.abs(slopes) > 30.0) or np.any(np.abs(right - 2 * values + left) > 1e-9):
        return
    value, slope = values[-1], slopes[-1]
    row = expression.bounds(path, place, 0.0, clock)
    np.testing.assert_allclose(row[[LOW, HIGH, LOW_MIDDLE, HIGH_MIDDLE]], value, rtol=0, atol=1e-10)
    np.testing.assert_allclose(row[[LEAST_SLOPE, MOST_SLOPE]], slope, rtol=0, atol=1e-6)
    # On a short piece the range follows from the slope.
    row = expression.bounds(path, place, 1e-7, clock)
    assert row[HIGH] - row[LOW] <= 2e-7 * (abs(slope) + 0.1) + 1e-11
    assert row[MOST_SLOPE] - row[LEAST_SLOPE] < 0.1


@given(st.lists(coefficient, min_size=3, max_size=3), st.floats(0.0, 1.0), st.floats(0.01, 0.5))
def test_a_parabola_is_bounded_exactly(column, middle, radius):
    path = np.array(column).reshape(-1, 1)
    row = Expression([(op.STATE, 0, 0, 0)], []).bounds(path, middle, radius)
    c0, c1, c2 = column
    places = [middle - radius, middle + radius]
    slopes = sorted(c1 + 2 * c2 * place for place in places)
    if slopes[0] < 0.0 < slopes[1]:
        places.append(-c1 / (2 * c2))
    values = [c0 + place * (c1 + place * c2) for place in places]
    np.testing.assert_allclose(row[[LOW, HIGH]], [min(values), max(values)], rtol=0, atol=1e-14)
    np.testing.assert_allclose(row[[LEAST_SLOPE, MOST_SLOPE]], slopes, rtol=0, atol=1e-14)


@given(st.floats(-1.0, 1.0), st.integers(3, 6), st.floats(0.0, 1.0), st.floats(0.001, 0.3))
def test_the_remainder_of_a_parabola_is_of_third_order(factor, power, middle, radius):
    path = np.zeros((power + 1, 1))
    path[power] = factor
    row = Expression([(op.STATE, 0, 0, 0)], []).bounds(path, middle, radius)
    places = np.linspace(middle - radius, middle + radius, 101)
    values, slopes = factor * places**power, factor * power * places ** (power - 1)
    third = abs(factor) * math.comb(power, 3) * (middle + radius) ** (power - 3)
    slack = 2.0 * third * radius**3 + 2e-3 * radius**2 * third * (middle + radius) + 1e-14
    assert values.min() - slack <= row[LOW] <= values.min() + 1e-14
    assert values.max() - 1e-14 <= row[HIGH] <= values.max() + slack
    slack = 6.0 * third * radius**2 + 1e-14
    assert slopes.min() - slack <= row[LEAST_SLOPE] <= slopes.min() + 1e-13
    assert slopes.max() - 1e-13 <= row[MOST_SLOPE] <= slopes.max() + slack


X, Y, NUMBER = (op.STATE, 0, 0, 0), (op.STATE, 1, 0, 0), (op.NUMBER, 0, 0, 0)
# Both components run from -1 to 1, in opposite directions.
OPPOSITE = np.array([[0.0, 0.0], [1.0, -1.0]])


@pytest.mark.parametrize(("code", "low", "high"), [(op.MAXIMUM, 0.0, 1.0), (op.MINIMUM, -1.0, 0.0)])
def test_where_two_change_places_the_larger_has_either_slope(code, low, high):
    either = Expression([X, Y, (code, 0, 1, 0)], [])
    row = either.bounds(OPPOSITE, 0.0, 1.0)
    np.testing.assert_allclose(row, [-1.0, 1.0, -1.0, 1.0, 0.0, 0.0], atol=1e-14)
    # Away from there only one of them counts: the first, which grows, or the second, which falls.
    first = 1.0 if code == op.MAXIMUM else -1.0
    np.testing.assert_allclose(
        either.bounds(OPPOSITE, 0.5, 0.25)[[LEAST_SLOPE, MOST_SLOPE]], first, atol=1e-14
    )
    np.testing.assert_allclose(
        either.bounds(OPPOSITE, -0.5, 0.25)[[LEAST_SLOPE, MOST_SLOPE]], -first, atol=1e-14
    )
    np.testing.assert_allclose(
        either.bounds(OPPOSITE, 0.5, 0.25)[LOW:LEAST_SLOPE], sorted([first * 0.25, first * 0.75])
    )
    np.testing.assert_allclose(either.bounds(OPPOSITE, 0.0, 0.0)[LOW:LEAST_SLOPE], 0.0, atol=1e-14)
    assert low <= 0.0 <= high


@pytest.mark.parametrize("code", TRUTHS)
@given(st.sampled_from([-3.0, 0.25, 3.0]), st.sampled_from([-3.5, 0.125, 2.5]), st.sampled_from([0.0, 1.0]))
def test_truths_are_known_where_they_are_certain(code, a, b, radius):
    """Components ``a + s`` and ``b - s``, with ``s`` from ``-radius`` to ``radius``."""
    path = np.array([[a, b], [1.0, -1.0]])
    row = Expression([X, Y, (code, 0, 1, 0)], []).bounds(path, 0.0, radius)
    expected = float(TRUTHS[code](a, b))
    np.testing.assert_array_equal(row[[LOW_MIDDLE, HIGH_MIDDLE]], expected)
    ends = [-radius, radius]
    possible = {bool(TRUTHS[code](a + s, b + other)) for s in ends for other in ends}
    if code in (op.AND, op.OR):
        # A number that is not zero is true; around zero it may be either.
        truths = [{True, False} if abs(value) <= radius else {True} for value in (a, b)]
        possible = {bool(TRUTHS[code](one, other)) for one in truths[0] for other in truths[1]}
    elif code == op.EQUAL and abs(a - b) <= 2.0 * radius:
        possible = {True, False}
    certain = len(possible) == 1
    assert (row[LOW], row[HIGH]) == ((expected, expected) if certain else (0.0, 1.0))
    assert (row[LEAST_SLOPE], row[MOST_SLOPE]) == ((0.0, 0.0) if certain else (-math.inf, math.inf))


@pytest.mark.parametrize("code", TRUTHS)
@pytest.mark.parametrize(
    "numbers", [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (-2.0, 1.0), (0.0, -2.0)]
)
def test_truths_of_numbers(code, numbers):
    rows = [NUMBER, (op.NUMBER, 1, 0, 0), (code, 0, 1, 0)]
    row = Expression(rows, numbers).bounds(OPPOSITE, 0.0, 1.0)
    expected = float(TRUTHS[code](*numbers))
    np.testing.assert_array_equal(row, [expected, expected, 0.0, 0.0, expected, expected])


@pytest.mark.parametrize(("middle", "radius"), [(0.5, 0.25), (-0.5, 0.25), (0.25, 0.5), (-0.25, 0.5)])
def test_a_choice_is_that_of_its_branch_where_the_condition_is_certain(middle, radius):
    """``x < 0`` chooses ``3 x``, else ``y``."""
    rows = [
        X,
        Y,
        NUMBER,
        (op.NUMBER, 1, 0, 0),
        (op.LESS, 0, 2, 0),
        (op.PRODUCT, 3, 0, 0),
        (op.SELECT, 4, 5, 1),
    ]
    row = Expression(rows, [0.0, 3.0]).bounds(OPPOSITE, middle, radius)
    value = 3.0 * middle if middle < 0.0 else -middle
    np.testing.assert_allclose(row[[LOW_MIDDLE, HIGH_MIDDLE]], value, atol=1e-14)
    if abs(middle) > radius:
        slope = 3.0 if middle < 0.0 else -1.0
        ends = sorted([value - slope * radius, value + slope * radius])
        np.testing.assert_allclose(row[:LOW_MIDDLE], [*ends, slope, slope], atol=1e-13)
    else:
        ends = np.array([middle - radius, middle + radius])
        expected = [min(3 * ends[0], -ends[1]), max(3 * ends[1], -ends[0])]
        np.testing.assert_allclose(row[[LOW, HIGH]], expected, atol=1e-13)
        assert (row[LEAST_SLOPE], row[MOST_SLOPE]) == (-math.inf, math.inf)


def test_around_a_pole_nothing_is_known():
    whole = [-math.inf, math.inf, -math.inf, math.inf]
    inverse = Expression([X, (op.WHOLE_POWER, 0, -1, 0)], [])
    np.testing.assert_array_equal(inverse.bounds(OPPOSITE, 0.0, 0.5)[:LOW_MIDDLE], whole)
    quotient = Expression([NUMBER, X, (op.QUOTIENT, 0, 1, 0)], [1.0])
    np.testing.assert_array_equal(quotient.bounds(OPPOSITE, 0.25, 0.5)[:LOW_MIDDLE], whole)
    # The angle jumps where the second argument is negative and the first one changes sign.
    turning = np.array([[0.0, -2.0], [1.0, 0.0]])
    angle = Expression([X, Y, (op.ANGLE, 0, 1, 0)], [])
    row = angle.bounds(turning, 0.0, 0.5)
    np.testing.assert_array_equal(row[:LOW_MIDDLE], [-math.pi, math.pi, -math.inf, math.inf])
    row = angle.bounds(turning, 1.0, 0.5)
    np.testing.assert_allclose(row[[LOW, HIGH]], np.arctan2([1.5, 0.5], -2.0), atol=1e-13)
    assert row[MOST_SLOPE] < 0.0


@settings(max_examples=80)
@given(expressions(depth=2), st.lists(st.floats(0.7, 1.3), min_size=3, max_size=3), st.floats(0.5, 2.0))
def test_rounding_moves_an_expression_by_its_gradient(expression, x, t):
    scale, clock, share = [1.0, 3.0, 0.25], 5.0, 1e-7

    def value(arguments):
        return float(
            expression.parts[-1](np.float64(arguments[0]), [np.float64(each) for each in arguments[1:]])
        )

    expected, here = 0.0, [t, *x]
    with np.errstate(all="ignore"):
        middle = value(here)
        for i, size in enumerate([clock, *scale]):
            moved = [
                value([each + 1e-6 * sign * (i == j) for j, each in enumerate(here)]) for sign in (-1, 1)
            ]
            bend = abs(moved[0] + moved[1] - 2 * middle) / 1e-12
            if not (abs(middle) < 1e2 and bend < 1e3):
                return
            expected += share * size * abs(moved[1] - moved[0]) / 2e-6
    found = expression.distance(t, clock, x, scale, share)
    # A component that occurs twice may count twice.
    assert expected * (1 - 1e-3) - 1e-11 <= found
    leaves = sum(row[0] in (op.STATE, op.TIME) for row in expression.rows)
    kinds = {row[:2] for row in expression.rows if row[0] in (op.STATE, op.TIME)}
    if leaves == len(kinds):
        assert found <= expected * (1 + 1e-3) + 1e-11


@pytest.mark.parametrize(("x", "jumps"), [(0.0, True), (1e-10, True), (1.0, False), (-1.0, False)])
def test_the_distance_is_negative_where_rounding_may_lead_over_a_jump(x, jumps):
    sign = Expression([X, (op.SIGN, 0, 0, 0)], [])
    distance = sign.distance(0.0, 0.0, [x, 0.0, 0.0], [1.0, 0.0, 0.0], 1e-9)
    assert (distance < 0.0) == jumps
    assert abs(distance) >= 1.0 if jumps else distance == 0.0
