"""The arc of an orbit has the jumps of its signature and ends where it begins."""

import numpy as np
import pytest

import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, periodic_orbit

KICKED = HybridSystem(
    state=("q",),
    modes=[Mode("on", lambda t, x, p: (-x.q,))],
    transitions=[
        Transition(
            "on",
            "on",
            Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.25)), +1),
            Reset(lambda t, x, p: (x.q + 1,)),
        )
    ],
    period=1.0,
)


def assert_closes(orbit):
    assert orbit.status.ok
    arc = orbit.arc()
    assert arc.status.ok
    assert len(arc.jumps) == len(orbit.signature) - 1
    assert arc.mode[-1] == arc.mode[0]
    extent = np.ptp(arc.x, axis=0)
    assert np.all(np.abs(arc.x[-1] - arc.x[0]) <= 1e-8 * np.maximum(extent, 1e-3))
    return arc


@pytest.mark.parametrize("t0", [0.0, 0.1, 0.25, 0.8, 7.25, -0.75])
def test_a_forced_orbit_from_any_phase(t0):
    """On the kick, the point is the state before it, and the arc begins behind it."""
    orbit = periodic_orbit(KICKED, (0.5,), t0=t0)
    arc = assert_closes(orbit)
    before = 1 / (np.e - 1)
    np.testing.assert_allclose(arc.x[:, 0].max(), before + 1, rtol=1e-9)
    if t0 in (0.25, 7.25, -0.75):
        np.testing.assert_allclose(orbit.x0, before, rtol=1e-9)
        np.testing.assert_allclose(arc.x[0], before + 1, rtol=1e-7)


def test_a_walker_whose_guess_is_at_heel_strike():
    guess = (0.2003, 0.4006, -0.1998, -0.0158)
    orbit = periodic_orbit(models.simplest_walker(), guess, mode="behind", period=3.88)
    arc = assert_closes(orbit)
    assert np.abs(arc.jumps.t - orbit.t0).min() > 1e-7 * orbit.period


@pytest.mark.parametrize("phase", [0.0, 0.3, 1.0])
def test_an_orbit_of_a_forced_impact_oscillator(phase):
    first = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    impact = first.arc().jumps[0]
    t0 = float(impact.t) * phase
    start = first.arc()(t0) if phase < 1 else impact.x_minus
    assert_closes(periodic_orbit(models.impact_oscillator(), start, t0=t0))
