"""The three-disk billiard: stretching of its shortest orbits, escape, and the closed pocket between disks."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from models import three_disk_billiard

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)


def multipliers(start, period, R):
    """Multipliers of a closed orbit by modulus; energy and flow direction give two that are 1."""
    arc = hybrid.simulate(
        three_disk_billiard(), start, (0.0, period), parameters={"R": R}, tangent=True, solver=TIGHT
    )
    np.testing.assert_allclose(arc.x[-1], start, atol=1e-9)
    values = np.linalg.eigvals(arc.fundamental)
    return values[np.argsort(-np.abs(values))]


@pytest.mark.parametrize("R", [2.5, 4.0, 6.0])
def test_orbit_between_two_disks(R):
    a = 1.0
    sigma = R / a
    found = multipliers((0.0, -R / (2 * math.sqrt(3)), 1.0, 0.0), 2 * (R - 2 * a), R)
    stretch = sigma - 1 + math.sqrt(sigma * (sigma - 2))
    assert found[0].real == pytest.approx(stretch**2, rel=1e-9)
    assert found[-1].real == pytest.approx(stretch**-2, rel=1e-6)
    # A double eigenvalue with one eigenvector is accurate to the square root of rounding.
    np.testing.assert_allclose(found[1:3], 1.0, atol=1e-5)


@pytest.mark.parametrize("R", [2.5, 4.0, 6.0])
def test_triangular_orbit(R):
    a = 1.0
    sigma = R / a
    side = R - math.sqrt(3) * a
    # The lower side, from left to right, relative to its middle.
    found = multipliers((0.0, -side / (2 * math.sqrt(3)), 1.0, 0.0), 3 * side, R)
    s = 2 * sigma / math.sqrt(3)
    stretch = s - 1 + s * math.sqrt(1 - math.sqrt(3) / sigma)
    assert found[0].real == pytest.approx(-(stretch**3), rel=1e-9)
    np.testing.assert_allclose(found[1:3], 1.0, atol=1e-5)


def test_escape():
    """A particle near the orbit between two disks leaves after some reflections at the same speed."""
    start = (0.0, -math.sqrt(3), math.cos(0.02), math.sin(0.02))
    arc = hybrid.simulate(three_disk_billiard(), start, (0.0, 1000.0))
    assert 1 <= len(arc.jumps) <= 10
    assert np.hypot(*arc.x[-1, :2]) > 900
    assert np.hypot(*arc.x[-1, 2:]) == pytest.approx(1.0, rel=1e-12)


def test_closed_pocket():
    """The mean free path of a mixing billiard is pi times its area divided by its perimeter."""
    a, R = 1.0, 1.9
    cut = math.acos(R / (2 * a))
    perimeter = 3 * a * (math.pi / 3 - 2 * cut)
    lens = a**2 * cut - R / 2 * math.sqrt(a**2 - R**2 / 4)
    area = math.sqrt(3) / 4 * R**2 - math.pi * a**2 / 2 + 3 * lens
    result = lyapunov.lyapunov_spectrum(
        three_disk_billiard(),
        (0.01, 0.02, math.cos(0.3), math.sin(0.3)),
        parameters={"R": R},
        interval=1.0,
        intervals=2000,
    )
    assert result.jumps_per_interval == pytest.approx(perimeter / (math.pi * area), rel=0.02)
    assert result.exponents[0] > 1.0
    np.testing.assert_allclose(result.exponents + result.exponents[::-1], 0.0, atol=1e-9)
    # Two exponents are zero (speed, flight direction); their estimates converge like one over the time.
    np.testing.assert_allclose(result.exponents[1:3], 0.0, atol=3e-3)
