"""The rocking block: free rocking by energy and quadrature, Housner's and Hogan's slender block."""

import math

import mpmath as mp
import numpy as np
import pytest

import hybrid
from models import rocking_block

ALPHA, P, E = 0.25, 2.0, 0.9
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-15)
# Slender enough to neglect quadratic terms, with matching tolerances.
SLENDER = 1e-5
FINE = hybrid.DOP853(rtol=1e-12, atol=1e-18)


def quarter_period(theta0):
    """From rest at ``theta0`` to the impact, by energy; ``theta = theta0 - s^2`` tames the turning point."""

    def integrand(s):
        # cos(alpha - theta0) - cos(alpha - theta), without the cancellation
        gain = 2 * mp.sin(ALPHA - theta0 + s**2 / 2) * mp.sin(s**2 / 2)
        return 2 * s / (P * mp.sqrt(2 * gain))

    return mp.quad(integrand, [0, mp.sqrt(theta0) / 2, mp.sqrt(theta0)])


def test_free_rocking():
    """Each impact leaves ``e^2`` of the energy, which gives the next amplitude and its time."""
    amplitudes = [mp.mpf("0.2")]
    for _ in range(6):
        fall = mp.cos(ALPHA - amplitudes[-1]) - mp.cos(ALPHA)
        amplitudes.append(ALPHA - mp.acos(mp.cos(ALPHA) + E**2 * fall))
    quarters = np.array([float(quarter_period(theta)) for theta in amplitudes])
    impacts = np.cumsum(quarters[:-1] + np.append(0.0, quarters[1:-1]))
    tops = impacts + quarters[1:]
    arc = hybrid.simulate(rocking_block(), (0.2, 0.0), (0.0, tops[-1]), solver=TIGHT)
    np.testing.assert_allclose(arc.jumps.t, impacts, rtol=0, atol=1e-10)
    exact = [-float(theta) * (-1) ** k for k, theta in enumerate(amplitudes[1:])]
    np.testing.assert_allclose([arc(t)[0] for t in tops], exact, rtol=0, atol=1e-11)


def test_the_slender_block_of_housner():
    """``arcosh(1 / (1 - theta0 / alpha)) / p``, up to terms in ``alpha^2``."""
    arc = hybrid.simulate(
        rocking_block(), (0.7 * SLENDER, 0.0), (0.0, 1.0), parameters={"alpha": SLENDER}, solver=FINE
    )
    assert arc.jumps[0].t == pytest.approx(math.acosh(1 / 0.3) / P, abs=1e-9)


def test_impacts_accumulate():
    arc = hybrid.simulate(rocking_block(), (0.2, 0.0), (0.0, 30.0))
    assert arc.status.code == hybrid.StatusCode.ACCUMULATION
    np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-12)


def test_elastic_rocking_is_a_shear():
    """The tangent map over a period from rest follows from the period as a function of the amplitude."""
    theta0 = 0.15
    T = 4 * float(quarter_period(theta0))
    arc = hybrid.simulate(
        rocking_block(), (theta0, 0.0), (0.0, T), parameters={"e": 1.0}, tangent=True, solver=TIGHT
    )
    acceleration = -(P**2) * math.sin(ALPHA - theta0)
    exact = [[1.0, 0.0], [-acceleration * 4 * float(mp.diff(quarter_period, theta0)), 1.0]]
    np.testing.assert_allclose(arc.x[-1], (theta0, 0.0), atol=1e-10)
    np.testing.assert_allclose(arc.fundamental, exact, rtol=1e-8, atol=1e-8)


def harmonic_orbit(beta, w, e):
    """Symmetric orbit of the slender block: phase and speed as it leaves zero, and its multipliers.

    In units of ``alpha`` and ``1 / p`` it is ``x'' = x - 1 - beta cos(w t)`` from ``(0, V)`` to
    ``(0, -V / e)`` in half a period. Without the forced response, ``(1 + c, s)`` at the start and
    ``(1 - c, -s)`` at the end, the flow is free and linear in ``c``, ``s`` and ``V``, and
    ``c^2 + (s / w)^2`` is known.
    """
    ch, sh = math.cosh(math.pi / w), math.sinh(math.pi / w)
    flow = np.array([[ch, sh], [sh, ch]])
    response = beta / (1 + w**2)
    constant = np.linalg.solve(flow + np.eye(2), [1 - ch, -sh])
    per_speed = np.linalg.solve(flow + np.eye(2), [sh, ch + 1 / e])
    a, b = (values * (1.0, 1 / w) for values in (per_speed, constant))
    V = max(np.roots([a @ a, 2 * a @ b, b @ b - response**2]))
    c, s = constant + per_speed * V
    ground = beta * c / response
    bend = ((1 + ground) - e * (-1 + ground)) / (-V / e)
    multipliers = np.linalg.eigvals(np.array([[e, 0.0], [bend, e]]) @ flow) ** 2
    return math.atan2(-s / w, c) / w, V, multipliers


@pytest.mark.parametrize(("beta", "w", "e"), [(3.0, 4.0, 0.9), (2.0, 2.0, 0.7), (5.0, 2.0, 0.9)])
def test_rocking_with_the_ground(beta, w, e):
    """The cases are stable, a node, and unstable."""
    t, V, multipliers = harmonic_orbit(beta, w, e)
    parameters = {"alpha": SLENDER, "p": 1.0, "e": e, "A": beta * SLENDER, "w": w}
    quarter = math.pi / (2 * w)
    options = {"mode": "right", "parameters": parameters, "solver": FINE}
    guess = hybrid.simulate(rocking_block(), (0.0, V * SLENDER), (t, t + quarter), **options).x[-1]
    orbit = hybrid.periodic_orbit(rocking_block(), guess * 1.001, t0=t + quarter, **options)
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0 / SLENDER, guess / SLENDER, atol=1e-8)
    np.testing.assert_allclose(orbit.arc(FINE).jumps.t, [t + 2 * quarter, t + 4 * quarter], atol=1e-8)
    np.testing.assert_allclose(
        np.sort_complex(orbit.multipliers), np.sort_complex(multipliers), rtol=1e-8, atol=1e-8
    )
