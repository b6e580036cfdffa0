"""The shaken stack: where its boxes begin to slip, how they slide, and when they never stick again."""

import math

import numpy as np
import pytest

import hybrid
from models import shaken_stack

G, W = 9.81, 2 * math.pi


def onsets(arc, contact):
    return [jump.t for jump in arc.jumps[f"{contact} slips"]]


def test_nothing_slips_below_the_smallest_coefficient():
    arc = hybrid.simulate(shaken_stack(), np.zeros(8), (0.0, 3.0), parameters={"A": 0.199})
    assert set(map(str, arc.mode)) == {"1 sticks, 2 sticks"}
    np.testing.assert_allclose(arc.x, 0.0, atol=1e-12)
    np.testing.assert_allclose(arc["1.normal"], 2 * G, rtol=1e-12)
    np.testing.assert_allclose(arc["1.tangential"], -2 * 0.199 * G * np.sin(W * arc.t), atol=1e-9)


@pytest.mark.parametrize("masses", [{"m1": 1.0, "m2": 1.0}, {"m1": 0.5, "m2": 3.0}])
def test_the_upper_box_slips_first_and_pulls_the_lower_one(masses):
    A, mu1, mu2 = 1.0, 0.5, 0.2
    arc = hybrid.simulate(
        shaken_stack(), np.zeros(8), (0.0, 0.25), parameters={"A": A, "mu1": mu1, "mu2": mu2, **masses}
    )
    m1, m2 = masses.values()
    assert onsets(arc, "2") == pytest.approx([math.asin(mu2 / A) / W], abs=1e-12)
    late = (mu1 * (m1 + m2) - mu2 * m2) / (m1 * A)
    assert onsets(arc, "1") == pytest.approx([math.asin(late) / W] if late < 1 else [], abs=1e-12)


def test_a_stack_with_the_smoothest_contact_below_slides_as_one():
    parameters = {"A": 0.6, "mu1": 0.2, "mu2": 0.3}
    arc = hybrid.simulate(shaken_stack(), np.zeros(8), (0.0, 3.0), parameters=parameters)
    assert onsets(arc, "1")[0] == pytest.approx(math.asin(0.2 / 0.6) / W, abs=1e-12)
    assert all("2 sticks" in str(mode) for mode in arc.mode)
    np.testing.assert_allclose(arc["x1"], arc["x2"], atol=1e-12)


def test_two_equal_contacts_that_reach_their_bounds_at_once_slide_as_one():
    """Any share of the slip between them obeys Coulomb's law at that instant, and the lower one goes on."""
    parameters = {"A": 0.6, "mu1": 0.2, "mu2": 0.2}
    arc = hybrid.simulate(shaken_stack(), np.zeros(8), (0.0, 2.0), parameters=parameters)
    assert arc.t[-1] == pytest.approx(2.0)
    alone = hybrid.simulate(
        shaken_stack(1), np.zeros(4), (0.0, 2.0), parameters={"A": 0.6, "mu1": 0.2, "m1": 2.0}
    )
    np.testing.assert_allclose(arc.x[-1, [0, 1]], alone.x[-1, 0], atol=1e-9)
    np.testing.assert_allclose(arc.x[-1, [4, 5]], alone.x[-1, 2], atol=1e-9)


def test_of_three_boxes_those_above_a_slip_move_with_it():
    parameters = {"mu1": 0.3, "mu2": 0.15, "mu3": 0.2, "A": 0.25}
    arc = hybrid.simulate(shaken_stack(3), np.zeros(12), (0.0, 0.3), parameters=parameters)
    assert onsets(arc, "2") == pytest.approx([math.asin(0.15 / 0.25) / W], abs=1e-12)
    assert str(arc.mode[-1]) == "1 sticks, 2 slips +, 3 sticks"


def test_a_single_box_slides_as_newmark_says():
    A, mu = 0.5, 0.3
    arc = hybrid.simulate(shaken_stack(1), np.zeros(4), (0.0, 0.5), parameters={"A": A, "mu1": mu})
    [first] = onsets(arc, "1")
    assert first == pytest.approx(math.asin(mu / A) / W, abs=1e-12)
    t = np.linspace(first, 0.5, 20)
    speed = A * G / W * (math.cos(W * first) - np.cos(W * t)) - mu * G * (t - first)
    np.testing.assert_allclose(arc(t)[:, 2], speed, atol=1e-12)


@pytest.mark.parametrize(("share", "sticks"), [(0.99, True), (1.01, False)])
def test_a_box_never_sticks_above_the_limit_of_westermo_and_udwadia(share, sticks):
    limit = math.sqrt(1 + math.pi**2 / 4)
    arc = hybrid.simulate(
        shaken_stack(1), np.zeros(4), (0.0, 30.0), parameters={"A": share * limit * 0.3, "mu1": 0.3}
    )
    late = {str(mode) for mode, t in zip(arc.mode, arc.t, strict=True) if t > 20.0}
    assert late == {"1 slips +", "1 slips -"} | ({"1 sticks"} if sticks else set())


def test_sliding_without_a_stop_is_a_periodic_orbit():
    """Speeds are those of the fields with the sign of the slip, which changes twice per period."""
    A, mu = 0.8, 0.3
    parameters = {"A": A, "mu1": mu}
    run = hybrid.simulate(shaken_stack(1), np.zeros(4), (0.0, 30.0), parameters=parameters)
    stop = run.jumps["1 stops"][-1]
    # From a stop at the phase a to the next one half a period later the speed changes by zero.
    phase = math.acos(math.pi * mu / (2 * A))
    assert (W * stop.t) % math.pi == pytest.approx(phase, abs=1e-6)


def test_boxes_are_one_or_more():
    with pytest.raises(hybrid.ArgumentError, match="boxes must be"):
        shaken_stack(0)
