"""The rocking block: free rocking by energy and quadrature, Housner's equations, and what begins first."""

import math

import mpmath as mp
import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from models import rocking_block

ALPHA, R, G = 0.25, 1.0, 9.81
P = math.sqrt(3 * G / (4 * R))
KEPT = 1 - 1.5 * math.sin(ALPHA) ** 2
TIGHT = hybrid.Taylor(rtol=1e-13, atol=1e-15)
THETA, OMEGA = 2, 5


def on_a_corner(theta, omega=0.0, alpha=ALPHA):
    """A state in which the lower corner is on the ground and at rest."""
    angle = alpha - abs(theta)
    rise = math.copysign(R * math.sin(angle), theta) * omega
    return np.array([0.0, R * math.cos(angle), theta, -R * math.cos(angle) * omega, rise, omega])


def quarter_period(theta0):
    """From rest at ``theta0`` to the impact, by energy; ``theta = theta0 - s^2`` tames the turning point."""

    def integrand(s):
        # cos(alpha - theta0) - cos(alpha - theta), without the cancellation
        gain = 2 * mp.sin(ALPHA - theta0 + s**2 / 2) * mp.sin(s**2 / 2)
        return 2 * s / (P * mp.sqrt(2 * gain))

    return mp.quad(integrand, [0, mp.sqrt(theta0) / 2, mp.sqrt(theta0)])


def pivots():
    """Housner's equations, by hand: rotation about one corner or the other, and his factor at impacts."""

    def about(side):
        def field(t, x, p):
            angle = p.alpha - side * x.theta
            ground = p.A * np.cos(p.w * t)
            return x.omega, -(P**2) * (side * np.sin(angle) - ground * np.cos(angle))

        return field

    loss = Reset(lambda t, x, p: (0.0, (1 - 1.5 * np.sin(p.alpha) ** 2) * x.omega))
    return HybridSystem(
        state=("theta", "omega"),
        parameters={"alpha": ALPHA, "A": 0.0, "w": 2 * np.pi},
        modes=[Mode("left", about(+1)), Mode("right", about(-1))],
        transitions=[
            Transition("left", "right", Guard(lambda t, x, p: x.theta, direction=-1), loss),
            Transition("right", "left", Guard(lambda t, x, p: x.theta, direction=+1), loss),
        ],
        period=lambda p: 2 * np.pi / p.w,
    )


def test_free_rocking():
    """Each impact leaves the factor squared of the energy: the next amplitude, and its time."""
    amplitudes = [mp.mpf("0.2")]
    for _ in range(6):
        fall = mp.cos(ALPHA - amplitudes[-1]) - mp.cos(ALPHA)
        amplitudes.append(ALPHA - mp.acos(mp.cos(ALPHA) + KEPT**2 * fall))
    quarters = np.array([float(quarter_period(theta)) for theta in amplitudes])
    impacts = np.cumsum(quarters[:-1] + np.append(0.0, quarters[1:-1]))
    tops = impacts + quarters[1:]
    arc = hybrid.simulate(rocking_block(), on_a_corner(0.2), (0.0, tops[-1]), solver=TIGHT)
    np.testing.assert_allclose(arc.jumps.t, impacts, rtol=0, atol=1e-10)
    exact = [-float(theta) * (-1) ** k for k, theta in enumerate(amplitudes[1:])]
    np.testing.assert_allclose([arc(t)[THETA] for t in tops], exact, rtol=0, atol=1e-10)


@pytest.mark.parametrize("alpha", [0.1, 0.3, 0.5])
def test_the_factor_of_housner(alpha):
    """It follows from the impulses of two contacts; no equation of the model has it."""
    arc = hybrid.simulate(
        rocking_block(), on_a_corner(0.2 * alpha, alpha=alpha), (0.0, 1.0), parameters={"alpha": alpha}
    )
    rates = arc.jumps.x_plus[:2, OMEGA] / arc.jumps.x_minus[:2, OMEGA]
    assert len(rates) == 2
    np.testing.assert_allclose(rates, 1 - 1.5 * math.sin(alpha) ** 2, rtol=1e-10)


def test_the_slender_block_of_housner():
    """The period is ``4 arcosh(1 / (1 - theta0 / alpha)) / p``, up to terms in ``alpha^2``."""
    alpha, share = 1e-4, 0.7
    start = on_a_corner(share * alpha, alpha=alpha)
    arc = hybrid.simulate(rocking_block(), start, (0.0, 4.0), parameters={"alpha": alpha}, solver=TIGHT)
    quarter = math.acosh(1 / (1 - share)) / P
    np.testing.assert_allclose(arc.jumps.t[:3], [quarter, 3 * quarter, 5 * quarter], rtol=1e-6)


def test_the_block_comes_to_rest_on_both_corners():
    arc = hybrid.simulate(rocking_block(), on_a_corner(0.1), (0.0, 10.0))
    assert str(arc.mode[-1]) == "left sticks, right sticks"
    # The left corner has not moved.
    shift = R * (math.sin(ALPHA) - math.sin(ALPHA - 0.1))
    np.testing.assert_allclose(arc.x[-1], [shift, R * math.cos(ALPHA), 0.0, 0.0, 0.0, 0.0], atol=1e-9)
    assert np.nansum([arc[f"{side}.normal"][-1] for side in ("left", "right")]) == pytest.approx(G)


def test_shaken_the_block_turns_as_by_the_equations_of_housner():
    parameters = {"A": 0.3, "w": 6.0}
    by_contacts = hybrid.simulate(
        rocking_block(), on_a_corner(0.15), (0.0, 3.0), parameters=parameters, solver=TIGHT
    )
    by_hand = hybrid.simulate(
        pivots(), (0.15, 0.0), (0.0, 3.0), mode="left", parameters=parameters, solver=TIGHT
    )
    assert len(by_hand.jumps) == 4
    np.testing.assert_allclose(by_contacts.jumps.t, by_hand.jumps.t, rtol=0, atol=1e-10)
    t = np.linspace(0.0, 3.0, 50)
    np.testing.assert_allclose(by_contacts(t)[:, [THETA, OMEGA]], by_hand(t), atol=1e-9)


def test_rocking_with_the_ground():
    """A periodic orbit and its multipliers, beside those of the equations of Housner."""
    given = {"t0": 0.2794, "parameters": {"A": 0.75, "w": 4 * P}}
    by_hand = hybrid.periodic_orbit(pivots(), (0.061, 0.019), mode="left", **given)
    orbit = hybrid.periodic_orbit(rocking_block(), on_a_corner(0.061, 0.019), **given)
    assert by_hand.status.ok
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0[[THETA, OMEGA]], by_hand.x0, atol=1e-8)
    assert orbit.shift["x"] == pytest.approx(0.0, abs=1e-9)
    # A shift along the ground has the multiplier 1, the directions that contacts forbid have 0.
    exact = np.concatenate((by_hand.multipliers, [1.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), np.sort(np.abs(exact)), atol=1e-6)


@pytest.mark.parametrize(
    ("A", "mu", "limit", "mode"),
    [
        (0.5, 1.0, math.tan(ALPHA), "left sticks"),
        (0.5, 0.2, 0.2, "left slips -, right slips -"),
        (0.2, 1.0, None, "left sticks, right sticks"),
        (0.2, 0.21, None, "left sticks, right sticks"),
    ],
)
def test_what_begins_where_the_ground_shakes_harder(A, mu, limit, mode):
    """From ``t = 0.75`` on the ground accelerates to the right: the block tips or lags to the left."""
    arc = hybrid.simulate(rocking_block(), on_a_corner(0.0), (0.75, 0.9), parameters={"A": A, "mu": mu})
    assert str(arc.mode[-1]) == mode
    began = [] if limit is None else [1.0 - math.acos(limit / A) / (2 * math.pi)]
    assert [jump.t for jump in arc.jumps] == pytest.approx(began, abs=1e-9)


def test_a_smooth_elastic_block_bounces_with_its_energy():
    start = (0.0, 1.3, 0.1, 0.0, 0.0, 0.0)
    arc = hybrid.simulate(rocking_block(), start, (0.0, 0.4), parameters={"mu": 0.0, "e": 1.0})
    assert arc.jumps["left"]
    np.testing.assert_allclose(arc["energy"], arc["energy"][0], rtol=1e-10)
