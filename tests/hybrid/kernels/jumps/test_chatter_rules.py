"""The arithmetic of chatter, rule by rule: a ball above a floor that may be bent, move and be driven.

The state is the height ``q``, the speed ``v`` and a third component ``s`` that drifts.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.jumps import chatter
from hybrid.kernels.jumps.chatter import BEFORE, IMPULSE, LIMIT
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(chatter)
PULL = 4.0


class Model:
    """``q' = v``, ``v' = -4 + q s / 2``, ``s' = 1/2 + q + 2 v``; the guard is ``q + bend s^2``."""

    dimension = 3
    timed = np.array([1, 1])
    parameters = np.zeros(0)
    programs = SimpleNamespace(first=np.zeros(9, dtype=int))
    target = np.zeros(2)
    steep = np.zeros(2, dtype=int)
    period = 0.0
    first_forcing = np.zeros(3, dtype=int)
    first_residue = np.zeros(3, dtype=int)
    # Rows of the Jacobian that are not zero: all of them, in both modes.
    first_slope = np.array([[0, 3, 6, 9], [0, 3, 6, 9]])
    slope_column = np.array([0, 1, 2] * 3)

    def __init__(self, *, bend=0.0, direction=-1, ratio=0.5, tilt=0.0):
        self.bend, self.ratio, self.tilt = bend, ratio, tilt
        self.direction = np.array([9, direction])
        self.affine_guard = np.array([0, int(bend == 0.0)])

    def field(self, mode, t, x, parameters, out):
        assert mode == 1
        q, v, s = x
        out[:] = v, -PULL + q * s / 2.0, 0.5 + q + 2.0 * v

    def field_jacobian(self, mode, t, x, parameters, out):
        assert mode == 1
        q, _, s = x
        out[:] = (0.0, 1.0, 0.0, 0.0), (s / 2.0, 0.0, q / 2.0, 0.0), (1.0, 2.0, 0.0, 0.0)

    def guard(self, transition, t, x, parameters, out):
        assert transition == 1
        out[0] = x[0] + self.bend * x[2] ** 2

    def guard_gradient(self, transition, t, x, parameters, out):
        assert transition == 1
        out[:] = 1.0, 0.0, 2.0 * self.bend * x[2], 0.0

    def guard_curvature(self, transition, t, x, parameters, out):
        out[0] = 2.0 * self.bend * out[2] ** 2

    def reset(self, transition, t, x, parameters, out):
        """The speed of the guard falls by ``(1 + r) v`` along ``(0, 1, tilt)``."""
        out[:] = x[0], -self.ratio * x[1], x[2] - self.tilt * (1.0 + self.ratio) * x[1]


def memory():
    names = ("trial", "error", "new", "second_error", "settled", "state", "field", "field_after")
    return SimpleNamespace(
        **{name: np.full(3, 1e9) for name in names},
        gradient=np.full(4, 1e9),
        scalar=np.zeros(1),
        jacobian=np.full((3, 4), 1e9),
        reset_jacobian=np.full((3, 4), 1e9),
        saltation=np.full((3, 3), 1e9),
        sizes=np.full((3, 3), 1e9),
        rounding=np.full((4, 3), 1e9),
    )


def new_run(y=(0.0, 1.0, 0.0), **values):
    given = {
        "mode": 1,
        "y": np.array(y),
        "phase": 3.0,
        "scale": np.ones(3),
        "restitution": 0.5,
        "last_transversality": -1.0,
        "chattering": 0,
        "chatter_jumps": 0,
        "jumps": 1,
        "recent": np.full(32, 1),
        "visits": np.zeros(32, dtype=int),
        "since_entry": 0.0,
        "trail": np.zeros((3, 4)),
        "instant": np.full(3, 1e9),
        "last_fired": 1,
    }
    run = SimpleNamespace(**(given | values))
    run.trail[IMPULSE, :3] = 0.0, 1.0, 0.25
    return run


METHOD = SimpleNamespace(atol=1e-10, rtol=1e-8)


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


class Ball(Model):
    """Nothing but the pull, towards a floor or a ceiling, and a drift of 1/2."""

    def field(self, mode, t, x, parameters, out):
        out[:] = x[1], self.direction[1] * PULL, 0.5


class TestAccumulation:
    """A ball that loses a part of its speed at each impact; flights are ``2 v / a``."""

    def bounces(self, ratio, *, most=40, band=1e-30, speed=1.0, side=-1, change=lambda k: 0.0):
        """Number of the jump at which the limit is known, and the time to it; ``change`` drives the speed."""
        tested = plain(
            chatter,
            rounding_band=lambda *given: band,
            guard_acceleration=lambda *given: side * PULL,
            guard_value=lambda *given: 0.0,
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

    def after(self, since_last, speed, *, band=1.0, ratio=0.5, value=0.0, **trail):
        """What is found after a series with the speed 2, of which 2 time units were left, and the run."""
        tested = plain(
            chatter,
            rounding_band=lambda *given: band,
            guard_acceleration=lambda *given: -PULL,
            guard_value=lambda *given: value,
        ).accumulation
        run = new_run((0.0, speed, 0.0), chattering=5, chatter_jumps=8, jumps=9, restitution=ratio)
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
        # Higher flights are followed.
        assert self.after(since_last, speed, band=1e-9)[0] == 0.0

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
        ).accumulation
        run = new_run((0.0, 1.0, 0.0), chattering=16, chatter_jumps=8, jumps=9, phase=0.0)
        run.trail[:, 3] = 2.0, 2.0, before
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
            run.recent[:] = before
            run.trail[:, 3] = 0.5, 1.0, math.inf
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


@pytest.mark.parametrize("bend", [0.0, 0.75])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_the_gradient_of_a_speed(bend, scale):
    """The speed is ``v + 2 b s (1/2 + q + 2 v)``."""
    out, (q, v, s) = np.zeros(3), (0.5, -1.0, 0.25)
    run = new_run(scale=np.full(3, scale))
    kernels.speed_gradient(Model(bend=bend), run, 1, 1, 0.0, np.array([q, v, s]), out, memory())
    expected = [2.0 * bend * s, 1.0 + 4.0 * bend * s, 2.0 * bend * (0.5 + q + 2.0 * v)]
    np.testing.assert_allclose(out, expected, rtol=1e-9)


def test_the_matrix_of_a_whole_chatter():
    """``Xi = I - p (D_x v - (D_x v D_x f p) D_x g) - (D_x f p) D_x g``; it leaves states at rest alone."""
    for bend in (0.0, 0.5):
        run, work, model = new_run((0.25, -1.0, 0.5)), memory(), Model(bend=bend)
        slope, jacobian = np.zeros(3), np.zeros((3, 4))
        kernels.speed_gradient(model, run, 1, 1, 3.0, run.y, slope, memory())
        model.field_jacobian(1, 3.0, run.y, None, jacobian)
        gradient = np.array([1.0, 0.0, 2.0 * bend * 0.5])
        p = run.trail[IMPULSE, :3]
        carried = jacobian[:, :3] @ p
        expected = np.eye(3) - np.outer(p, slope - (slope @ carried) * gradient) - np.outer(carried, gradient)
        kernels.chatter_matrix(model, run, 1, work)
        np.testing.assert_allclose(work.saltation, expected, rtol=0, atol=2e-15)
        assert np.all((work.saltation != 0.0) == (np.abs(expected) > 1e-13))


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 2.0, -1.0), (1e6, 1e5, 0.0), (0.0, 0.0, 0.0)])
def test_the_derivative_of_the_mean_field(direction):
    """``D f d - (D a d) p`` with ``a = -4 + q s / 2``, whose central difference is exact."""
    x, direction, p = np.array([0.5, -1.0, 0.25]), np.array(direction), np.array([0.0, 1.0, 0.25])
    model, run, mean, out = Model(), new_run(), np.zeros(3), np.zeros(3)
    kernels.mean_field(model, run, 1, 3.0, x, mean, memory())
    jacobian = np.zeros((3, 4))
    model.field_jacobian(1, 3.0, x, None, jacobian)
    kernels.along_mean(model, run, 1, 3.0, x, direction, 2.0, mean, jacobian, out, memory())
    change = 0.5 * (direction[0] * x[2] + direction[2] * x[0])
    expected = jacobian[:, :3] @ direction - change * p
    np.testing.assert_allclose(out, expected, rtol=1e-8, atol=1e-8 * np.abs(direction).max())


def test_the_step_of_the_difference_is_that_of_the_component_that_allows_least():
    places = []

    def mean_field(model, run, transition, t, x, out, work):
        places.append(x.copy())
        return 0.0

    tested, x = plain(chatter, mean_field=mean_field).along_mean, np.array([0.5, -8.0, 0.0])
    for direction, mean, scale, step in (
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.25, 3e-6),
        ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0), 2.0, 12e-6),
        ((1.0, 0.0, 0.0), (-3.0, 0.0, 0.0), 2.0, 36e-6),
        ((1.0, 64.0, 0.0), (0.0, 0.0, 0.0), 0.25, 0.75e-6),
        ((1.0, -64.0, 0.0), (0.0, 0.0, 0.0), 0.25, 0.75e-6),
        ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 0.0, 1.0),
    ):
        places.clear()
        run, direction = new_run(scale=np.full(3, scale)), np.array(direction)
        given = (x, direction, 2.0, np.array(mean), np.zeros((3, 4)), np.zeros(3), memory())
        tested(Model(), run, 1, 3.0, *given)
        np.testing.assert_allclose(places, [x + step * direction, x - step * direction], rtol=1e-14)


def test_the_drift_with_the_mean_field():
    """Columns grow by ``A h + (A h)^2 / 2`` with the derivative of the mean field half way."""
    run, work, model, p = new_run((0.5, -1.0, 0.25)), memory(), Model(), np.array([0.0, 1.0, 0.25])
    work.settled[:] = 0.0, -0.5, 0.75
    q, s, h = 0.25, 0.5, 0.125
    jacobian = np.array([[0.0, 1.0, 0.0], [s / 2.0, 0.0, q / 2.0], [1.0, 2.0, 0.0]])
    a = jacobian - np.outer(p, [s / 2.0, 0.0, q / 2.0])
    start = np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 0.0], [3.0, 1.0, 1.0]])
    work.saltation[:] = start
    times, field = set(), model.field
    model.field = lambda mode, t, *given: times.add(t) or field(mode, t, *given)
    kernels.drift_with_mean(model, run, 1, h, work)
    assert times == {3.0 + h / 2.0}
    expected = start + h * a @ start + h**2 / 2.0 * a @ a @ start
    np.testing.assert_allclose(work.saltation, expected, rtol=0, atol=1e-9)


def test_an_impact():
    """The guard's speed is the height's: from -2 to 1."""
    after = np.zeros(3)
    found = kernels.impact(Model(tilt=0.25), new_run(), 1, 3.0, np.array([0.0, -2.0, 1.0]), after, memory())
    assert found == (0.5, 3.0)
    assert after.tolist() == [0.0, 1.0, 1.75]


@pytest.mark.parametrize(
    ("up", "down", "noise", "change"),
    [
        (3.0, 1.0, 0.0, 2.0),
        (1.0, 3.0, 0.0, -2.0),
        (1.0, 3.0, 2.1, 0.0),
        (1.0, 3.0, 1.9, -2.0),
        (1.0, 1.0 + 100 * EPSILON, 0.0, 0.0),
        (1.0, 1.0 - 200 * EPSILON, 0.0, 200 * EPSILON),
        (1.0 + 120 * EPSILON, 1.0, 0.0, 0.0),
        (-1.0, -1.0 - 100 * EPSILON, 0.0, 0.0),
    ],
)
def test_changes_that_are_rounding(up, down, noise, change):
    assert kernels.changed(up, down, noise) == change


def test_an_impulse_that_turns():
    """The impulse per unit of the guard's speed at the limit, less the last one, in the time 1/8."""
    run, work, p = new_run((0.0, -1.0, 0.5)), memory(), np.array([0.0, 1.0, 0.25])
    work.settled[:] = 0.0, 0.0, 1.0
    work.error[:] = 2.0, 3.0, 4.0
    work.saltation[:] = 7.0
    kernels.add_turn_of_impulse(Model(tilt=0.5, bend=0.75), run, 1, 3.125, -2.0, 0.125, work)
    gradient = np.array([1.0, 0.0, 1.5 * 0.5])
    place = work.settled + 2.0 * p
    speed = lambda x: x[1] + 1.5 * x[2] * (0.5 + x[0] + 2.0 * x[1])  # noqa: E731
    after = np.array([place[0], -0.5 * place[1], place[2] - 0.75 * place[1]])
    turn = ((after - place) / (speed(after) - speed(place)) - p) / 0.125
    expected = 7.0 + np.outer(turn - np.dot([2.0, 3.0, 4.0], turn) * p, gradient)
    np.testing.assert_allclose(work.saltation, expected, rtol=1e-13)


class Changing(Model):
    """The restitution is ``1/2 + s/8``, and the impulse ``(0, 1, 1/4 + q/2)``."""

    def reset(self, transition, t, x, parameters, out):
        change = -(1.5 + 0.125 * x[2]) * x[1]
        out[:] = x[0], x[1] + change, x[2] + (0.25 + 0.5 * x[0]) * change


def test_impacts_that_change():
    """Derivatives of acceleration, restitution and impulse along the columns, which are those of formulas.

    The impulse takes out a speed of 2, and what the pull adds to it in the time 1/4.
    """
    run, work = new_run((0.5, 1.0, 0.5), scale=np.full(3, 0.125)), memory()
    columns = np.array([[1.0, 0.0, 0.0], [0.5, 0.0, 3.0], [2.0, 0.0, -1.0]])
    work.saltation[:] = columns
    kernels.add_change_of_impacts(Changing(), run, 1, 2.0, 0.25, work)
    q, s = 0.5, 0.5 - 2.0 * 0.25
    bends = 0.5 * (columns[0] * s + q * columns[2])
    np.testing.assert_allclose(work.rounding[0], bends, rtol=0, atol=1e-9)
    np.testing.assert_allclose(work.rounding[1], 0.125 * columns[2], rtol=0, atol=1e-9)
    taken = 0.5 * columns[0] * (2.0 + 0.25 * (-PULL + 0.5 * q * s))
    expected = columns - np.array([0.0 * taken, 0.0 * taken, taken])
    np.testing.assert_allclose(work.saltation, expected, rtol=0, atol=1e-9)


class Resting(Ball):
    """A ball, and a mode at rest with a drift of its own."""

    drift = 1.0

    def field(self, mode, t, x, parameters, out):
        super().field(mode, t, x, parameters, out)
        if mode == 0:
            out[:] = 0.0, 0.0, self.drift

    def field_jacobian(self, mode, t, x, parameters, out):
        out[:] = 0.0
        out[0, 1] = 1.0 if mode == 1 else 0.0


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("drift", [1.0, 0.25])
def test_the_duration_of_a_chatter(drift, side):
    """``2 v / (a (1 - r))``, which a height changes through the energy of the flight.

    A state that chatters longer drifts longer with the mean field, ``1/2 - a p``, and shorter with the other.
    """
    speed, ratio, p = 0.125, 0.5, 0.25
    model = Resting(direction=-side, ratio=ratio, tilt=p)
    model.drift = drift
    run, work = new_run((0.0, side * speed, 0.5), restitution=ratio), memory()
    run.trail[BEFORE, 3] = speed
    span = 2.0 * speed / (PULL * (1.0 - ratio))
    kernels.chatter_matrix(model, run, 1, work)
    matrix = work.saltation.copy()
    np.testing.assert_allclose(matrix, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -p, 1.0]], atol=1e-15)
    work.settled[:] = 0.0, 0.0, 0.5 - side * speed * p + span * (0.5 + side * PULL * p)
    assert kernels.add_change_of_duration(model, METHOD, run, 0, span, work)
    instant = [side * (1.0 + ratio) / (speed * (1.0 - ratio)), side * 2.0 / (PULL * (1.0 - ratio)), 0.0]
    np.testing.assert_allclose(run.instant, instant, rtol=1e-9, atol=1e-9)
    excess = 0.5 + side * PULL * p - drift
    expected = matrix + np.outer([0.0, 0.0, excess], instant)
    np.testing.assert_allclose(work.saltation, expected, rtol=1e-9, atol=1e-9)


def test_a_limit_mode_that_drifts_alike_adds_nothing():
    model = Resting(direction=-1, tilt=0.25)
    run, work = new_run((0.0, 0.125, 0.5)), memory()
    run.trail[BEFORE, 3] = 0.125
    for drift, apart in ((1.5, False), (1.5 + 1e-13, False), (1.5 - 1e-9, True), (1.5 + 1e-9, True)):
        model.drift = drift
        kernels.chatter_matrix(model, run, 1, work)
        matrix = work.saltation.copy()
        work.settled[:] = 0.0, 0.0, 0.5
        assert kernels.add_change_of_duration(model, METHOD, run, 0, 0.125, work) == apart
        added = (work.saltation - matrix)[2]
        np.testing.assert_allclose(
            added, (1.5 - drift if apart else 0.0) * run.instant, rtol=1e-5, atol=1e-14
        )


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("drift", "apart"), [(0.25, True), (0.5, False)])
def test_parts_of_a_change_of_duration(drift, apart, side):
    """The speed has its sign, and the whole chatter counts only where the two drifts differ."""
    calls = []
    tested = plain(
        chatter,
        add_turn_of_impulse=lambda model, run, *given: calls.append(("turn", *given[:4])),
        add_change_of_impacts=lambda model, run, *given: calls.append(("impacts", *given[:3])),
        drift_with_mean=lambda model, run, *given: calls.append(("drift", *given[:2])),
    ).add_change_of_duration
    model = Resting(direction=-side)
    model.drift = drift
    run, work, times = new_run(), memory(), set()
    run.trail[BEFORE, 3] = 4.0
    run.trail[IMPULSE, :3] = 0.0, 1.0, 0.0
    work.settled[:], work.error[:], work.rounding[:], work.saltation[:] = 0.0, 0.0, 0.0, 0.0
    work.jacobian[:] = 0.0
    work.rounding[0, 1], work.rounding[1, 2] = 3.0, 5.0
    field = model.field
    model.field = lambda mode, t, *given: times.add(t) or field(mode, t, *given)
    assert tested(model, METHOD, run, 0, 0.125, work) == apart
    assert times == {3.125}
    whole = [("drift", 1, 0.125)] if apart else []
    assert calls == [("turn", 1, 3.125, side * 4.0, 0.125), ("impacts", 1, side * 4.0, 0.125), *whole]
    # The span changes with the pull and the restitution.
    expected = [side * 1.5 / 2.0, 0.125 * side * 3.0 / PULL, 0.125 * 5.0 / 0.5]
    assert run.instant.tolist() == expected
    assert work.saltation.tolist() == [[0.0] * 3, [0.0] * 3, [(0.5 - drift) * each for each in expected]]
