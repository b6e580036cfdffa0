"""Surfaces that change nothing: a branch passes them without a word, and without a warning of NumPy."""

import warnings

import numpy as np

from hybrid import continue_orbit, from_equations, periodic_orbit


def test_a_gear_without_backlash_is_a_linear_oscillator():
    """Its multipliers are those of the stiffness alone, whatever guards its orbits touch."""

    def mesh(t, x, p):
        stiffness = np.where(np.mod(t, 2 * np.pi / p.w) < np.pi / p.w, 1.2, 0.8)
        deflection = np.where(x.x > p.b, x.x - p.b, np.where(x.x < -p.b, x.x + p.b, 0.0))
        return x.v, 0.1 + 0.3 * np.cos(p.w * t) - 0.1 * x.v - stiffness * deflection

    gear = from_equations(
        mesh, state=("x", "v"), parameters={"b": 0.0, "w": 0.8}, period=lambda p: 2 * np.pi / p.w
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        branch = continue_orbit(periodic_orbit(gear, (1.2, 0.0)), "w", (0.8, 1.0))
    assert branch.status.ok
    # Liouville: the product of the multipliers is that of the damping over a period.
    products = np.prod(branch.multipliers, axis=1)
    np.testing.assert_allclose(products, np.exp(-0.1 * branch.period), rtol=1e-9)
