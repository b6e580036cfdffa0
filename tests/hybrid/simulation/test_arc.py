"""Contents of an arc: both sides of jumps, dense output, samples, the sequence of jumps."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hybrid
import models
from hybrid import ArgumentError, simulate
from models import bouncing_ball, impact_oscillator, vibroimpact

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
BALL, OSCILLATOR = bouncing_ball(), impact_oscillator()


def ball_exact(t):
    """From rest at 1: the state at ``t``, after a jump at ``t`` if there is one."""
    g, e, start = 9.81, 0.8, -math.sqrt(2 / 9.81)
    v = math.sqrt(2 * g)
    while t - start >= 2 * v / g:
        start += 2 * v / g
        v *= e
    s = t - start
    return np.array([v * s - g * s**2 / 2, v - g * s])


@pytest.fixture(scope="module")
def arc():
    return simulate(BALL, (1.0, 0.0), (0.0, 3.0), solver=TIGHT)


@pytest.fixture(scope="module")
def ride():
    return simulate(OSCILLATOR, (0.0, 0.0), (0.0, 60.0), solver=TIGHT)


class TestPoints:
    def test_hybrid_time_is_ordered(self, arc, ride):
        for run in (arc, ride):
            assert np.all(np.diff(run.t) >= 0)
            assert np.all(np.isin(np.diff(run.j), (0, 1)))
            assert np.all(np.diff(run.t)[np.diff(run.j) == 1] == 0)

    def test_ends(self, arc):
        assert (arc.t[0], arc.t[-1]) == pytest.approx((0.0, 3.0), rel=1e-14)
        np.testing.assert_allclose(arc.x[0], [1.0, 0.0], rtol=1e-14)
        np.testing.assert_allclose(arc.x[-1], ball_exact(3.0), atol=1e-12)

    def test_both_sides_of_a_jump_are_points(self, arc):
        for jump in arc.jumps:
            before = np.flatnonzero((arc.t == jump.t) & (arc.j == jump.j))
            after = np.flatnonzero((arc.t == jump.t) & (arc.j == jump.j + 1))
            np.testing.assert_array_equal(arc.x[before[-1]], jump.x_minus)
            np.testing.assert_allclose(arc.x[after[0]], jump.x_plus, atol=1e-15)

    def test_shapes(self, arc):
        n = len(arc.t)
        assert arc.j.shape == arc.mode.shape == (n,)
        assert arc.x.shape == (n, 2)
        assert set(arc.mode) == {"flight"}

    def test_repr(self, arc):
        assert repr(arc) == "<HybridArc t = 0 to 3, 6 jumps, SUCCESS>"
        assert repr(arc.jumps) == "<6 jumps>"
        assert repr(simulate(BALL, (1.0, 0.0), (0.0, 1.0), samples=[])) == (
            "<HybridArc no points, 1 jump, SUCCESS>"
        )


class TestDense:
    @given(st.floats(0.0, 3.0))
    def test_against_the_exact_answer(self, t):
        arc = simulate(BALL, (1.0, 0.0), (0.0, 3.0), solver=TIGHT)
        if np.abs(arc.jumps.t - t).min() > 1e-12:
            np.testing.assert_allclose(arc(t), ball_exact(t), atol=1e-11)

    def test_of_a_curved_flight(self, ride):
        t = np.linspace(0.0, 60.0, 777)
        sampled = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 60.0), solver=TIGHT, samples=t)
        np.testing.assert_allclose(ride(t), sampled.x, atol=1e-14)
        for k in (100, 400, 776):
            direct = simulate(OSCILLATOR, (0.0, 0.0), (0.0, t[k]), solver=TIGHT)
            np.testing.assert_allclose(ride(t[k]), direct.x[-1], atol=1e-10)

    def test_at_a_jump_it_is_the_state_after(self, arc, ride):
        for run in (arc, ride):
            for jump in run.jumps:
                np.testing.assert_allclose(run(jump.t), jump.x_plus, atol=1e-15)
                before = np.nextafter(jump.t, 0)
                np.testing.assert_allclose(run(before), jump.x_minus, atol=1e-11)

    def test_shapes(self, arc):
        assert arc(0.3).shape == (2,)
        assert arc([0.3]).shape == (1, 2)
        assert arc(np.zeros((3, 4))).shape == (3, 4, 2)
        assert arc([]).shape == (0, 2)

    def test_at_the_ends(self, arc):
        np.testing.assert_array_equal(arc(0.0), arc.x[0])
        np.testing.assert_allclose(arc(3.0), arc.x[-1], atol=1e-14)

    @pytest.mark.parametrize("t", [-1e-9, 3.1, math.nan, [0.0, 4.0]])
    def test_outside_the_run(self, arc, t):
        with pytest.raises(hybrid.ArgumentError, match=r"t must lie in the run, \[0.0, .*\]; got"):
            arc(t)

    @pytest.mark.as_given
    def test_of_a_run_that_ends_at_a_jump(self):
        whole = simulate(BALL, (1.0, 0.0), (0.0, 3.0), solver=TIGHT)
        t = whole.jumps[1].t
        arc = simulate(BALL, (1.0, 0.0), (0.0, t), solver=TIGHT)
        assert len(arc.jumps) == 2
        np.testing.assert_allclose(arc(t), whole.jumps[1].x_plus, atol=1e-12)

    def test_of_a_run_that_jumps_at_its_start(self):
        arc = simulate(BALL, (0.0, -4.0), (0.0, 0.1), mode="flight")
        np.testing.assert_allclose(arc(0.0), [0.0, 3.2])
        np.testing.assert_allclose(arc.x[0], [0.0, -4.0], rtol=1e-14)


class TestDenseOnEveryClock:
    """Dense output: polynomials and series in time, series on a contact's clock, Runge-Kutta steps."""

    SYSTEM = vibroimpact()
    PERIOD = SYSTEM.forcing_period()
    START = (0.0, 0.001, 0.0, 0.0)
    EXACT = hybrid.Taylor(rtol=1e-13, atol=1e-15)

    @pytest.fixture(params=[EXACT, TIGHT], ids=["Taylor", "DOP853"])
    def run(self, request):
        return simulate(self.SYSTEM, self.START, (0.0, 3 * self.PERIOD), mode="free", solver=request.param)

    def test_inside_contacts(self, run):
        """A state on the arc equals the end of a run that ends at that time."""
        entry, leave = run.jumps.t[:2]
        for t in [*np.linspace(entry, leave, 12), *np.linspace(0.0, entry, 5)]:
            end = simulate(self.SYSTEM, self.START, (0.0, t), mode="free", solver=self.EXACT).x[-1]
            atol = 1e-12 if run.propagators["contact"].startswith("Taylor") else 5e-11
            np.testing.assert_allclose(run(t), end, rtol=0, atol=atol)

    def test_next_to_the_start_of_a_contact(self, run):
        """The clock of a contact starts at zero speed, so the position on it grows like sqrt(time)."""
        jump = run.jumps[0]
        field = np.array([*jump.x_plus[2:], 0.0, 0.0])
        for since in 10.0 ** np.arange(-13, -5):
            moved = run(jump.t + since) - jump.x_plus
            np.testing.assert_allclose(moved[:2], since * field[:2], atol=4e-16 + 30 * since**2)

    @given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=40))
    def test_in_any_order(self, shares):
        arc = simulate(self.SYSTEM, self.START, (0.0, 3 * self.PERIOD), mode="free")
        times = np.array(shares) * 3 * self.PERIOD
        one_by_one = [arc(t) for t in times]
        np.testing.assert_array_equal(arc(times), one_by_one)

    def test_of_more_steps_than_a_record_holds(self):
        span = 400 * self.PERIOD
        arc = simulate(self.SYSTEM, self.START, (0.0, span), mode="free")
        assert arc.steps > 3000
        times = np.linspace(0.0, span, 5000)
        sampled = simulate(self.SYSTEM, self.START, (0.0, span), mode="free", samples=times)
        np.testing.assert_allclose(sampled.t, times, rtol=1e-14)
        np.testing.assert_array_equal(arc(sampled.t), sampled.x)
        np.testing.assert_array_equal(arc.mode[np.searchsorted(arc.t, sampled.t, "right") - 1], sampled.mode)
        assert np.all(np.diff(arc.t) >= 0)


class TestSamples:
    def test_nothing_else_is_kept(self):
        arc = simulate(BALL, (1.0, 0.0), (0.0, 3.0), samples=[0.1, 0.5, 2.0], solver=TIGHT)
        np.testing.assert_allclose(arc.t, [0.1, 0.5, 2.0], rtol=1e-14)
        np.testing.assert_array_equal(arc.j, [0, 1, 3])
        np.testing.assert_allclose(arc.x, [ball_exact(t) for t in arc.t], atol=1e-12)
        assert arc.jump_count == 6
        with pytest.raises(hybrid.ArgumentError, match=r"keeps samples only\. Run simulate without samples="):
            arc(0.5)

    def test_none(self):
        arc = simulate(BALL, (1.0, 0.0), (0.0, 3.0), samples=[])
        assert arc.x.shape == (0, 2)
        assert arc.jump_count == 6

    def test_at_the_ends_and_twice(self):
        arc = simulate(BALL, (1.0, 0.0), (0.0, 3.0), samples=[0.0, 0.0, 3.0, 3.0], solver=TIGHT)
        np.testing.assert_allclose(arc.x, [ball_exact(t) for t in arc.t], atol=1e-12)

    @pytest.mark.as_given
    def test_exactly_at_events(self):
        ride = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 60.0), solver=TIGHT)
        times = ride.jumps.t
        arc = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 60.0), samples=times, keep_jumps=True, solver=TIGHT)
        np.testing.assert_allclose(arc.x, ride.jumps.x_plus, atol=1e-14)
        np.testing.assert_array_equal(arc.j, np.arange(1, len(times) + 1))
        np.testing.assert_array_equal(arc.jumps.t, times)

    @pytest.mark.as_given
    def test_at_an_event_that_ends_the_run(self):
        ride = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 60.0), solver=TIGHT)
        for jump in ride.jumps[:4]:
            arc = simulate(OSCILLATOR, (0.0, 0.0), (0.0, jump.t), samples=[jump.t], solver=TIGHT)
            np.testing.assert_allclose(arc.x[-1], jump.x_plus, atol=1e-12)
            assert arc.j[-1] == jump.j + 1

    def test_do_not_change_the_run(self, ride):
        times = np.linspace(0, 60, 999)
        arc = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 60.0), samples=times, keep_jumps=True, solver=TIGHT)
        np.testing.assert_array_equal(arc.jumps.t, ride.jumps.t)
        assert arc.steps == ride.steps

    def test_beyond_an_early_end_are_left_out(self):
        arc = simulate(BALL, (1.0, 0.0), (0.0, 9.0), samples=[1.0, 8.0])
        assert not arc.status.ok
        np.testing.assert_allclose(arc.t, [1.0], rtol=1e-14)

    def test_of_a_zero_length_run(self):
        arc = simulate(BALL, (1.0, 0.0), (2.0, 2.0), samples=[2.0])
        np.testing.assert_allclose(arc.x, [[1.0, 0.0]], rtol=1e-14)

    def test_across_the_record_s_capacity(self):
        """More steps and jumps than a record holds between two returns to Python."""
        t = np.linspace(0.0, 900.0, 5001)
        fine = hybrid.DOP853(rtol=1e-13, atol=1e-14, max_step=0.05)
        sampled = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 900.0), samples=t, solver=fine)
        whole = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 900.0), solver=fine)
        assert whole.steps > 2 * 2048
        np.testing.assert_allclose(sampled.x, whole(t), atol=1e-12)
        assert np.all(np.diff(whole.t) >= 0)


class TestJumps:
    def test_is_a_sequence(self, arc):
        assert len(arc.jumps) == len(list(arc.jumps)) == 6
        assert arc.jumps[-1].t == arc.jumps[5].t == arc.jumps.t[-1]
        assert [jump.j for jump in arc.jumps[1:3]] == [1, 2]
        with pytest.raises(IndexError, match="jump 6 of an arc with 6 jumps"):
            arc.jumps[6]
        with pytest.raises(IndexError):
            arc.jumps[-7]
        for index in (None, 1.0, True, (0, 1), [0], np.array([True]), b"a", object()):
            with pytest.raises(ArgumentError, match="jumps: the index must be a whole number"):
                arc.jumps[index]

    def test_fields(self, arc):
        jump = arc.jumps[0]
        assert (jump.transition, jump.source, jump.target) == ("bounce", "flight", "flight")
        assert jump.transversality == jump.x_minus[1] < 0
        assert jump.saltation.shape == (2, 2)
        assert type(jump.t) is float


def test_components_and_jumps_by_name():
    system = models.impact_pair()
    arc = hybrid.simulate(system, system.dimension * (0.1,), (0.0, 20.0))
    for i, name in enumerate(system.state_names):
        np.testing.assert_array_equal(arc[name], arc.x[:, i])
    with pytest.raises(hybrid.ArgumentError, match="State component or output 'w' does not exist"):
        arc["w"]
    first, second = system.transition_names[:2]
    assert {first, second} == set(arc.jumps.transition)
    assert [jump.transition for jump in arc.jumps] == arc.jumps.transition.tolist()
    assert [jump.kind for jump in arc.jumps] == arc.jumps.kind.tolist()
    for name in (first, second):
        chosen = arc.jumps[name]
        assert [jump.t for jump in chosen] == arc.jumps.t[arc.jumps.transition == name].tolist()
        assert {jump.transition for jump in chosen} == {name}
    with pytest.raises(hybrid.ModelError, match="Transition 'wall' does not exist"):
        arc.jumps["wall"]


def test_parameters_are_all_of_them_by_name():
    oscillator = models.impact_oscillator()
    orbit = hybrid.periodic_orbit(oscillator, (0.9, 1.0), parameters={"r": 0.75})
    arc = orbit.arc()
    assert orbit.parameters == pytest.approx({**oscillator.parameters, "r": 0.75}, rel=1e-14)
    assert arc.parameters == pytest.approx(orbit.parameters, rel=1e-14)


def test_dense_output_is_the_same_in_parts(monkeypatch):
    run = simulate(bouncing_ball(), (1.0, 0.0), (0.0, 3.0))
    times = np.linspace(0.0, 3.0, 50)
    whole = run(times)
    monkeypatch.setattr("hybrid.simulation.points.TIMES_AT_ONCE", 7)
    np.testing.assert_array_equal(run(times), whole)
    assert run(np.zeros(0)).shape == (0, 2)
