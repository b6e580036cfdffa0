"""The arithmetic of chatter, rule by rule: a ball above a floor that may be bent, move and be driven.

The state is the height ``q``, the speed ``v`` and a third component ``s`` that drifts.
"""

import math

import numpy as np
import pytest

from hybrid.kernels.jumps import chatter
from hybrid.kernels.jumps.chatter import BEFORE, IMPULSE, LIMIT
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.jumps.balls import METHOD, PULL, Ball, Model, memory, new_run
from tests.hybrid.kernels.plain import plain

kernels = plain(chatter)


def test_the_far_side():
    for direction, speed, side in ((-1, 5.0, -1), (1, -5.0, 1), (0, 0.5, 1), (0, -0.5, -1)):
        run = new_run(last_transversality=speed)
        assert kernels.far_side(Model(direction=direction), run, 1) == side


@pytest.mark.parametrize(
    ("ratio", "acceleration", "direction", "time"),
    [
        (0.5, -3.0, -1, 2.0),
        (0.25, -8.0, -1, 0.5),
        (0.5, 3.0, 1, 2.0),
        (0.5, 3.0, -1, 0.0),
        (0.5, 0.0, -1, 0.0),
        (1.0, -3.0, -1, 0.0),
        (0.0, -3.0, -1, 0.0),
        (1.5, -3.0, -1, 0.0),
        (-0.5, -3.0, -1, 0.0),
    ],
)
def test_the_time_that_is_left(ratio, acceleration, direction, time):
    """``2 v / (a (1 - r))`` with the speed 1.5."""
    tested = plain(chatter, guard_acceleration=lambda *given: acceleration).remaining_chatter
    assert tested(Model(direction=direction), new_run(restitution=ratio), 1, 1.5, memory()) == time


def test_the_mean_field():
    """``f - a p`` with the acceleration ``-4 + q s / 2`` of the height."""
    out = np.zeros(3)
    acceleration = kernels.mean_field(Model(), new_run(), 1, 0.0, np.array([2.0, 3.0, -1.0]), out, memory())
    assert acceleration == -5.0
    assert out.tolist() == [3.0, 0.0, 8.5 + 1.25]


def test_the_limit_follows_the_mean_field():
    """A rate of third order in time is integrated exactly, an exponential to the fourth order."""

    def mean_field(model, run, transition, t, x, out, work):
        out[:] = 4.0 * t**3, x[1], 2.0

    work, run = memory(), new_run((1.0, 5.0, 0.0))
    plain(chatter, mean_field=mean_field).follow_mean(Model(), run, 1, 3.0, 0.5, work)
    h = 0.5
    growth = 1.0 + h + h**2 / 2.0 + h**3 / 6.0 + h**4 / 24.0
    expected = [1.0 + 3.5**4 - 3.0**4, 2.0 * growth, -0.75 + 1.0]
    np.testing.assert_allclose(work.settled, expected, rtol=1e-14)


@pytest.mark.parametrize("shift", [-3e-8, 3e-8])
def test_changes_of_the_limit_in_tolerances(shift):
    run = new_run(phase=-1e6)
    found = kernels.change_of_limit_time(Model(), METHOD, run, 0.25, shift, 2.0)
    assert found == pytest.approx(0.25 * 3e-8 / (2e-8 + 8.0 * EPSILON * 1e6), rel=1e-14)
    work = memory()
    work.settled[:] = 2.0, -7.0, 0.5
    run.trail[LIMIT, :3] = 2.0 + 1e-7, -7.0 - 1e-6, 0.5
    found = kernels.change_of_limit(Model(), METHOD, run, 0.25, 3.0, work)
    assert found == pytest.approx(max(3.0, 0.25 * 1e-6 / (1e-10 + 7e-8)), rel=1e-8)
    assert run.trail[LIMIT, :3].tolist() == [2.0, -7.0, 0.5]
    assert kernels.change_of_limit(Model(), METHOD, run, 0.25, 3.0, work) == 3.0


class TestAccumulation:
    """A ball that loses a part of its speed at each impact; flights are ``2 v / a``."""

    def bounces(self, ratio, *, most=40, band=1e-30, speed=1.0, side=-1, change=lambda k: 0.0):
        """Number of the jump at which the limit is known, and the time to it; ``change`` drives the speed."""
        tested = plain(
            chatter,
            rounding_band=lambda *given: band,
            guard_acceleration=lambda *given: side * PULL,
            guard_value=lambda *given: 0.0,
            slower_are_alike=lambda *given: True,
        ).accumulation
        model, run = Ball(direction=side), new_run()
        flight = 0.0
        for k in range(1, most):
            run.jumps, run.restitution = k, ratio
            run.phase += flight
            run.y[:] = 0.0, -side * speed, 0.5 * run.phase
            run.trail[IMPULSE, :3] = 0.0, 1.0, 0.0
            work = memory()
            span = tested(model, METHOD, run, 1, flight, work)
            if span > 0.0:
                np.testing.assert_allclose(work.settled, [0.0, 0.0, 0.5 * (run.phase + span)], atol=1e-7)
                return k, span, speed
            flight = 2.0 * speed / PULL
            speed *= ratio * (1.0 + change(k))
        return None

    @pytest.mark.parametrize("side", [-1, 1])
    def test_the_limit_is_that_of_the_geometric_series(self, side):
        k, span, speed = self.bounces(0.5, side=side)
        assert k == 17
        assert span == pytest.approx(2.0 * speed / (PULL * 0.5), rel=1e-14)

    def test_invisible_jumps_are_not_waited_for(self):
        assert self.bounces(0.09)[0] == 7
        assert self.bounces(0.009)[0] == 4
        # Against the first speed, in any units.
        for speed in (0.01, 100.0):
            assert self.bounces(0.09, speed=speed)[0] == 7

    def test_shallow_flights_end_it_before_rounding_spoils_it(self):
        """Heights are ``v^2 / 8``, and a million times the rounding is reached after some flights."""
        for band in (1e-10, 1e-9, 1e-8):
            k, _, speed = self.bounces(0.5, band=band)
            assert speed**2 / (2.0 * PULL) <= 1e6 * band < (2.0 * speed) ** 2 / (2.0 * PULL)
            assert k < 17

    def test_driven_jumps_have_no_limit(self):
        assert self.bounces(0.9, change=lambda k: 0.08) is None
        # Flights that are lower than rounding are the end.
        _, _, speed = self.bounces(0.5, band=1e-14, change=lambda k: (-1) ** k * 0.01)
        assert speed**2 / (2.0 * PULL) <= 1e-14 < (2.0 * speed) ** 2 / (2.0 * PULL)

    def test_a_small_drive_needs_more_jumps(self):
        """It falls with the speed, as a bent path makes it."""
        k, span, speed = self.bounces(0.5, change=lambda k: 1e-3 * 0.5**k)
        assert k >= 17
        assert span == pytest.approx(2.0 * speed / (PULL * 0.5), rel=1e-14)

    def after(self, since_last, speed, *, band=1.0, ratio=0.5, value=0.0, phase=3.0, **trail):
        """What is found after a series with the speed 2, of which 2 time units were left, and the run."""
        tested = plain(
            chatter,
            rounding_band=lambda *given: band,
            guard_acceleration=lambda *given: -PULL,
            guard_value=lambda *given: value,
            slower_are_alike=lambda *given: self.asked.append(given[3:]) or True,
        ).accumulation
        self.asked = []
        run = new_run((0.0, speed, 0.0), chattering=5, chatter_jumps=8, jumps=9, restitution=ratio)
        run.phase = phase
        run.trail[BEFORE] = 1.0, 0.0, 0.0, 2.0
        run.trail[LIMIT] = 0.0, 0.0, 0.0, 2.0
        run.trail[IMPULSE] = 0.0, 1.0, 0.0, trail.get("misfit", math.inf)
        found = tested(Ball(), METHOD, run, 1, since_last, memory())
        return found, run

    @pytest.mark.parametrize(
        ("since_last", "speed", "found"),
        [(1.0, 1.0, True), (1.4, 1.0, True), (0.6, 1.0, True), (1.6, 1.0, False), (0.4, 1.0, False),
         (1.0, 1.4, True), (1.0, 0.6, True), (1.0, 1.6, False), (1.0, 0.4, False), (1.6, 0.4, False)],
    )  # fmt: skip
    def test_lower_than_rounding_a_steady_flight_is_the_last(self, since_last, speed, found):
        """Half of the flight, and of the speed, that the series has."""
        span, run = self.after(since_last, speed)
        assert span == (2.0 * speed / (PULL * 0.5) if found else 0.0)
        assert run.chattering == 6
        # Slower impacts may then lead anywhere near.
        assert len(self.asked) == found
        if found:
            transition, towards, left, impulse, apart, _ = self.asked[0]
            assert (transition, towards, left, apart) == (1, speed, span, math.inf)
            assert impulse[:3].tolist() == [0.0, 1.0, 0.0]
        # Higher flights are followed.
        assert self.after(since_last, speed, band=1e-9)[0] == 0.0

    @pytest.mark.parametrize(
        ("since_last", "speed", "found"),
        [(1.5, 0.5, True), (2.2, 0.5, True), (0.8, 0.5, True), (2.3, 0.5, False), (0.7, 0.5, False),
         (1.5, 0.74, True), (1.5, 0.26, True), (1.5, 0.76, False), (1.5, 0.24, False)],
    )  # fmt: skip
    def test_a_steady_flight_at_another_ratio(self, since_last, speed, found):
        """The series with the ratio 1/4 has the flight 1.5, and the speed 1/2 after it."""
        assert (self.after(since_last, speed, ratio=0.25)[0] > 0.0) == found

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_flight_as_short_as_the_rounding_of_time_is_steady(self, way):
        """Eight units of the time count, beside a half of the flight of 1."""
        for units, found in ((7.0, True), (9.0, False)):
            since_last = 1.0 + way * (0.5 + units * EPSILON * 1e16)
            assert (self.after(since_last, 1.0, phase=-1e16)[0] > 0.0) == found

    def test_the_change_of_the_limit_is_kept(self):
        """A third of the change of its time for the ratio 1/2, in units of the tolerances."""
        for ratio, gain in ((0.5, 1 / 3), (0.25, 1 / 15)):
            span, run = self.after(0.75, 1.0, band=1e-9, ratio=ratio)
            left = 2.0 / (PULL * (1.0 - ratio))
            shift = left - (2.0 - 0.75)
            misfit = gain * abs(shift) / (METHOD.rtol * left + 8.0 * EPSILON * 3.0)
            assert span == 0.0
            assert run.trail[IMPULSE, 3] == pytest.approx(misfit, rel=1e-14)
            # It is driven: there is no limit to compare with.
            assert run.trail[LIMIT, 0] == math.inf
        # Slightly driven: the limit is compared with the last one, which was zero.
        _, run = self.after(1.0 + 1e-4, 1.0, band=1e-9)
        assert run.trail[LIMIT, 2] == pytest.approx(0.5, rel=1e-15)
        assert run.trail[IMPULSE, 3] == pytest.approx(0.5 / 3.0 / (1e-10 + 1e-8), rel=1e-12)

    @pytest.mark.parametrize(
        ("band", "before", "found"),
        [(1e-7, 1.0, True), (1e-7, 1e9, False), (1e-9, 1.0, False), (0.8e-8, 1.0, False), (2e-8, 1.0, True)],
    )
    def test_a_change_that_rounding_makes_is_the_last(self, band, before, found):
        """The limit changes by 1e-6 / 3, and by at most 8 / 3 of the rounding over the height 1/8."""
        tested = plain(
            chatter,
            rounding_band=lambda *given: band,
            guard_acceleration=lambda *given: -PULL,
            guard_value=lambda *given: 0.0,
            change_of_limit=lambda model, method, run, gain, misfit, work: misfit,
            slower_are_alike=lambda *given: True,
        ).accumulation
        run = new_run((0.0, 1.0, 0.0), chattering=16, chatter_jumps=8, jumps=9, phase=0.0)
        run.trail[:3, 3] = 2.0, 2.0, before
        span = tested(Ball(), METHOD, run, 1, 1.0 + 1e-6, memory())
        assert run.trail[IMPULSE, 3] == pytest.approx(1e-6 / 3.0 / METHOD.rtol, rel=1e-6)
        assert (span > 0.0) == found

    def test_what_ends_a_chatter(self):
        """A landing off the guard, no pull, and another transition in between."""
        options = {"rounding_band": lambda *given: 1e-9, "guard_acceleration": lambda *given: -PULL}
        for value, span, left in ((0.9e-9, 0, 1), (-0.9e-9, 0, 1), (1.1e-9, 0, 0), (-1.1e-9, 0, 0)):
            run = new_run(chattering=0)
            tested = plain(chatter, guard_value=lambda *given, v=value: v, **options).accumulation
            assert tested(Model(), METHOD, run, 1, 0.0, memory()) == span
            assert run.chattering == left
        run = new_run(chattering=5, restitution=1.5)
        assert tested(Model(), METHOD, run, 1, 0.0, memory()) == 0.0
        assert run.chattering == 0
        tested = plain(chatter, guard_value=lambda *given: 0.0, **options).accumulation
        for jumps, before, left in ((9, 1, 6), (9, 0, 1), (10, 1, 1)):
            run = new_run(chattering=5, chatter_jumps=8, jumps=jumps)
            run.recent[:] = 1 - before
            run.recent[jumps - 2] = before
            run.trail[:3, 3] = 0.5, 1.0, math.inf
            run.trail[LIMIT, :3] = math.inf
            tested(Model(), METHOD, run, 1, 0.5, memory())
            assert (run.chattering, run.chatter_jumps) == (left, jumps)
            assert run.trail[LIMIT, 3] == 2.0 / (PULL * 0.5)
            assert run.trail[BEFORE, 3] == 1.0


def test_impulses():
    """Per unit of the guard's speed; a component that moves by rounding does not move."""
    run, work = new_run((0.0, -2.0, 1.0)), memory()
    work.new[:] = 3.0 * EPSILON, 1.0, 1.75
    work.field_after[:] = 1.0, -PULL, 2.0
    kernels.remember_impulse(Model(), run, 1, -2.0, work)
    assert run.restitution == 0.5
    assert run.trail[IMPULSE, :3].tolist() == [0.0, 1.0, 0.25]
    work.new[0] = 17.0 * EPSILON
    kernels.remember_impulse(Model(), run, 1, -2.0, work)
    assert run.trail[IMPULSE, 0] == 17.0 * EPSILON / 3.0
    # By sixteen units of its own size.
    run.scale[:] = 0.25, 4.0, 4.0
    for units, moves in ((3.0, False), (5.0, True)):
        work.new[0] = units * EPSILON
        kernels.remember_impulse(Model(), run, 1, -2.0, work)
        assert (run.trail[IMPULSE, 0] != 0.0) == moves


class TestEndless:
    def kept(self, *, found=True, scale=1.0, speed=2.0, impulse=(0.0, 1.0, -0.25)):
        """Impulses that stay of those of a height, a speed and a counter, and what was asked of their moves.

        The restitution is 1/2: the last impact has changed a speed of 2 by 6.
        """
        asked = []

        def mark_endless(model, run, turn, t, x, share, work):
            asked.append((turn, t, x.tolist(), share.tolist()))
            run.trail[ENDLESS, :3] = 0.0, 0.0, 1.0
            return found

        run = new_run((5.0, 7.0, 9.0), scale=np.array([1.0, 1.0, scale]))
        run.trail[IMPULSE, :3] = impulse
        plain(chatter, mark_endless=mark_endless).keep_endless(Model(), run, 1, speed, memory())
        ((turn, t, rest, share),) = asked
        assert (turn, t) == (1, 3.0)
        return run.trail[IMPULSE, :3].tolist(), rest, share

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_what_moves_for_ever_has_no_impulse(self, way):
        """Only moves beyond a tenth of that of the last impact count, or beyond rounding if that is more."""
        left, rest, share = self.kept(speed=2.0 * way)
        assert left == [0.0, 1.0, 0.0]
        assert rest == [5.0, 7.0 - 2.0 * way, 9.0 + 0.5 * way]
        assert share == [math.inf, pytest.approx(0.6, rel=1e-15), pytest.approx(0.15, rel=1e-15)]
        assert self.kept(scale=2.0**50)[2][2] == 16.0 * EPSILON * 2.0**50
        # What the impacts do not move in one component they may move in another.
        assert self.kept(impulse=(0.5, 1.0, 0.25))[2][0] == pytest.approx(0.3, rel=1e-15)

    def test_without_any_all_stay(self):
        assert self.kept(found=False)[0] == [0.0, 1.0, -0.25]
