"""A run goes on from the end of another one as if it had not stopped."""

import pickle
from itertools import pairwise

import numpy as np
import pytest

import hybrid
import models
from hybrid import (
    DOP853,
    After,
    ArgumentError,
    At,
    Every,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Transition,
    Tsit5,
    from_equations,
    open_end,
    simulate,
)
from hybrid.simulation.trajectory import start

# A run that goes on from the end of another begins at the very numbers with which that ended.
pytestmark = pytest.mark.as_given


def chained():
    """A jump that sets off another one at the same instant."""
    return HybridSystem(
        state=("x", "y"),
        modes=[Mode(name, lambda t, x, p, s=s: (1.0, s)) for name, s in (("a", 0.0), ("b", 2.0), ("c", 5.0))],
        transitions=[
            Transition("a", "b", Guard(lambda t, x, p: x.x - 1, +1), Reset(lambda t, x, p: (x.x, x.y - 1))),
            Transition("b", "c", Guard(lambda t, x, p: x.y, -1)),
        ],
    )


def clocked():
    """All clocks at once, held components and a counter, forced with a period."""
    count = Reset(lambda t, x, p: {"n": x.n + 1, "u": 0.5 * x.u + x.x})
    return HybridSystem(
        state=("x",),
        held=("u",),
        counters=("n",),
        parameters={"T": 0.3, "rest": 0.45},
        modes=[
            Mode("run", lambda t, x, p: (x.u - x.x + np.cos(2 * np.pi * t),)),
            Mode("wait", lambda t, x, p: (-0.1 * x.x,)),
        ],
        transitions=[
            Transition("run", "run", Every("T"), count, name="sample"),
            Transition("run", "wait", Guard(lambda t, x, p: x.x - 0.9, +1), name="full"),
            Transition("wait", "run", After("rest"), name="again"),
            Transition("wait", "wait", At([0.7, 1.9, 3.3]), count, name="listed"),
        ],
        start="run",
        period=1.0,
    )


def rubbing():
    """A system whose modes are made when a run needs them."""
    return from_equations(
        lambda t, x, p: (x.v, -x.q - 0.1 * np.sign(x.v) - 0.5 * np.floor(x.q) + 3.0 * np.sin(t)),
        state=("q", "v"),
    )


# By name: a system, its start, the mode there, and the end of the time.
RUNS = {
    "impacts": (models.impact_oscillator, (0.0, 0.0), None, 60.0),
    "impacts that accumulate": (models.bouncing_ball, (1.0, 0.0), None, 6.0),
    "chatter, rest and lift-off": (models.bouncing_table, (0.01, 0.0), "flight", 3.0),
    "stick and slip": (models.stick_slip, (0.5, 0.2), None, 40.0),
    "stick and slip with Coulomb's friction": (models.coulomb_stick_slip, (0.5, 0.2), "stick", 40.0),
    "dry friction": (models.dry_friction_oscillator, (0.1, 0.0), None, 40.0),
    "a soft contact": (models.vibroimpact, (-0.01, 0.0, 0.5, -0.3), "free", 5.0),
    "a sampled loop": (models.sampled_loop, {"y": 0.0}, None, 3.0),
    "dwell times": (models.refractory_neuron, {"u": -65.0}, None, 60.0),
    "listed times": (models.dosing_schedule, (0.0, 0.0), None, 96.0),
    "a table in time": (models.battery_cell, (0.2, 0.0), None, 1000.0),
    "a clock and a guard": (models.buck_converter, (12.0, 0.6, 0.0), "off", 8e-3),
    "all clocks": (clocked, {"x": 0.2, "u": 1.0}, None, 6.0),
    "collisions of three": (models.ball_chain, (-1.0, -0.3, 1.0, 0.5, 0.0, -0.5), None, 4.0),
    "a run on foot": (models.slip_hopper, (0.0, 0.95, 5.1, 0.0), "descent", 2.0),
    "two jumps at one instant": (chained, (0.0, 0.5), "a", 2.0),
    "modes made on the way": (rubbing, (3.2, 0.0), None, 20.0),
}
SHARES = (0.137, 0.47, 0.83)


def pieces(system, x0, mode, times, *, change=lambda end: end, **options):
    """The arcs of a run from 0 that stops at times, each from the end of the one before."""
    arcs = [simulate(system, x0, (0.0, times[0]), mode=mode, **options)]
    for t in times[1:]:
        if not arcs[-1].status.ok:
            break
        end = change(arcs[-1].end)
        arcs.append(simulate(arcs[-1].system, end, (end.t, t), **options))
    return arcs


def fired(arcs):
    return [str(name) for arc in arcs for name in arc.jumps.transition]


def close(x, y, rtol=1e-7):
    np.testing.assert_allclose(x, y, rtol=rtol, atol=rtol * max(1.0, np.abs(y).max()))


@pytest.mark.parametrize("name", RUNS)
class TestAsIfItHadNotStopped:
    def test_the_jumps_and_the_end_are_those_of_one_run(self, name):
        """Also with a sample at the joint: the states there agree, and so do those that follow."""
        factory, x0, mode, t1 = RUNS[name]
        system, times = factory(), [*(share * t1 for share in SHARES), t1]
        whole, parts = simulate(system, x0, (0.0, t1), mode=mode), pieces(system, x0, mode, times)
        assert fired(parts) == fired([whole])
        close(np.concatenate([each.jumps.t for each in parts]), whole.jumps.t)
        assert parts[-1].status.code == whole.status.code
        assert parts[-1].t[-1] == pytest.approx(whole.t[-1], rel=1e-9)
        close(parts[-1].x[-1], whole.x[-1])
        for before, after in pairwise(parts):
            np.testing.assert_array_equal(after.x[0], before.x[-1])
            assert after.t[0] == pytest.approx(before.t[-1], rel=1e-14)
            assert after.mode[0] == before.mode[-1]
            close(before.x[-1], whole(before.t[-1]))
            within = np.linspace(after.t[0], after.t[-1], 9)[1:-1]
            # At a jump rounding decides on the side.
            far = [t for t in within if np.abs(whole.jumps.t - t).min(initial=np.inf) > 1e-6 * t1]
            close(after(far), whole(far))

    @pytest.mark.parametrize("solver", [None, DOP853()], ids=["Taylor", "DOP853"])
    def test_each_bit_is_that_of_a_run_which_stops_there(self, name, solver):
        """Of one that is advanced to each of the times in turn and forgets nothing.

        A Runge-Kutta method takes the rates at the end of its last step for the next one; a run that goes on
        computes them anew, at a time that is rounded another way.
        """
        factory, x0, mode, t1 = RUNS[name]
        system, times = factory(), [*(share * t1 for share in SHARES), t1]
        parts = pieces(system, x0, mode, times, solver=solver)
        system = parts[-1].system
        run = start(system, x0, 0.0, mode=mode, solver=solver, horizon=times[0])
        for before, t, part in zip([0.0, *times], times, parts, strict=False):
            run.run.horizon += t - before if before else 0.0
            run.advance(t, run.no_record())
            if solver is None:
                np.testing.assert_array_equal(run.x, part.x[-1])
            close(run.x, part.x[-1], 1e-9)
            assert run.mode == part.mode[-1]
        assert run.jumps == len(fired(parts))

    def test_a_stop_at_an_event_fires_it_once(self, name):
        factory, x0, mode, t1 = RUNS[name]
        system = factory()
        whole = simulate(system, x0, (0.0, t1), mode=mode)
        for t in dict.fromkeys(whole.jumps.t[:3].tolist()):
            parts = pieces(system, x0, mode, [t, t1])
            assert fired(parts) == fired([whole])
            close(parts[-1].x[-1], whole.x[-1])

    def test_an_end_that_was_stored_gives_the_same_bits(self, name, tmp_path):
        factory, x0, mode, t1 = RUNS[name]
        system, times = factory(), [0.6 * t1, t1]

        def stored(end):
            end.to_xarray().to_netcdf(tmp_path / "end.nc")
            return pickle.loads(pickle.dumps(open_end(tmp_path / "end.nc")))

        one, other = (pieces(system, x0, mode, times, change=each)[-1] for each in (lambda end: end, stored))
        np.testing.assert_array_equal(one.x, other.x)
        np.testing.assert_array_equal(one.t, other.t)


@pytest.mark.parametrize("solver", [RadauIIA(), Tsit5(rtol=1e-8)], ids=["RadauIIA", "Tsit5"])
def test_other_solvers(solver):
    system = models.impact_oscillator()
    whole = simulate(system, (0.0, 0.0), (0.0, 20.0), solver=solver)
    parts = pieces(system, (0.0, 0.0), None, [7.0, 20.0], solver=solver)
    assert fired(parts) == fired([whole])
    close(parts[-1].x[-1], whole.x[-1], 1e-5)


class TestStopsWithinARun:
    def test_at_the_ticks_of_a_clock_each_bit_is_that_of_one_run(self):
        """There its step ends anyway."""
        system, x0 = models.sampled_loop(), {"y": 0.0}
        whole = simulate(system, x0, (0.0, 3.0))
        parts = pieces(system, x0, None, [float(whole.jumps.t[6]), float(whole.jumps.t[19]), 3.0])
        np.testing.assert_array_equal(parts[-1].x[-1], whole.x[-1])
        np.testing.assert_array_equal(
            np.concatenate([each.jumps.x_plus for each in parts]), whole.jumps.x_plus
        )

    def test_counters_and_held_components_go_on(self):
        parts = pieces(models.sampled_loop(), {"y": 0.0}, None, [0.25, 0.5])
        assert parts[1].x[0, 1:] == pytest.approx(parts[0].x[-1, 1:], rel=0, abs=0)
        assert parts[1]["u"][0] != 0.0

    def test_a_dwell_time_counts_from_the_entry(self):
        """Not from where the run was stopped."""
        system = models.refractory_neuron()
        spike = simulate(system, {"u": -65.0}, (0.0, 20.0)).jumps["spike"][0].t
        _, after = pieces(system, {"u": -65.0}, None, [spike + 3.0, 20.0])
        assert after.jumps[0].t == pytest.approx(spike + 4.0, rel=1e-12)

    def test_with_tangent_vectors_too(self):
        """They begin anew at the joint, but the dwell time goes on."""
        system = models.refractory_neuron()
        spike = simulate(system, {"u": -65.0}, (0.0, 20.0)).jumps["spike"][0].t
        first = simulate(system, {"u": -65.0}, (0.0, spike + 3.0), tangent=True)
        for each in (first, simulate(system, {"u": -65.0}, (0.0, spike + 3.0))):
            after = simulate(system, each.end, (each.end.t, 20.0), tangent=True)
            assert after.jumps[0].t == pytest.approx(spike + 4.0, rel=1e-12)
            assert after.fundamental.shape == (1, 1)

    def test_the_derivatives_of_two_runs_multiply(self):
        system, times = models.impact_oscillator(), (7.0, 20.0)
        whole = simulate(system, (0.1, 0.0), (0.0, times[1]), tangent=True)
        one = simulate(system, (0.1, 0.0), (0.0, times[0]), tangent=True)
        other = simulate(system, one.end, times, tangent=True)
        close(other.fundamental @ one.fundamental, whole.fundamental, 1e-6)

    def test_jumps_are_counted_from_the_joint(self):
        ball = models.bouncing_ball()
        first, second = pieces(ball, (1.0, 0.0), None, [2.0, 3.0])
        assert first.jump_count > 0
        assert second.jumps[0].j == 0
        assert second.j[0] == 0
        assert second.j[-1] == second.jump_count == len(second.jumps)
        assert "JUMPS" not in second.status.code.name
        limited = simulate(ball, first.end, (2.0, 4.0), max_jumps=2)
        assert (limited.jump_count, limited.status.code) == (2, StatusCode.MAX_JUMPS)

    def test_samples(self):
        ball, times = models.bouncing_ball(), [2.0, 2.5, 3.0]
        first = simulate(ball, (1.0, 0.0), (0.0, 2.0))
        after = simulate(ball, first.end, (2.0, 3.0), samples=times)
        whole = simulate(ball, (1.0, 0.0), (0.0, 3.0), samples=times)
        close(after.x, whole.x, 1e-12)
        np.testing.assert_array_equal(after.j, whole.j - first.jump_count)

    def test_another_solver_may_go_on(self):
        system = models.impact_oscillator()
        first = simulate(system, (0.0, 0.0), (0.0, 7.0))
        after = simulate(system, first.end, (7.0, 20.0), solver=DOP853(rtol=1e-12, atol=1e-14))
        close(after.x[-1], simulate(system, (0.0, 0.0), (0.0, 20.0)).x[-1])

    def test_derivatives_in_parameters(self):
        system = models.impact_oscillator()
        first = simulate(system, (0.0, 0.0), (0.0, 7.0))
        after = simulate(system, first.end, (7.0, 20.0), sensitivities=("k",))
        again = simulate(system, first.x[-1], (7.0, 20.0), mode="flight", sensitivities=("k",))
        close(after.sensitivity, again.sensitivity)


class TestWhatStoppedARun:
    def test_too_many_jumps(self):
        ball = models.bouncing_ball()
        first = simulate(ball, (1.0, 0.0), (0.0, 3.0), max_jumps=2)
        after = simulate(ball, first.end, (first.end.t, 3.0))
        whole = simulate(ball, (1.0, 0.0), (0.0, 3.0))
        assert fired([first, after]) == fired([whole])
        close(after.x[-1], whole.x[-1])

    def test_between_two_jumps_of_one_instant(self):
        system = chained()
        whole = simulate(system, (0.0, 0.5), (0.0, 2.0), mode="a")
        first = simulate(system, (0.0, 0.5), (0.0, 2.0), mode="a", max_jumps=1)
        after = simulate(system, first.end, (first.end.t, 2.0))
        assert fired([first, after]) == fired([whole])
        np.testing.assert_allclose(after.jumps[0].saltation, whole.jumps[1].saltation)
        with pytest.raises(ArgumentError, match="stopped between two jumps of one instant"):
            simulate(system, first.end, (first.end.t, 2.0), tangent=True)

    def test_too_many_steps(self):
        system = models.impact_oscillator()
        first = simulate(system, (0.0, 0.0), (0.0, 60.0), solver=DOP853(max_steps=100))
        assert first.status.code == StatusCode.MAX_STEPS
        after = simulate(system, first.end, (first.end.t, 60.0), solver=DOP853())
        whole = simulate(system, (0.0, 0.0), (0.0, 60.0), solver=DOP853())
        assert fired([first, after]) == fired([whole])
        close(after.x[-1], whole.x[-1], 1e-10)

    def test_a_run_that_is_over_does_not_go_on(self):
        ball = models.bouncing_ball()
        limit = simulate(ball, (1.0, 0.0), (0.0, 6.0)).end
        with pytest.raises(ArgumentError, match=r"x0 is the end of a run that is over \(ACCUMULATION\)"):
            simulate(ball, limit, (limit.t, 9.0))


class TestTheObject:
    @pytest.fixture
    def end(self):
        return simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0)).end

    def test_it_is_frozen_and_prints_well(self, end):
        assert repr(end) == "<ArcEnd t = 1, mode 'flight', q = 0.468004, v = -1.837, SUCCESS>"
        assert (end.t, end.mode, dict(end.parameters)) == (1.0, "flight", {"g": 9.81, "e": 0.8})
        with pytest.raises(AttributeError):
            end.t = 2.0
        with pytest.raises(ValueError, match="read-only"):
            end.x[0] = 0.0

    def test_an_arc_keeps_its_end_when_it_is_pickled(self):
        arc = simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0))
        again = pickle.loads(pickle.dumps(arc))
        one, other = (simulate(arc.system, each.end, (1.0, 2.0)) for each in (arc, again))
        np.testing.assert_array_equal(one.x, other.x)

    def test_the_end_of_a_run_without_length(self):
        ball = models.bouncing_ball()
        end = simulate(ball, (1.0, 0.0), (0.0, 0.0)).end
        after = simulate(ball, end, (0.0, 2.0))
        np.testing.assert_array_equal(after.x, simulate(ball, (1.0, 0.0), (0.0, 2.0)).x)

    @pytest.mark.parametrize(
        ("change", "text"),
        [
            ({"t_span": (0.5, 2.0)}, r"t_span must begin at 1\.0, where the run ended .*; got 0\.5"),
            ({"mode": "fligth"}, "mode must be left out, since x0 is the end of a run in mode 'flight'"),
            ({"parameters": {"e": 0.5}}, r"parameters must be left out, .* with e = 0\.8; got 0\.5"),
            ({"parameters": {"E": 0.5}}, "parameters: Parameter 'E' does not exist"),
        ],
    )
    def test_what_does_not_go_on_is_refused(self, end, change, text):
        given = {"t_span": (1.0, 2.0), **change}
        with pytest.raises(ArgumentError, match=text):
            simulate(models.bouncing_ball(), end, **given)

    def test_what_is_the_same_may_be_given(self, end):
        simulate(models.bouncing_ball(), end, (1.0, 2.0), mode="flight", parameters={"e": 0.8})

    def test_another_system_is_refused(self, end):
        with pytest.raises(ArgumentError, match="with the state q, v; the system has x, v"):
            simulate(models.impact_oscillator(), end, (1.0, 2.0))
        with pytest.raises(ArgumentError, match="another system: mode 'fall' is in one of the two only"):
            simulate(
                HybridSystem(
                    state=("q", "v"),
                    parameters={"g": 9.81, "e": 0.8},
                    modes=[Mode("fall", lambda t, x, p: (x.v, -p.g + 0 * p.e))],
                ),
                end,
                (1.0, 2.0),
            )

    def test_sensitivities_need_the_entry_of_a_dwell_time(self):
        neuron = models.refractory_neuron()
        end = simulate(neuron, {"u": -65.0}, (0.0, 16.0)).end
        with pytest.raises(ArgumentError, match="sensitivities= needs a start at which the mode is entered"):
            simulate(neuron, end, (16.0, 20.0), sensitivities=("tau",))

    def test_a_changed_save_is_refused(self, end):
        saved = end.to_xarray()
        saved["x"] = saved["x"] + 1.0
        with pytest.raises(ArgumentError, match="saved is not what was saved: 'x' is damaged or changed"):
            open_end(saved)
        with pytest.raises(ArgumentError, match="saved must be the dataset of an end"):
            open_end(hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0)).to_xarray())
