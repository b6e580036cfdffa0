"""Runs compared with exact answers, and changes that must not affect a run."""

import math
from concurrent.futures import ThreadPoolExecutor

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate
from models import bouncing_ball
from tests.hybrid.systems import BALL_SYSTEM, OSCILLATOR_SYSTEM, PENDULUM, pendulum
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
BALL = reference("bouncing_ball")
FLIGHT = reference("impact_oscillator")["flight"]
FALL = math.sqrt(2 / 9.81)
BENT = pendulum(lambda t, x, p: np.sin(x.q) - np.sin(p.c))
CROSSED = pendulum(both=True)


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

    @pytest.mark.parametrize("end", [1e99, 1e101, 1e150, 1e300])
    def test_to_the_end_of_time(self, end):
        steady = HybridSystem(state=("y", "v"), modes=[Mode("run", lambda t, x, p: (x.v, 0.0))])
        arc = simulate(steady, (0.0, 1.0), (0.0, end))
        assert arc.status.ok
        assert np.allclose(arc.x[-1], (end, 1.0), rtol=1e-12)

    def test_no_transitions_at_all(self):
        decay = HybridSystem(state=("x",), modes=[Mode("only", lambda t, x, p: (-x.x,))])
        arc = simulate(decay, (2.0,), (0.0, 3.0), tangent=True)
        assert arc.x[-1, 0] == pytest.approx(2 * math.exp(-3), rel=1e-10)
        assert arc.fundamental[0, 0] == pytest.approx(math.exp(-3), rel=1e-9)

    def test_many_states(self):
        """A chain of twelve masses: its energy, and a jump that mirrors it."""
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

    def test_tangent_vectors_of_many_states(self):
        """Most cells of the Jacobian of a chain are zero; its fundamental matrix is an exponential."""
        n = 12
        stiffness = np.diag(np.full(n - 1, 1.0), 1) + np.diag(np.full(n - 1, 1.0), -1) - 2.0 * np.eye(n)
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [stiffness, np.zeros((n, n))]])

        def field(t, x, p):
            q = np.concatenate([np.zeros_like(x[:1]), x[:n], np.zeros_like(x[:1])])
            return np.concatenate([x[n:], q[2:] - 2 * q[1:-1] + q[:-2]])

        chain = HybridSystem(state=2 * n, modes=[Mode("swing", field)])
        for solver in (hybrid.Taylor(), hybrid.RadauIIA(rtol=1e-9)):
            arc = simulate(chain, np.linspace(0.3, 1.0, 2 * n), (0.0, 2.0), solver=solver, tangent=True)
            np.testing.assert_allclose(arc.fundamental, expm(2.0 * matrix), rtol=0, atol=1e-7)

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


class TestStays:
    """The length of the last stay in a mode sets the step, not the result."""

    @staticmethod
    def turn(lengths):
        """A clock that stays in ``run`` for two alternating lengths, and in ``rest`` for a second."""
        first, second = lengths
        return HybridSystem(
            state=("x", "length"),
            modes=[Mode(name, lambda t, x, p: (1.0, 0.0)) for name in ("run", "rest")],
            transitions=[
                Transition(
                    "run",
                    "rest",
                    Guard(lambda t, x, p: x.x - x.length, direction=1),
                    Reset(lambda t, x, p: (0.0, first + second - x.length)),
                ),
                Transition(
                    "rest",
                    "run",
                    Guard(lambda t, x, p: x.x - 1.0, direction=1),
                    Reset(lambda t, x, p: (0.0, x.length)),
                ),
            ],
        )

    @pytest.mark.parametrize("t0", [0.0, 1e6])
    @pytest.mark.parametrize("lengths", [(1.0, 30.0), (1e-3, 1e3), (1e-9, 1.0), (1e-12, 1.0)])
    def test_stays_of_two_lengths(self, lengths, t0):
        arc = simulate(self.turn(lengths), (0.0, lengths[0]), (t0, t0 + 2.5 * (2 + sum(lengths))), mode="run")
        assert arc.status.ok
        stays = [*lengths, *lengths]
        assert len(arc.jumps) >= 2 * len(stays)
        exact = t0 + np.cumsum([span for stay in stays for span in (stay, 1.0)])
        np.testing.assert_allclose(arc.jumps.t[: 2 * len(stays)], exact, rtol=1e-14, atol=1e-14)
        assert arc.steps <= 3 * len(arc.jumps) + 2


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
    """Jumps before and after the cut, and the end, of a run cut at ``split``."""
    first = simulate(system, x0, (0.0, split), mode=mode, solver=TIGHT)
    second = simulate(system, first.x[-1], (split, end), mode=first.mode[-1], solver=TIGHT)
    return len(first.jumps) + len(second.jumps), second.x[-1]


class TestSplit:
    """A run that is cut anywhere and resumed is the same run."""

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

    @pytest.mark.as_given
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


class TestPeriodicTime:
    def test_a_million_radians_keep_their_phase(self, oscillator):
        """Orbit with one impact per period: the impact has the same phase at the end as at the start."""
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


class TestRunsKnowNothingOfOneAnother:
    @pytest.mark.parametrize("samples", [None, [9.0]])
    @pytest.mark.parametrize("solver", [None, hybrid.DOP853(), hybrid.RadauIIA()])
    def test_the_same_run_again(self, oscillator, samples, solver):
        def arc(x0, parameters=None):
            return simulate(
                oscillator,
                x0,
                (0.0, 9.0),
                parameters=parameters,
                solver=solver,
                tangent=True,
                samples=samples,
                keep_jumps=True,
            )

        first = arc((0.1, 0.3))
        arc((-1.0, 5.0), {"r": 0.3})
        again = arc((0.1, 0.3))
        for name in ("t", "j", "x", "parameters", "fundamental"):
            np.testing.assert_array_equal(getattr(again, name), getattr(first, name))
        np.testing.assert_array_equal(again.jumps.saltation, first.jumps.saltation)
        assert (again.steps, again.rejected) == (first.steps, first.rejected)

    def test_what_is_written_into_an_arc_stays_there(self, oscillator):
        first = simulate(oscillator, (0.1, 0.3), (0.0, 9.0), tangent=True)
        kept = first.x.copy(), first.parameters.copy()
        for array in (first.x, first.fundamental, first.jumps.x_plus):
            array[:] = np.nan
        first.propagators.clear()
        first.parameters.clear()
        again = simulate(oscillator, (0.1, 0.3), (0.0, 9.0), tangent=True)
        np.testing.assert_array_equal(again.x, kept[0])
        assert again.parameters == kept[1]
        assert np.isfinite(again.fundamental).all()
        assert again.propagators

    @pytest.mark.parametrize("samples", [None, [1.0, 7.0, 9.0]])
    @pytest.mark.parametrize("t_end", [9.0, 900.0])
    def test_later_runs_leave_an_arc_as_it_is(self, oscillator, samples, t_end):
        """Later runs may reuse the memory of an earlier run."""

        def everything(arc):
            jumps = arc.jumps
            columns = [arc.t, arc.j, arc.x, arc.fundamental, jumps.t, jumps.x_minus, jumps.x_plus]
            dense = [] if samples else [arc(np.linspace(0.0, t_end, 101))]
            return [*columns, jumps.transversality, jumps.kind, *dense]

        kept_jumps = {"tangent": True, "samples": samples, "keep_jumps": True}
        first = simulate(oscillator, (0.1, 0.3), (0.0, t_end), **kept_jumps)
        before = [np.array(each) for each in everything(first)]
        for x0 in ((-1.0, 5.0), (0.0, -2.0), (0.5, 0.5)):
            simulate(oscillator, x0, (0.0, t_end), **kept_jumps)
        for kept, now in zip(before, everything(first), strict=True):
            np.testing.assert_array_equal(kept, now)

    def test_in_threads_at_once(self, oscillator):
        def end(start):
            return simulate(oscillator, (start, 0.3), (0.0, 40.0), samples=[20.0, 40.0]).x

        starts = np.linspace(-1.0, 0.9, 200)
        with ThreadPoolExecutor(8) as pool:
            together = list(pool.map(end, starts))
        np.testing.assert_array_equal(together, [end(start) for start in starts])


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
            ({"t_span": 3.0}, r"t_span must be a pair \(t0, t1\) of numbers; got 3.0"),
            ({"mode": "fligth"}, "Mode 'fligth' does not exist. Modes: flight. Did you mean 'flight'?"),
            ({"parameters": {"h": 1.0}}, "Parameter 'h' does not exist. Parameters: g, e"),
            ({"parameters": {"g": math.inf}}, "Parameter 'g' must be finite"),
            ({"parameters": {"g": "big"}}, "Parameter 'g' must be a number"),
            ({"solver": "DOP853"}, "solver must be a solver object; got 'DOP853'"),
            ({"tangent": np.eye(3)}, r"tangent must be True or a finite matrix of shape \(2, k\)"),
            (
                {"samples": [0.2, 1.0, 0.5]},
                r"samples must be increasing times; got samples\[1\] = 1.0 before samples\[2\] = 0.5",
            ),
            ({"samples": [0.2, math.nan]}, r"samples must be finite; got samples\[1\] = nan"),
            ({"samples": [-1.0, 0.5]}, r"samples must lie in t_span, \[0.0, .*\]; got times from -1.0"),
            ({"max_jumps": -1}, "max_jumps must be a whole number of at least 0; got -1"),
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
