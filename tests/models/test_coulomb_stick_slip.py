"""The block on the belt with Coulomb's friction: the closed form."""

import math

import numpy as np
import pytest

import hybrid
from models import coulomb_stick_slip

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
BELTS = pytest.mark.parametrize(("belt", "Fs", "Fk"), [(0.2, 1.0, 0.5), (0.7, 1.2, 0.9), (0.05, 2.0, 0.3)])


@BELTS
def test_limit_cycle(belt, Fs, Fk):
    D = Fs - Fk
    slip, stick = 2 * (math.pi - math.atan(D / belt)), 2 * D / belt
    parameters = {"belt": belt, "Fs": Fs, "Fk": Fk}
    orbit = hybrid.periodic_orbit(
        coulomb_stick_slip(), (Fk, belt), mode="stick", period=slip + stick, parameters=parameters
    )
    assert orbit.period == pytest.approx(slip + stick, abs=1e-10)
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), [0.0, 1.0], atol=1e-8)

    arc = hybrid.simulate(
        coulomb_stick_slip(), (Fk, belt), (0.0, 2 * orbit.period), mode="stick", parameters=parameters
    )
    release, catch = arc.jumps[:2]
    assert release.t == pytest.approx(D / belt, rel=1e-12)
    assert catch.t - release.t == pytest.approx(slip, abs=1e-9)
    assert catch.x_plus[0] == pytest.approx(Fk - D, abs=1e-9)
    np.testing.assert_allclose(release.saltation, [[1, 0], [-D / belt, 1]], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(catch.saltation, [[1, 0], [0, 0]], atol=1e-9)


def test_slips_inside_the_grazing_circle_never_stick():
    """Harmonic motion about ``Fk`` that always stays slower than the belt."""
    arc = hybrid.simulate(coulomb_stick_slip(), (0.69, 0.0), (0.0, 30.0), mode="slip", solver=TIGHT)
    assert not arc.jumps
    np.testing.assert_allclose(arc.x[-1], [0.5 + 0.19 * math.cos(30.0), -0.19 * math.sin(30.0)], atol=1e-11)


def test_the_block_waits_for_the_belt():
    """After a slip of any speed the block sticks until ``x = Fs``."""
    for x0 in (0.9, 1.3, 1.9):
        arc = hybrid.simulate(coulomb_stick_slip(), (x0, 0.0), (0.0, 30.0), mode="slip")
        catch, release = arc.jumps[:2]
        assert release.x_minus[0] == pytest.approx(1.0, abs=1e-12)
        left = 0.5 - math.sqrt((x0 - 0.5) ** 2 - 0.2**2)
        assert release.t - catch.t == pytest.approx((1.0 - left) / 0.2, abs=1e-8)
