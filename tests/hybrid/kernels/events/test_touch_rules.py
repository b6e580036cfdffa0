"""Touches of guards that are polynomials on a step, rule by rule."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events import guards, touches
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(touches)
DEGREE = 6
BOTH = pytest.mark.parametrize("way", [1.0, -1.0])


def bernstein(*roots, factor=1.0, rest=0.0):
    """Bernstein coefficients of ``factor * (product of (s - root) + rest)``."""
    powers = np.zeros(DEGREE + 1)
    powers[: len(roots) + 1] = np.polynomial.Polynomial.fromroots(roots).coef
    powers[0] += rest
    shares = [[math.comb(i, k) / math.comb(DEGREE, k) for k in range(i + 1)] for i in range(DEGREE + 1)]
    return [factor * sum(a * b for a, b in zip(share, powers, strict=False)) for share in shares]


class TestNote:
    def noted(self, *places):
        """First and second place of a step, after touches at these places in this order."""
        run = SimpleNamespace()
        kernels.forget_touches(run)
        for transition, place in enumerate(places):
            kernels.note_touch(run, transition, place, 10.0 * place)
        self.run = run
        return run.grazing_place, run.next_grazing

    def test_a_step_without_touches(self):
        assert self.noted() == (NO_ROOT, NO_ROOT)
        assert kernels.share_with_one_touch(self.run) == NO_ROOT > 1.0

    @pytest.mark.parametrize("places", [(0.2, 0.4, 0.8), (0.8, 0.4, 0.2), (0.4, 0.2, 0.8), (0.4, 0.8, 0.2)])
    def test_the_first_two_are_kept_in_any_order(self, places):
        assert self.noted(*places) == (0.2, 0.4)
        assert (self.run.grazing_guard, self.run.grazing_value) == (places.index(0.2), 2.0)
        assert kernels.share_with_one_touch(self.run) == pytest.approx(0.2 + 0.3819 * 0.2, rel=1e-15)

    @pytest.mark.parametrize(("apart", "second"), [(0.9e-6, NO_ROOT), (1.1e-6, 0.5 + 1.1e-6)])
    def test_touches_that_are_close_are_one(self, apart, second):
        assert self.noted(0.5, 0.5 + apart) == (0.5, second)
        assert self.run.grazing_guard == 0
        assert self.noted(0.5 + apart, 0.5) == (0.5, second)
        assert (self.run.grazing_guard, self.run.grazing_value) == (1, 5.0)
        assert self.noted(0.5, 0.5) == (0.5, NO_ROOT)
        assert self.run.grazing_guard == 0


class TestTurnAtEnd:
    """Polynomials of degree two and three by their differences at the end of the step."""

    def kind(self, *coefficients, rounding=1e-9):
        # Rows are no longer than they must be.
        stack = np.full((4, len(coefficients) + 2), 88.0)
        given = np.array([*coefficients, 77.0])
        found = kernels.turn_at_end(given, len(coefficients) - 1, rounding, stack)
        assert given.tolist() == [*coefficients, 77.0]
        return found

    @BOTH
    def test_the_first_derivative_that_is_not_zero_tells(self, way):
        assert self.kind(way, 0.5 * way, 0.0) == 0
        assert self.kind(way, 0.0, 0.0) == way
        assert self.kind(way, 0.0, 0.0, 0.0) == 0
        assert self.kind(way, 0.0, 0.0, 0.0, 0.0) == way
        assert self.kind(3.0, 3.0, 3.0) == 0
        assert self.kind(3.0, 3.0, 3.0, 3.0) == 0
        assert self.kind(5.0) == 0
        # The second difference of the last three is 3 - 2 * 2 + 2.
        assert self.kind(9.0 * way, 3.0 * way, 2.0 * way, 2.0 * way) == way

    @BOTH
    def test_the_rounding_of_differences_doubles_with_their_order(self, way):
        assert self.kind(way, 2.01e-9 * way, 0.0) == 0
        assert self.kind(way, 1.99e-9 * way, 0.0) == way
        assert self.kind(4.01e-9 * way, 0.0, 0.0) == way
        assert self.kind(3.99e-9 * way, 0.0, 0.0) == 0


class TestNoteTouches:
    def touches(self, polynomial, *, known=0, start=0.0, theta=NO_ROOT, band=1e-5):
        found = []
        tested = plain(touches, note_touch=lambda run, transition, *touch: found.append(touch))
        stack = np.full((80, 40), 88.0)
        work = SimpleNamespace(polynomial=np.full(40, 88.0), stack=stack)
        work.polynomial[: len(polynomial)] = polynomial
        # The search for roots divides zero by zero where both ends of an interval are roots.
        with np.errstate(invalid="ignore"):
            tested.note_touches("run", 5, len(polynomial) - 1, known, start, theta, band, work)
        return found

    def at(self, place, value):
        return pytest.approx(place, abs=1e-7), pytest.approx(value, rel=1e-6, abs=1e-15)

    @BOTH
    def test_a_turn_within_the_band(self, way):
        bottom = bernstein(0.4, 0.4, factor=way, rest=1e-6)
        assert self.touches(bottom, band=1.01e-6) == [self.at(0.4, way * 1e-6)]
        assert self.touches(bottom, band=0.99e-6) == []
        # A dip through zero holds two crossings, whether they fire or not.
        assert self.touches(bernstein(0.4, 0.4, factor=way, rest=-1e-6)) == []

    @BOTH
    @pytest.mark.parametrize("place", [0.4, 0.6])
    def test_a_turn_may_lie_beyond_zero_by_rounding(self, place, way):
        """The largest coefficient, at one end or the other, is 0.36: rounding is 5.8 EPSILON."""
        for units, count in ((-4.0, 1), (-8.0, 0)):
            bottom = bernstein(place, place, factor=way, rest=units * EPSILON)
            assert len(self.touches(bottom)) == count

    @BOTH
    def test_only_turns_between_the_start_and_the_crossing(self, way):
        bottom = bernstein(0.4, 0.4, factor=way, rest=1e-6)
        assert self.touches(bottom, start=0.3) == [self.at(0.4, way * 1e-6)]
        assert self.touches(bottom, start=0.5) == []
        crossing = bernstein(0.4, 0.4, 0.7, factor=-way)
        assert self.touches(crossing, theta=0.7) == [self.at(0.4, 0.0)]
        assert self.touches(crossing, theta=0.3) == []

    @BOTH
    def test_the_start_of_a_step_belongs_to_the_step_before(self, way):
        assert self.touches(bernstein(0.0, 0.0, factor=way, rest=1e-6)) == []

    @BOTH
    def test_the_bottom_of_a_dip_at_which_the_guard_crosses_is_none(self, way):
        crossing = bernstein(0.4, 0.4, 0.7, factor=-way)
        assert self.touches(crossing, theta=0.4 + 1e-9) == []

    @BOTH
    def test_several_in_their_order(self, way):
        twice = bernstein(0.25, 0.25, 0.75, 0.75, factor=way)
        found = [self.at(0.25, 0.0), self.at(0.75, 0.0)]
        assert self.touches(twice) == found
        assert self.touches(twice, start=0.5) == found[1:]
        assert self.touches(twice, theta=0.6) == found[:1]
        # The top between both is no touch, unless it is within the band: the turns are then all touches.
        assert self.touches(twice, band=2.0**-8) == [found[0], found[1]]

    @BOTH
    def test_turns_that_only_rounding_parts_are_one(self, way):
        for level in (0.0, 1e-6):
            flat = bernstein(0.4, 0.4, 0.4002, 0.4002, factor=way, rest=level)
            ((place, value),) = self.touches(flat)
            assert place == pytest.approx(0.4, abs=1e-3)
            assert value == pytest.approx(way * level, abs=1e-15)

    @BOTH
    def test_roots_at_the_start_are_put_back(self, way):
        """The guard is the given polynomial times ``s**known``, with a touch at 1/2."""
        for known in (1, 2):
            quotient = np.array([0.25, -0.25, 0.25]) * way
            assert self.touches(quotient, known=known) == [self.at(0.5, 0.0)]
        shifted = np.array([0.25, -0.25, 0.25]) * way + 1e-7 * way
        ((_, value),) = self.touches(shifted, known=1)
        assert value == pytest.approx(0.5e-7 * way, rel=1e-5)

    @BOTH
    def test_a_turn_at_the_end(self, way):
        ended = bernstein(1.0, 1.0, factor=way, rest=1e-6)
        assert self.touches(ended, band=1.01e-6)[-1] == (1.0, pytest.approx(way * 1e-6, rel=1e-9))
        assert self.touches(ended, band=0.99e-6) == []
        assert self.touches(ended, theta=1.0) == []
        assert self.touches(bernstein(1.0, 1.0, factor=way, rest=-1e-6)) == []
        # A guard that ends near zero and moves on does not turn there, nor does one with a flat root.
        assert self.touches(bernstein(1.0, factor=way, rest=1e-6)) == []
        assert self.touches(bernstein(1.0, 1.0, 1.0, factor=way)) == []

    @BOTH
    def test_a_turn_that_the_end_follows_at_once(self, way):
        """Up to the end the guard rises by less than rounding, but it does not cross."""
        ((place, value),) = self.touches(bernstein(1.0 - 1e-9, 1.0 - 1e-9, factor=way, rest=1e-6))
        assert place == pytest.approx(1.0 - 1e-9, abs=1e-12)
        assert value == pytest.approx(way * 1e-6, rel=1e-9)

    @BOTH
    @pytest.mark.parametrize("size", [2.0**-20, 1.0, 2.0**20])
    def test_a_turn_at_the_end_may_lie_beyond_zero_by_rounding(self, size, way):
        """That is 16 units in the last place of the largest coefficient."""
        for units, expected in ((-15.0, True), (-17.0, False)):
            last = units * EPSILON * size * way
            ended = bernstein(1.0, 1.0, factor=way * size)
            ended[0], ended[-2:] = way * size, [last, last]
            found = self.touches(ended, band=1e-5 * size)
            assert bool(found) == expected
            if expected:
                assert found[-1] == (1.0, last)


class TestRemember:
    """The 9th step of a run, two of which were rejected, touches the guard of transition 4."""

    def remembered(self, place, *, before=(-1, 0), allows=True):
        kept = []

        def keep_grazing(model, run, record, transition, *rest):
            kept.append((record, transition, *rest[:-1]))

        def allowed(model, transition, t, x, scalar):
            assert (transition, t, x) == (4, 7.5, "state")
            return allows

        run = SimpleNamespace(grazing_guard=4, steps=9, rejected=2, grazing_value=0.25)
        run.touched_step, run.touched_guard = before
        work = SimpleNamespace(state="state", scalar=None)
        tested = plain(touches, keep_grazing=keep_grazing, allowed=allowed)
        tested.remember_touch("model", run, "record", place, 7.5, work)
        self.last = run.touched_step, run.touched_guard
        assert kept in ([], [("record", 4, 7.5, "state", 0.25)])
        return bool(kept)

    def test_is_recorded_where_its_condition_holds(self):
        assert self.remembered(0.5)
        assert not self.remembered(0.5, allows=False)
        assert self.last == (-1, 0)

    @pytest.mark.parametrize("place", [1.0, 1.0 - 0.9e-6])
    def test_a_touch_at_the_end_of_a_step_is_known_to_the_next_one(self, place):
        assert self.remembered(place)
        assert self.last == (7, 5)
        assert self.remembered(1.0 - 1.1e-6)
        assert self.last == (-1, 0)

    @pytest.mark.parametrize("place", [0.0, 0.9e-6])
    def test_a_touch_at_the_start_has_been_recorded_by_the_step_before(self, place):
        assert not self.remembered(place, before=(6, 5))
        assert self.remembered(1.1e-6, before=(6, 5))
        # Not if that step or that guard was another one.
        assert self.remembered(place, before=(5, 5))
        assert self.remembered(place, before=(7, 5))
        assert self.remembered(place, before=(6, 4))


@pytest.mark.parametrize(("used", "room"), [(0, 2), (1, 2), (2, 2), (0, 0)])
def test_a_record_of_touches_that_is_full_only_counts_them(used, room):
    tested = plain(guards, guard_speed=lambda *given: 0.0, guard_acceleration=lambda *given: -4.0)
    names = ("phase", "cycle", "transition", "jumps", "value", "acceleration")
    record = SimpleNamespace(
        grazings=used,
        grazing_state=np.zeros((room, 2)),
        **{f"grazing_{name}": np.zeros(room) for name in names},
    )
    run = SimpleNamespace(grazings=7, mode=1, cycle=3, jumps=5)
    model = SimpleNamespace(dimension=2, parameters=None, field=lambda *given: None)
    work = SimpleNamespace(field=None, gradient=None)
    tested.keep_grazing(model, run, record, 6, 0.5, np.array([1.0, 2.0]), 0.25, work)
    assert run.grazings == 8
    if used < room:
        assert [getattr(record, f"grazing_{name}")[used] for name in names] == [0.5, 3, 6, 5, 0.25, -4.0]
        assert record.grazing_state[used].tolist() == [1.0, 2.0]
    assert record.grazings == used + (used < room)
