"""The woodpecker toy: its rest and its swing in closed form, and the periodic pecking of the paper."""

import math

import numpy as np
import pytest

import hybrid
from models import woodpecker

# The start of Glocker and Studer 2005.
START = (0.0, -0.1034, -0.2788, -0.3411, 0.0, -7.4583)
P = woodpecker().parameters


@pytest.fixture(scope="module")
def fall():
    return hybrid.simulate(woodpecker(), START, (0.0, 2.0))


@pytest.fixture(scope="module")
def pecking(fall):
    return hybrid.periodic_orbit(fall.system, fall.x[-1], mode=fall.end.mode, period=0.146)


@pytest.mark.parametrize(("mu", "mode"), [(0.286, "lower sticks"), (0.284, "lower slips -")])
def test_the_bird_hangs_on_the_jammed_sleeve(mu, mode):
    """At rest it stays there if friction is 0.285 or more, as the paper says."""
    least = (P["m_S"] + P["m_M"]) * P["h_M"]
    least /= P["m_S"] * (P["l_M"] + P["l_G"]) - (P["m_S"] + P["m_M"]) * P["r_M"]
    assert least == pytest.approx(0.285, abs=5e-4)
    sleeve = -(P["r_M"] - P["r_0"]) / P["h_M"]
    bird = sleeve - P["m_S"] * P["g"] * P["l_G"] / P["c"]
    assert (sleeve, bird) == pytest.approx((-0.1034, -0.2216), abs=1e-4)
    arc = hybrid.simulate(woodpecker(), (0.0, sleeve, bird, 0.0, 0.0, 0.0), (0.0, 0.2), parameters={"mu": mu})
    assert str(arc.mode[-1]) == mode
    if mode == "lower sticks":
        np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-10)
    else:
        assert arc["v"][-1] < 0.0


def test_bird_and_sleeve_swing_against_each_other():
    """In flight at 72.91 Hz, as the paper says."""
    period = 1 / 72.91
    arc = hybrid.simulate(woodpecker(), (0.0, 0.005, -0.005, 0.0, 0.0, 0.0), (0.0, period))
    assert set(map(str, arc.mode)) == {"free"}
    t = np.linspace(0.0, period, 9)
    twist = arc(t)[:, 1] - arc(t)[:, 2]
    np.testing.assert_allclose(twist, 0.01 * np.cos(2 * math.pi * 72.91 * t), atol=1e-5)


def test_pecking_is_periodic_but_for_the_fall(pecking):
    assert pecking.status.ok
    assert pecking.period == pytest.approx(0.1452, rel=0.01)
    assert pecking.period == pytest.approx(0.14597607, abs=1e-7)
    assert pecking.shift["y"] == pytest.approx(-0.01944538, abs=1e-7)


def test_the_bird_swings_back_as_far_as_in_the_paper(pecking):
    """While the sleeve jams it turns back to -0.53 rad; the beak stops it at 0.12 rad."""
    t = np.linspace(pecking.t0, pecking.t0 + pecking.period, 2001)
    turns = pecking.arc()(t)[:, 2]
    assert turns.min() == pytest.approx(-0.53, abs=5e-3)
    assert turns.max() == pytest.approx(0.12, abs=1e-3)


def test_pecks_go_through_the_frames_of_the_paper(pecking):
    """Figure 7; between its frames the lower edge, which has no restitution, may touch for short times."""
    arc = pecking.arc()
    titles = {each.name: each.part_of for each in arc.system.transitions}
    found = [titles[jump.transition] for jump in arc.jumps]
    first = found.index("lower slips")
    rest = iter(found[first:] + found[:first])
    frames = "lower slips", "lower opens", "upper", "beak", "upper", "upper opens", "lower", "lower stops"
    assert all(frame in rest for frame in frames)


def test_multipliers_tell_how_fast_pecks_become_alike(fall, pecking):
    """A shift along the pole and one in time have the multiplier 1; contacts take three directions."""
    lap = hybrid.simulate(
        pecking.arc().system, pecking.x0, (0.0, pecking.period), mode=pecking.mode, tangent=True
    )
    multipliers = np.sort(np.linalg.eigvals(lap.fundamental).real)
    np.testing.assert_allclose(multipliers, [-0.83916, 0.0, 0.0, 0.0, 1.0, 1.0], atol=1e-3)
    np.testing.assert_allclose(np.sort(pecking.multipliers.real), multipliers, atol=1e-3)
    pecks = np.array([jump.t for jump in fall.jumps["beak"]])
    assert np.diff(pecks)[-1] == pytest.approx(pecking.period, abs=1e-4)
    changes = np.diff(pecks, 2)
    assert (changes[1:] / changes[:-1])[-1] == pytest.approx(multipliers[0], abs=0.01)


def test_what_the_fall_releases_is_lost_in_contacts(pecking):
    arc = pecking.arc()
    lost = arc["energy"][-1] - arc["energy"][0]
    weight = (P["m_S"] + P["m_M"]) * P["g"]
    assert lost == pytest.approx(weight * pecking.shift["y"], rel=1e-9)
    assert np.diff(arc["energy"]).max() < 1e-12
