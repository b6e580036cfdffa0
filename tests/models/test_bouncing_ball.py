"""The ball compared with its closed form: times, states, saltation and the accumulation point."""

import numpy as np
import pytest

import hybrid
from models import bouncing_ball
from tests.reference.load import reference

BALL = reference("bouncing_ball")
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)


@pytest.fixture(scope="module")
def arc():
    after_twenty = BALL["t"][-1] + 1e-3
    return hybrid.simulate(bouncing_ball(), BALL["x0"], (0.0, after_twenty), solver=TIGHT)


def test_bounces_come_on_time(arc):
    np.testing.assert_allclose([jump.t for jump in arc.jumps], BALL["t"], rtol=1e-12)


def test_speeds_before_the_bounces(arc):
    np.testing.assert_allclose([jump.x_minus[1] for jump in arc.jumps], BALL["v_minus"], rtol=1e-11)


def test_the_ball_leaves_the_ground_with_restitution(arc):
    for jump, v in zip(arc.jumps, BALL["v_minus"], strict=True):
        np.testing.assert_allclose(jump.x_plus, [0.0, -0.8 * v], rtol=1e-11)


def test_saltation_of_every_bounce(arc):
    for jump, saltation in zip(arc.jumps, BALL["saltation"], strict=True):
        np.testing.assert_allclose(jump.saltation, saltation, rtol=1e-10)


def test_transversality_is_the_speed_of_approach(arc):
    np.testing.assert_allclose([jump.transversality for jump in arc.jumps], BALL["v_minus"], rtol=1e-11)


def test_bounces_accumulate():
    """The run ends or reports where the bounces accumulate; it never hangs or falls through the ground."""
    arc = hybrid.simulate(bouncing_ball(), BALL["x0"], (0.0, 5.0))
    assert max(jump.t for jump in arc.jumps) == pytest.approx(BALL["accumulation"], abs=1e-3)
    assert np.min(arc.x[:, 0]) > -1e-9


def test_an_elastic_ball_keeps_its_energy():
    arc = hybrid.simulate(bouncing_ball(), (1.0, 0.0), (0.0, 20.0), parameters={"e": 1.0}, solver=TIGHT)
    q, v = arc.x.T
    np.testing.assert_allclose(9.81 * q + v**2 / 2, 9.81, rtol=1e-10)
