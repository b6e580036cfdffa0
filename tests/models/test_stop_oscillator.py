"""The oscillator between stops: free motion in closed form, a forced orbit solved at thirty digits."""

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm

import hybrid
from models import stop_oscillator
from tests.reference.impacts import ImpactOscillator

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
C, KS = 0.1, 10.0


def period(V, F0):
    """Period of free undamped motion with ``k = d = 1``: arcs about zero and about the stop's balance."""
    outer = mp.sqrt(1 + KS)
    return 4 * mp.asin(1 / V) + 4 / outer * mp.atan(outer * mp.sqrt(V**2 - 1) / (1 + F0))


@pytest.mark.parametrize(("V", "F0"), [(1.5, 0.0), (1.5, 3.0), (10.0, 3.0), (4.0, -0.5)])
def test_free_motion(V, F0):
    """Times at the stops, and the tangent map: a shear, because the period depends on the speed."""
    T = float(period(V, F0))
    arc = hybrid.simulate(
        stop_oscillator(),
        (0.0, V),
        (0.0, T),
        parameters={"c": 0.0, "A": 0.0, "F0": F0},
        tangent=True,
        solver=TIGHT,
    )
    reach = math.asin(1 / V)
    times = [reach, T / 2 - reach, T / 2 + reach, T - reach]
    assert [jump.transition for jump in arc.jumps] == [
        "touch right",
        "leave right",
        "touch left",
        "leave left",
    ]
    np.testing.assert_allclose(arc.jumps.t, times, rtol=0, atol=1e-10)
    np.testing.assert_allclose(arc.x[-1], (0.0, V), atol=1e-10 * V)
    shear = -V * float(mp.diff(lambda speed: period(speed, F0), V))
    np.testing.assert_allclose(arc.fundamental, [[1.0, shear], [0.0, 1.0]], atol=1e-8)


@pytest.mark.parametrize("name", ["touch right", "leave right", "touch left", "leave left"])
def test_saltation(name):
    speed = 0.7
    v = speed if name in ("touch right", "leave left") else -speed
    x = (1.0 if "right" in name else -1.0, v)
    found = hybrid.saltation_matrix(stop_oscillator(), name, 0.2, x, parameters={"F0": 3.0})
    np.testing.assert_allclose(found, [[1.0, 0.0], [-3.0 / speed, 1.0]], atol=1e-13)


def forced_orbit(w, F0, guess):
    """Symmetric orbit, each stop once per period: time, duration and speed of the right contact."""
    free = ImpactOscillator(1.0, C, 2.0, w, 0.0, 1.0)
    stop = ImpactOscillator(1.0 + KS, C, 2.0, w, 0.0, 1.0)
    balance = mp.mpf(KS - F0) / (1 + KS)
    with mp.workdps(30):

        def closing(t, stay, v):
            x_leave, v_leave = stop.flight(1 - balance, v, t)(t + stay)
            x_end, v_end = free.flight(1, v_leave, t + stay)(t + mp.pi / w)
            return x_leave + balance - 1, x_end + 1, v_end + v

        t, stay, v = mp.findroot(closing, guess)
        x_middle, v_middle = stop.flight(1 - balance, v, t)(t + stay / 2)
        _, v_leave = stop.flight(1 - balance, v, t)(t + stay)
    middle = np.array([float(x_middle + balance), float(v_middle)])
    return float(t), float(stay), float(v), float(-v_leave), middle


@pytest.mark.parametrize(
    ("w", "F0", "guess"),
    [(1.5, 0.0, (3.75, 1.03, 1.98)), (1.5, 1.0, (3.79, 0.94, 1.86)), (2.0, 1.0, (2.77, 0.94, 3.2))],
)
def test_forced_orbit(w, F0, guess):
    """The multipliers are the squares of those of half a period followed by a reflection."""
    t, stay, v_touch, v_leave, x = forced_orbit(w, F0, guess)
    parameters = {"w": w, "F0": F0, "A": 2.0}
    orbit = hybrid.periodic_orbit(stop_oscillator(), x + 1e-3, parameters=parameters, t0=t + stay / 2)
    np.testing.assert_allclose(orbit.x0, x, rtol=0, atol=1e-9)
    half = math.pi / w
    np.testing.assert_allclose(
        orbit.arc(TIGHT).jumps.t, t + np.array([stay, half, half + stay, 2 * half]), rtol=0, atol=1e-9
    )
    free, stop = (np.array([[0.0, 1.0], [-k, -C]]) for k in (1.0, 1.0 + KS))
    touch, leave = (np.array([[1.0, 0.0], [-F0 / speed, 1.0]]) for speed in (v_touch, v_leave))
    exact = np.linalg.eigvals(expm((half - stay) * free) @ leave @ expm(stay * stop) @ touch) ** 2
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), np.sort_complex(exact), atol=1e-8)
