"""Bounds of each operation on two lines, as plain Python, with what is known of them."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

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
from hybrid.kernels.types.layout import EPSILON, Path
from tests.hybrid.kernels.plain import plain

kernels = plain(bounds)
X, Y, ACROSS = (op.STATE, 0, 0, 0), (op.STATE, 1, 0, 0), (op.STATE, 2, 0, 0)
NUMBER = (op.NUMBER, 0, 0, 0)
# ``2 + s``, ``5 - 2 s`` and ``2 - s`` for ``s`` from -1/2 to 1/2.
LINES = np.array([[2.0, 5.0, 2.0], [1.0, -2.0, -1.0]])
WHOLE_LINE = (-math.inf, math.inf)


def program(rows, numbers=(), parameters=()):
    """Guard 1 has these rows; guard 0 has two of its own."""
    return SimpleNamespace(
        rows=np.array([(op.NUMBER, 99, 0, 0)] * 2 + list(rows)),
        first=np.array([0, 2, 2 + len(rows)]),
        numbers=np.array(numbers, dtype=float),
        parameters=np.array(parameters, dtype=float),
    )


def bounded(rows, numbers=(), parameters=(), *, path=LINES, middle=0.0, radius=0.5, clock=-1, pace=1.0):
    """Range, slopes and value in the middle."""
    registers = np.full((len(rows), REGISTERS), np.nan)
    programs = program(rows, numbers, parameters)
    along = Path(path, len(path) - 1, clock, 3.0, pace, math.nan, True)
    last = kernels.bound_guard(programs, 1, along, middle, radius, registers)
    assert last == len(rows) - 1
    row = registers[last]
    return tuple(
        (float(row[low]), float(row[high]))
        for low, high in ((LOW, HIGH), (LEAST_SLOPE, MOST_SLOPE), (LOW_MIDDLE, HIGH_MIDDLE))
    )


def near(values):
    return tuple(pytest.approx(pair, rel=1e-13, abs=1e-13) for pair in values)


@pytest.mark.parametrize(
    ("row", "values", "slopes", "middle"),
    [
        # The range follows from the slopes where that is narrower: 7 by 1/2, 10 by 3/2.
        ((op.SUM, 0, 1, 0), (6.5, 7.5), (-1.0, -1.0), 7.0),
        ((op.PRODUCT, 0, 1, 0), (8.5, 11.5), (4.0 - 5.0, 6.0 - 3.0), 10.0),
        ((op.QUOTIENT, 0, 1, 0), (0.25, 0.625), (1.5 / 6.0, 2.25 / 4.0), 0.4),
        ((op.QUOTIENT, 1, 0, 0), (1.6, 4.0), (-6.0 / 1.5, -3.6 / 2.5), 2.5),
        ((op.WHOLE_POWER, 0, 3, 0), (1.5**3, 2.5**3), (6.75, 18.75), 8.0),
        ((op.WHOLE_POWER, 0, -2, 0), (0.16, 1.0 / 2.25), (-2.0 / 1.5**3, -2.0 / 2.5**3), 0.25),
        ((op.WHOLE_POWER, 1, 2, 0), (16.0, 35.0 + 1.0), (-24.0, -16.0), 25.0),
        ((op.FIXED_POWER, 0, 0, 0), (1.5**1.5, 2.5**1.5), (1.5 * 1.5**0.5, 1.5 * 2.5**0.5), 2.0**1.5),
        ((op.FIXED_POWER, 0, 1, 0), (2.5**-0.5, 1.5**-0.5), (-0.5 * 1.5**-1.5, -0.5 * 2.5**-1.5), 2.0**-0.5),
        ((op.ANGLE, 1, 0, 0), (math.atan2(4.0, 2.5), math.atan2(6.0, 1.5)), (-11.0 / 18.25, -7.0 / 42.25),
         math.atan2(5.0, 2.0)),
        ((op.MAXIMUM, 0, 1, 0), (4.0, 6.0), (-2.0, -2.0), 5.0),
        ((op.MAXIMUM, 1, 0, 0), (4.0, 6.0), (-2.0, -2.0), 5.0),
        ((op.MAXIMUM, 0, 2, 0), (1.5, 2.5), (-1.0, 1.0), 2.0),
        ((op.MINIMUM, 0, 1, 0), (1.5, 2.5), (1.0, 1.0), 2.0),
        ((op.MINIMUM, 1, 0, 0), (1.5, 2.5), (1.0, 1.0), 2.0),
        ((op.MINIMUM, 0, 2, 0), (1.5, 2.5), (-1.0, 1.0), 2.0),
        ((op.EXP, 0, 0, 0), (math.exp(1.5), math.exp(2.5)), (math.exp(1.5), math.exp(2.5)), math.exp(2.0)),
        ((op.ATAN, 1, 0, 0), (math.atan(4.0), math.atan(6.0)), (-2.0 / 17.0, -2.0 / 37.0), math.atan(5.0)),
    ],
)  # fmt: skip
def test_operations(row, values, slopes, middle):
    found = bounded([X, Y, ACROSS, row], (1.5, -0.5))
    assert found == near((values, slopes, (middle, middle)))


@pytest.mark.parametrize(
    ("code", "a", "b", "answer"),
    [
        (op.LESS, 0, 1, 1.0),
        (op.LESS, 1, 0, 0.0),
        (op.LESS_EQUAL, 0, 1, 1.0),
        (op.EQUAL, 0, 1, 0.0),
        (op.AND, 0, 1, 1.0),
        (op.LESS, 0, 2, None),
    ],
)
def test_comparisons(code, a, b, answer):
    """Where it may be either, it may jump; in the middle 2 is not less than 2, up to its rounding."""
    values, slopes, middle = bounded([X, Y, ACROSS, (code, a, b, 0)])
    if answer is None:
        assert (values, slopes, middle) == ((0.0, 1.0), WHOLE_LINE, (0.0, 1.0))
    else:
        assert (values, slopes, middle) == ((answer, answer), (0.0, 0.0), (answer, answer))


def test_choices():
    """``x < c`` chooses the first or the second line, where ``c`` is a parameter."""
    rows = [X, Y, ACROSS, (op.PARAMETER, 0, 0, 0), (op.LESS, 0, 3, 0), (op.SELECT, 4, 0, 1)]
    one, other = ((1.5, 2.5), (1.0, 1.0), (2.0, 2.0)), ((4.0, 6.0), (-2.0, -2.0), (5.0, 5.0))
    assert bounded(rows, parameters=(9.0,)) == near(one)
    assert bounded(rows, parameters=(-9.0,)) == near(other)
    # In the middle ``x`` is 2.
    either = ((1.5, 6.0), WHOLE_LINE)
    assert bounded(rows, parameters=(2.25,)) == near((*either, (2.0, 2.0)))
    assert bounded(rows, parameters=(1.75,)) == near((*either, (5.0, 5.0)))
    assert bounded(rows, parameters=(2.0,)) == near((*either, (2.0, 5.0)))


def test_numbers_and_parameters():
    for row in ((op.NUMBER, 1, 0, 0), (op.PARAMETER, 2, 0, 0)):
        found = bounded([row], (9.0, -7.0), (9.0, 9.0, -7.0))
        assert found == ((-7.0, -7.0), (0.0, 0.0), (-7.0, -7.0))


@pytest.mark.parametrize(
    "rows",
    [
        # Poles of quotients and of powers, also at an end, and the jump of an angle.
        [(op.STATE, 3, 0, 0), X, (op.QUOTIENT, 1, 0, 0)],
        [(op.STATE, 4, 0, 0), X, (op.QUOTIENT, 1, 0, 0)],
        [(op.STATE, 5, 0, 0), X, (op.QUOTIENT, 1, 0, 0)],
        [(op.STATE, 3, 0, 0), (op.WHOLE_POWER, 0, -1, 0)],
        [(op.STATE, 4, 0, 0), (op.WHOLE_POWER, 0, -2, 0)],
        [(op.STATE, 5, 0, 0), (op.WHOLE_POWER, 0, -3, 0)],
        [(op.STATE, 3, 0, 0), (op.STATE, 4, 0, 0), (op.ANGLE, 0, 1, 0)],
        [(op.STATE, 4, 0, 0), (op.STATE, 3, 0, 0), (op.ANGLE, 0, 1, 0)],
        [(op.STATE, 5, 0, 0), (op.STATE, 3, 0, 0), (op.ANGLE, 0, 1, 0)],
    ],
)
def test_where_a_slope_may_be_anything(rows):
    """Components from -1/2 to 1/2, from 0 to 1, and from -1 to 0."""
    path = np.zeros((2, 6))
    path[:, :2], path[:, 3:] = LINES[:, :2], ((0.0, 0.5, -0.5), (1.0, 1.0, 1.0))
    assert bounded(rows, path=path)[1] == WHOLE_LINE


def test_beyond_a_pole_any_value_is_possible():
    path = np.array([[0.0, 2.0], [1.0, 0.0]])
    for row in ((op.WHOLE_POWER, 0, -1, 0), (op.WHOLE_POWER, 0, -3, 0), (op.QUOTIENT, 1, 0, 0)):
        assert bounded([X, Y, row], path=path)[:2] == (WHOLE_LINE, WHOLE_LINE)


def test_the_larger_and_the_smaller_of_a_steep_and_a_flat_line():
    """``2 + s`` and ``2 - s / 8``: neither is beyond 2 by more than a sixteenth on both sides."""
    path = np.array([[2.0, 2.0], [1.0, -0.125]])
    for rows in ([X, Y, (op.MAXIMUM, 0, 1, 0)], [X, Y, (op.MAXIMUM, 1, 0, 0)]):
        assert bounded(rows, path=path) == near(((1.9375, 2.5), (-0.125, 1.0), (2.0, 2.0)))
    for rows in ([X, Y, (op.MINIMUM, 0, 1, 0)], [X, Y, (op.MINIMUM, 1, 0, 0)]):
        assert bounded(rows, path=path) == near(((1.5, 2.0625), (-0.125, 1.0), (2.0, 2.0)))


def test_an_angle_jumps_where_its_second_argument_is_negative():
    """The first one goes from -1/2 to 1/2, or beside zero."""
    for start, second, slopes in (
        (0.0, -2.0, WHOLE_LINE),
        (0.5, -2.0, WHOLE_LINE),
        (-0.5, -2.0, WHOLE_LINE),
        (0.0, 0.0, WHOLE_LINE),
        (0.75, -2.0, (-2.0 / (4.0 + 1.0 / 16.0), -2.0 / (4.0 + 25.0 / 16.0))),
        (-0.75, -2.0, (-2.0 / (4.0 + 1.0 / 16.0), -2.0 / (4.0 + 25.0 / 16.0))),
        (0.0, 0.75, (0.75 / (9.0 / 16.0 + 0.25), 4.0 / 3.0)),
    ):
        path = np.array([[start, second], [1.0, 0.0]])
        found = bounded([X, Y, (op.ANGLE, 0, 1, 0)], path=path)[1]
        assert found == pytest.approx(slopes, rel=1e-13)


def test_where_neither_a_pole_nor_a_jump_is():
    path = np.array([[0.0, 2.0, -2.0], [1.0, 0.0, 0.0]])
    # The first component changes its sign, the others are 2 and -2.
    for rows, slopes in (
        ([X, Y, (op.ANGLE, 0, 1, 0)], (2.0 / 4.25, 0.5)),
        ([X, ACROSS, (op.ANGLE, 1, 0, 0)], (2.0 / 4.25, 0.5)),
        ([X, (op.WHOLE_POWER, 0, 2, 0)], (-1.0, 1.0)),
        ([X, (op.WHOLE_POWER, 0, 1, 0)], (1.0, 1.0)),
        ([X, Y, (op.QUOTIENT, 0, 1, 0)], (0.5, 0.5)),
        ([X, ACROSS, (op.QUOTIENT, 0, 1, 0)], (-0.5, -0.5)),
    ):
        assert bounded(rows, path=path)[1] == pytest.approx(slopes, rel=1e-13)


class TestLeaves:
    def state(self, *coefficients, middle, radius):
        return bounded([X], path=np.array(coefficients, dtype=float)[:, None], middle=middle, radius=radius)

    def outside(self, found, exact):
        """Bounds enclose what is exact, with a rounding of their own, and hardly more."""
        for (low, high), (least, most) in zip(found, exact, strict=True):
            size = 1.0 + max(abs(least), abs(most))
            assert least - 1e-13 * size < low < least
            assert most < high < most + 1e-13 * size

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_parabola(self, way):
        """``3 s^2 - 12 s + 5`` has its vertex at 2, where it is -7."""
        for middle, radius, values, slopes in (
            (1.0, 0.5, (-4.0 + 0.75 - 3.0, -4.0 + 0.75 + 3.0), (-9.0, -3.0)),
            (2.5, 1.0, (-7.0, 3.0 * 1.5**2 - 7.0), (-3.0, 9.0)),
            (1.5, 1.0, (-7.0, 3.0 * 1.5**2 - 7.0), (-9.0, 3.0)),
        ):
            found = self.state(5.0 * way, -12.0 * way, 3.0 * way, middle=middle, radius=radius)
            value = 3.0 * (middle - 2.0) ** 2 - 7.0
            exact = [tuple(sorted(way * each for each in pair)) for pair in (values, slopes, (value, value))]
            self.outside(found, exact)

    def test_the_rest_of_higher_order(self):
        """``-s^3`` and ``-s^4`` from 3/2 to 2: terms beyond the parabola are bounded at the end."""
        m, r = 1.75, 0.25
        # Value, slope and bend in the middle, and the bound of a third of the third derivative.
        for power, value, slope, bend, third in (
            (3, m**3, 3.0 * m**2, 3.0 * m, 1.0),
            (4, m**4, 4.0 * m**3, 6.0 * m**2, 4.0 * 2.0),
        ):
            found = self.state(*[0.0] * power, -1.0, middle=m, radius=r)
            low, high = (value + sign * slope * r + bend * r * r for sign in (-1, 1))
            rest = third * r**3
            assert found[0] == near([(-high - rest, rest - low)])[0]
            turn = 2.0 * bend * r + 3.0 * third * r * r
            assert found[1] == near([(-slope - turn, -slope + turn)])[0]

    @pytest.mark.parametrize("pace", [0.5, 2.0])
    def test_time_at_a_pace(self, pace):
        """It is 3 at the start of the step."""
        values, slopes, middles = bounded([(op.TIME, 0, 0, 0)], middle=2.0, radius=0.5, pace=pace)
        assert slopes == (pace, pace)
        value = 3.0 + 2.0 * pace
        self.outside((values, middles), ((value - 0.5 * pace, value + 0.5 * pace), (value, value)))

    @pytest.mark.parametrize("clock", [0, 1])
    def test_time_on_a_clock(self, clock):
        path = np.array([[0.5, 0.25], [2.0, 4.0]])
        values, slopes, middles = bounded(
            [(op.TIME, 0, 0, 0)], middle=2.0, radius=0.5, clock=clock, path=path
        )
        pace = path[1, clock]
        assert slopes == pytest.approx((pace, pace), rel=1e-14)
        value = 3.0 + path[0, clock] + 2.0 * pace
        self.outside((values, middles), ((value - 0.5 * pace, value + 0.5 * pace), (value, value)))

    def test_time_is_off_by_the_rounding_of_its_start(self):
        """Two units of a start of 3 that the clock leaves, and two of each end."""
        (low, high), _, _ = bounded([(op.TIME, 0, 0, 0)], middle=0.0, radius=0.0)
        assert 3.0 - 6.5 * EPSILON <= low < 3.0 < high <= 3.0 + 6.5 * EPSILON


class TestSpread:
    """Components are off by 1/8 of their sizes 4 and 16, and the time by 1/8 of 2."""

    def spread(self, rows, x=(2.0, -5.0), numbers=(), parameters=()):
        registers = np.full((len(rows), REGISTERS), np.nan)
        programs = program(rows, numbers, parameters)
        scale = np.array([4.0, 16.0])
        return kernels.spread_by_rounding(programs, 1, 3.0, 2.0, np.array(x), scale, 0.125, registers)

    def test_of_arguments(self):
        assert self.spread([X]) == pytest.approx(0.5, rel=1e-14)
        assert self.spread([Y]) == pytest.approx(2.0, rel=1e-14)
        assert self.spread([(op.TIME, 0, 0, 0)]) == pytest.approx(0.25, rel=1e-14)
        assert self.spread([(op.NUMBER, 0, 0, 0)], numbers=(7.0,)) == 0.0
        assert self.spread([(op.PARAMETER, 1, 0, 0)], parameters=(9.0, 7.0)) == 0.0

    def test_of_what_is_made_of_them(self):
        """The larger end of a product counts: (2 + 1/2) (-5 - 2) against 2 (-5)."""
        assert self.spread([X, Y, (op.SUM, 0, 1, 0)]) == pytest.approx(2.5, rel=1e-13)
        assert self.spread([X, Y, (op.PRODUCT, 0, 1, 0)]) == pytest.approx(7.5, rel=1e-13)
        assert self.spread([X, Y, (op.PRODUCT, 0, 1, 0)], (2.0, 5.0)) == pytest.approx(7.5, rel=1e-13)
        assert self.spread([X, (op.TIME, 0, 0, 0), (op.SUM, 0, 1, 0)]) == pytest.approx(0.75, rel=1e-13)

    def test_is_negative_where_it_may_jump(self):
        """Between 0 and 1; a jump between 2 and 3 leaves the guard above zero, from either side."""
        floor = [X, (op.FLOOR, 0, 0, 0)]
        for x, distance in ((0.4, -1.0), (2.4, 0.0), (3.4, 0.0), (2.75, 0.0)):
            assert self.spread(floor, (x, 0.0)) == distance
        assert self.spread([Y, NUMBER, (op.PRODUCT, 0, 1, 0), (op.FLOOR, 2, 0, 0)], (0.0, 5.0), (0.1,)) == 0.0
        # A vertical tangent is no better than a jump, in either direction.
        root = [X, (op.SQRT, 0, 0, 0), NUMBER, (op.PRODUCT, 1, 2, 0)]
        for sign in (1.0, -1.0):
            assert self.spread(root, (0.25, 0.0), (sign,)) < 0.0
            assert self.spread(root, (1.0, 0.0), (sign,)) > 0.0


class TestNarrowed:
    """The range that follows from the middle, 1 to 2, and the slopes, and the range that was known."""

    def narrowed(self, low, high, slopes=(0.0, 0.0), radius=0.5, middle=(1.0, 2.0)):
        row = np.zeros(REGISTERS)
        row[[LOW, HIGH]], row[[LEAST_SLOPE, MOST_SLOPE]] = (low, high), slopes
        row[[LOW_MIDDLE, HIGH_MIDDLE]] = middle
        plain(bounds)._narrowed(row, radius)
        assert row[[LEAST_SLOPE, MOST_SLOPE]].tolist() == list(slopes)
        return row[[LOW, HIGH]].tolist()

    def test_the_narrower_end_counts(self):
        assert self.narrowed(-9.0, 9.0) == [1.0, 2.0]
        assert self.narrowed(1.25, 9.0) == [1.25, 2.0]
        assert self.narrowed(-9.0, 1.5) == [1.0, 1.5]

    @pytest.mark.parametrize("slopes", [(-4.0, 2.0), (-2.0, 4.0)])
    def test_the_steepest_slope_counts_over_the_radius(self, slopes):
        low, high = self.narrowed(-9.0, 9.0, slopes)
        assert low == pytest.approx(-1.0, rel=1e-15, abs=1e-15)
        assert high == pytest.approx(4.0, rel=1e-15)
        # Outwards by its rounding.
        assert low < -1.0
        assert high > 4.0
        # At one place an infinite slope says nothing.
        assert self.narrowed(-9.0, 9.0, (-math.inf, 1.0), radius=0.0) == [1.0, 2.0]

    def test_ranges_that_rounding_sets_apart_are_joined(self):
        assert self.narrowed(3.0, 4.0) == [1.0, 3.0]
        assert self.narrowed(-1.0, 0.0) == [0.0, 2.0]

    def test_what_has_no_value_has_no_bounds(self):
        for low, high in ((math.nan, 1.0), (1.0, math.nan)):
            assert self.narrowed(low, high, middle=(math.nan, math.nan)) == [-math.inf, math.inf]
