"""Runs against exact answers, and what must not change a run."""

import math

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate
from models import bouncing_ball, impact_oscillator
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
LONG_STEPS = hybrid.DOP853(rtol=1.0, atol=1.0)
BALL = reference("bouncing_ball")
FLIGHT = reference("impact_oscillator")["flight"]
FALL = math.sqrt(2 / 9.81)


def pendulum(guard=lambda t, x, p: x.q - p.c, *, both=False, names=("left", "right"), order=1):
    """A pendulum cut at ``q = c``, where nothing happens."""

    def field(t, x, p):
        return x.v, -np.sin(x.q)

    left, right = names
    transitions = [
        Transition(left, right, Guard(guard, 0 if both else +1), name="forth"),
        Transition(right, left, Guard(guard, 0 if both else -1), name="back"),
    ]
    return HybridSystem(
        state=("q", "v"),
        parameters={"c": 0.3},
        modes=[Mode(left, field), Mode(right, field)],
        transitions=transitions[::order],
    )


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


PENDULUM = pendulum()
BENT = pendulum(lambda t, x, p: np.sin(x.q) - np.sin(p.c))
CROSSED = pendulum(both=True)
BALL_SYSTEM = bouncing_ball()
OSCILLATOR_SYSTEM = impact_oscillator()


@pytest.fixture
def ball():
    return BALL_SYSTEM


@pytest.fixture
def oscillator():
    return OSCILLATOR_SYSTEM


class TestExactAnswers:
    def test_ball(self, ball):
        arc = simulate(ball, BALL["x0"], (0.0, 3.9), solver=TIGHT)
        exact = [t for t in BALL["t"] if t < 3.9]
        np.testing.assert_allclose(arc.jumps.t, exact, rtol=1e-13)
        np.testing.assert_allclose(arc.jumps.x_minus[:, 1], BALL["v_minus"][: len(exact)], rtol=1e-12)
        t, v = arc.jumps[-1].t, arc.jumps[-1].x_plus[1]
        end = 3.9 - t
        np.testing.assert_allclose(arc.x[-1], [v * end - 9.81 * end**2 / 2, v - 9.81 * end], atol=1e-13)

    def test_impact_oscillator(self, oscillator):
        arc = simulate(oscillator, FLIGHT["x0"], (0.0, FLIGHT["t_end"]), solver=TIGHT)
        np.testing.assert_allclose(arc.jumps.t, FLIGHT["t"], rtol=1e-11)
        np.testing.assert_allclose(arc.x[-1], FLIGHT["x_end"], atol=1e-10)

    def test_no_transitions_at_all(self):
        decay = HybridSystem(state=("x",), modes=[Mode("only", lambda t, x, p: (-x.x,))])
        arc = simulate(decay, (2.0,), (0.0, 3.0), tangent=True)
        assert arc.x[-1, 0] == pytest.approx(2 * math.exp(-3), rel=1e-10)
        assert arc.fundamental[0, 0] == pytest.approx(math.exp(-3), rel=1e-9)

    def test_many_states(self):
        """A chain of twelve: its energy, and a jump that mirrors it."""
        n = 6

        def field(t, x, p):
            q = np.concatenate([np.zeros_like(x[:1]), x[:n], np.zeros_like(x[:1])])
            return np.concatenate([x[n:], q[2:] - 2 * q[1:-1] + q[:-2]])

        chain = HybridSystem(
            state=12,
            modes=[Mode("swing", field)],
            transitions=[
                Transition("swing", "swing", Guard(lambda t, x, p: x[0], -1), Reset(lambda t, x, p: -x))
            ],
        )
        x0 = np.linspace(0.3, 1.0, 12)
        arc = simulate(chain, x0, (0.0, 60.0), solver=TIGHT, tangent=np.eye(12)[:, :2])

        def energy(x):
            return np.sum(x[n:] ** 2) + np.sum(np.diff(np.concatenate([[0.0], x[:n], [0.0]])) ** 2)

        assert len(arc.jumps) > 2
        assert len(simulate(chain, x0, (0.0, 60.0), samples=[60.0]).x[0]) == 12
        assert arc.fundamental.shape == (12, 2)
        assert energy(arc.x[-1]) == pytest.approx(energy(x0), rel=1e-10)

    def test_functions_that_tracing_cannot_follow(self):
        def field(t, x, p):
            pull = 0.0
            if x.v < 100.0:
                pull = -p.g
            return x.v, pull

        mode = Mode("flight", field, jacobian=lambda t, x, p: ((0.0, 1.0), (0.0, 0.0)))
        opaque = attrs.evolve(bouncing_ball(), modes=[mode])
        arc = simulate(opaque, (1.0, 0.0), (0.0, 1.0), solver=TIGHT, tangent=True)
        assert arc.jumps[0].t == pytest.approx(FALL, rel=1e-12)
        assert arc.jumps[0].saltation[1, 0] == pytest.approx(BALL["saltation"][0][1][0], rel=1e-9)


class TestInvariance:
    @pytest.mark.parametrize("factor", [1e-12, 1e-3, 7.0, 1e9])
    def test_scale_of_a_guard(self, factor):
        arcs = [
            simulate(pendulum(lambda t, x, p, c=c: c * (x.q - p.c)), (1.0, 0.5), (0.0, 30.0), mode="right")
            for c in (1.0, factor)
        ]
        np.testing.assert_allclose(arcs[1].jumps.t, arcs[0].jumps.t, atol=1e-12)
        np.testing.assert_allclose(arcs[1].x[-1], arcs[0].x[-1], atol=1e-12)

    def test_names_and_order(self):
        base = simulate(pendulum(), (1.0, 0.5), (0.0, 30.0), mode="right")
        other = simulate(pendulum(names=("b", "a"), order=-1), (1.0, 0.5), (0.0, 30.0), mode="a")
        np.testing.assert_array_equal(other.jumps.t, base.jumps.t)
        np.testing.assert_array_equal(other.x, base.x)

    @pytest.mark.parametrize(
        "guard",
        [
            lambda t, x, p: x.q - p.c,
            lambda t, x, p: np.sin(x.q / 2) - np.sin(p.c / 2),
            lambda t, x, p: (x.q - p.c) * (2 + x.v**2),
            lambda t, x, p: np.abs(x.q - p.c) * np.sign(x.q - p.c) * np.exp(x.v) + 0 * t,
            lambda t, x, p: np.minimum(x.q - p.c, 3 + x.v),
        ],
        ids=["affine", "sine", "product", "kinked", "minimum"],
    )
    @pytest.mark.parametrize("both", [False, True])
    def test_cutting_a_smooth_flow_changes_nothing(self, guard, both):
        whole = simulate(pendulum(lambda t, x, p: x.q - 99.0), (1.0, 0.5), (0.0, 30.0), mode="left",
                         solver=TIGHT, tangent=True)  # fmt: skip
        cut = simulate(pendulum(guard, both=both), (1.0, 0.5), (0.0, 30.0), mode="right",
                       solver=TIGHT, tangent=True)  # fmt: skip
        crossings = np.diff(np.sign(whole(np.linspace(0, 30, 20001))[:, 0] - 0.3)) != 0
        assert len(cut.jumps) == crossings.sum()
        np.testing.assert_allclose(cut.x[-1], whole.x[-1], atol=1e-10)
        np.testing.assert_allclose(cut.fundamental, whole.fundamental, atol=1e-8)
        np.testing.assert_allclose(cut.jumps.saltation, np.broadcast_to(np.eye(2), (len(cut.jumps), 2, 2)),
                                   atol=1e-12)  # fmt: skip

    def test_elastic_runs_go_back_to_where_they_started(self, oscillator):
        forth = {"c": 0.0, "A": 0.0, "r": 1.0, "d": 0.3}
        start = (-0.4, 1.1)
        arc = simulate(oscillator, start, (0.0, 40.0), parameters=forth, solver=TIGHT)
        assert len(arc.jumps) > 8
        x, v = arc.x[-1]
        back = simulate(oscillator, (x, -v), (0.0, 40.0), parameters=forth, solver=TIGHT)
        np.testing.assert_allclose(back.x[-1], [start[0], -start[1]], atol=1e-9)
        assert len(back.jumps) == len(arc.jumps)

    def test_negated_fields_run_backwards(self):
        ahead = pendulum()
        back = attrs.evolve(
            ahead,
            modes=[Mode(m.name, lambda t, x, p: (-x.v, np.sin(x.q))) for m in ahead.modes],
            transitions=[
                Transition("left", "right", Guard(lambda t, x, p: x.q - p.c, +1)),
                Transition("right", "left", Guard(lambda t, x, p: x.q - p.c, -1)),
            ],
        )
        arc = simulate(ahead, (1.0, 0.5), (0.0, 20.0), mode="right", solver=TIGHT)
        returned = simulate(back, arc.x[-1], (0.0, 20.0), mode=arc.mode[-1], solver=TIGHT)
        np.testing.assert_allclose(returned.x[-1], [1.0, 0.5], atol=1e-9)
        assert len(returned.jumps) == len(arc.jumps)


def resumed(system, x0, split, end, mode=None):
    """The jumps before and after, and the end, of a run cut at ``split``."""
    first = simulate(system, x0, (0.0, split), mode=mode, solver=TIGHT)
    second = simulate(system, first.x[-1], (split, end), mode=first.mode[-1], solver=TIGHT)
    return len(first.jumps) + len(second.jumps), second.x[-1]


class TestSplit:
    """A run cut anywhere and taken up again is the same run."""

    @settings(max_examples=40)
    @given(st.floats(0.0, 3.0))
    def test_ball(self, split):
        jumps, end = resumed(BALL_SYSTEM, (1.0, 0.0), split, 3.0)
        whole = simulate(BALL_SYSTEM, (1.0, 0.0), (0.0, 3.0), solver=TIGHT)
        assert jumps == len(whole.jumps)
        np.testing.assert_allclose(end, whole.x[-1], atol=1e-9)

    @settings(max_examples=40)
    @given(st.floats(0.0, 60.0))
    def test_oscillator(self, split):
        jumps, end = resumed(OSCILLATOR_SYSTEM, (0.0, 0.0), split, 60.0)
        whole = simulate(OSCILLATOR_SYSTEM, (0.0, 0.0), (0.0, 60.0), solver=TIGHT)
        assert jumps == len(whole.jumps)
        np.testing.assert_allclose(end, whole.x[-1], atol=1e-9)

    @pytest.mark.parametrize("ulps", [-3, -1, 0, 1, 3])
    def test_exactly_at_a_jump(self, ball, oscillator, ulps):
        cases = (
            (ball, (1.0, 0.0), None, 3.0),
            (oscillator, (0.0, 0.0), None, 40.0),
            (PENDULUM, (1.0, 0.5), "right", 20.0),
            (BENT, (1.0, 0.5), "right", 20.0),
            (CROSSED, (1.0, 0.5), "right", 20.0),
        )
        for system, x0, mode, end in cases:
            whole = simulate(system, x0, (0.0, end), mode=mode, solver=TIGHT)
            for t in whole.jumps.t:
                split = t + ulps * np.spacing(t)
                jumps, x = resumed(system, x0, split, end, mode)
                assert jumps == len(whole.jumps), (system.name, t)
                np.testing.assert_allclose(x, whole.x[-1], atol=1e-9)

    @pytest.mark.parametrize("system", ["ball", "oscillator"])
    def test_after_the_limit_of_jumps(self, system, request):
        system = request.getfixturevalue(system)
        end = 2.5 if system is BALL_SYSTEM else 40.0
        whole = simulate(system, (0.5, 0.0), (0.0, end), solver=TIGHT)
        for limit in range(len(whole.jumps)):
            first = simulate(system, (0.5, 0.0), (0.0, end), solver=TIGHT, max_jumps=limit)
            assert first.status.code == StatusCode.MAX_JUMPS
            assert len(first.jumps) == limit
            second = simulate(system, first.x[-1], (first.t[-1], end), mode=first.mode[-1], solver=TIGHT)
            assert limit + len(second.jumps) == len(whole.jumps)
            np.testing.assert_allclose(second.x[-1], whole.x[-1], atol=1e-9)


class TestCrossings:
    @pytest.mark.parametrize(
        ("gap", "bent"), [(1e-2, False), (1e-4, False), (1e-6, False), (1e-2, True), (1e-4, True)]
    )
    def test_two_in_one_step(self, gap, bent):
        """``x = (t - 1)(t - 1 - gap)`` is followed exactly, in one step of any length."""
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
        """A puck in the corner turns back on itself."""
        arc = simulate(box(direction), (start, start, 1.0, 1.0), (0.0, 6.0), mode="slide")
        assert [jump.transition for jump in arc.jumps[:4]] == ["right", "top", "left", "bottom"]
        np.testing.assert_allclose(arc.jumps.t, np.repeat(1 - start + np.arange(6), 2), atol=1e-12)
        np.testing.assert_allclose(arc.x[-1], [start, start, 1.0, 1.0], atol=1e-12)

    @pytest.mark.parametrize("step", [0.1, np.inf])
    def test_a_reset_beyond_another_guard_fires_it_however_long_the_step(self, step):
        """Flow alone would have crossed the second guard later in the same step."""
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
        """Crossings anywhere near the joint of two coarse steps fire once each."""
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

    @pytest.mark.parametrize("turns", range(1, 7))
    def test_with_rounding_for_an_acceleration(self, turns):
        """``sin(2 pi)`` is not quite zero, on either side of it; the third derivative of ``x`` decides."""
        t0 = 2 * np.pi * turns
        for sign, times in ((1.0, []), (-1.0, [t0])):
            system = HybridSystem(
                state=("x", "v"),
                modes=[
                    Mode("run", lambda t, x, p, s=sign: (x.v, s * np.sin(t))),
                    Mode("beyond", lambda t, x, p: (x.v, 0.0)),
                ],
                transitions=[Transition("run", "beyond", Guard(lambda t, x, p: x.x, direction=-1))],
            )
            arc = simulate(system, (0.0, 0.0), (t0, t0 + 3.0), mode="run")
            np.testing.assert_allclose(arc.jumps.t, times, atol=1e-12)

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
        """What a run that ended on the guard leaves there is a start on the guard."""
        assert len(simulate(ball, (q, -4.0), (0.0, 0.5), mode="flight").jumps) == 1
        assert len(simulate(ball, (q, 4.0), (0.0, 0.5), mode="flight").jumps) == 0
        assert not simulate(PENDULUM, (q, 1.0), (0.0, 1.0), mode="right", parameters={"c": 0.0}).jumps

    def test_violating_a_mode_that_names_it_fires_at_once(self):
        arc = simulate(PENDULUM, (1.0, 0.0), (0.0, 0.1), mode="left")
        assert [(jump.t, jump.target) for jump in arc.jumps] == [(0.0, "right")]

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
            assert arc.t[-1] == t1
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
        np.testing.assert_array_equal(arc.x[-1], [1.0, 2.0])
        np.testing.assert_array_equal(arc.fundamental, np.eye(2))
        np.testing.assert_array_equal(arc(0.3), [1.0, 2.0])
        fired = simulate(ball, (0.0, -1.0), (0.3, 0.3), mode="flight")
        assert len(fired.jumps) == 1
        np.testing.assert_array_equal(fired(0.3), [0.0, 0.8])

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
        """Fields that point at each other leave no way on."""
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
        assert "the fields on both sides point at the guard" in arc.status.message
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


class TestPeriodicTime:
    def test_a_million_radians_keep_their_phase(self, oscillator):
        """Period-1 orbit, one impact a period: the impact's phase is the same at the end as at the start."""
        exact = reference("impact_oscillator")["orbits"][0]
        T = 2 * math.pi
        loose = hybrid.DOP853(rtol=1e-7, atol=1e-7)
        settled = simulate(oscillator, (0.0, 0.0), (0.0, 200 * T), samples=[200 * T]).x[-1]
        first = hybrid.stroboscopic_section(oscillator, settled, periods=1, transient=100, solver=loose)
        last = hybrid.stroboscopic_section(oscillator, settled, periods=1, transient=100_000, solver=loose)
        np.testing.assert_allclose(last.x, first.x, atol=1e-9)
        late = simulate(oscillator, settled, (1e5 * T, 1e5 * T + T))
        assert late.jumps[0].t - 1e5 * T == pytest.approx(exact["theta"], abs=1e-9)

    def test_period_or_not_the_run_is_the_same(self, oscillator):
        plain = attrs.evolve(oscillator, period=None)
        arcs = [simulate(s, (0.0, 0.0), (0.0, 100.0), solver=TIGHT) for s in (oscillator, plain)]
        np.testing.assert_allclose(arcs[0].jumps.t, arcs[1].jumps.t, atol=1e-10)
        np.testing.assert_allclose(arcs[0].x[-1], arcs[1].x[-1], atol=1e-9)

    @pytest.mark.parametrize("shift", [-7, -1, 3, 1000])
    def test_whole_periods_shift_nothing_but_time(self, oscillator, shift):
        T = 2 * math.pi
        base = simulate(oscillator, (0.0, 0.0), (0.5, 30.0), solver=TIGHT)
        moved = simulate(oscillator, (0.0, 0.0), (0.5 + shift * T, 30.0 + shift * T), solver=TIGHT)
        np.testing.assert_allclose(moved.jumps.t - shift * T, base.jumps.t, atol=1e-11)
        np.testing.assert_allclose(moved.x[-1], base.x[-1], atol=1e-11)


class TestMemory:
    def test_of_a_run_that_keeps_samples_does_not_grow(self, oscillator):
        import tracemalloc

        peaks = []
        for periods in (500, 500, 2000):
            tracemalloc.start()
            end = periods * 2 * math.pi
            simulate(oscillator, (0.0, 0.0), (0.0, end), samples=[end], max_jumps=10**9)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        # Jumps are kept, about 100 bytes each; steps, of kilobytes, are not.
        assert peaks[2] - peaks[1] < 1500 * 300


class TestTangents:
    def test_columns_are_carried_one_by_one(self, oscillator):
        vectors = np.array([[1.0, 0.3, -2.0], [0.5, 0.0, 1.0]])
        whole = simulate(oscillator, (0.0, 0.0), (0.0, 30.0), tangent=True, solver=TIGHT).fundamental
        some = simulate(oscillator, (0.0, 0.0), (0.0, 30.0), tangent=vectors, solver=TIGHT).fundamental
        one = simulate(oscillator, (0.0, 0.0), (0.0, 30.0), tangent=vectors[:, 0], solver=TIGHT).fundamental
        np.testing.assert_allclose(some, whole @ vectors, rtol=1e-8)
        np.testing.assert_allclose(one[:, 0], some[:, 0], rtol=1e-8)

    def test_fundamental_matrix_is_the_derivative_of_the_end(self, oscillator):
        start, span, step = np.array([0.1, 0.2]), (0.0, 33.0), 1e-6
        arc = simulate(oscillator, start, span, tangent=True, solver=TIGHT)
        assert len(arc.jumps) > 3
        for i, shift in enumerate(step * np.eye(2)):
            ahead, behind = (simulate(oscillator, start + s * shift, span, solver=TIGHT) for s in (1, -1))
            np.testing.assert_allclose(
                (ahead.x[-1] - behind.x[-1]) / (2 * step), arc.fundamental[:, i], atol=1e-6
            )

    def test_no_tangents_unless_asked_for(self, ball):
        assert simulate(ball, (1.0, 0.0), (0.0, 1.0)).fundamental is None
        assert simulate(ball, (1.0, 0.0), (0.0, 1.0), tangent=False).fundamental is None


class TestBadArguments:
    @pytest.mark.parametrize(
        ("arguments", "text"),
        [
            ({"x0": (1.0,)}, r"x0 has shape \(1,\); the state needs shape \(2,\): q, v"),
            ({"x0": (1.0, math.nan)}, "x0: component 'v' must be finite; got nan"),
            ({"x0": "fast"}, "x0 must hold 2 numbers; got 'fast'"),
            ({"t_span": (1.0, 0.0)}, r"t_span must not run backwards; got \(1.0, 0.0\)"),
            ({"t_span": (0.0, math.inf)}, "t_span must be finite"),
            ({"t_span": 3.0}, r"t_span must be a pair \(t0, t1\); got 3.0"),
            ({"mode": "fligth"}, "Mode 'fligth' does not exist. Modes: flight. Did you mean 'flight'?"),
            ({"parameters": {"h": 1.0}}, "Parameter 'h' does not exist. Parameters: g, e"),
            ({"parameters": {"g": math.inf}}, "Parameter 'g' must be finite"),
            ({"parameters": {"g": "big"}}, "Parameter 'g' must be a number"),
            ({"solver": "DOP853"}, "solver must be a solver object; got 'DOP853'"),
            ({"tangent": np.eye(3)}, r"tangent must be True or a finite matrix of shape \(2, k\)"),
            ({"samples": [1.0, 0.5]}, "samples must be increasing times"),
            ({"samples": [-1.0, 0.5]}, r"samples must lie in t_span, \[0.0, 1.0\]; they run from -1.0"),
            ({"max_jumps": -1}, "max_jumps must be at least 0; got -1"),
            ({"x0": (-1.0, 0.0)}, "violates every mode: mode 'flight' is left through 'bounce'"),
        ],
    )
    def test_text(self, ball, arguments, text):
        call = {"x0": (1.0, 0.0), "t_span": (0.0, 1.0)} | arguments
        with pytest.raises(hybrid.ModelError, match=text):
            simulate(ball, **call)

    def test_no_system(self):
        with pytest.raises(hybrid.ArgumentError, match="system must be a HybridSystem; got"):
            simulate(bouncing_ball, (1.0, 0.0), (0.0, 1.0))

    def test_more_than_one_mode_allows_the_start(self):
        system = HybridSystem(
            state=("x",),
            modes=[Mode("a", lambda t, x, p: (1.0,)), Mode("b", lambda t, x, p: (-1.0,))],
            transitions=[
                Transition("a", "b", Guard(lambda t, x, p: x.x - 1, +1)),
                Transition("b", "a", Guard(lambda t, x, p: x.x + 1, -1)),
            ],
        )
        with pytest.raises(hybrid.ModelError, match=r"allowed in more than one mode: a, b\. Choose one"):
            simulate(system, (0.0,), (0.0, 1.0))

    def test_a_guard_that_is_not_defined(self):
        system = HybridSystem(
            state=("x",),
            modes=[Mode("a", lambda t, x, p: (1.0,))],
            transitions=[Transition("a", "a", Guard(lambda t, x, p: np.log(x.x)), name="log")],
        )
        with pytest.raises(hybrid.ModelError, match=r"Transition 'log': the guard is nan at t = 0.0"):
            simulate(system, (-1.0,), (0.0, 1.0))
