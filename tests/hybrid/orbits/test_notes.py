"""What the status of an orbit says of the run along it."""

import numpy as np

from hybrid import Guard, HybridSystem, Mode, Transition, periodic_orbit


def opaque(t, x, p):
    """The velocity, by a loop that cannot be traced."""
    total = 0.0
    for _ in range(int(p.n)):
        total = total + x.v
    return total


def test_an_orbit_says_that_crossings_on_it_are_not_proved():
    system = HybridSystem(
        state=("q", "v"),
        parameters={"n": 1.5},
        modes=[Mode("m", lambda t, x, p: (x.v, np.cos(t) - 0.1 * x.v - x.q**3))],
        transitions=[Transition("m", "m", Guard(opaque, -1), name="top")],
        period=2 * np.pi,
    )
    status = periodic_orbit(system, (1.0, 0.0)).status
    assert status.ok
    assert "The crossings of 'top' are not proved" in status.message
