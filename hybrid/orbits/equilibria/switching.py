"""From a bifurcation of an equilibrium to what begins or crosses there."""

from __future__ import annotations

import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.equilibria.boundary import Neighbour, neighbour_of, neighbours
from hybrid.orbits.equilibria.branch import EquilibriumBifurcation
from hybrid.orbits.equilibria.curve import Spot, corrected
from hybrid.orbits.equilibria.equations import Equations, Reduced
from hybrid.orbits.equilibria.equilibrium import Equilibrium, described, solved
from hybrid.orbits.equilibria.normal_forms import directions_at, hopf_at
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.solvers import Solver

# Distances along the other branch, and sizes of the first cycle, in units of the state.
LENGTHS = (0.01, 0.003, 0.03, 0.001, 0.1)
# The equilibrium of another mode is taken at this distance, in units of the parameter.
BEYOND = 1e-3
# A cycle is the one that was looked for if its size is that of the guess up to this factor.
AS_LARGE = 2.0


def switched(bifurcation: EquilibriumBifurcation, solver: Solver) -> Equilibrium | PeriodicOrbit:
    """What begins or crosses at a bifurcation of an equilibrium; errors are those of `switch_branch`."""
    spot = bifurcation._place
    if bifurcation.kind == "branch point":
        return _across(spot)
    if bifurcation.kind == "Hopf":
        return _cycle(spot, solver)
    if bifurcation.kind == "boundary":
        return _beyond(spot, bifurcation)
    raise ArgumentError(
        "bifurcation is a fold of equilibria, where no other branch begins; allowed are a Hopf point, a "
        "branch point, and a boundary at which another mode has an equilibrium."
    )


def _equations_of(spot: Spot) -> tuple[Reduced, Equations]:
    assert isinstance(spot.system, Reduced)
    return spot.system, spot.system.equations


def _across(spot: Spot) -> Equilibrium:
    """An equilibrium on the branch that crosses."""
    part, equations = _equations_of(spot)
    directions = directions_at(part, spot.u, spot.units)
    for length in LENGTHS if directions else ():
        onward = min(directions, key=lambda each: abs(float(each @ spot.tangent)))
        made = corrected(part, spot.u + length * spot.units * onward, spot.units, onward)
        if made is not None:
            return described(equations, made[0])
    raise ArgumentError("no other branch is found near the branch point: its quadratic form is degenerate.")


def _beyond(spot: Spot, bifurcation: EquilibriumBifurcation) -> Equilibrium:
    """The equilibrium of another mode beside a boundary, where it is admissible."""
    _, equations = _equations_of(spot)
    own = neighbour_of(equations, spot.u, spot.units)
    found = [each for each in neighbours(equations, spot.u, spot.units) if each.side]
    if not found:
        raise ArgumentError(
            "no other mode has an equilibrium at this boundary that is admissible on one side of it, so no "
            "branch goes on from here."
        )

    def is_second(each: Neighbour) -> bool:
        return own is not None and each.side == own.side

    other = min(found, key=is_second)
    there = other.u + other.side * BEYOND * spot.units[-1] * other.onward
    own_equations = other.equations
    vector = own_equations.vector.copy()
    vector[own_equations.places] = there[-1:]
    start = Equations(own_equations.system, own_equations.mode, (), own_equations.state(there), vector)
    return solved(start)


def _cycle(spot: Spot, solver: Solver) -> PeriodicOrbit:
    """A small cycle beside a Hopf point: the first terms of its series, corrected by Newton's method."""
    _, equations = _equations_of(spot)
    onward = spot.tangent * spot.units / (spot.tangent[-1] * spot.units[-1])
    hopf = hopf_at(equations, spot.u, onward)
    sizes = np.abs(hopf.vector) / spot.units[:-1]
    for length in LENGTHS if hopf.speed else ():
        radius = length / float(sizes.max())
        # The radius grows like r' = speed (p - p0) r + omega first r^3.
        move = -hopf.omega * hopf.first * radius**2 / hopf.speed
        u = spot.u + move * onward
        u[:-1] += 2.0 * radius * hopf.vector.real
        orbit = periodic_orbit(
            equations.system,
            equations.state(u),
            mode=equations.mode,
            parameters=equations.parameters(u),
            period=2.0 * np.pi / hopf.omega,
            solver=solver,
        )
        if orbit.closes and not orbit.transitions and _is_as_large(orbit, spot, 2.0 * length):
            return orbit
    raise ArgumentError(
        "no small cycle is found near the Hopf point. It may be degenerate, its first Lyapunov coefficient "
        "or the speed of its eigenvalues zero, or the equilibrium may be too near to a guard for a cycle "
        "inside of the mode; else tighten solver=."
    )


def _is_as_large(orbit: PeriodicOrbit, spot: Spot, size: float) -> bool:
    """Whether the cycle has about this size in units of the state, and is no point."""
    x = orbit.arc().x[:, : len(spot.u) - 1]
    found = float((np.abs(x - spot.u[:-1]) / spot.units[:-1]).max())
    return size / AS_LARGE <= found <= size * AS_LARGE
