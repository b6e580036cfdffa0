"""The search for a change of sign, piece by piece, on guards whose bounds are known exactly."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events import crossings
from hybrid.kernels.events.crossings import MOST_PIECES
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING
from hybrid.kernels.events.sampled import NOWHERE
from hybrid.kernels.types.codes import HIGH, HIGH_MIDDLE, LEAST_SLOPE, LOW, LOW_MIDDLE, MOST_SLOPE
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(crossings)
# One component, which is the place itself: time is 10 plus half of the place.
PATH, ORDER, CLOCK, START, PACE = np.array([[0.0], [1.0]]), 1, -1, 10.0, 0.5
ALONG = (PATH, ORDER, CLOCK, START, PACE)
TRANSITION = 1
# Lengths of steps.
UNITS = [1.0, 2.0**-20, 2.0**20]


def approx(place, roundings):
    """A place up to a few units in the last place, without the absolute tolerance of pytest."""
    return pytest.approx(place, rel=roundings * EPSILON, abs=0.0)


class Curve:
    """A guard as a function of the place, its slope, and the places where either may turn.

    It jumps or has a vertical tangent at the places ``steep``, and has a value on ``domain`` alone; with
    ``sure`` its slope is bounded even so. Its bounds are its ranges, ``noise`` wider, and those of its slope
    ``tilts`` wider. With ``loose``, a range is that of the mean value theorem.
    """

    def __init__(
        self,
        value,
        slope,
        turns=(),
        *,
        noise=0.0,
        tilts=0.0,
        steep=(),
        domain=(-math.inf, math.inf),
        loose=False,
        sure=False,
    ):
        self.sure = sure
        self.value, self.slope, self.turns = value, slope, turns
        self.noise, self.tilts, self.steep, self.domain, self.loose = noise, tilts, steep, domain, loose
        self.asked = []

    def __call__(self, place):
        return self.value(place) if self.domain[0] <= place <= self.domain[1] else math.nan

    def ranges(self, low, high):
        """The bounds on a piece."""
        middle = 0.5 * (low + high)
        least, most = max(low, self.domain[0]), min(high, self.domain[1])
        if least > most:
            return -math.inf, math.inf, -math.inf, math.inf, -math.inf, math.inf
        places = [least, most, *(each for each in self.turns if least < each < most)]
        slopes = [self.slope(each) for each in places]
        flat, steep = min(slopes) - self.tilts, max(slopes) + self.tilts
        values = [self.value(each) for each in places]
        if any(low <= each <= high for each in self.steep) or (
            not self.sure and (least > low or most < high)
        ):
            flat, steep = -math.inf, math.inf
        if self.loose and steep < math.inf:
            most = max(abs(flat), abs(steep)) * (high - middle)
            values = [self.value(middle) - most, self.value(middle) + most]
        center = self(middle)
        near = (-math.inf, math.inf) if math.isnan(center) else (center - self.noise, center + self.noise)
        return min(values) - self.noise, max(values) + self.noise, flat, steep, *near


def polynomial(*roots, factor=1.0, **others):
    """A guard with these roots."""
    exact = np.polynomial.Polynomial.fromroots(roots)
    turns = np.concatenate([[], *(exact.deriv(k).roots() for k in range(1, len(roots)))])

    def value(place):
        return factor * math.prod(place - root for root in roots)

    def slope(place):
        left_out = ([*roots[:i], *roots[i + 1 :]] for i in range(len(roots)))
        return factor * sum(math.prod(place - root for root in some) for some in left_out)

    return Curve(value, slope, [each.real for each in turns if abs(each.imag) < 1e-6], **others)


def scene(curve, *, direction=0, side=0, on_guard=0, scale=1.0, fired=-1, since_entry=0.0, tolerance=0.0):
    """Model, method, run and memory."""

    def bound(programs, transition, path, order, clock, start, pace, middle, radius, registers):
        assert (transition, path is PATH, order, clock, start, pace) == (TRANSITION, True, *ALONG[1:])
        curve.asked.append((middle, radius))
        assert radius >= 0.0
        registers[2, [LOW, HIGH, LEAST_SLOPE, MOST_SLOPE, LOW_MIDDLE, HIGH_MIDDLE]] = curve.ranges(
            middle - radius, middle + radius
        )
        return 2

    def guard(transition, t, x, parameters, out):
        assert (transition, t) == (TRANSITION, START + PACE * x[0])
        out[0] = curve(x[0])

    def gradient(transition, t, x, parameters, out):
        assert (transition, t) == (TRANSITION, START + PACE * x[0])
        out[:] = curve.slope(x[0]), 7.0

    model = SimpleNamespace(
        dimension=1,
        period=0.0,
        parameters=np.zeros(0),
        programs=SimpleNamespace(first=np.array([0, 0, 3])),
        direction=np.array([5, direction]),
        bound=bound,
        guard=guard,
        guard_gradient=gradient,
        spread=lambda programs, transition, t, clock, x, scale, share, registers: curve.noise,
    )
    method = SimpleNamespace(atol=tolerance, rtol=0.0)
    run = SimpleNamespace(
        mode=0,
        side=np.array([5, side]),
        on_guard=np.array([5, on_guard]),
        scale=np.array([scale]),
        y=np.zeros(1),
        last_fired=fired,
        since_entry=since_entry,
        unproved=0,
        grazing_place=NO_ROOT,
        next_grazing=NO_ROOT,
        grazing_value=math.nan,
        grazing_guard=-1,
    )
    work = SimpleNamespace(
        state=np.zeros(1),
        scalar=np.zeros(1),
        gradient=np.zeros(2),
        field=np.zeros(1),
        registers=np.full((3, 6), 99.0),
        intervals=np.full((200, 2), 99.0),
    )
    return model, method, run, work


class TestRows:
    def test_a_known_part_is_taken_from_all_bounds(self):
        for tilt, low, high in ((3.0, -1.0 - 13.0, 4.0 - 7.0), (-3.0, -1.0 + 5.0, 4.0 + 11.0)):
            row = np.zeros(6)
            row[[LOW, HIGH, LOW_MIDDLE, HIGH_MIDDLE, LEAST_SLOPE, MOST_SLOPE]] = (
                -1.0,
                4.0,
                1.0,
                2.0,
                -6.0,
                8.0,
            )
            kernels._shifted(row, 1.0, tilt, 2.0, 4.0)
            middle = 1.0 + 3.0 * tilt
            assert row[[LOW, HIGH]].tolist() == [low, high]
            assert row[[LOW_MIDDLE, HIGH_MIDDLE]].tolist() == [1.0 - middle, 2.0 - middle]
            assert row[[LEAST_SLOPE, MOST_SLOPE]].tolist() == [-6.0 - tilt, 8.0 - tilt]

    @pytest.mark.parametrize(("base", "tilt"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.25, -4.0)])
    def test_the_row_of_a_place(self, base, tilt):
        model, _, _, work = scene(polynomial(1.0, 3.0, noise=0.125))
        assert kernels._row_at(model, TRANSITION, *ALONG, 2.0, base, tilt, work) == 2
        value = -1.0 - base - 2.0 * tilt
        row = work.registers[2]
        assert row[[LOW, HIGH]].tolist() == [value - 0.125, value + 0.125]
        assert row[[LOW_MIDDLE, HIGH_MIDDLE]].tolist() == [value - 0.125, value + 0.125]
        assert row[LEAST_SLOPE] == row[MOST_SLOPE] == pytest.approx(-tilt, abs=1e-15)

    @pytest.mark.parametrize(
        ("slopes", "middle", "value"),
        [
            ((-1.0, 2.0), (-1.0, 4.0), 1.5),
            ((-math.inf, 2.0), (1.0, 3.0), 2.0),
            ((-1.0, math.inf), (-3.0, -1.0), -2.0),
            # The guard itself is 12 at the place 2.
            ((-math.inf, 2.0), (-1.0, 3.0), 12.0 - 5.0 - 6.0),
            ((-1.0, math.inf), (-1.0, 3.0), 12.0 - 5.0 - 6.0),
            ((-math.inf, math.inf), (0.0, 3.0), 12.0 - 5.0 - 6.0),
            ((-math.inf, math.inf), (-3.0, 0.0), 12.0 - 5.0 - 6.0),
            ((math.nan, 1.0), (-3.0, 1.0), 12.0 - 5.0 - 6.0),
        ],
    )
    def test_the_value_at_a_place(self, slopes, middle, value):
        model, _, _, work = scene(Curve(lambda place: 6.0 * place, None))
        row = np.zeros(6)
        row[[LEAST_SLOPE, MOST_SLOPE]], row[[LOW_MIDDLE, HIGH_MIDDLE]] = slopes, middle
        assert kernels._value_at(model, TRANSITION, *ALONG, 2.0, row, 5.0, 3.0, work) == value

    def test_the_flattest_slope(self):
        for least, most, flattest in ((2.0, 5.0, 2.0), (-5.0, -2.0, -2.0), (2.0, math.inf, 2.0)):
            row = np.zeros(6)
            row[[LEAST_SLOPE, MOST_SLOPE]] = least, most
            assert kernels._least_slope(row) == flattest
        for least, most in ((-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0), (-math.inf, math.inf)):
            row[[LEAST_SLOPE, MOST_SLOPE]] = least, most
            assert math.isnan(kernels._least_slope(row))

    def test_signs_and_distances(self):
        model, _, _, work = scene(Curve(lambda place: place - 2.0, lambda place: 1.0, noise=0.5))

        def sign(place, base=0.0, tilt=0.0):
            return kernels.certain_sign(model, TRANSITION, *ALONG, place, base, tilt, work)

        assert [sign(place) for place in (1.0, 1.5, 2.0, 2.5, 3.0)] == [-1, 0, 0, 0, 1]
        assert [sign(place, 1.0) for place in (2.0, 2.5, 3.0, 3.5, 4.0)] == [-1, 0, 0, 0, 1]
        assert [sign(place, -2.0, 2.0) for place in (-1.0, -0.5, 0.0, 0.5, 1.0)] == [1, 0, 0, 0, -1]
        assert kernels._distance_at(model, TRANSITION, *ALONG, 5.0, 1, work) == 2.5
        assert kernels._distance_at(model, TRANSITION, *ALONG, 5.0, -1, work) == -3.5
        assert kernels._distance_at(model, TRANSITION, *ALONG, -1.0, -1, work) == 2.5

    def test_guards_without_a_value(self):
        ends = scene(Curve(lambda place: place, lambda place: 1.0, domain=(1.0, 2.0)))
        for place, has in ((0.5, False), (1.0, True), (1.5, True), (2.5, False)):
            assert kernels._has_value(ends[0], TRANSITION, *ALONG, place, ends[3]) == has
        for low, high in ((-math.inf, 3.0), (3.0, math.inf)):
            half = Curve(None, None)
            half.ranges = lambda *piece, low=low, high=high: (low, high, 0.0, 0.0, 0.0, 0.0)
            model, *_, work = scene(half)
            assert kernels._has_value(model, TRANSITION, *ALONG, 0.0, work)

    def test_a_guard_that_rests_at_zero(self):
        for value, least, most, rests in (
            (0.0, 0.0, 0.0, True),
            (1.0, 0.0, 0.0, False),
            (0.0, -1.0, 0.0, False),
            (0.0, 0.0, 1.0, False),
        ):
            row = np.zeros(6)
            row[[LEAST_SLOPE, MOST_SLOPE]] = least, most
            assert kernels._rests_at_zero(value, row) == rests

    def test_a_known_part_is_subtracted_until_the_whole_guard_is_on_its_side(self):
        model, _, _, work = scene(Curve(lambda place: place - 2.0, lambda place: 1.0, noise=0.5))
        for place, side, hides in (
            (1.0, 1, True),
            (2.4, 1, True),
            (2.6, 1, False),
            (1.0, -1, False),
            (3.0, -1, True),
        ):
            found = kernels._still_hidden(model, TRANSITION, *ALONG, place, side, 3.0, 5.0, work)
            assert found == ((3.0, 5.0) if hides else (0.0, 0.0))


class TestRootInBracket:
    def root(self, curve, low, high, side, *, on_guard=0, base=0.0, tilt=0.0):
        model, _, _, work = scene(curve)
        place = kernels.root_in_bracket(
            model, TRANSITION, *ALONG, low, high, side, on_guard, base, tilt, work
        )
        assert all(low <= asked <= high and radius == 0.0 for asked, radius in curve.asked)
        assert len(curve.asked) <= 110
        return place

    @pytest.mark.parametrize("low", [0.0, 0.125])
    @pytest.mark.parametrize("root", [0.2, 0.25, 0.875])
    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("unit", UNITS)
    def test_simple_roots_take_a_few_evaluations(self, low, root, way, unit):
        for others in ((), (-1.0,), (2.0, 3.0)):
            curve = polynomial(*(unit * each for each in (root, *others)), factor=way)
            side = 1 if curve(unit * low) > 0.0 else -1
            assert self.root(curve, unit * low, unit, side) == approx(unit * root, 3.0)
            assert len(curve.asked) <= 9

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("unit", UNITS)
    def test_flat_roots_are_bracketed(self, way, unit):
        root = 0.3 * unit
        assert self.root(polynomial(root, root, root, factor=way), 0.0, unit, -way) == approx(root, 4.0)
        assert self.root(polynomial(*[root] * 7, factor=way), 0.0, unit, -way) == approx(root, 24.0)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("unit", UNITS)
    def test_a_jump_is_at_the_first_place_beyond(self, way, unit):
        root = 0.3 * unit
        jump = Curve(lambda place: way if place >= root else -way, lambda place: 0.0, steep=(root,))
        found = self.root(jump, 0.0, unit, -way)
        assert root <= found <= root * (1.0 + 2.0 * EPSILON)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("low", [0.0, 0.1])
    def test_a_guard_without_a_value_has_not_crossed(self, way, low):
        curve = Curve(lambda place: way * (place - 0.3), lambda place: way, domain=(0.4, 1.0))
        assert 0.4 <= self.root(curve, low, 1.0, -way) <= 0.4 * (1.0 + 2.0 * EPSILON)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("unit", UNITS)
    @pytest.mark.parametrize("on_guard", [0, BY_SPEED, BY_STEP])
    def test_a_guard_that_stays_zero_crosses_at_the_end_of_that(self, way, unit, on_guard):
        """One that leaves zero earlier than a thousandth of the bracket has crossed at the start."""
        for end in (0.3, 1.1e-3, 0.9e-3):
            late = Curve(
                lambda place, end=end: way * max(place - unit * end, 0.0),
                lambda place, end=end: way * float(place > unit * end),
                noise=1e-9 * unit,
            )
            leaves = end < 1e-3 and on_guard != BY_SPEED
            expected = 0.0 if leaves else approx(unit * end, 4.0)
            assert self.root(late, 0.0, unit, -way, on_guard=on_guard) == expected

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_beyond_zero_at_the_start_crosses_there(self, way):
        for start in (0.5, 1e-300):
            beyond = Curve(lambda place, start=start: way * (start + place), lambda place: way)
            assert self.root(beyond, 0.0, 1.0, -way) == 0.0
        assert self.root(Curve(lambda place: way * place, lambda place: way), 0.0, 1.0, -way) == 0.0
        assert self.root(Curve(lambda place: way * (place - 0.25), lambda place: way), 0.0, 1.0, -way) == 0.25

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize(("on_guard", "place"), [(BY_SPEED, 0.5), (BY_ACCELERATION, 0.5), (BY_STEP, 0.0)])
    def test_a_guard_that_is_zero_at_the_start_crosses_later_if_its_side_is_certain(
        self, way, on_guard, place
    ):
        """Its value there is rounding and its slope leads to the side."""
        curve = polynomial(0.0, 0.5, factor=way)
        assert self.root(curve, 0.0, 1.0, -way, on_guard=on_guard) == approx(place, 2.0)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_kink_at_the_start_leaves_the_side_uncertain(self, way):
        for tilts, place in ((0.25, 0.5), (1.0, 0.0)):
            curve = polynomial(0.0, 0.5, factor=way, tilts=tilts)
            found = self.root(curve, 0.0, 1.0, -way, on_guard=BY_SPEED)
            assert found == approx(place, 2.0)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_known_parts_do_not_count(self, way):
        curve = Curve(lambda place: way * (place + 1.0), lambda place: way)
        found = self.root(curve, 0.125, 1.0, -way, base=way * 2.0, tilt=way * -1.0)
        assert found == 0.5
        curve = Curve(lambda place: way * (place + 1.0), lambda place: way)
        assert self.root(curve, 0.0, 1.0, -way, base=way * 2.0, tilt=way * -1.0) == 0.5

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_flat_guards_cross_at_the_start_unless_they_rest_there(self, way):
        flat = polynomial(0.0, 0.0, 0.0, factor=way)
        assert self.root(flat, 0.0, 1.0, -way) == 0.0


class TestTurnBetween:
    def turn(self, curve, low, high, side, *, base=0.0, tilt=0.0):
        model, _, _, work = scene(curve)
        return kernels._turn_between(model, TRANSITION, *ALONG, low, high, side, base, tilt, work)

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_is_where_the_slope_changes_its_sign(self, way, unit):
        for turn in (0.3, 0.01, 0.8):
            curve = polynomial(unit * turn, unit * turn, factor=way)
            for low, high in ((0.0, 1.0), (0.005, 0.9)):
                del curve.asked[:]
                assert self.turn(curve, unit * low, unit * high, way) == approx(unit * turn, 2.0)
                assert all(unit * low <= place <= unit * high for place, _ in curve.asked)
                assert len(curve.asked) <= 2 + 60
                # A turn away from zero is none.
                assert self.turn(curve, unit * low, unit * high, -way) == NOWHERE
            # Nor is one beside the piece.
            assert self.turn(curve, unit * turn * 1.01, unit, way) == NOWHERE
            assert self.turn(curve, 0.0, unit * turn * 0.99, way) == NOWHERE

    @pytest.mark.parametrize("way", [1, -1])
    def test_counts_at_the_upper_end_within_rounding(self, way):
        curve = Curve(
            lambda place: way * (place - 1.0) ** 2, lambda place: way * 2.0 * (place - 1.0), tilts=1e-3
        )
        assert self.turn(curve, 0.0, 1.0, way) == approx(1.0, 2.0)
        assert self.turn(curve, 0.0, 1.0 - 0.4e-3, way) == approx(1.0 - 0.4e-3, 2.0)
        assert self.turn(curve, 0.0, 1.0 - 0.6e-3, way) == NOWHERE
        # At the lower end the middle of the slopes tells.
        assert self.turn(curve, 1.0, 1.5, way) == NOWHERE
        assert self.turn(curve, 1.0 - 1e-6, 1.5, way) == pytest.approx(1.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_is_that_of_the_guard_without_its_known_part(self, way):
        curve = Curve(lambda place: way * (place - 0.3) ** 2, lambda place: way * 2.0 * (place - 0.3))
        assert self.turn(curve, 0.0, 1.0, way, base=5.0, tilt=way * 0.5) == approx(0.55, 2.0)


def test_how_far_tolerances_move_a_guard_at_a_place():
    """Its slope by the place times the tolerance of the place; times do not count."""
    model, method, run, work = scene(polynomial(1.0, 3.0), scale=8.0)
    method.atol, method.rtol = 0.5, 0.25
    found = kernels._tolerated(model, method, run, TRANSITION, *ALONG, 4.0, work)
    assert found == 4.0 * (0.5 + 0.25 * 8.0)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("value", "slope", "on_guard", "returns"),
    [
        # The guard moves back to its side from within 16 bands of zero.
        (-1.5, 1.0, 0, True),
        (-1.7, 1.0, 0, False),
        (-1.5, -1.0, 0, False),
        (-1.5, 0.05, 0, False),
        (-1.5, 1.0, BY_SPEED, False),
    ],
)
def test_a_guard_that_a_jump_has_left_beyond_zero(way, value, slope, on_guard, returns):
    curve = Curve(
        lambda place: way * (value + slope * place - 5.0 * place**2),
        lambda place: way * (slope - 10.0 * place),
        noise=0.1,
        tilts=0.1,
    )
    model, _, run, work = scene(curve)
    assert kernels._returns(model, run, TRANSITION, *ALONG, way, on_guard, work) == returns


class TestFirstChange:
    def change(self, curve, side, *, length=1.0, hidden=0.0, exact=True, **others):
        """Place, side and proved part, and the run."""
        model, method, run, work = scene(curve, **others)
        on_guard = others.get("on_guard", 0)
        with np.errstate(invalid="ignore"):
            found = kernels.first_change(
                model, method, run, TRANSITION, *ALONG, length, side, on_guard, hidden, exact, work
            )
        assert all(
            -EPSILON * length <= middle - radius and middle + radius <= length * (1.0 + EPSILON)
            for middle, radius in curve.asked
        )
        return found, run

    @pytest.mark.parametrize("unit", UNITS)
    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("loose", [False, True])
    def test_is_the_first_one_in_the_direction(self, unit, way, loose):
        for direction, place, side in (
            (0, 0.2, -1),
            (-1, 0.2, -1),
            (1, 0.45, 1),
        ):
            curve = polynomial(
                *(unit * each for each in (0.2, 0.45, 0.8)), factor=-way, loose=loose, noise=1e-15 * unit**3
            )
            found, run = self.change(curve, way, length=unit, direction=way * direction)
            assert found == (approx(unit * place, 20.0), way * side, unit)
            assert (run.unproved, run.grazing_place) == (0, NO_ROOT)
            assert len(curve.asked) < 200

    @pytest.mark.parametrize("way", [1, -1])
    def test_is_none_without_roots_or_in_the_other_direction_alone(self, way):
        for roots, direction, side in (
            ((-0.2, 1.2), 0, 1),
            ((0.3,), 1, -1),
            ((0.3, 0.6), 2, 1),
            ((1.01,), 0, 1),
        ):
            curve = polynomial(*roots, factor=way * (-1) ** sum(root > 0.0 for root in roots))
            found, run = self.change(curve, way, direction=way * direction)
            assert found == (NOWHERE, way * side, 1.0)
            assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_may_be_at_either_end(self, way):
        assert self.change(polynomial(1.0, factor=-way), way)[0] == (NOWHERE, way, 1.0)
        assert self.change(polynomial(1.0 - 4.0 * EPSILON, factor=-way), way)[0] == (
            approx(1.0, 4.0),
            -way,
            1.0,
        )
        # A guard that is beyond zero at the start crosses there; one without a side does not.
        assert self.change(polynomial(-0.5, factor=-way), way)[0] == (0.0, -way, 1.0)
        assert self.change(polynomial(-0.5, factor=-way), 0)[0] == (NOWHERE, -way, 1.0)
        assert self.change(polynomial(-0.5, factor=-way), way, direction=way)[0] == (NOWHERE, -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_of_a_guard_that_jumps(self, way, unit):
        root = 0.3 * unit
        jump = Curve(lambda place: -way if place >= root else way, lambda place: 0.0, (root,), steep=(root,))
        found, run = self.change(jump, way, length=unit)
        assert found == (approx(root, 2.0), -way, unit)
        assert found[0] >= root
        assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_guard_that_ends(self, way):
        """Where it has no value it has not crossed."""
        for domain, expected in (
            ((0.0, 0.4), (approx(0.3, 4.0), -way)),
            ((0.5, 1.0), (approx(0.5, 4.0), -way)),
        ):
            curve = Curve(lambda place: way * (0.3 - place), lambda place: -way, domain=domain)
            found, _ = self.change(curve, way)
            assert found == (*expected, 1.0)
        curve = Curve(lambda place: way * (0.3 - place), lambda place: -way, domain=(0.0, 0.2))
        assert self.change(curve, way)[0] == (NOWHERE, way, 1.0)
        curve = Curve(lambda place: math.nan, lambda place: math.nan, domain=(3.0, 4.0))
        assert self.change(curve, way)[0] == (NOWHERE, way, 1.0)
        assert len(curve.asked) < 10

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_of_a_guard_that_ends_and_falls_up_to_there(self, way, unit):
        """Its slope keeps its sign, but the signs at the ends of the step do not tell."""
        for domain, expected in (
            ((0.0, 0.4), (approx(0.3 * unit, 4.0), -way)),
            ((0.25, 0.95), (approx(0.3 * unit, 4.0), -way)),
            ((0.0, 0.2), (NOWHERE, way)),
            ((0.05, 0.2), (NOWHERE, way)),
        ):
            curve = Curve(
                lambda place: way * (0.3 - place / unit),
                lambda place: -way / unit,
                domain=(domain[0] * unit, domain[1] * unit),
                sure=True,
            )
            found, run = self.change(curve, way, length=unit)
            assert found == (*expected, unit)
            assert (run.unproved, run.grazing_place) == (0, NO_ROOT)

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_a_guard_with_a_value_on_a_small_part_alone(self, way):
        for domain, root in (((0.0, 0.1), 0.05), ((0.9, 1.0), 0.95), ((0.45, 0.48), 0.47)):
            curve = Curve(lambda place, root=root: way * (root - place), lambda place: -way, domain=domain)
            found, _ = self.change(curve, way)
            assert found == (approx(root, 4.0), -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_a_cusp_that_reaches_zero_is_a_touch(self, way, unit):
        place = 0.4 * unit
        curve = Curve(
            lambda s: way * math.sqrt(abs(s - place) / unit),
            lambda s: way * math.copysign(0.5, s - place) / math.sqrt((abs(s - place) + 1e-300) * unit),
            (place,),
            steep=(place,),
            noise=1e-6,
        )
        found, run = self.change(curve, way, length=unit)
        assert found == (NOWHERE, way, unit)
        assert run.grazing_place == pytest.approx(0.4, rel=1e-6)
        assert (run.grazing_guard, run.next_grazing, run.unproved) == (TRANSITION, NO_ROOT, 0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_leaves_zero_at_the_start_does_not_touch_it_there(self, way):
        for on_guard, touches in ((BY_ACCELERATION, False), (0, True)):
            curve = polynomial(1e-9, 1e-9, factor=way, noise=1e-16)
            found, run = self.change(curve, way, on_guard=on_guard)
            assert found == (NOWHERE, way, 1.0)
            assert (run.grazing_place < 1.0) == touches

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_jumps_at_the_start_may_be_before_its_jump_by_rounding(self, way):
        """Time has a rounding of 16 units: the state is sure only after that, or after half of the step."""
        edge = 16.0 * EPSILON * START / PACE
        for jump, scale, place in (
            (0.9 * edge, 1.0, 0.75),
            (20.0 * edge, 1.0, 0.0),
            (0.4, 1e17, 0.75),
        ):
            curve = Curve(
                lambda s, jump=jump: -way if s < jump or s >= 0.75 else way,
                lambda s: 0.0,
                (jump, 0.75),
                steep=(jump, 0.75),
            )
            found, run = self.change(curve, way, on_guard=JUMPING, scale=scale)
            assert found == (approx(place, 2.0) if place else 0.0, -way, 1.0)
            assert run.grazing_place == NO_ROOT

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_leaves_its_jump_by_signs_may_cross_after_them(self, way):
        """Up to there either sign is possible; its transition may fire again at once."""
        for root, hidden in ((0.75, 0.25), (0.125, 0.0625)):
            curve = Curve(
                lambda s, root=root, hidden=hidden: way * (-1.0 if s < 0.5 * hidden or s >= root else 1.0),
                lambda s: 0.0,
                (0.5 * hidden, root),
                steep=(0.5 * hidden, root),
            )
            found, _ = self.change(
                curve, way, on_guard=JUMPING, hidden=hidden, fired=TRANSITION, since_entry=0.0
            )
            assert found == (approx(root, 2.0), -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_a_touch_is_no_change(self, way, unit):
        curve = polynomial(0.4 * unit, 0.4 * unit, factor=way, noise=1e-15 * unit**2)
        found, run = self.change(curve, way, length=unit)
        assert found == (NOWHERE, way, unit)
        assert run.grazing_place == pytest.approx(0.4, rel=1e-6)
        assert run.grazing_value == pytest.approx(0.0, abs=1e-12 * unit**2)
        assert (run.grazing_guard, run.next_grazing, run.unproved) == (TRANSITION, NO_ROOT, 0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_turns_within_the_tolerances_are_touches(self, way):
        """The slope is 1e-3 at most where the guard is looked at: the tolerance of the place counts 1e-2."""
        for height, tolerance, exact, touches in (
            (1e-6, 1e-2, False, True),
            (1e-6, 1e-2, True, False),
            (1e-3, 1e-4, False, False),
        ):
            curve = Curve(
                lambda place, height=height: way * ((place - 0.4) ** 2 + height),
                lambda place: way * 2.0 * (place - 0.4),
                (0.4,),
                noise=1e-15,
            )
            found, run = self.change(curve, way, exact=exact, tolerance=tolerance)
            assert found == (NOWHERE, way, 1.0)
            if touches:
                assert run.grazing_place == pytest.approx(0.4, abs=1e-6)
                assert run.grazing_value == pytest.approx(way * height, rel=1e-6)
            else:
                assert run.grazing_place == NO_ROOT

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("unit", UNITS)
    def test_two_touches(self, way, unit):
        touches = (unit * each for each in (0.3, 0.3, 0.8, 0.8))
        curve = polynomial(*touches, factor=way, noise=1e-15 * unit**4)
        found, run = self.change(curve, way, length=unit)
        assert found == (NOWHERE, way, unit)
        assert run.grazing_place == pytest.approx(0.3, rel=1e-6)
        assert run.next_grazing == pytest.approx(0.8, rel=1e-6)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_dip_beyond_zero_within_rounding_has_both_its_crossings(self, way):
        """It is deeper than a half of the rounding in its middle."""
        for depth in (1e-4, 1e-6, 1e-12):
            curve = Curve(
                lambda place, depth=depth: way * ((place - 0.4) ** 2 - depth),
                lambda place: way * 2.0 * (place - 0.4),
                (0.4,),
                noise=1e-17,
            )
            shift = math.sqrt(depth)
            found, run = self.change(curve, way)
            assert found == (pytest.approx(0.4 - shift, abs=1e-9), -way, 1.0)
            found, _ = self.change(curve, way, direction=way)
            assert found == (pytest.approx(0.4 + shift, abs=1e-9), way, 1.0)
            assert run.grazing_place == NO_ROOT
            found, _ = self.change(curve, way, exact=False, tolerance=10.0)
            assert found == (pytest.approx(0.4 - shift, abs=1e-9), -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_is_zero_at_the_start_is_searched_after_that(self, way):
        """The rest of its value there, and of its slope if that is zero too, is rounding."""
        for on_guard, roots in ((BY_SPEED, 1), (BY_ACCELERATION, 2), (BY_STEP, 3)):
            for rounding in (0.0, 1e-7, -1e-7):
                for unit in UNITS:
                    exact = polynomial(*[0.0] * roots, 0.5 * unit, factor=-way / unit ** (roots + 1))

                    def value(place, exact=exact, rounding=rounding, roots=roots, unit=unit):
                        return exact(place) - way * rounding * (1.0 + (place / unit if roots > 1 else 0.0))

                    def slope(place, exact=exact, rounding=rounding, roots=roots, unit=unit):
                        return exact.slope(place) - way * (rounding / unit if roots > 1 else 0.0)

                    curve = Curve(value, slope, exact.turns, noise=1e-12)
                    found, run = self.change(curve, way, on_guard=on_guard, length=unit)
                    # Once the whole guard is on its side, its later root is what counts.
                    assert found == (pytest.approx(0.5 * unit, rel=4e-6), -way, unit)
                    assert run.grazing_place == NO_ROOT
                    assert run.unproved == 0

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_is_zero_and_goes_the_other_way_crosses_at_the_start(self, way):
        """But not if its transition has just fired."""
        for on_guard, roots, tilts in ((BY_SPEED, 1, 0.6), (BY_ACCELERATION, 2, 0.0), (BY_STEP, 3, 0.0)):
            for fired, since, place in ((-1, 0.0, True), (TRANSITION, 0.0, False), (TRANSITION, 1.0, True)):
                curve = polynomial(*[0.0] * roots, -0.5, factor=-way, noise=1e-20, tilts=tilts)
                found, _ = self.change(curve, way, on_guard=on_guard, fired=fired, since_entry=since)
                assert found[1:] == (-way, 1.0)
                if place:
                    assert 0.0 <= found[0] <= 1e-12
                else:
                    assert found[0] == NOWHERE

    @pytest.mark.parametrize("way", [1, -1])
    def test_signs_up_to_a_place_may_be_noise(self, way):
        curve = polynomial(0.0, 0.0, 0.0, 0.125, 0.75, factor=-way)
        assert self.change(curve, -way, on_guard=BY_STEP)[0][0] == approx(0.125, 4.0)
        found, _ = self.change(curve, way, hidden=0.25, on_guard=BY_STEP)
        assert found == (approx(0.75, 4.0), -way, 1.0)
        assert all(middle - radius >= 0.25 for middle, radius in curve.asked[10:] if radius > 0.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_a_jump_has_left_beyond_zero_returns(self, way):
        """It moves back to its side where the step starts, so it has not crossed there."""
        for turn, place in ((1e-6, NOWHERE), (-1e-6, 0.0)):
            curve = Curve(
                lambda place, turn=turn: -way * ((place - turn) ** 2 + 1e-12),
                lambda place, turn=turn: -way * 2.0 * (place - turn),
                (turn,),
                noise=1e-11,
            )
            assert self.change(curve, way)[0] == (place, -way, 1.0)

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_step_with_too_many_pieces_is_cut_to_its_proved_part(self, way):
        """From 0.3 on the bounds say nothing."""
        for edge, proved in ((0.3, pytest.approx(0.3, abs=1e-3)), (1e-3, 1.0 / 64.0)):
            curve = polynomial(2.0, factor=-way)
            plainly = curve.ranges

            def ranges(low, high, plainly=plainly, edge=edge):
                found = plainly(low, high)
                wide = (-9.0, 9.0, -9.0, 9.0)
                return (*wide, *found[4:]) if high > edge and high > low else found

            curve.ranges = ranges
            found, run = self.change(curve, way)
            assert found == (NOWHERE, way, proved)
            assert sum(radius > 0.0 for _, radius in curve.asked) > MOST_PIECES
            assert (run.unproved > 0) == (edge < 0.01)


class TestCrossingOnPath:
    def crossing(self, curve, side, *, length=2.0, end=0.0, exact=True, program=True, rests=None, **others):
        """Share of the crossing, side after it and proved share, and the run."""
        given = []

        def hidden_until(*arguments):
            given.append(arguments)
            return rests

        model, method, run, work = scene(curve, side=side, **others)
        if not program:
            model.programs.first[:] = 0
        model.field = None
        tested = plain(crossings, hidden_until=hidden_until).crossing_on_path
        found = tested(model, method, run, TRANSITION, *ALONG, length, end, exact, work)
        if rests is not None:
            assert given == [(model, method, run, TRANSITION, *ALONG, length, end, exact, work)]
        return found, run

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("program", [True, False])
    def test_places_are_shares_of_the_step(self, way, program):
        found, run = self.crossing(polynomial(0.5, factor=-way), way, program=program)
        assert found == (approx(0.25, 4.0), -way, 1.0)
        assert run.unproved == (not program)
        found, run = self.crossing(polynomial(0.0, 2.5, factor=-way), way, on_guard=BY_SPEED, program=program)
        assert found == (NO_ROOT, way, 1.0)
        assert run.on_guard.tolist() == [5, 0]

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_at_rest_stays_on_zero(self, way):
        found, run = self.crossing(polynomial(0.5, factor=-way), way, on_guard=BY_STEP, rests=(2.0, True))
        assert found == (NO_ROOT, way, 1.0)
        assert run.on_guard.tolist() == [5, BY_STEP]

    @pytest.mark.parametrize("way", [1, -1])
    @pytest.mark.parametrize("direction", [-1, 0, 1])
    def test_a_guard_that_is_noise_all_over_the_step(self, way, direction):
        """Its value at the end tells its side, and it crosses at the start unless it has just fired."""
        for end, after in ((0.25, 1), (-0.25, -1), (0.0, way)):
            for fired in (-1, TRANSITION):
                crosses = after == -way and direction in (0, after) and fired != TRANSITION
                found, run = self.crossing(
                    polynomial(0.5), way, on_guard=BY_STEP, rests=(2.0, False), end=end,
                    direction=direction, fired=fired,
                )  # fmt: skip
                assert found == (0.0 if crosses else NO_ROOT, after, 1.0)
                assert run.on_guard.tolist() == [5, 0]

    @pytest.mark.parametrize("way", [1, -1])
    def test_a_guard_that_jumps_is_left_by_its_signs(self, way):
        """It is beside the jump for a moment of 1/16, two of which are a place of 1/8."""
        for beside, fired, expected in ((way, TRANSITION, 0.5), (-way, TRANSITION, NO_ROOT), (way, -1, 0.0)):
            curve = Curve(
                lambda s: way if 0.1 <= s < 1.0 else -way, lambda s: 0.0, (0.1, 1.0), steep=(0.1, 1.0)
            )
            model, method, run, work = scene(curve, side=way, on_guard=JUMPING, fired=fired)
            asked = []

            def field(mode, t, x, parameters, out):
                assert (mode, t, x is run.y, out is work.field) == (0, START, True, True)  # noqa: B023
                asked.append(mode)  # noqa: B023

            def signs_beside(*given, beside=beside):
                assert given[2:4] == (TRANSITION, START)
                return -beside, beside, 0.0625

            model.field = field
            tested = plain(crossings, signs_beside=signs_beside).crossing_on_path
            found = tested(model, method, run, TRANSITION, *ALONG, 2.0, 0.0, True, work)
            assert len(asked) == (fired == TRANSITION)
            if fired == TRANSITION:
                assert found[0] == approx(expected, 4.0) if beside == way else found[0] <= NO_ROOT
            else:
                assert found[0] == expected
            assert run.on_guard.tolist() == [5, 0]

    @pytest.mark.parametrize("way", [1, -1])
    def test_the_rest_of_the_step_after_noise(self, way):
        found, _ = self.crossing(
            polynomial(0.0, 0.0, 0.0, 0.125, 1.0, factor=-way), way, on_guard=BY_STEP, rests=(0.25, False)
        )
        assert found == (approx(0.5, 4.0), -way, 1.0)
