"""Angles that no one declared: what helps a search for an orbit that a component of the state turns along."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.newton import Point
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.shooting import Shooting
from hybrid.status import StatusCode
from hybrid.system.graph import functions_of
from hybrid.system.periodicity import angle_fault_at

# The turn of an angle that is not declared.
TURN = 2.0 * np.pi


def hinted(shooting: Shooting, orbit: PeriodicOrbit, guess: Point) -> PeriodicOrbit:
    """The orbit, with a remedy for a search that failed since a component counts turns."""
    if orbit.status.code != StatusCode.NOT_CONVERGED:
        return orbit
    system = shooting.system
    moved = shooting.follow(guess, guess.period, shooting.mode).x[-1] - shooting.whole(guess)
    for i in np.flatnonzero(np.abs(moved) > 0.5 * TURN).tolist():
        if system.turn_lengths[i] == 0.0 and _is_same_after_a_turn(shooting, i, guess):
            name = system.state_names[i]
            hint = (
                f"{name!r} moves by {moved[i]:.6g}, and a turn of 2 pi changes no function: if it is an "
                f"angle, declare it with HybridSystem(angles={{{name!r}: 2 * np.pi}})."
            )
            status = attrs.evolve(orbit.status, remedy=f"{orbit.status.remedy} {hint}".strip())
            return attrs.evolve(orbit, status=status)
    return orbit


def _is_same_after_a_turn(shooting: Shooting, i: int, guess: Point) -> bool:
    """Whether no function changes where a component is larger by 2 pi."""
    system, values = shooting.system, shooting.system.parameter_values(shooting.parameters)
    lengths = TURN * (np.arange(system.dimension) == i)
    return all(
        angle_fault_at(system.variables, function, guess.t, shooting.whole(guess), values, lengths) is None
        for _, function in functions_of(system)
    )
