"""Sections compared with simulate at the same times, and with the jumps."""

import math
from types import SimpleNamespace

import attrs
import numpy as np
import pytest

import hybrid
from hybrid import Guard, StatusCode, poincare_section, simulate, stroboscopic_section
from hybrid.orbits import sections
from hybrid.simulation import interrupt, trajectory
from models import bouncing_ball, impact_oscillator, vibroimpact
from tests.cases import systems
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
BALL, OSCILLATOR = bouncing_ball(), impact_oscillator()
T = 2 * math.pi


class TestStroboscopic:
    @pytest.mark.parametrize("t0", [0.0, 0.7, -3.0, T, 100 * T + 1])
    def test_is_simulate_at_the_same_times(self, t0):
        section = stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=20, t0=t0, solver=TIGHT)
        times = t0 + T * np.arange(1, 21)
        arc = simulate(OSCILLATOR, (0.0, 0.0), (t0, times[-1]), samples=times, solver=TIGHT)
        np.testing.assert_allclose(section.t, times, rtol=1e-14, atol=1e-12)
        np.testing.assert_allclose(section.x, arc.x, atol=1e-9)
        np.testing.assert_array_equal(np.cumsum(section.jumps), arc.j)
        assert section.status.ok

    @pytest.mark.parametrize("transient", [1, 7, 499, 500, 501])
    def test_transient_is_left_out(self, transient):
        whole = stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=transient + 5)
        late = stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=5, transient=transient)
        for field in ("t", "x", "jumps", "mode"):
            np.testing.assert_array_equal(getattr(late, field), getattr(whole, field)[transient:])

    @pytest.mark.parametrize("solver", [None, TIGHT])
    @pytest.mark.parametrize("system", [OSCILLATOR, vibroimpact()], ids=["oscillator", "vibro-impact"])
    def test_a_run_is_taken_on_without_its_tangent_vectors(self, system, solver):
        n = system.dimension
        start = trajectory.start(system, (0.0,) * n, 0.0, solver=solver)
        carrying = trajectory.start(system, (0.0,) * n, 0.0, solver=solver, tangent=np.eye(n))
        for one, other in zip(sections.strobe(start, 30), sections.strobe(carrying, 30), strict=True):
            np.testing.assert_array_equal(one, other)

    @pytest.mark.parametrize("steps", [1, 2, 3, 50, 10**6])
    @pytest.mark.parametrize("count", [1, 2, 7])
    def test_points_do_not_depend_on_where_bursts_end(self, steps, count, monkeypatch):
        """A burst may end within a period, at its end, or within the last one."""

        def made():
            found = trajectory.start(OSCILLATOR, (0.0, 0.0), 0.0, solver=hybrid.DOP853(rtol=1e-6))
            return sections.strobe(found, count)

        states, places, code = made()
        assert (len(states), len(places)) == (count, count)
        monkeypatch.setattr(interrupt, "FIRST_BURST", steps)
        monkeypatch.setattr(interrupt, "SECONDS", 0.0)
        for one, other in zip(made(), (states, places, code), strict=True):
            np.testing.assert_array_equal(one, other)

    def test_modes(self):
        start = reference("founding_system")["D=0.05"]["x0"]
        section = stroboscopic_section(vibroimpact(), start, periods=5, mode="free")
        np.testing.assert_array_equal(section.mode, ["free"] * 5)
        np.testing.assert_array_equal(section.jumps, [2] * 5)
        np.testing.assert_allclose(section.x, np.tile(start, (5, 1)), atol=1e-6)

    def test_a_run_that_ends_early_keeps_what_it_has(self):
        section = stroboscopic_section(
            OSCILLATOR, (0.0, 0.0), periods=50, solver=hybrid.DOP853(max_steps=100)
        )
        assert section.status.code == StatusCode.MAX_STEPS
        assert 0 < len(section) < 50
        none = stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=50, solver=hybrid.DOP853(max_steps=2))
        assert len(none) == 0
        assert repr(none) == "<Section of 0 points, MAX_STEPS>"

    def test_memory_of_a_transient_does_not_grow(self):
        import tracemalloc

        peaks = []
        for transient in (500, 500, 5000):
            tracemalloc.start()
            stroboscopic_section(OSCILLATOR, (0.0, 0.0), periods=2, transient=transient)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        assert peaks[2] < peaks[1] + 50_000

    @pytest.mark.parametrize(
        ("arguments", "text"),
        [
            ({"periods": 0}, "periods must be a whole number of at least 1; got 0"),
            ({"periods": 2.5}, "periods must be a whole number of at least 1; got 2.5"),
            ({"transient": -1}, "transient must be a whole number of at least 0; got -1"),
        ],
    )
    def test_bad_arguments(self, arguments, text):
        with pytest.raises(hybrid.ArgumentError, match=text):
            stroboscopic_section(OSCILLATOR, **({"x0": (0.0, 0.0), "periods": 3} | arguments))

    def test_without_a_period(self):
        with pytest.raises(
            hybrid.ArgumentError, match="needs a forcing period, and the system declares none"
        ):
            stroboscopic_section(BALL, (1.0, 0.0), periods=3)


class TestPoincare:
    @pytest.mark.parametrize("direction", [-1, 0])
    def test_at_the_impacts_is_the_state_before_them(self, direction):
        section = poincare_section(
            OSCILLATOR, (0.0, 0.0), Guard(lambda t, x, p: x.x - p.d, -direction), points=10, solver=TIGHT
        )
        arc = simulate(OSCILLATOR, (0.0, 0.0), (0.0, 80.0), solver=TIGHT)
        np.testing.assert_allclose(section.t, arc.jumps.t[:10], atol=1e-10)
        np.testing.assert_allclose(section.x, arc.jumps.x_minus[:10], atol=1e-9)
        np.testing.assert_array_equal(section.jumps, [0] + [1] * 9)

    def test_apex_of_the_ball(self):
        section = poincare_section(BALL, (1.0, 0.0), Guard(lambda t, x, p: x.v, -1), points=4, solver=TIGHT)
        np.testing.assert_allclose(section.x[:, 0], 0.64 ** np.arange(1, 5), rtol=1e-11)
        np.testing.assert_array_equal(section.jumps, [1, 1, 1, 1])

    def test_a_bar_is_told_of_every_point_and_may_be_left_out(self):
        impacts = np.array([True])
        states, told = [], []
        for bar in (None, SimpleNamespace(update=told.append)):
            run = trajectory.start(OSCILLATOR, (0.0, 0.0), 0.0, solver=TIGHT)
            states.append(sections.crossings(run, impacts, 7, bar)[1])
        assert sum(told) == len(states[1]) == 7
        np.testing.assert_array_equal(*states)

    def test_a_surface_that_moves(self):
        """The surface ``cos t`` moves; ``x = sin t`` crosses it at ``pi / 4 + k pi``."""
        free = attrs.evolve(OSCILLATOR, transitions=[], period=None)
        section = poincare_section(
            free,
            (0.0, 1.0),
            Guard(lambda t, x, p: x.x - np.cos(t)),
            points=6,
            parameters={"A": 0.0, "c": 0.0},
            solver=TIGHT,
        )
        np.testing.assert_allclose(section.t, np.pi / 4 + np.pi * np.arange(6), atol=1e-10)

    def test_does_not_disturb_the_run(self):
        section = poincare_section(
            OSCILLATOR, (0.0, 0.0), Guard(lambda t, x, p: x.v, +1), points=15, transient=5, solver=TIGHT
        )
        arc = simulate(OSCILLATOR, (0.0, 0.0), (0.0, float(section.t[-1])), solver=TIGHT)
        np.testing.assert_allclose(arc(section.t), section.x, atol=1e-9)

    def test_in_every_mode(self):
        wheel = systems.stick_slip()
        section = poincare_section(
            wheel, (0.5, 0.2), Guard(lambda t, x, p: x.x), points=6, mode="stick", solver=TIGHT
        )
        assert set(section.mode) == {"stick", "slip"}
        np.testing.assert_allclose(section.x[:, 0], 0.0, atol=1e-13)

    def test_transient(self):
        guard = Guard(lambda t, x, p: x.v, +1)
        whole = poincare_section(OSCILLATOR, (0.0, 0.0), guard, points=12)
        late = poincare_section(OSCILLATOR, (0.0, 0.0), guard, points=5, transient=7)
        for field in ("t", "x", "jumps"):
            np.testing.assert_array_equal(getattr(late, field), getattr(whole, field)[7:])

    def test_counts_as_large_as_numbers_get(self):
        most = 2**63 - 1
        apex = hybrid.Guard(lambda t, x, p: x.v, -1)
        few = hybrid.DOP853(max_steps=100)
        section = poincare_section(
            impact_oscillator(), (0.0, 0.0), apex, points=most, transient=most, solver=few
        )
        assert section.status.code == hybrid.StatusCode.MAX_STEPS

    def test_accumulation_ends_it(self):
        section = poincare_section(BALL, (1.0, 0.0), Guard(lambda t, x, p: x.q - 0.5, -1), points=9)
        assert len(section) == 2
        assert section.status.code == StatusCode.ACCUMULATION

    def test_a_surface_that_is_never_met(self):
        section = poincare_section(
            OSCILLATOR,
            (0.0, 0.0),
            Guard(lambda t, x, p: x.x - 50),
            points=3,
            solver=hybrid.DOP853(max_steps=2000),
        )
        assert len(section) == 0
        assert section.status.code == StatusCode.MAX_STEPS

    def test_a_surface_that_is_met_no_longer_while_impacts_go_on(self, monkeypatch):
        """On the attractor the velocity falls through zero only in impacts."""
        monkeypatch.setattr("hybrid.orbits.sections.STEPS_BETWEEN_POINTS", 20_000)
        section = poincare_section(OSCILLATOR, (0.0, 0.0), Guard(lambda t, x, p: x.v, -1), points=50)
        assert 0 < len(section) < 50
        assert section.status.code == StatusCode.MAX_STEPS

    @pytest.mark.parametrize(
        ("guard", "points", "text"),
        [
            (lambda t, x, p: x.v, 3, "section must be a Guard; got <function"),
            (Guard(lambda t, x, p: x.v), 0, "points must be a whole number of at least 1; got 0"),
        ],
    )
    def test_bad_arguments(self, guard, points, text):
        with pytest.raises(hybrid.ArgumentError, match=text):
            poincare_section(BALL, (1.0, 0.0), guard, points=points)


def test_counts_of_more_jumps_than_fit_into_one_burst():
    """A clock with a thousand jumps between two points of the section."""
    clock = hybrid.HybridSystem(
        state=("q", "c"),
        modes=[hybrid.Mode("on", lambda t, x, p: (1.0, 1.0))],
        transitions=[
            hybrid.Transition(
                "on",
                "on",
                Guard(lambda t, x, p: x.c - 1e-3, +1),
                hybrid.Reset(lambda t, x, p: (x.q, 0.0)),
                name="tick",
            )
        ],
    )
    section = poincare_section(
        clock, (0.0, 0.5e-3), Guard(lambda t, x, p: np.sin(2 * np.pi * (x.q - 0.25)), +1), points=4
    )
    assert section.jumps.tolist() == [250, 1000, 1000, 1000]
    np.testing.assert_allclose(section.t, [0.25, 1.25, 2.25, 3.25], atol=1e-12)
