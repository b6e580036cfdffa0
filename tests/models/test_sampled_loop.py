"""The sampled loop compared with its difference equation."""

import numpy as np
import pytest

import hybrid
from models import sampled_loop

P = sampled_loop().parameters
K, T, PHI = P["K"], P["T"], np.exp(-P["T"] / P["tau"])


def samples(y, u, e, count, p):
    """Output before each sample, and the values held after it."""
    found = []
    for _ in range(count):
        y = PHI * y + K * (1 - PHI) * u
        error = p["r"] - y
        u = np.clip(u + p["Kp"] * (error - e) + p["Ki"] * T * error, -p["u_max"], p["u_max"])
        e = error
        found.append((y, u, e))
    return found


@pytest.mark.parametrize("limit", [1.1, 1.5, 100.0])
def test_the_step_response(limit):
    arc = hybrid.simulate(sampled_loop(), {"y": 0.0}, (0.0, 50 * T), parameters={"u_max": limit})
    assert len(arc.jumps) == 50
    exact = samples(0.0, 0.0, 0.0, 50, {**P, "u_max": limit})
    np.testing.assert_allclose(arc.jumps.x_plus, exact, atol=1e-12)
    assert (np.abs(arc["u"]).max() == arc.parameters["u_max"]) == (limit < 100.0)


def test_the_multipliers():
    orbit = hybrid.periodic_orbit(sampled_loop(), (1.0, 1.0, 0.0))
    k, g = P["Kp"] + P["Ki"] * T, K * (1 - PHI)
    # A sample, then a period; the orbit starts with the period, which leaves the eigenvalues as they are.
    matrix = np.array([[PHI - g * k, g, -g * P["Kp"]], [-k, 1.0, -P["Kp"]], [-1.0, 0.0, 0.0]])
    expected = sorted(np.linalg.eigvals(matrix), key=lambda m: (abs(m), m.imag))
    found = sorted(orbit.multipliers, key=lambda m: (abs(m), m.imag))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    np.testing.assert_allclose(orbit.x0, (1.0, 1.0, 0.0), atol=1e-12)


def test_saturation_ends_a_deviation_of_the_control():
    arc = hybrid.simulate(sampled_loop(), {"y": 0.0, "u": 1.5}, (0.0, T), tangent=True)
    assert arc["u"][-1] == arc.parameters["u_max"]
    np.testing.assert_allclose(arc.fundamental[1], 0.0)


def test_it_does_not_wind_up():
    """After a long time at the limit the control leaves it at the first sample that asks for less."""
    far = {"r": 3.0}
    held = hybrid.simulate(sampled_loop(), {"y": 0.0}, (0.0, 20.0), parameters=far)
    assert held["u"][-1] == held.parameters["u_max"]
    back = hybrid.simulate(sampled_loop(), held.x[-1], (20.0, 20.25))
    assert back["u"][-1] < 0.999 * P["u_max"]
