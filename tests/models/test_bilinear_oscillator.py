"""The bilinear oscillator: its natural period, its decay, and a forced orbit solved at thirty digits."""

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm

import hybrid
import lyapunov
from models import bilinear_oscillator
from tests.reference.impacts import ImpactOscillator

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
K1, K2, C = 1.0, 10.0, 0.1


@pytest.mark.parametrize("speed", [0.01, 1.0, 100.0])
def test_natural_period(speed):
    """Half an oscillation of each spring at any amplitude: the flow over a period is the identity."""
    stay = math.pi / math.sqrt(K2)
    period = math.pi / math.sqrt(K1) + stay
    start = (speed / math.sqrt(K2), 0.0)
    arc = hybrid.simulate(
        bilinear_oscillator(),
        start,
        (0.0, period),
        parameters={"A": 0.0, "c": 0.0},
        tangent=True,
        solver=TIGHT,
    )
    np.testing.assert_allclose(arc.jumps.t, [stay / 2, period - stay / 2], rtol=0, atol=1e-10)
    np.testing.assert_allclose(arc.x[-1], start, atol=1e-10 * speed)
    np.testing.assert_allclose(arc.fundamental, np.eye(2), atol=1e-9)


def test_decay_of_free_motion():
    times = [math.pi / math.sqrt(k - C**2 / 4) for k in (K2, K1)]
    arc = hybrid.simulate(
        bilinear_oscillator(), (0.0, 1.0), (0.0, 30.0), mode="stiff", parameters={"A": 0.0}, solver=TIGHT
    )
    crossings = np.cumsum(times * 4)
    np.testing.assert_allclose(arc.jumps.t[:8], crossings, rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        np.abs([jump.x_minus[1] for jump in arc.jumps[:8]]), np.exp(-C * crossings / 2), rtol=1e-9
    )


def forced_orbit(w, guess):
    """Orbit with one visit to positive ``x`` per period: its start, its length, its middle.

    Solved with both flights in closed form.
    """
    soft, stiff = (ImpactOscillator(k, C, 1.0, w, 0.0, 1.0) for k in (K1, K2))
    with mp.workdps(30):

        def closing(t, stay, v):
            x_leave, v_leave = stiff.flight(0, v, t)(t + stay)
            x_end, v_end = soft.flight(x_leave, v_leave, t + stay)(t + 2 * mp.pi / w)
            return x_leave, x_end, v_end - v

        t, stay, v = mp.findroot(closing, guess)
        middle = stiff.flight(0, v, t)(t + stay / 2)
    return float(t), float(stay), np.array([float(value) for value in middle])


@pytest.mark.parametrize(("w", "guess"), [(1.5, (0.29, 1.0, 9.05)), (2.5, (1.25, 0.6, 0.4))])
def test_forced_orbit(w, guess):
    """At the higher frequency the orbit is unstable after a period doubling."""
    t, stay, x = forced_orbit(w, guess)
    orbit = hybrid.periodic_orbit(bilinear_oscillator(), x + 1e-3, parameters={"w": w}, t0=t + stay / 2)
    np.testing.assert_allclose(orbit.x0, x, rtol=0, atol=1e-9)
    arc = orbit.arc(TIGHT)
    np.testing.assert_allclose(arc.jumps.t, [t + stay, t + 2 * math.pi / w], rtol=0, atol=1e-9)
    soft, stiff = (np.array([[0.0, 1.0], [-k, -C]]) for k in (K1, K2))
    exact = np.linalg.eigvals(expm((2 * math.pi / w - stay) * soft) @ expm(stay * stiff))
    assert (np.abs(exact).max() > 1) == (w > 2)
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), np.sort_complex(exact), atol=1e-8)


def test_exponents():
    """Exponents of the attracting orbit: its multipliers are complex with a modulus set by the damping."""
    result = lyapunov.lyapunov_spectrum(
        bilinear_oscillator(), (0.0, 1.0), parameters={"w": 1.5}, intervals=2000
    )
    assert np.all(np.abs(result.exponents + C / 2) <= 2 * result.standard_error + 1e-12)
    assert result.exponents.sum() == pytest.approx(-C, abs=1e-9)
