"""Exponents on both sides of a grazing have no spike, by closed forms and by two orbits.

An overdamped impact oscillator: small displacements decay monotonically. Up to the grazing its orbit has
the exponents of the linear flow. Beyond it stable orbits with one impact in ever more periods alternate with
chaos, down to the grazing (Nordmark 1991, doi:10.1016/0022-460X(91)90592-8).
"""

import math

import numpy as np
import pytest

from hybrid import DOP853, simulate
from lyapunov import lyapunov_spectrum, two_orbit_exponents
from models import impact_oscillator
from models.one_impact import one_impact_orbits

# x'' + 1.1 x' + 0.1 x has the roots -0.1 and -1.
DAMPED = {"k": 0.1, "c": 1.1, "w": 1.0, "d": 1.0, "r": 0.8}
GRAZING = math.hypot(DAMPED["k"] - DAMPED["w"] ** 2, DAMPED["c"] * DAMPED["w"]) * DAMPED["d"]
PERIOD = 2 * math.pi


def beyond_grazing(share):
    return {**DAMPED, "A": (1 + share) * GRAZING}


@pytest.mark.parametrize("share", [-1e-1, -1e-3, -1e-5, -1e-7, -1e-9])
def test_up_to_the_grazing_the_flow_is_linear(share):
    spectrum = lyapunov_spectrum(
        impact_oscillator(), (0.0, 0.0), parameters=beyond_grazing(share), intervals=200
    )
    assert spectrum.jumps_per_interval == 0
    np.testing.assert_allclose(spectrum.exponents, [-0.1, -1.0], atol=1e-9)


@pytest.mark.parametrize(
    ("share", "n"), [(1e-1, 4), (1e-3, 7), (1e-5, 11), (2.5e-7, 14), (6.3e-9, 17), (5e-10, 19)]
)
def test_beyond_it_stable_orbits_have_the_exponents_of_the_closed_form(share, n):
    p = beyond_grazing(share)
    (orbit,) = one_impact_orbits(**p, n=n)
    exact = math.log(max(abs(orbit.multipliers))) / (n * PERIOD)
    assert exact < 0
    # Start half a flight after an impact, so that each interval contains one impact.
    impact, start = orbit.theta, orbit.theta + n * PERIOD / 2
    x0 = simulate(impact_oscillator(), (p["d"], -p["r"] * orbit.V), (impact, start), parameters=p).x[-1]
    spectrum = lyapunov_spectrum(
        impact_oscillator(),
        x0,
        t0=start,
        interval=n * PERIOD,
        parameters=p,
        k=1,
        intervals=60,
        transient=60,
    )
    assert spectrum.jumps_per_interval == 1
    # The relative error of so small a depth, and of the impact speed, is proportional to its reciprocal.
    assert abs(spectrum.exponents[0] - exact) < 1e-10 + 1e-13 / share


@pytest.mark.parametrize(("share", "exponent"), [(2.5e-3, 0.0168), (4e-6, 0.0123)])
def test_in_the_chaos_between_two_orbits_separate_as_fast(share, exponent):
    p = beyond_grazing(share)
    x0 = simulate(
        impact_oscillator(), (0.0, 0.0), (0.0, 100 * PERIOD), parameters=p, samples=[100 * PERIOD]
    ).x[-1]
    spectrum = lyapunov_spectrum(impact_oscillator(), x0, parameters=p, k=1, intervals=2000)
    pair = two_orbit_exponents(
        impact_oscillator(),
        x0,
        parameters=p,
        intervals=2000,
        separation=1e-11,
        solver=DOP853(rtol=1e-12, atol=1e-14),
    )
    assert spectrum.exponents[0] == pytest.approx(exponent, abs=5e-3)
    assert pair.renormalised_exponent == pytest.approx(exponent, abs=5e-3)


def test_a_spectrum_with_grazed_jumps_says_so():
    """Too close for the tolerances to separate an impact from a touch: a warning but no spike."""
    p = beyond_grazing(1e-12)
    spectrum = lyapunov_spectrum(impact_oscillator(), (0.0, 0.0), parameters=p, k=1, intervals=400)
    assert "jumps grazed within the tolerances" in spectrum.status.message
    assert "to the first exponent" in spectrum.status.message
    assert -0.1 < spectrum.exponents[0] < 0.02
