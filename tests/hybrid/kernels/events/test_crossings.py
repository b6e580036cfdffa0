"""Which crossings fire, a start on a guard, and how a run ends."""

import math

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate
from models import bouncing_ball
from tests.hybrid.systems import PENDULUM
from tests.reference.load import reference

LONG_STEPS = hybrid.DOP853(rtol=1.0, atol=1.0)
BALL = reference("bouncing_ball")
FALL = math.sqrt(2 / 9.81)


def box(direction):
    """A puck in the unit square."""

    def wall(function, sign, flip, name):
        return Transition("slide", "slide", Guard(function, sign * direction), Reset(flip), name=name)

    def flip_u(t, x, p):
        return x.x, x.y, -x.u, x.v

    def flip_v(t, x, p):
        return x.x, x.y, x.u, -x.v

    return HybridSystem(
        state=("x", "y", "u", "v"),
        modes=[Mode("slide", lambda t, x, p: (x.u, x.v, 0.0, 0.0))],
        transitions=[
            wall(lambda t, x, p: x.x - 1, +1, flip_u, "right"),
            wall(lambda t, x, p: x.y - 1, +1, flip_v, "top"),
            wall(lambda t, x, p: x.x, -1, flip_u, "left"),
            wall(lambda t, x, p: x.y, -1, flip_v, "bottom"),
        ],
    )


def polynomial_motion(derivative, guard=lambda t, x, p: x.x, direction=0):
    """``x' = derivative(t)`` with a counter ``n`` of the crossings of a guard."""
    return HybridSystem(
        state=("x", "n"),
        modes=[Mode("run", lambda t, x, p: (derivative(t), 0.0))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(guard, direction),
                Reset(lambda t, x, p: (x.x, x.n + 1)),
                name="cross",
            )
        ],
    )


class TestCrossings:
    @pytest.mark.parametrize(
        ("gap", "bent"), [(1e-2, False), (1e-4, False), (1e-6, False), (1e-2, True), (1e-4, True)]
    )
    def test_two_in_one_step(self, gap, bent):
        """``x = (t - 1)(t - 1 - gap)`` is integrated exactly, in one step of any length."""
        guard = (lambda t, x, p: np.sinh(x.x)) if bent else (lambda t, x, p: x.x)
        system = polynomial_motion(lambda t: 2 * t - 2 - gap, guard)
        arc = simulate(system, (1 + gap, 0.0), (0.0, 2.0), solver=LONG_STEPS)
        assert len(arc.jumps) == 2
        np.testing.assert_allclose(arc.jumps.t, [1.0, 1 + gap], atol=1e-15 / gap)
        assert arc.x[-1, 1] == 2.0

    @pytest.mark.parametrize(("direction", "which"), [(-1, 0), (+1, 1)])
    def test_the_right_one_of_two_fires(self, direction, which):
        system = polynomial_motion(lambda t: 2 * t - 2 - 1e-4, direction=direction)
        arc = simulate(system, (1 + 1e-4, 0.0), (0.0, 2.0), mode="run", solver=LONG_STEPS)
        np.testing.assert_allclose(arc.jumps.t, [1.0 + which * 1e-4], atol=1e-10)

    def test_a_graze_does_not_fire(self):
        for direction in (-1, 0, 1):
            system = polynomial_motion(lambda t: 2 * t - 2, direction=direction)
            arc = simulate(system, (1.0 + 1e-9, 0.0), (0.0, 2.0), mode="run", solver=LONG_STEPS)
            assert not arc.jumps

    @pytest.mark.parametrize("direction", [0, 1])
    @pytest.mark.parametrize("start", [0.5, 0.3, 1 / 7])
    def test_two_guards_at_one_instant_both_fire(self, direction, start):
        """A puck in the corner returns the way it came."""
        arc = simulate(box(direction), (start, start, 1.0, 1.0), (0.0, 6.0), mode="slide")
        assert [jump.transition for jump in arc.jumps[:4]] == ["right", "top", "left", "bottom"]
        np.testing.assert_allclose(arc.jumps.t, np.repeat(1 - start + np.arange(6), 2), atol=1e-12)
        np.testing.assert_allclose(arc.x[-1], [start, start, 1.0, 1.0], atol=1e-12)

    @pytest.mark.parametrize("step", [0.1, np.inf])
    def test_a_reset_beyond_another_guard_fires_it_however_long_the_step(self, step):
        """Without the reset the flow would cross the second guard later in the same step."""
        jumper = HybridSystem(
            state=("x", "n"),
            modes=[Mode("go", lambda t, x, p: (1.0, 0.0))],
            transitions=[
                Transition("go", "go", Guard(lambda t, x, p: x.x - 1, +1),
                           Reset(lambda t, x, p: (5.0, x.n)), name="leap"),
                Transition("go", "go", Guard(lambda t, x, p: x.x - 1.5, +1),
                           Reset(lambda t, x, p: (0.0, x.n + 1)), name="return"),
            ],
        )  # fmt: skip
        arc = simulate(jumper, (0.0, 0.0), (0.0, 2.9), mode="go", solver=hybrid.DOP853(max_step=step))
        assert [jump.transition for jump in arc.jumps] == ["leap", "return"] * 2
        np.testing.assert_allclose(arc.x[-1], [0.9, 2.0], atol=1e-12)

    def test_landing_at_the_very_end_of_a_step(self):
        """Crossings near the boundary of two coarse steps fire once each."""
        for solver in (hybrid.Tsit5(rtol=1.0, atol=1.0, max_step=1.0), hybrid.DOP853(rtol=1.0, max_step=2.5)):
            free = simulate(PENDULUM, (-1.5, 0.0), (0.0, 3.6), mode="left",
                            parameters={"c": 50.0}, solver=solver)  # fmt: skip
            joint = free.x[np.searchsorted(free.t, 3.0) - 1, 0]
            for shift in [0.0, *(s * 10.0**e for e in range(-16, -2, 2) for s in (1, -1))]:
                arc = simulate(PENDULUM, (-1.5, 0.0), (0.0, 3.6), mode="left",
                               parameters={"c": joint + shift}, solver=solver)  # fmt: skip
                assert len(arc.jumps) == 1
                assert arc.jumps[0].x_minus[0] == pytest.approx(joint + shift, abs=1e-12)


class TestStartOnAGuard:
    """The half-open rule: the side of a guard that is zero at the start is that of its speed."""

    def test_inbound_fires_at_once(self, ball):
        arc = simulate(ball, (0.0, -4.0), (0.0, 0.1), mode="flight")
        assert [jump.t for jump in arc.jumps] == [0.0]
        np.testing.assert_allclose(arc.x[-1], [0.8 * 4 * 0.1 - 9.81 * 0.005, 3.2 - 0.981], atol=1e-12)

    def test_outbound_does_not(self, ball):
        arc = simulate(ball, (0.0, 4.0), (0.0, 0.8))
        assert not arc.jumps
        assert len(simulate(ball, (0.0, 4.0), (0.0, 0.9)).jumps) == 1

    def test_tangential_outbound_does_not(self):
        system = polynomial_motion(lambda t: 2 * t, direction=-1)
        assert not simulate(system, (0.0, 0.0), (0.0, 1.0)).jumps

    def test_tangential_inbound_fires_at_once(self):
        system = polynomial_motion(lambda t: -2 * t, direction=-1)
        assert [jump.t for jump in simulate(system, (0.0, 0.0), (0.0, 1.0), mode="run").jumps] == [0.0]

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_both_ways_never_fires_at_the_start(self, sign):
        for derivative in (lambda t: 1.0 + 0 * t, lambda t: 2 * t, lambda t: 3 * t**2):
            system = polynomial_motion(lambda t, d=derivative: sign * d(t))
            assert not simulate(system, (0.0, 0.0), (0.0, 1.0)).jumps

    @pytest.mark.parametrize("bent", [False, True])
    def test_a_second_zero_close_to_the_start_is_found(self, bent):
        guard = (lambda t, x, p: np.sinh(x.x)) if bent else (lambda t, x, p: x.x)
        system = polynomial_motion(lambda t: 1e-6 - 2 * t, guard, -1)
        arc = simulate(system, (0.0, 0.0), (0.0, 1.0), solver=LONG_STEPS)
        np.testing.assert_allclose([jump.t for jump in arc.jumps], [1e-6], rtol=1e-6)

    @pytest.mark.parametrize("q", [0.0, 3e-17, -3e-17, -1e-16])
    def test_rounding_is_no_side(self, ball, q):
        """A run that ended on the guard, up to rounding, restarts on the guard."""
        assert len(simulate(ball, (q, -4.0), (0.0, 0.5), mode="flight").jumps) == 1
        assert len(simulate(ball, (q, 4.0), (0.0, 0.5), mode="flight").jumps) == 0
        assert not simulate(PENDULUM, (q, 1.0), (0.0, 1.0), mode="right", parameters={"c": 0.0}).jumps

    def test_a_named_mode_that_the_state_violates_goes_on_and_the_status_says_so(self):
        arc = simulate(PENDULUM, (1.0, 0.0), (0.0, 0.1), mode="left")
        assert not arc.jumps
        assert arc.status.ok
        assert "counts as crossed" in arc.status.message

    def test_mode_is_found_from_the_state(self):
        assert simulate(PENDULUM, (1.0, 0.0), (0.0, 0.1)).mode[0] == "right"
        assert simulate(PENDULUM, (0.0, 0.0), (0.0, 0.1)).mode[0] == "left"
        assert simulate(PENDULUM, (0.3, 1.0), (0.0, 0.1)).mode[0] == "right"
        assert simulate(PENDULUM, (0.3, -1.0), (0.0, 0.1)).mode[0] == "left"


class TestEnds:
    def test_an_event_exactly_at_the_end_belongs_to_the_run(self):
        for t1 in (0.5, 1.0, 0.1, 1 / 3):
            clock = polynomial_motion(lambda t: 1.0 + 0 * t, direction=+1)
            arc = simulate(clock, (-t1, 0.0), (0.0, t1))
            assert len(arc.jumps) == 1
            assert arc.t[-1] == pytest.approx(t1, rel=1e-14)
            np.testing.assert_allclose(arc.x[-1], [0.0, 1.0], atol=1e-15)

    def test_an_event_at_the_end_is_not_repeated_by_the_next_run(self, ball):
        t = simulate(ball, (1.0, 0.0), (0.0, 1.0)).jumps[0].t
        first = simulate(ball, (1.0, 0.0), (0.0, t))
        assert len(first.jumps) == 1
        assert first.x[-1, 1] > 0
        assert np.all(np.diff(first.t) >= 0)

    def test_zero_length(self, ball):
        arc = simulate(ball, (1.0, 2.0), (0.3, 0.3), tangent=True)
        assert arc.status.ok
        np.testing.assert_allclose(arc.x[-1], [1.0, 2.0], rtol=1e-14)
        np.testing.assert_array_equal(arc.fundamental, np.eye(2))
        np.testing.assert_array_equal(arc(0.3), arc.x[-1])
        fired = simulate(ball, (0.0, -1.0), (0.3, 0.3), mode="flight")
        assert len(fired.jumps) == 1
        np.testing.assert_allclose(fired(0.3), [0.0, 0.8], rtol=1e-14)

    def test_limit_of_jumps(self, ball):
        arc = simulate(ball, (1.0, 0.0), (0.0, 3.0), max_jumps=2)
        assert arc.status.code == StatusCode.MAX_JUMPS
        assert "limit of jumps was reached at t = 1.7519" in arc.status.message
        assert len(arc.jumps) == 2

    def test_limit_of_steps(self, oscillator):
        arc = simulate(oscillator, (0.0, 0.0), (0.0, 100.0), solver=hybrid.DOP853(max_steps=20))
        assert arc.status.code == StatusCode.MAX_STEPS
        assert arc.steps == 20
        assert 0 < arc.t[-1] < 100

    def test_accumulation(self, ball):
        arc = simulate(ball, (1.0, 0.0), (0.0, 10.0))
        assert arc.status.code == StatusCode.ACCUMULATION
        assert "bounce" in arc.status.message
        assert "Add a mode for the limit" in arc.status.remedy
        assert arc.t[-1] == pytest.approx(BALL["accumulation"], abs=1e-7)

    @pytest.mark.parametrize("end", [5.0, 1e3, 1e6, 1e9, 1e12])
    def test_accumulation_is_found_however_far_the_end(self, ball, end):
        arc = simulate(ball, (1.0, 0.0), (0.0, end))
        assert arc.status.code == StatusCode.ACCUMULATION
        assert arc.t[-1] == pytest.approx(BALL["accumulation"], abs=1e-9)

    @pytest.mark.parametrize("direction", [-1, 0])
    def test_an_inelastic_ball_comes_to_rest_at_once(self, ball, direction):
        (bounce,) = ball.transitions
        guard = attrs.evolve(bounce.guard, direction=direction)
        plastic = attrs.evolve(ball, transitions=[attrs.evolve(bounce, guard=guard)])
        arc = simulate(plastic, (1.0, 0.0), (0.0, 10.0), parameters={"e": 0.0})
        assert arc.status.code == StatusCode.ACCUMULATION
        assert arc.t[-1] == pytest.approx(FALL)

    @pytest.mark.parametrize("gap", [0.0, 1.0])
    def test_stuck(self, gap):
        """Fields that point towards each other leave no mode for the state."""
        stuck = HybridSystem(
            state=("x",),
            modes=[Mode("left", lambda t, x, p: (1.0,)), Mode("right", lambda t, x, p: (-1.0,))],
            transitions=[
                Transition("left", "right", Guard(lambda t, x, p: x.x, +1)),
                Transition("right", "left", Guard(lambda t, x, p: x.x, -1)),
            ],
        )
        arc = simulate(stuck, (-gap,), (0.0, 3.0), mode="left")
        assert arc.status.code == StatusCode.STUCK
        assert arc.t[-1] == pytest.approx(gap, abs=1e-12)
        assert "the fields on both sides point towards the guard" in arc.status.message
        assert "'left->right'" in arc.status.message
        assert "'right->left'" in arc.status.message
        assert "filippov" in arc.status.remedy

    def test_a_field_that_is_nan_beyond_a_point(self):
        system = HybridSystem(state=("x",), modes=[Mode("a", lambda t, x, p: (-np.sqrt(x.x - 0.5),))])
        arc = simulate(system, (0.6,), (0.0, 10.0))
        assert arc.status.code in (StatusCode.NON_FINITE, StatusCode.SUCCESS, StatusCode.STEP_TOO_SMALL)
        assert np.all(np.isfinite(arc.x))
        system = HybridSystem(state=("x",), modes=[Mode("a", lambda t, x, p: (-1 / np.sqrt(1 - t),))])
        arc = simulate(system, (0.6,), (0.0, 2.0))
        assert not arc.status.ok
        assert arc.t[-1] == pytest.approx(1.0, abs=1e-3)
        assert np.all(np.isfinite(arc.x))

    def test_a_field_that_is_nan_at_the_start(self):
        system = HybridSystem(state=("x",), modes=[Mode("a", lambda t, x, p: (np.log(x.x),))])
        arc = simulate(system, (-1.0,), (0.0, 1.0))
        assert arc.status.code == StatusCode.NON_FINITE
        assert "at t = 0 in mode 'a'" in arc.status.message

    def test_a_blow_up_in_finite_time(self):
        system = HybridSystem(state=("x",), modes=[Mode("a", lambda t, x, p: (x.x**2,))])
        arc = simulate(system, (1.0,), (0.0, 2.0))
        assert not arc.status.ok
        assert arc.t[-1] == pytest.approx(1.0, abs=1e-6)

    def test_a_reset_to_nan(self):
        system = attrs.evolve(
            bouncing_ball(),
            transitions=[
                Transition("flight", "flight", Guard(lambda t, x, p: x.q, -1),
                           Reset(lambda t, x, p: (0.0, np.sqrt(x.v))), name="bad")
            ],
        )  # fmt: skip
        arc = simulate(system, (1.0, 0.0), (0.0, 1.0))
        assert arc.status.code == StatusCode.NON_FINITE
        assert arc.t[-1] == pytest.approx(FALL)
