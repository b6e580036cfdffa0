"""Orbits of contacts that stick and slip, and their branches."""

import numpy as np
import pytest

from hybrid import Contact, continue_orbit, mechanics, periodic_orbit, simulate


@pytest.fixture(scope="module")
def on_a_belt():
    """A block on a moving belt, held by a spring: friction that needs more to begin than to go on."""
    return mechanics(
        coordinates=("x", "y"),
        velocities=("u", "v"),
        parameters={"belt": 0.7, "mu": 0.2, "mus": 0.5},
        mass=lambda t, x, p: (1.0, 1.0),
        forces=lambda t, x, p: (-x.x, -1.0),
        contacts=[
            Contact(
                "belt", lambda t, x, p: x.y, friction="mu", static="mus", slip=lambda t, x, p: x.u - p.belt
            )
        ],
    )


def period(belt, step=0.3):
    """Of the block that sticks and slips, from its straight and its round stretch."""
    return 2 * np.pi - 2 * np.arctan(step / belt) + 2 * step / belt


def test_a_branch_of_stick_slip_has_the_period_of_the_closed_form(on_a_belt):
    start = {"x": 0.0, "y": 0.0, "u": 0.7, "v": 0.0}
    arc = simulate(on_a_belt, start, (0, 20))
    orbit = periodic_orbit(on_a_belt, arc.x[-1], mode=arc.end.mode, period=period(0.7))
    assert orbit.period == pytest.approx(period(0.7), abs=1e-10)
    # Where it sticks it forgets: all but the motion along the orbit is lost.
    np.testing.assert_allclose(np.abs(orbit.multipliers), [1, 0, 0, 0], atol=1e-9)
    branch = continue_orbit(orbit, "belt", span=(0.4, 1.5))
    assert branch.status.ok
    assert min(branch.parameter) == pytest.approx(0.4)
    assert max(branch.parameter) == pytest.approx(1.5)
    np.testing.assert_allclose(branch.period, period(branch.parameter), atol=1e-9)
    assert not branch.bifurcations
