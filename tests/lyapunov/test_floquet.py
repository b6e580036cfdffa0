"""Floquet exponents compared with multipliers in closed form."""

import attrs
import numpy as np
import pytest

import hybrid
import lyapunov
import models
from models.one_impact import one_impact_orbits


@pytest.fixture(scope="module")
def impacting():
    return hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))


def test_logarithms_in_the_order_of_the_multipliers(impacting):
    orbit = attrs.evolve(impacting, log_moduli=np.array([1.0, 0.0, np.log(0.5)]), period=2.0)
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), [0.5, 0.0, np.log(0.5) / 2], rtol=1e-15)


def test_a_zero_multiplier_is_minus_infinity_and_no_warning(impacting):
    orbit = attrs.evolve(impacting, log_moduli=np.array([0.0, -np.inf]), period=3.0)
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


@pytest.fixture(scope="module")
def van_der_pol():
    return hybrid.HybridSystem(
        state=("x", "y"),
        parameters={"mu": 3.0},
        modes=[hybrid.Mode("turn", lambda t, x, p: (x.y, p.mu * (1 - x.x**2) * x.y - x.x))],
    )


@pytest.mark.parametrize(("mu", "period", "exponent"), [(3.0, 8.86, -3.9391), (10.0, 19.08, -16.345)])
@pytest.mark.parametrize("solver", [None, hybrid.Taylor()])
def test_a_strongly_contracting_orbit(van_der_pol, mu, period, exponent, solver):
    """The other exponent of a planar orbit is the mean divergence; its multiplier can be 1e-136."""
    orbit = hybrid.periodic_orbit(
        van_der_pol, (2.0, 0.0), parameters={"mu": mu}, period=period, solver=solver
    )
    arc = hybrid.simulate(van_der_pol, orbit.x0, (0.0, orbit.period), parameters={"mu": mu})
    t = np.linspace(0.0, orbit.period, 40_001)[:-1]
    mean = mu * np.mean(1 - arc(t)[:, 0] ** 2)
    assert mean == pytest.approx(exponent, rel=1e-4)
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), [0.0, mean], atol=1e-8)
    np.testing.assert_allclose(orbit.multipliers[1], np.exp(mean * orbit.period), rtol=1e-6)


@pytest.mark.parametrize("decay", [8.0, 20.0, 200.0])
def test_a_linear_system_has_its_eigenvalues(decay):
    """The exponents are the matrix's eigenvalues, even if a multiplier is below the smallest double."""
    system = hybrid.HybridSystem(
        state=("a", "b"),
        parameters={"decay": 20.0},
        modes=[
            hybrid.Mode(
                "only",
                lambda t, x, p: (-0.1 * x.a + 0.5 * x.b + np.cos(t), 0.3 * x.a - p.decay * x.b),
            )
        ],
        period=2 * np.pi,
    )
    orbit = hybrid.periodic_orbit(system, (0.0, 0.0), parameters={"decay": decay})
    exact = np.sort(np.linalg.eigvals([[-0.1, 0.5], [0.3, -decay]]))[::-1]
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), exact, rtol=1e-11)


def test_steps_of_an_implicit_method_that_are_too_long_for_tangent_vectors():
    """At a loose tolerance a step forgets the fast state to all digits; shorter ones keep its exponent.

    The orbit follows ``cos t`` slowly, so the solver's own steps are far longer than 1/300.
    """
    system = hybrid.HybridSystem(
        state=("x", "y"),
        modes=[hybrid.Mode("m", lambda t, x, p: (-x.x + np.cos(t), -300.0 * (x.y - x.x)))],
        period=2 * np.pi,
    )
    orbit = hybrid.periodic_orbit(system, (0.5, 0.5), solver=hybrid.RadauIIA(rtol=1e-6, atol=1e-8))
    np.testing.assert_allclose(lyapunov.floquet_exponents(orbit), [-1.0, -300.0], rtol=1e-6)
