"""The simplest walker: both gaits at the slope of the paper, and its period doublings."""

import numpy as np
import pytest

import hybrid
from models import simplest_walker
from tests.reference.load import complex_pairs, reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
SYSTEM = simplest_walker()
LONG, SHORT = reference("simplest_walker")
gaits = pytest.mark.parametrize("gait", [LONG, SHORT], ids=["long", "short"])
STRIKE = hybrid.Guard(lambda t, x, p: x.phi - 2 * x.theta, direction=+1)


def long_gait(gamma):
    """The orbit at another slope, from the paper's scaling: angles grow with the cube root of the slope."""
    theta, _, rate, _ = np.array(LONG["x0"]) * (gamma / 0.009) ** (1 / 3)
    guess = theta, 2 * theta, rate, (1 - np.cos(2 * theta)) * rate
    return hybrid.periodic_orbit(SYSTEM, guess, mode="behind", period=3.88, parameters={"gamma": gamma})


def strikes(gamma, count):
    """Stance angles at heelstrikes of a settled walk that starts near the long gait."""
    orbit = long_gait(gamma)
    section = hybrid.poincare_section(
        SYSTEM, orbit.x0 * (1 + 1e-6), STRIKE, points=count, transient=250, mode=orbit.mode,
        parameters={"gamma": gamma},
    )  # fmt: skip
    assert section.status.ok
    return section.x[:, 0]


@gaits
def test_one_step(gait):
    arc = hybrid.simulate(SYSTEM, gait["x0"], (0.0, gait["period"] + 0.1), solver=TIGHT)
    assert [jump.transition for jump in arc.jumps] == ["passing", "heelstrike"]
    assert arc.jumps[1].t == pytest.approx(gait["period"], abs=1e-10)
    np.testing.assert_allclose(arc.jumps[1].x_plus, gait["x0"], atol=1e-10)
    np.testing.assert_allclose(arc.jumps[0].saltation, np.eye(4), atol=1e-12)


@gaits
def test_orbit(gait):
    guess = np.array(gait["x0"]) * (1 + 1e-4)
    orbit = hybrid.periodic_orbit(SYSTEM, guess, mode="behind", period=3.5)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(gait["period"], abs=1e-9)
    found = sorted(orbit.multipliers, key=lambda m: (round(m.real, 9), m.imag))
    np.testing.assert_allclose(found, complex_pairs(gait["multipliers"]), atol=1e-8)


def test_heelstrike_is_an_impulse_along_the_new_leg():
    """The hip keeps its velocity across the new leg; the old foot keeps zero velocity across its leg."""
    arc = hybrid.simulate(SYSTEM, np.array(LONG["x0"]) * 1.02, (0.0, 4.2))
    strike = next(jump for jump in arc.jumps if jump.transition == "heelstrike")

    def across(angle):
        return np.array([-np.cos(angle), -np.sin(angle)])

    theta, phi, rate, _ = strike.x_minus
    old, new = theta, theta - phi
    new_rate = rate * across(old) @ across(new)
    old_rate = new_rate * across(new) @ across(old)
    np.testing.assert_allclose(strike.x_plus, [new, new - old, new_rate, new_rate - old_rate], atol=1e-12)


def test_the_long_gait_is_stable_for_slopes_below_0_015():
    assert np.sort(np.abs(long_gait(0.015).multipliers))[2] < 1
    steeper = long_gait(0.0152).multipliers
    assert min(steeper.real) < -1


@pytest.mark.parametrize(("gamma", "periods"), [(0.014, 1), (0.016, 2), (0.018, 4)])
def test_the_period_doubles(gamma, periods):
    angles = strikes(gamma, 48)
    assert np.ptp(angles.reshape(-1, periods), axis=0).max() < 1e-7
    assert len(np.unique(np.round(angles, 4))) == periods


def test_it_walks_chaotically_before_it_falls():
    angles = strikes(0.0189, 300)
    assert len(np.unique(np.round(angles, 5))) > 100
