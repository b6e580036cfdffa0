"""Zeros along a curve, and Hermite's polynomial through places of one."""

from __future__ import annotations

import numpy as np
import pytest

from hybrid.orbits.zeros import interpolated, zero_on_the_way


def located(function, low, high):
    """The zero of a function of a number, and how often the function was asked."""
    asked = []

    def value(s):
        asked.append(s)
        return function(s)

    return zero_on_the_way({low: low, high: high}, lambda s: s, value), len(asked)


def test_a_smooth_function_is_asked_a_few_times():
    found, count = located(lambda s: np.exp(s) - 1.01, 0.0, 0.05)
    assert found == pytest.approx(np.log(1.01), rel=1e-13)
    assert count <= 6


@pytest.mark.parametrize("function", [lambda s: np.cbrt(s - 0.3), lambda s: np.tanh(200.0 * (s - 0.3))])
def test_functions_that_are_far_from_polynomials(function):
    found, _ = located(function, 0.0, 1.0)
    assert found == pytest.approx(0.3, abs=1e-12)


def test_a_jump_is_enclosed():
    found, _ = located(lambda s: 1.0 if s > 0.3 else -1.0, 0.0, 1.0)
    assert found == pytest.approx(0.3, abs=1e-12)


def test_none_without_a_change_of_sign_or_where_a_step_fails():
    assert located(lambda s: s + 1.0, 0.0, 1.0)[0] is None
    assert zero_on_the_way({0.0: 0.0, 1.0: 1.0}, lambda s: None, lambda s: s - 0.3) is None


def test_a_polynomial_of_degree_five_goes_through_three_knots():
    powers = np.arange(6)

    def unknowns(s):
        return np.array([np.sum(s**powers), 2.0 * s**5 - s**2])

    def slopes(s):
        return np.array([np.sum(powers[1:] * s ** powers[:-1]), 10.0 * s**4 - 2.0 * s])

    knots = [(s, unknowns(s), slopes(s)) for s in (0.0, -0.4, 0.3)]
    np.testing.assert_allclose(interpolated(knots, 0.7), unknowns(0.7), rtol=1e-12)
    np.testing.assert_allclose(interpolated(knots[:1], 0.7), unknowns(0.0) + 0.7 * slopes(0.0), rtol=1e-12)
