"""The wheel compared with its step map: saltation, fixed point, period, multipliers."""

import math

import numpy as np
import pytest

import hybrid
import lyapunov
from models import rimless_wheel
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
WHEEL = reference("rimless_wheel")
ALPHA, GAMMA, C = math.pi / 8, 0.08, math.cos(math.pi / 4)


def test_saltation():
    before = (GAMMA + ALPHA, WHEEL["omega"] / C)
    found = hybrid.saltation_matrix(rimless_wheel(), "step", 0.0, before)
    np.testing.assert_allclose(found, WHEEL["saltation"], rtol=1e-12, atol=1e-14)


def test_steps_settle_on_the_fixed_point():
    arc = hybrid.simulate(rimless_wheel(), (WHEEL["theta"], 1.3), (0.0, 60.0), solver=TIGHT)
    last, previous = arc.jumps[-1], arc.jumps[-2]
    np.testing.assert_allclose(last.x_plus, [WHEEL["theta"], WHEEL["omega"]], rtol=1e-10)
    assert last.t - previous.t == pytest.approx(WHEEL["period"], rel=1e-9)


def test_orbit():
    """The orbit starts in mid-step, so that its closing point is not an event."""
    theta, omega = hybrid.simulate(rimless_wheel(), (WHEEL["theta"], WHEEL["omega"]), (0.0, 0.5)).x[-1]
    orbit = hybrid.periodic_orbit(rimless_wheel(), (theta, omega + 0.01), period=1.0)
    assert orbit.period == pytest.approx(WHEEL["period"], rel=1e-10)
    np.testing.assert_allclose(sorted(orbit.multipliers.real), sorted(WHEEL["multipliers"]), atol=1e-8)


def test_exponents():
    result = lyapunov.lyapunov_spectrum(
        rimless_wheel(), (0.0, 1.2), interval=WHEEL["period"], intervals=300, transient=50
    )
    exact = 2 * math.log(C) / WHEEL["period"]
    np.testing.assert_allclose(result.exponents, [0.0, exact], atol=1e-6)


def test_step_map():
    """``omega^2 -> c^2 (omega^2 + 4 (g / l) sin(alpha) sin(gamma))`` while the wheel rolls."""
    arc = hybrid.simulate(rimless_wheel(), (WHEEL["theta"], 2.0), (0.0, 4.0), solver=TIGHT)
    squares = np.array([4.0, *(jump.x_plus[1] ** 2 for jump in arc.jumps)])
    gain = 4 * 9.8 * math.sin(ALPHA) * math.sin(GAMMA)
    np.testing.assert_allclose(squares[1:], C**2 * (squares[:-1] + gain), rtol=1e-11)


@pytest.mark.parametrize(("share", "transition"), [(1 + 1e-6, "step"), (1 - 1e-6, "step back")])
def test_it_rolls_if_it_comes_over_the_top(share, transition):
    top = math.sqrt(2 * 9.8 * (1 - math.cos(GAMMA - ALPHA)))
    arc = hybrid.simulate(rimless_wheel(), (GAMMA - ALPHA, share * top), (0.0, 8.0), max_jumps=1)
    assert arc.jumps[0].transition == transition


def test_a_step_back_loses_as_much():
    """The wheel falls back at the speed with which it rose, then turns about the spoke behind."""
    arc = hybrid.simulate(rimless_wheel(), (GAMMA - ALPHA, 0.8), (0.0, 1.0), solver=TIGHT)
    back = arc.jumps[0]
    assert back.transition == "step back"
    np.testing.assert_allclose(back.x_plus, [GAMMA + ALPHA, -0.8 * C], rtol=1e-11)
