"""What the search for a change of sign asks at one place, and between two places, on known guards."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP
from hybrid.kernels.guards import isolate, pieces
from hybrid.kernels.guards.pieces import NO_COLUMN, NOWHERE, Bounds
from hybrid.kernels.types.codes import DESINGULARISED, EXACT, ROOTED, TAYLOR
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.events.curves import (
    ALONG,
    TRANSITION,
    UNITS,
    Curve,
    approx,
    polynomial,
    scene,
)
from tests.hybrid.kernels.plain import plain

kernels = plain(pieces)


def known(side=1, *, on_guard=0, sure=0.0, base=0.0, tilt=0.0):
    return pieces.Guard(TRANSITION, NO_COLUMN, side, on_guard, sure, base, tilt)


class TestRows:
    @pytest.mark.parametrize(("base", "tilt"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.25, -4.0)])
    def test_the_row_of_a_place(self, base, tilt):
        model, _, _, work = scene(polynomial(1.0, 3.0, noise=0.125))
        at = kernels.bounds_at(model, ALONG, known(base=base, tilt=tilt), 2.0, work)
        value = -1.0 - base - 2.0 * tilt
        assert (at.low, at.high) == (at.low_middle, at.high_middle) == (value - 0.125, value + 0.125)
        assert at.least_slope == at.most_slope == pytest.approx(-tilt, abs=1e-15)

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
        at = Bounds(0.0, 0.0, *slopes, *middle)
        assert kernels._value_at(model, ALONG, known(base=5.0, tilt=3.0), 2.0, at, work) == value

    def test_the_flattest_slope(self):
        for least, most, flattest in ((2.0, 5.0, 2.0), (-5.0, -2.0, -2.0), (2.0, math.inf, 2.0)):
            assert kernels._least_slope(Bounds(0.0, 0.0, least, most, 0.0, 0.0)) == flattest
        for least, most in ((-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0), (-math.inf, math.inf)):
            assert math.isnan(kernels._least_slope(Bounds(0.0, 0.0, least, most, 0.0, 0.0)))

    def test_signs_and_distances(self):
        model, _, _, work = scene(Curve(lambda place: place - 2.0, lambda place: 1.0, noise=0.5))

        def sign(place, base=0.0, tilt=0.0):
            return kernels.certain_sign(model, ALONG, known(base=base, tilt=tilt), place, work)

        assert [sign(place) for place in (1.0, 1.5, 2.0, 2.5, 3.0)] == [-1, 0, 0, 0, 1]
        assert [sign(place, 1.0) for place in (2.0, 2.5, 3.0, 3.5, 4.0)] == [-1, 0, 0, 0, 1]
        assert [sign(place, -2.0, 2.0) for place in (-1.0, -0.5, 0.0, 0.5, 1.0)] == [1, 0, 0, 0, -1]
        assert kernels.distance_at(model, ALONG, known(1), 5.0, work) == 2.5
        assert kernels.distance_at(model, ALONG, known(-1), 5.0, work) == -3.5
        assert kernels.distance_at(model, ALONG, known(-1), -1.0, work) == 2.5

    def test_guards_without_a_value(self):
        ends = scene(Curve(lambda place: place, lambda place: 1.0, domain=(1.0, 2.0)))
        for place, has in ((0.5, False), (1.0, True), (1.5, True), (2.5, False)):
            assert kernels._has_value(ends[0], ALONG, known(), place, ends[3]) == has
        for low, high in ((-math.inf, 3.0), (3.0, math.inf)):
            half = Curve(None, None)
            half.ranges = lambda *piece, low=low, high=high: (low, high, 0.0, 0.0, 0.0, 0.0)
            model, *_, work = scene(half)
            assert kernels._has_value(model, ALONG, known(), 0.0, work)

    def test_a_guard_that_rests_at_zero(self):
        for value, least, most, rests in (
            (0.0, 0.0, 0.0, True),
            (1.0, 0.0, 0.0, False),
            (0.0, -1.0, 0.0, False),
            (0.0, 0.0, 1.0, False),
        ):
            assert kernels._rests_at_zero(value, Bounds(0.0, 0.0, least, most, 0.0, 0.0)) == rests

    def test_a_known_part_is_subtracted_until_the_whole_guard_is_on_its_side(self):
        model, _, _, work = scene(Curve(lambda place: place - 2.0, lambda place: 1.0, noise=0.5))
        for place, side, hides in (
            (1.0, 1, True),
            (2.4, 1, True),
            (2.6, 1, False),
            (1.0, -1, False),
            (3.0, -1, True),
        ):
            found = kernels.known_at(
                model, ALONG, known(on_guard=BY_STEP, base=3.0, tilt=5.0), place, side, work
            )
            parts = (3.0, 5.0) if hides else (0.0, 0.0)
            assert found[2:] == (side, BY_STEP, place, *parts)


class TestRootInBracket:
    def root(self, curve, low, high, side, *, on_guard=0, base=0.0, tilt=0.0):
        model, _, _, work = scene(curve)
        before = known(side, on_guard=on_guard, sure=low, base=base, tilt=tilt)
        place = kernels.place_of_change(model, ALONG, before, low, high, work)
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
        return kernels._turn_between(
            model, ALONG._replace(length=2.0 * high), known(side, base=base, tilt=tilt), low, high, work
        )

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
    work.intervals[0] = 3.995, 4.005
    path = ALONG._replace(length=8.0, exact=False)
    for side, tolerated in ((1, 0.0), (-1, 4.0 * (0.5 + 0.25 * 8.0))):
        piece = kernels.piece_of(model, path, known(side), 0, work)._replace(turns=side < 0)
        assert plain(isolate)._tolerated(model, method, run, path, known(side), piece, work) == tolerated
        assert plain(isolate)._tolerated(model, method, run, ALONG, known(side), piece, work) == 0.0


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
    assert plain(isolate)._returns(model, run, ALONG, known(way, on_guard=on_guard), work) == returns


@pytest.mark.parametrize(
    ("kind", "root", "size"),
    [(TAYLOR, 2, 64.0), (EXACT, 2, 64.0), (DESINGULARISED, 2, 8.0), (ROOTED, 2, 8.0), (ROOTED, 3, 4.0)],
)
def test_the_size_of_a_guard_in_its_column(kind, root, size):
    model = SimpleNamespace(propagator=np.array([9, kind]), root=np.array([9, root]))
    run = SimpleNamespace(mode=1)
    assert kernels.as_column(model, run, known()._replace(column=3), 64.0) == pytest.approx(size, rel=1e-14)
    assert kernels.as_column(model, run, known(), 64.0) == 64.0
