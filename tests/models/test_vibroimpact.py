"""The founding model: its printed numbers, its identities, its periodic orbits to ten digits."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from models import vibroimpact
from models.contact import hertz_stiffness
from tests.reference.load import complex_pairs, reference

FOUNDING = reference("founding_system")
TIGHT = hybrid.DOP853(rtol=1e-11, atol=1e-13)
cases = pytest.mark.parametrize("gap", [0.05, 0.0])


def case(gap):
    return FOUNDING[f"D={gap:g}"]


def test_stiffness_of_the_contact():
    assert hertz_stiffness() == pytest.approx(1.53696379e11, rel=1e-8)
    assert vibroimpact().parameters["K"] == hertz_stiffness()


def test_graph():
    system = vibroimpact()
    assert system.mode_names == ("free", "contact")
    assert system.transition_names == ("impact", "release")
    assert system.forcing_period({"omega": 8.0}) == pytest.approx(2 * math.pi / 8)


def test_at_rest_without_drive_the_bodies_stay_at_the_gap():
    arc = hybrid.simulate(vibroimpact(), (0.0, 0.05, 0.0, 0.0), (0.0, 10.0), parameters={"P": 0.0})
    assert not arc.jumps
    np.testing.assert_allclose(arc.x[-1], [0.0, 0.05, 0.0, 0.0], atol=1e-12)


def test_the_contact_keeps_total_momentum_of_the_impact():
    """The contact force is internal: during the 0.8 ms of an impact springs and drive have little effect."""
    arc = hybrid.simulate(vibroimpact(), case(0.05)["x0"], (0.0, 0.1), mode="free", solver=TIGHT)
    impact, release = arc.jumps[:2]
    momentum = [1000 * x[2] + 100 * x[3] for x in (impact.x_minus, release.x_plus)]
    assert release.t - impact.t == pytest.approx(0.000785922, abs=1e-7)
    assert momentum[1] == pytest.approx(momentum[0], abs=1.0)


def test_saltation_is_the_identity_at_both_ends_of_the_contact():
    arc = hybrid.simulate(vibroimpact(), case(0.05)["x0"], (0.0, 0.1), mode="free")
    assert [jump.transition for jump in arc.jumps[:2]] == ["impact", "release"]
    for jump in arc.jumps:
        np.testing.assert_allclose(jump.saltation, np.eye(4), atol=1e-7)


@cases
def test_periodic_orbit(gap):
    exact = case(gap)
    guess = np.array(exact["x0"]) * (1 + 1e-4)
    orbit = hybrid.periodic_orbit(
        vibroimpact(), guess, mode="free", parameters={"D": gap}, periods=exact["periods"]
    )
    np.testing.assert_allclose(orbit.x0, exact["x0"], atol=1e-8)
    found = sorted(orbit.multipliers, key=lambda m: (round(m.real, 9), m.imag))
    np.testing.assert_allclose(found, complex_pairs(exact["multipliers"]), atol=1e-6)


@cases
def test_floquet_exponents(gap):
    exact = case(gap)
    orbit = hybrid.periodic_orbit(
        vibroimpact(), exact["x0"], mode="free", parameters={"D": gap}, periods=exact["periods"]
    )
    exponents = np.sort(lyapunov.floquet_exponents(orbit))[::-1]
    np.testing.assert_allclose(exponents, exact["exponents"], atol=1e-6)


@cases
def test_spectrum_of_the_periodic_regime(gap):
    """QR converges like 1/M on an orbit with complex multipliers; the sum is exact at any M."""
    exact = case(gap)
    result = lyapunov.lyapunov_spectrum(
        vibroimpact(), exact["x0"], mode="free", parameters={"D": gap}, intervals=2000
    )
    np.testing.assert_allclose(result.exponents, exact["exponents"], atol=2e-3)
    assert result.exponents.sum() == pytest.approx(FOUNDING["trace"], abs=1e-7)
