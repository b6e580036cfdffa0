"""Attractors of systems with angles: those whole turns apart are one."""

import numpy as np
import pytest

from hybrid import HybridSystem, Mode, attractors, basins

TURN = 2 * np.pi


def pendulum(angles, **parameters):
    """A pendulum with damping and a torque that may turn it round."""
    return HybridSystem(
        state=("phi", "w"),
        parameters={"c": 0.5, "T": 0.0} | parameters,
        modes=[Mode("m", lambda t, x, p: (x.w, p.T - p.c * x.w - np.sin(x.phi)))],
        angles=angles,
    )


OVER = {"phi": (-9.0, 9.0), "w": (-1.0, 1.0)}


def test_rests_whole_turns_apart_are_one_attractor():
    found = attractors(pendulum({"phi": TURN}), OVER, interval=1.0, starts=30)
    assert [each.kind for each in found.values()] == ["equilibrium"]
    assert len(attractors(pendulum({}), OVER, interval=1.0, starts=30)) > 1


def test_a_rotation_comes_back():
    """With a torque above 1 there is no rest; at strong damping ``c w = T - sin(phi)`` nearly."""
    turned = attractors(pendulum({"phi": TURN}, c=4.0, T=5.0), OVER, interval=1.0, starts=8)
    (rotation,) = turned.values()
    assert rotation.kind == "periodic"
    assert rotation.period == pytest.approx(TURN * 4.0 / np.sqrt(25.0 - 1.0), rel=1e-2)
    assert rotation.exponents == pytest.approx([0.0, -4.0], abs=1e-6)
    assert np.all((rotation.points[:, 0] >= 0.0) & (rotation.points[:, 0] < TURN))


def test_basins_have_the_period_of_the_angle():
    places = np.linspace(-1.0, 1.0, 5)
    over = {"phi": np.concatenate([places, places + TURN, places - 3 * TURN]), "w": [0.0, 3.0]}
    label = basins(pendulum({"phi": TURN}, c=0.2, T=0.5), over, interval=1.0).label.values
    assert {1, 2} == set(label.ravel().tolist())
    np.testing.assert_array_equal(label[:5], label[5:10])
    np.testing.assert_array_equal(label[:5], label[10:])
