"""Two neurons with a synaptic delay, compared with their closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from hybrid.testing import Case, check_laws, check_ticks
from lyapunov import lyapunov_spectrum
from models import delayed_neurons

DRIVE, WEIGHT = 1.5, -0.2


def period(s, eps=WEIGHT):
    """The period of a neuron that gets its pulse at the age ``s``, and its slope in ``s``."""
    left = DRIVE * np.exp(-s) - eps
    return s + np.log(left / (DRIVE - 1.0)), -eps / left


@pytest.mark.parametrize("solver", [None, hybrid.DOP853(rtol=1e-12, atol=1e-14)])
@pytest.mark.parametrize("tau", [0.02, 0.3, 0.32, 0.6])
def test_in_phase(tau, solver):
    exact, slope = period(tau)
    orbit = hybrid.periodic_orbit(
        delayed_neurons(), (0.95, 0.95), period=exact, parameters={"tau": tau}, solver=solver
    )
    assert orbit.status.ok
    assert orbit.period == pytest.approx(exact, rel=1e-11)
    found = np.sort(np.abs(orbit.multipliers))[::-1]
    np.testing.assert_allclose(found[:3], [1.0, 1.0 - 2.0 * slope, 0.0], atol=1e-9)
    assert sorted(orbit.transitions) == ["arrive 1", "arrive 2", "spike 1", "spike 2"]


@pytest.mark.parametrize("tau", [0.02, 0.1, 0.2])
def test_in_antiphase(tau):
    s = brentq(lambda s: period(s)[0] - 2.0 * (s - tau), tau, 3.0)
    exact, slope = period(s)
    start = (0.95, DRIVE * (1.0 - np.exp(-0.5 * exact)))
    orbit = hybrid.periodic_orbit(delayed_neurons(), start, period=exact, parameters={"tau": tau})
    assert orbit.status.ok
    assert orbit.period == pytest.approx(exact, rel=1e-11)
    found = np.sort(np.abs(orbit.multipliers))[::-1]
    np.testing.assert_allclose(found[:3], [1.0, (1.0 - slope) ** 2, 0.0], atol=1e-8)


def test_the_period_over_the_delay():
    orbit = hybrid.periodic_orbit(delayed_neurons(), (0.95, 0.95), period=1.3)
    [slope] = orbit.sensitivity(("tau",)).period
    assert slope == pytest.approx(period(0.3)[1], rel=1e-9)
    branch = hybrid.continue_orbit(orbit, "tau", (0.1, 0.7))
    np.testing.assert_allclose(branch.period, period(branch.parameter)[0], rtol=1e-9)


def test_excitation_drives_the_neurons_apart():
    exact, slope = period(0.3, 0.1)
    given = {"eps": 0.1}
    orbit = hybrid.periodic_orbit(delayed_neurons(), (0.95, 0.95), period=exact, parameters=given)
    assert np.abs(orbit.multipliers).max() == pytest.approx(1.0 - 2.0 * slope, rel=1e-8)


def test_the_exponent_of_a_difference_lasts_when_the_neurons_have_met():
    """Their spikes come to one instant up to rounding, and neither is set off by the other."""
    found = lyapunov_spectrum(delayed_neurons(), (0.8, 0.3), interval=1.0, intervals=150, transient=10, k=2)
    exact = np.log(1.0 - 2.0 * period(0.3)[1]) / period(0.3)[0]
    np.testing.assert_allclose(found.exponents, [0.0, exact], atol=5e-3)


def test_laws_and_ticks():
    system = delayed_neurons()
    start = np.r_[0.2, 0.7, np.zeros(system.dimension - 2)]
    case = Case(system, system.parameters, "run", start, 0.0, 12.0)
    check_laws(case)
    check_ticks(case)
