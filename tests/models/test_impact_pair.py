"""The impact pair: its symmetric orbits and their multipliers in closed form, contraction in chaos."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from models import impact_pair


def symmetric_orbit(d, r):
    """State and time a quarter period before the right impact, phase there, multipliers; ``A = w = 1``.

    The mass crosses the box at the absolute speed ``u``: ``pi u = d + 2 cos(phase)``, and leaves the wall,
    which moves at ``-sin(phase)``, as fast as it came: ``u (1 - r) = (1 + r) sin(phase)``.
    """
    loss = (1 - r) / (1 + r)
    u = max(np.roots([math.pi**2 / 4 + loss**2, -math.pi * d / 2, d**2 / 4 - 1]))
    phase = math.atan2(u * loss, (math.pi * u - d) / 2)
    t = phase - math.pi / 2
    x = (d / 2 + math.cos(phase) - u * math.pi / 2 - math.cos(t), u + math.sin(t))
    half = np.roots([1.0, -(2 * r - math.pi * (1 + r) ** 2 * math.cos(phase) / (2 * u)), r**2])
    return x, t, phase, half**2


@pytest.mark.parametrize(("d", "r"), [(1.0, 0.8), (2.5, 0.6), (4.0, 0.8), (6.0, 0.7)])
def test_symmetric_orbit(d, r):
    x, t, phase, multipliers = symmetric_orbit(d, r)
    orbit = hybrid.periodic_orbit(impact_pair(), np.array(x) + 1e-4, parameters={"d": d, "r": r}, t0=t)
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, x, atol=1e-10)
    np.testing.assert_allclose(
        np.sort_complex(orbit.multipliers), np.sort_complex(multipliers), rtol=1e-8, atol=1e-8
    )
    jumps = orbit.arc().jumps
    assert [jump.transition for jump in jumps] == ["right", "left"]
    np.testing.assert_allclose(jumps.t, [phase, phase + math.pi], atol=1e-10)


def test_the_default_orbit_attracts():
    x, t, _, multipliers = symmetric_orbit(4.0, 0.8)
    assert np.abs(multipliers).max() < 1
    section = hybrid.stroboscopic_section(impact_pair(), (0.0, 1.0), t0=t, transient=300, periods=1)
    np.testing.assert_allclose(section.x[0], x, atol=1e-8)


def test_exponents_sum_to_the_losses_of_the_impacts():
    """In chaos each impact contracts areas by ``r^2``, and a flight preserves areas."""
    parameters = {"d": 1.0}
    result = lyapunov.lyapunov_spectrum(impact_pair(), (0.1, 1.0), parameters=parameters, intervals=2000)
    section = hybrid.stroboscopic_section(impact_pair(), (0.1, 1.0), parameters=parameters, periods=2000)
    rate = section.jumps.sum() / (2000 * 2 * math.pi)
    assert result.exponents[0] > 5 * result.standard_error[0]
    assert result.exponents.sum() == pytest.approx(2 * math.log(0.8) * rate, rel=0.02)
