"""Angles and cyclic components that no one declared: what helps a search that fails for want of them."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.newton import Point
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.shooting import Shooting
from hybrid.status import StatusCode
from hybrid.system.graph import functions_of
from hybrid.system.periodicity import angle_fault_at, cyclic_fault_at

# The turn of an angle that is not declared.
TURN = 2.0 * np.pi
# A component that is carried by a smaller share of its motion comes back but for errors.
LEAST_MOVED = 1e-6


def hinted(shooting: Shooting, orbit: PeriodicOrbit, guess: Point) -> PeriodicOrbit:
    """The orbit, with a remedy for a search that failed since a component counts turns."""
    if orbit.status.code != StatusCode.NOT_CONVERGED:
        return orbit
    system = shooting.system
    arc = shooting.follow(guess, guess.period, shooting.mode)
    moved = arc.x[-1] - shooting.whole(guess)
    undeclared = (system.turn_lengths == 0.0) & ~system.is_cyclic
    for i in np.flatnonzero(undeclared & (np.abs(moved) > LEAST_MOVED * np.ptp(arc.x, axis=0))).tolist():
        name = system.state_names[i]
        if i < system.tangent_dimension and _is_same_after_a_shift(shooting, i, guess):
            hint = (
                f"{name!r} moves by {moved[i]:.6g}, and no shift of it changes a function: if the orbit may "
                f"go on along it, declare it with HybridSystem(cyclic=({name!r},))."
            )
        elif abs(moved[i]) > 0.5 * TURN and _is_same_after_a_turn(shooting, i, guess):
            hint = (
                f"{name!r} moves by {moved[i]:.6g}, and a turn of 2 pi changes no function: if it is an "
                f"angle, declare it with HybridSystem(angles={{{name!r}: 2 * np.pi}})."
            )
        else:
            continue
        status = attrs.evolve(orbit.status, remedy=f"{orbit.status.remedy} {hint}".strip())
        return attrs.evolve(orbit, status=status)
    return orbit


def _is_same_after_a_shift(shooting: Shooting, i: int, guess: Point) -> bool:
    """Whether no function changes where a component is larger, and resets shift with it."""
    system, values = shooting.system, shooting.system.parameter_values(shooting.parameters)
    alone = np.arange(system.dimension) == i
    return all(
        cyclic_fault_at(system.variables, function, guess.t, shooting.whole(guess), values, alone) is None
        for _, function in functions_of(system)
    )


def _is_same_after_a_turn(shooting: Shooting, i: int, guess: Point) -> bool:
    """Whether no function changes where a component is larger by 2 pi."""
    system, values = shooting.system, shooting.system.parameter_values(shooting.parameters)
    lengths = TURN * (np.arange(system.dimension) == i)
    return all(
        angle_fault_at(system.variables, function, guess.t, shooting.whole(guess), values, lengths) is None
        for _, function in functions_of(system)
    )
