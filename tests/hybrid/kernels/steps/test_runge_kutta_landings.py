"""Landings of Runge-Kutta steps on guards, rule by rule: where Newton's method leads."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.steps import runge_kutta_guards
from hybrid.kernels.steps.runge_kutta_guards import (
    EULER_IS_ENOUGH,
    FARTHEST,
    FIRST_REACH,
    MOST_LANDINGS,
    NOT_THERE,
)
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain


class Landing:
    """A landing on ``guard(s)`` after ``s`` of a step of 4, from the time 7 on; the state is ``s``.

    ``slope(s)`` is what the gradient of the guard says; its derivative is right unless stated otherwise.
    """

    H, T = 4.0, 7.0

    def __init__(self, guard, slope, theta, *, side=1, smooth=True, h=H, rounding=0.0):
        self.tried = []
        work = SimpleNamespace(
            new=np.array([h, 77.0, 77.0, 88.0]),
            scalar=np.zeros(1),
            gradient=np.zeros(2),
            stages=np.zeros((2, 4)),
        )

        def attempt_again(task, length):
            self.tried.append(length)
            work.new[:3] = length, 20.0, 30.0
            work.stages[1, :3] = 1.0, 2.0, -4.0

        def shown(t, x):
            assert t == self.T + x[0]
            return x[0]

        def write_value(transition, t, x, parameters, out):
            out[0] = side * guard(shown(t, x))

        def write_gradient(transition, t, x, parameters, out):
            # Half of the speed comes from the state, half from the time.
            out[:] = 0.5 * side * slope(shown(t, x))

        model = SimpleNamespace(
            dimension=1,
            affine_guard=np.array([9, int(smooth)]),
            guard=write_value,
            guard_gradient=write_gradient,
            parameters=None,
        )
        tested = plain(
            runge_kutta_guards,
            attempt_again=attempt_again,
            measured_time=lambda *given: np.float64(rounding),
            turns_back=lambda *given: False,
        )
        method, run = SimpleNamespace(b=np.zeros(1)), SimpleNamespace(mode=5, phase=self.T, y=np.array([0.0]))
        task = SimpleNamespace(
            attempts=None, model=model, method=method, run=run, record=None, work=work, tangents=2
        )
        with np.errstate(all="ignore"):
            self.length, self.correction = tested.land(task, 1, side, np.float64(h), np.float64(theta))
        self.new = work.new.tolist()

    @property
    def end(self):
        return self.length + self.correction


SIDES = pytest.mark.parametrize("side", [1, -1])


def line(root, slope=-1.0):
    return lambda s: slope * (s - root)


def falls(s):
    return -1.0


class TestSmooth:
    @SIDES
    def test_a_landing_ends_with_an_euler_step(self, side):
        for off in (0.9, -0.9):
            root = 1.0 + off * EULER_IS_ENOUGH
            landing = Landing(line(root), falls, 0.25, side=side)
            assert landing.tried == [1.0]
            assert landing.correction == pytest.approx(off * EULER_IS_ENOUGH, rel=1e-6)
            # The state and its tangent vectors move with it, nothing beyond them does.
            moved = [1.0, 20.0, 30.0] + np.array([1.0, 2.0, -4.0]) * landing.correction
            assert landing.new == [*moved, 88.0]
        for off in (1.1, -1.1):
            root = 1.0 + off * EULER_IS_ENOUGH
            landing = Landing(line(root), falls, 0.25, side=side)
            assert landing.tried == [1.0, pytest.approx(root, abs=1e-15)]
            assert abs(landing.correction) < 1e-15

    @SIDES
    def test_newton_from_a_wrong_place(self, side):
        """``1 - s^2 / 4``: from 1, the steps lead to 2.5, 2.05, 2.0006, 2.0000001 and 2."""
        landing = Landing(lambda s: 1.0 - 0.25 * s * s, lambda s: -0.5 * s, 0.25, side=side)
        places = [1.0]
        while len(places) < len(landing.tried):
            places.append(0.5 * (places[-1] + 4.0 / places[-1]))
        assert landing.tried == pytest.approx(places, rel=1e-14)
        assert len(places) == 6
        assert landing.end == pytest.approx(2.0, rel=1e-15)

    @SIDES
    def test_bisection_if_newton_leaves_the_bracket(self, side):
        """From 1, it leads to -1, or to 6; the bracket is the rest of the step at first."""
        for slope in (0.125, -0.05):
            landing = Landing(line(1.25), lambda s, slope=slope: slope, 0.25, side=side)
            assert landing.tried[:5] == [1.0, 2.5, 1.75, 1.375, 1.1875]
        landing = Landing(line(1.25), lambda s: 0.125, 0.25, side=side)
        assert landing.length == pytest.approx(1.25, rel=1e-15)
        assert landing.correction == 0.0
        assert landing.tried[-1] == landing.length

    @SIDES
    @pytest.mark.parametrize("rounding", [0.0, 64.0])
    def test_a_bracket_as_short_as_rounding_ends_at_its_farther_end(self, side, rounding):
        """No slope helps here. Twice the rounding of 64 is 2^-45."""
        landing = Landing(line(1.7), lambda s: 0.0, 0.25, side=side, rounding=rounding)
        tried = sorted(landing.tried)
        before = max(each for each in tried if each < 1.7)
        assert landing.length == min(each for each in tried if each >= 1.7)
        finest = 2.0 * EPSILON * max(rounding, landing.length)
        assert 0.25 * finest < landing.length - before <= finest
        # The state is that of the step last taken.
        assert landing.tried[-1] == landing.length
        assert landing.new == [landing.length, 20.0, 30.0, 88.0]
        assert len(landing.tried) < 60

    @SIDES
    def test_a_slow_newton_gives_way_to_bisection(self, side):
        """Steps of 1 % of the distance each: after half of the trials it is bisected."""
        landing = Landing(line(3.0), lambda s: -100.0, 0.25, side=side)
        half = MOST_LANDINGS // 2
        newton = 3.0 - 2.0 * 0.99 ** np.arange(half + 1)
        assert landing.tried[: half + 1] == pytest.approx(newton, rel=1e-12)
        low = landing.tried[half]
        assert landing.tried[half + 1] == 0.5 * (low + 4.0)
        assert landing.end == pytest.approx(3.0, abs=3e-6)

    @SIDES
    def test_a_guard_that_does_not_cross_is_not_there(self, side):
        # It only comes close to zero: Newton's method leads out of the step.
        for guard, slope in (
            (lambda s: 1e-3 + (s - 1.0) ** 2, lambda s: 2.0 * (s - 1.0)),
            (lambda s: 1.0, lambda s: 0.0),
            (line(4.5), falls),
            (lambda s: -1.0, lambda s: 0.25),
        ):
            landing = Landing(guard, slope, 0.26, side=side)
            assert (landing.length, landing.correction) == (NOT_THERE, 0.0)

    @SIDES
    def test_the_ends_of_the_step_bracket_a_guard_that_begins_on_its_side(self, side):
        # Zero at the end is across; zero at the start is not on the side.
        for guard, found in (
            (lambda s: 1.0 if s < 4.0 else 0.0, 4.0),
            (lambda s: 1.0 if 0.0 < s < 2.0 else -1.0 if s else 0.0, 2.0),
            (lambda s: 1.0 if 0.0 <= s < 2.0 else -1.0, 2.0),
        ):
            landing = Landing(guard, lambda s: 0.0, 0.25, side=side)
            if found is None:
                assert landing.length == NOT_THERE
            else:
                assert landing.length == pytest.approx(found, rel=1e-14)

    @SIDES
    def test_a_start_beyond_the_guard_is_no_end_of_a_bracket(self, side):
        # From beyond the guard at 1, Newton's method would leave the step, and nothing else is known.
        landing = Landing(lambda s: -1.0, lambda s: 0.125, 0.25, side=side)
        assert landing.length == NOT_THERE
        assert landing.tried == [1.0]

    @SIDES
    def test_a_place_without_a_value_is_before_the_crossing_of_the_interpolant_or_across(self, side):
        for root, place in ((1.5, 2.0), (2.5, 2.5)):

            def guard(s, root=root):
                return 1.0 if s <= root else math.nan if s < root + 1.0 else -1.0

            landing = Landing(guard, lambda s: math.nan, 0.5, side=side)
            assert landing.length == pytest.approx(place, rel=1e-14)
        gap = Landing(lambda s: math.nan if s < 1.0 else line(2.0)(s), falls, 0.25, side=side)
        assert gap.end == pytest.approx(2.0, rel=1e-14)

    def test_a_step_of_no_length(self):
        landing = Landing(line(0.0), falls, 0.0)
        assert (landing.length, landing.correction) == (0.0, 0.0)
        assert landing.tried == [0.0]


class TestNotSmooth:
    @SIDES
    def test_newton_must_converge_before_it_ends(self, side):
        """The first correction is never the last one."""
        root = 1.0 + 0.5 * EULER_IS_ENOUGH
        landing = Landing(line(root), falls, 0.25, side=side, smooth=False)
        assert landing.tried == [1.0, pytest.approx(root, abs=1e-15)]
        assert landing.end == root
        # The interpolant is off by less than its farthest: the second correction is far smaller.
        landing = Landing(
            lambda s: 1.0 - s * s, lambda s: -2.0 * s, 0.25 * (1.0 - 1e-4), side=side, smooth=False
        )
        places = [1.0 - 1e-4]
        while len(places) < len(landing.tried):
            places.append(0.5 * (places[-1] + 1.0 / places[-1]))
        assert landing.tried == pytest.approx(places, rel=1e-15)
        assert landing.end == pytest.approx(1.0, abs=2e-16)

    @SIDES
    def test_a_long_step_is_not_trusted(self, side):
        """Beyond a share of the step the other side is searched at growing distances instead."""
        far = FARTHEST * Landing.H
        for off, trusted in ((0.9 * far, True), (1.1 * far, False), (-0.9 * far, True), (-1.1 * far, False)):
            landing = Landing(line(1.0 + off), falls, 0.25, side=side, smooth=False)
            if trusted:
                assert landing.tried[1] == pytest.approx(1.0 + off, rel=1e-15)
            else:
                reach, way = FIRST_REACH * Landing.H, math.copysign(1.0, off)
                places = [1.0]
                while len(places) < 6:
                    places.append(places[-1] + way * reach)
                    reach *= 8.0
                assert landing.tried[:6] == pytest.approx(places, rel=1e-15)
            assert landing.end == pytest.approx(1.0 + off, rel=1e-14)

    @SIDES
    @pytest.mark.parametrize("root", [0.25, 1.0 - 3e-9, 1.0 + 3e-9, 3.75])
    def test_a_guard_that_jumps_is_bisected(self, side, root):
        landing = Landing(lambda s: 1.0 if s < root else -1.0, lambda s: 0.0, 0.25, side=side, smooth=False)
        before = max(each for each in landing.tried if each < root)
        assert landing.length == min(each for each in landing.tried if each >= root)
        assert landing.length - before <= 2.0 * EPSILON * landing.length
        assert landing.correction == 0.0
        assert landing.tried[-1] == landing.length
        assert len(landing.tried) < 80

    @SIDES
    def test_the_ends_of_the_step_are_the_farthest_places(self, side):
        # Across nowhere: the search ends at the end of the step.
        landing = Landing(lambda s: 1.0, lambda s: 0.0, 0.25, side=side, smooth=False)
        assert landing.length == NOT_THERE
        assert landing.tried[-1] == Landing.H
        assert landing.tried == sorted(landing.tried)
        # Across at the end alone.
        landing = Landing(lambda s: 1.0 if s < 4.0 else 0.0, lambda s: 1.0, 0.25, side=side, smooth=False)
        assert landing.length == 4.0
        assert landing.tried[-1] == 4.0
        # Across everywhere, the start as well: nothing is found.
        landing = Landing(lambda s: -1.0, lambda s: 0.0, 0.25, side=side, smooth=False)
        assert landing.length == NOT_THERE
        assert landing.tried == sorted(landing.tried, reverse=True)
        assert landing.tried[-1] > 0.0
        # Across from early on: halves of the first place lead to it where no place is left to search.
        landing = Landing(lambda s: 1.0 if s < 1e-9 else -1.0, lambda s: 0.0, 0.25, side=side, smooth=False)
        assert landing.length == pytest.approx(1e-9, rel=1e-14)
        halved = landing.tried.index(min(landing.tried[:15])) + 1
        assert landing.tried[halved] == 0.5 * landing.tried[halved - 1]

    @SIDES
    def test_a_guard_that_rests_at_zero_crosses_where_it_leaves(self, side):
        def guard(s):
            return max(1.0 - s, 0.0) if s < 1.5 else 1.5 - s

        def slope(s):
            return 0.0 if 1.0 < s < 1.5 else -1.0

        landing = Landing(guard, slope, 0.3, side=side, smooth=False)
        assert landing.end == pytest.approx(1.5, rel=1e-14)
        # A smooth guard is not at rest if it is zero: that is its crossing.
        landing = Landing(lambda s: 0.0 if s > 1.0 else 1.0, lambda s: 0.0, 0.3, side=side)
        assert landing.length == pytest.approx(1.0, rel=1e-14)

    @SIDES
    def test_newton_that_halves_no_more_gives_way(self, side):
        """Steps of 40 % of the distance: after three trials the place is bisected or searched."""
        off = 1e-3
        landing = Landing(line(1.0 + off), lambda s: -2.5, 0.25, side=side, smooth=False)
        # Three steps shrink by 0.6 each, and then a place is searched that is not Newton's.
        newton = [1.0 + off * (1.0 - 0.6**k) for k in range(4)]
        assert landing.tried[:4] == pytest.approx(newton, rel=1e-14)
        assert landing.tried[4] == pytest.approx(newton[3] + FIRST_REACH * Landing.H, rel=1e-14)
        # The searched place gives no rate: no trial after it is slow by its last step.
        assert landing.end == pytest.approx(1.0 + off, rel=1e-13)
        # Steps of 60 % are not slow.
        landing = Landing(line(1.0 + off), lambda s: -1.0 / 0.6, 0.25, side=side, smooth=False)
        newton = [1.0 + off * (1.0 - 0.4**k) for k in range(8)]
        assert landing.tried[:8] == pytest.approx(newton, rel=1e-14)

    @SIDES
    def test_a_place_without_a_value(self, side):
        """The search backwards from 2 comes to a gap between 1 and 1.6, before the crossing at 1.8."""

        def guard(s):
            return 1.0 if s < 1.0 else math.nan if s < 1.6 else 1.8 - s

        landing = Landing(guard, lambda s: 0.0, 0.5, side=side, smooth=False)
        assert landing.length == pytest.approx(1.8, rel=1e-14)

    @SIDES
    def test_the_finest_bracket_is_that_of_the_length(self, side):
        """Rounding of the time is no limit: the guard may be steep."""
        landing = Landing(
            lambda s: 1.0 if s < 1.1 else -1.0, lambda s: 0.0, 0.25, side=side, smooth=False, rounding=1e6
        )
        assert landing.length - 1.1 <= 4.0 * EPSILON


class TestReach:
    """One state with the rate -2; its guard is ``3 x + t``."""

    def reach(self, value, *, holds=True, h=1.0, speed=-5.0):
        def field_holds(model, transition, mode, t, x, there, work):
            assert (transition, mode, t, x is run.y) == (1, 4, 7.0, True)
            assert there == speed
            return holds

        tested = plain(runge_kutta_guards, field_holds=field_holds)

        def guard(transition, t, x, parameters, out):
            assert (transition, t) == (1, 7.0)
            out[0] = value

        model = SimpleNamespace(
            dimension=2,
            parameters=None,
            guard=guard,
            guard_gradient=lambda i, t, x, parameters, out: out.__setitem__(
                slice(None), (3.0, 5.0, speed - 1.0)
            ),
        )
        run = SimpleNamespace(mode=4, y=np.array([1.0, 2.0, 3.0, 4.0, 5.0]))
        rates = np.array([[-8.0, 5.0, 2.0, -4.0, 99.0]])
        work = SimpleNamespace(scalar=np.zeros(1), gradient=np.zeros(3), stages=rates, new=np.full(5, 88.0))
        length = tested.reach(model, run, 1, 7.0, h, 1, work)
        return length, work.new.tolist()

    @SIDES
    def test_the_euler_step_to_a_guard(self, side):
        speed = -5.0 * side
        for value, length in ((2.5, 0.5), (5.0, 1.0)):
            found, new = self.reach(side * value, speed=speed)
            assert found == length
            assert new == [*(np.arange(1.0, 5.0) + length * np.array([-8.0, 5.0, 2.0, -4.0])), 88.0]
        assert self.reach(side * 2.5, speed=speed, holds=False)[0] == NOT_THERE
        # Farther than the step, on the guard, or moving away from it.
        assert self.reach(side * 5.1, speed=speed) == (NOT_THERE, [88.0] * 5)
        assert self.reach(side * 5.1, speed=speed, h=1.1)[0] == pytest.approx(1.02)
        assert self.reach(0.0, speed=speed) == (NOT_THERE, [88.0] * 5)
        assert self.reach(side * -2.5, speed=speed) == (NOT_THERE, [88.0] * 5)
        assert self.reach(math.nan, speed=speed) == (NOT_THERE, [88.0] * 5)


class TestReachAny:
    def first(self, lengths, *, sides=(1, -1, 1), directions=(0, 0, 0), on_guard=(0, 0, 0)):
        """Guards 1, 2 and 3 of the second of two modes."""
        asked = []

        def reach(model, run, transition, t, h, tangents, work):
            assert (t, h, tangents, work) == (7.0, 0.5, 2, "work")
            asked.append(transition)
            return lengths[transition - 1]

        tested = plain(runge_kutta_guards, reach=reach)
        model = SimpleNamespace(
            first_outgoing=np.array([0, 1, 4]), outgoing=np.arange(4), direction=np.array([0, *directions])
        )
        self.run = SimpleNamespace(
            mode=1,
            side=np.array([1, *sides]),
            on_guard=np.array([0, *on_guard]),
            rehearsal=np.full((4, 4), 88),
        )
        found = tested.reach_any(model, self.run, 7.0, 0.5, 2, "work")
        self.asked = asked
        return found

    def test_the_first_guard_that_is_there(self):
        assert self.first((NOT_THERE, 0.25, 0.125)) == (0.25, 2)
        assert self.asked == [1, 2]
        assert self.run.rehearsal[3].tolist() == [88, 0, -1, 0]
        assert self.run.rehearsal[:3].tolist() == [[88] * 4] * 3
        assert self.first((0.5, 0.25, 0.125)) == (0.5, 1)
        assert self.run.rehearsal[3].tolist() == [88, 1, 0, 0]
        assert self.first((NOT_THERE,) * 3) == (NOT_THERE, NO_TRANSITION)
        assert self.run.rehearsal[3].tolist() == [88, 0, 0, 0]

    def test_it_fires_in_its_direction_and_is_not_zero_at_the_start(self):
        assert self.first((0.5, 0.25, 0.125), directions=(1, 1, -1)) == (0.25, 2)
        assert self.first((0.5, 0.25, 0.125), directions=(-1, 1, -1)) == (0.5, 1)
        assert self.first((0.5, 0.25, 0.125), directions=(1, -1, -1)) == (0.125, 3)
        assert self.first((0.5, 0.25, 0.125), on_guard=(1, 3, 0)) == (0.125, 3)
        assert self.asked == [3]


def first_landing(zeros, fired, *, side=(1, 1, 1), passed=NO_ROOT, missing=(), asked=None):
    """Length and transition of a landing on a step of 4 from the time 7, with guards zero after ``zeros``."""

    def land(task, transition, side, h, theta):
        assert side == 1
        if asked is not None:
            asked.append((transition, h, theta))
        return (NOT_THERE, 0.0) if transition in missing else (zeros[transition] - 0.125, 0.125)

    def is_beyond(model, run, transition, side, t, work):
        return side * (t - 7.0 - zeros[transition]) > 1e-9

    tested = plain(runge_kutta_guards, land=land, is_beyond=is_beyond)
    model = SimpleNamespace(first_outgoing=np.array([0, 0, 3]), outgoing=np.arange(3))
    run = SimpleNamespace(
        mode=1, y=None, side=np.array(side), rehearsal=np.ones((4, 3), dtype=int), passed=np.full(3, passed)
    )
    run.phase = 7.0
    task = SimpleNamespace(attempts=None, model=model, method=None, run=run, record=None, work=None)
    length, correction, first = tested.land_on_first(task, fired, 4.0, 0.5)
    return length + correction, first


def test_the_landing_is_on_the_guard_that_is_crossed_first():
    assert first_landing((2.0, 1.5, 1.75), 0) == (1.5, 1)
    assert first_landing((2.0, 1.75, 1.5), 0) == (1.5, 2)
    assert first_landing((1.5, 2.0, 1.75), 0) == (1.5, 0)
    # Within rounding both are reached.
    assert first_landing((2.0, 2.0 - 1e-10, 3.0), 0) == (2.0, 0)


def test_a_guard_without_a_crossing_that_fires_is_not_landed_on():
    assert first_landing((2.0, 1.5, 3.0), 0, side=(1, -1, 1)) == (2.0, 0)
    assert first_landing((2.0, 1.5, 3.0), 0, passed=0.25) == (2.0, 0)
    assert first_landing((2.0, 1.5, 3.0), 0, missing=(1,)) == (2.0, 0)


def test_each_landing_is_on_the_step_up_to_the_one_before():
    """A guard that only comes close to zero leaves the landing before as it was."""
    for zeros, missing, found, steps in (
        ((2.0, 1.5, 1.0), (), (1.0, 2), [(0, 4.0, 0.5), (1, 1.875, 1.0), (2, 1.375, 1.0)]),
        ((2.0, 1.5, 3.0), (1,), (2.0, 0), [(0, 4.0, 0.5), (1, 1.875, 1.0), (0, 1.875, 1.0)]),
        ((0.5, 0.375, 3.0), (), (0.375, 1), [(0, 4.0, 0.5), (1, 0.375, 1.0)]),
        ((0.125, 0.0, 3.0), (), (0.125, 0), [(0, 4.0, 0.5)]),
        ((2.0, 1.5, 3.0), (0,), (NOT_THERE, 0), [(0, 4.0, 0.5)]),
    ):
        asked = []
        assert first_landing(zeros, 0, missing=missing, asked=asked) == found
        assert asked == steps
    # The last landing completes the step, by its Euler step too.
    assert first_landing((2.0, 1.8, 3.0), 0) == (pytest.approx(1.8), 1)
