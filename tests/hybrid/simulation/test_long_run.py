"""Runs over very many periods: time is a count and a phase, and invariants are preserved."""

import math

import attrs
import numpy as np

import models
from benchmarks.long_run import CONSERVATIVE, energy, energy_drift
from hybrid import DOP853, Taylor, simulate, stroboscopic_section
from hybrid.kernels.types import codes
from hybrid.simulation.trajectory import start
from lyapunov import lyapunov_spectrum
from models.one_impact import one_impact_orbits

# A power of two, so that the time of this many periods is exact.
MILLION = 2**20


def test_after_a_million_periods_all_is_as_at_the_start():
    """Phases and states are the same to the last bit."""
    system = models.impact_oscillator()
    period = system.forcing_period()
    early, late = (
        stroboscopic_section(system, (0.1, 0.0), periods=20, t0=cycles * period) for cycles in (0, MILLION)
    )
    np.testing.assert_array_equal(early.x, late.x)
    early, late = (
        lyapunov_spectrum(system, (0.1, 0.0), intervals=50, transient=5, t0=cycles * period)
        for cycles in (0, MILLION)
    )
    np.testing.assert_array_equal(early.growths, late.growths)


def test_time_as_one_number_would_differ():
    """Control for the test above: the same model without a declared period."""
    system = attrs.evolve(models.impact_oscillator(), period=None)
    period = models.impact_oscillator().forcing_period()
    ends = [
        simulate(system, (0.1, 0.0), (cycles * period, (cycles + 20) * period)).x[-1]
        for cycles in (0, MILLION)
    ]
    assert np.abs(ends[0] - ends[1]).max() > 1e-12


def test_the_phase_of_impacts_stays_over_thousands_of_periods():
    """The orbit with one impact per period is stable, so only the clock could drift."""
    p = dict(models.impact_oscillator().parameters)
    (orbit,) = one_impact_orbits(**p)
    period, phase = 2 * math.pi / p["w"], orbit.theta / p["w"]
    trajectory = start(models.impact_oscillator(), (p["d"], -p["r"] * orbit.V), phase)
    record = trajectory.no_record()
    for count in (10, 100, 3000):
        assert trajectory.advance_to(count, phase + 0.5 * period, record) == codes.DONE
        assert trajectory.run.cycle == count
        assert trajectory.run.phase == phase + 0.5 * period
        run = trajectory.run
        assert abs((run.last_jump_cycle - count) * period + run.last_jump_phase - phase) < 1e-11


def test_energy_drifts_by_the_tolerance_and_at_the_tightest_hardly():
    """Elastic, undamped, unforced: 1e-9 in a million periods is 1e-15 per period."""
    counts = np.array([300, 1000])
    loose, impacts = energy_drift(DOP853(rtol=1e-9, atol=1e-11), counts)
    tight, _ = energy_drift(DOP853(rtol=1e-15, atol=1e-17), counts)
    assert impacts > 300
    assert 1e-9 < loose[-1] < 1e-6
    assert tight[-1] < 1e-11


def test_series_keep_the_energy_to_rounding():
    """Ten thousand periods with 3759 contacts, with a drift of 1e-15 per period."""
    (drift,), _ = energy_drift(Taylor(rtol=1e-14, atol=1e-16), np.array([10_000]))
    assert drift < 1e-11


def test_the_energy_is_what_the_equations_keep():
    """Check the energy formula: it is constant over short runs, in contact and in flight."""
    system = models.vibroimpact()
    p = {**system.parameters, **CONSERVATIVE}
    rng = np.random.default_rng(0)
    for mode in ("free", "contact"):
        for x in rng.uniform(-0.02, 0.02, (20, 4)):
            # x1 > x2 in contact, and x1 < x2 in free flight.
            x[1] = x[0] + (1e-4 if mode == "free" else -1e-4)
            arc = simulate(system, x, (0.0, 1e-7), mode=mode, parameters=CONSERVATIVE)
            change = energy(p, arc.x[-1]) - energy(p, arc.x[0])
            assert abs(change) < 1e-13 * energy(p, arc.x[0])
