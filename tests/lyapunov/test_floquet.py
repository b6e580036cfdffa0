"""Floquet exponents against multipliers in closed form."""

from types import SimpleNamespace

import numpy as np

import hybrid
import lyapunov
import models
from models.one_impact import one_impact_orbits


def test_logarithms_in_the_order_of_the_multipliers():
    orbit = SimpleNamespace(multipliers=np.array([1j * np.e, -1.0, 0.5]), period=2.0)
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), [0.5, 0.0, np.log(0.5) / 2], rtol=1e-15)


def test_a_zero_multiplier_is_minus_infinity_and_no_warning():
    orbit = SimpleNamespace(multipliers=np.array([1.0, 0.0]), period=3.0)
    assert lyapunov.floquet_exponents(orbit).tolist() == [0.0, -np.inf]


def test_impact_oscillator_against_its_closed_form():
    (closed,) = one_impact_orbits(k=1.0, c=0.1, A=1.0, w=1.0, d=1.0, r=0.8)
    orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    expected = np.log(np.abs(closed.multipliers)) / (2 * np.pi)
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), expected, rtol=1e-9)


def test_founding_system():
    orbit = hybrid.periodic_orbit(models.vibroimpact(), (-0.0076, -0.0041, 0.0556, -0.356))
    expected = [-0.05489357, -0.05489357, -0.39487603, -0.39487603]
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), expected, atol=1e-7)
