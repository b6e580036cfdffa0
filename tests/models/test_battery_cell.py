"""The cell compared with the closed form between the points of its drive cycle."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from models import battery_cell
from models.battery_cell import CYCLE

P = battery_cell().parameters
TIMES, SHARES = map(np.array, zip(*CYCLE, strict=True))


def stretch(s, v1, tau, i, slope, p):
    """State after the time ``tau`` in which the current is ``i + slope * t``."""
    a = p["R_1"] * p["C_1"]
    steady = p["R_1"] * (i - slope * a)
    end = steady + p["R_1"] * slope * tau
    return s - (i * tau + slope * tau**2 / 2) / p["Q"], end + (v1 - steady) * np.exp(-tau / a)


def voltage(s, v1, i, p):
    return p["E_0"] + (p["E_1"] - p["E_0"]) * s - v1 - p["R_0"] * i


def cut_off(p, s=1.0, v1=0.0, most=1000):
    """Time and state of the cut-off: stretch by stretch, and in the first that ends below, a root."""
    for k in range(most):
        for (t0, t1), (a, b) in zip(pairwise(TIMES), pairwise(p["I"] * SHARES), strict=True):
            slope = (b - a) / (t1 - t0)

            def reserve(tau, s=s, v1=v1, a=a, slope=slope):
                return voltage(*stretch(s, v1, tau, a, slope, p), a + slope * tau, p) - p["u_min"]

            if reserve(t1 - t0) < 0:
                tau = brentq(reserve, 0.0, t1 - t0, xtol=1e-13)
                return k * TIMES[-1] + t0 + tau, stretch(s, v1, tau, a, slope, p)
            s, v1 = stretch(s, v1, t1 - t0, a, slope, p)
    raise AssertionError("no cut-off")


def test_one_cycle():
    arc = hybrid.simulate(battery_cell(), (0.9, 0.0), (0.0, 65.0), samples=TIMES)
    s, v1 = 0.9, 0.0
    for k, (t0, t1) in enumerate(pairwise(TIMES)):
        a, b = P["I"] * SHARES[k : k + 2]
        s, v1 = stretch(s, v1, t1 - t0, a, (b - a) / (t1 - t0), P)
        np.testing.assert_allclose(arc.x[k + 1], (s, v1), rtol=1e-11, atol=1e-13)
    assert 0.9 - s == pytest.approx(13.0 * P["I"] / P["Q"], rel=1e-12)


@pytest.mark.parametrize("given", [{}, {"I": 16.0}, {"R_0": 0.06}, {"u_min": 3.3}])
def test_the_cut_off(given):
    t, (s, v1) = cut_off({**P, **given})
    arc = hybrid.simulate(battery_cell(), (1.0, 0.0), (0.0, t + 1000.0), parameters=given)
    [jump] = arc.jumps
    assert jump.t == pytest.approx(t, rel=1e-9)
    np.testing.assert_allclose(jump.x_minus, (s, v1), rtol=1e-8)
    # The cell recovers: the voltage of the RC pair goes back to zero.
    assert arc["s"][-1] == jump.x_minus[0]
    assert arc["v1"][-1] == pytest.approx(v1 * np.exp(-(arc.t[-1] - t) / (P["R_1"] * P["C_1"])), rel=1e-8)


def test_the_cut_off_moves_with_the_resistance():
    """The derivative of its time in a parameter, by differences of the closed form."""
    arc = hybrid.simulate(battery_cell(), (1.0, 0.0), (0.0, 8000.0), sensitivities=("R_0",))
    h = 1e-6
    up, down = (cut_off({**P, "R_0": P["R_0"] + s * h})[0] for s in (1, -1))
    assert arc.jumps.t_sensitivity[0, 0] == pytest.approx((up - down) / (2 * h), rel=1e-5)
