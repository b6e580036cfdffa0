"""The coil under digital control compared with its map from sample to sample."""

import numpy as np
import pytest
from scipy.optimize import brentq

import hybrid
from models import digital_pwm

P = digital_pwm().parameters
FULL, A = P["V"] / P["R"], P["R"] * P["T"] / P["L"]


def duty(i, k):
    """What the controller computes from a current."""
    return np.clip(P["d_0"] + k * (P["ref"] - i), 0.0, 1.0)


def after_a_period(i, k):
    """The current at the next sample."""
    d = duty(i, k)
    return (FULL + (i - FULL) * np.exp(-A * d)) * np.exp(-A * (1.0 - d))


def fixed_point(k):
    """The current that comes again at each sample."""
    return brentq(lambda i: after_a_period(i, k) - i, 0.0, FULL, xtol=1e-15)


@pytest.mark.parametrize("k", [0.05, 0.2, 0.5, 2.0])
def test_the_map_from_sample_to_sample(k):
    arc = hybrid.simulate(digital_pwm(), {"i": 0.0}, (0.0, 60 * P["T"]), parameters={"k": k})
    currents = np.array([jump.x_minus[0] for jump in arc.jumps["sample"]])
    assert len(currents) == 60
    np.testing.assert_allclose(currents[1:], after_a_period(currents, k)[:-1], rtol=1e-12)
    duties = [jump.x_plus[1] for jump in arc.jumps["sample"]]
    np.testing.assert_allclose(duties, duty(currents, k), atol=1e-14)
    assert (max(duties) == 1.0) == (k >= 0.2)


def slope(k):
    """Of the map at its fixed point."""
    i = fixed_point(k)
    return np.exp(-A) - k * A * FULL * np.exp(-A * (1.0 - duty(i, k)))


def settled(k):
    """A periodic orbit from a sample on."""
    arc = hybrid.simulate(digital_pwm(), {"i": 4.0}, (0.0, 200 * P["T"]), parameters={"k": k})
    return hybrid.periodic_orbit(digital_pwm(), arc.x[-1], mode=str(arc.mode[-1]), parameters={"k": k})


def test_the_multiplier_and_the_flip():
    orbit = settled(0.1)
    assert orbit.x0[0] == pytest.approx(fixed_point(0.1), rel=1e-9)
    assert max(orbit.multipliers, key=abs) == pytest.approx(slope(0.1), rel=1e-8)
    branch = hybrid.continue_orbit(orbit, "k", (0.05, 0.3))
    [flip] = (each for each in branch.bifurcations if each.kind == "flip")
    assert flip.value == pytest.approx(brentq(lambda k: slope(k) + 1.0, 0.1, 0.3), rel=1e-8)
