"""From a bifurcation to the branch that begins or crosses there."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Bifurcation
from hybrid.orbits.continuation.place import Place, place_on
from hybrid.orbits.continuation.result import Points, orbit_of
from hybrid.orbits.continuation.route import Loop
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor

# Number of passes of the orbit that make one of the other branch.
TIMES = {"flip": 2, "branch point": 1}
# The first orbit is this far from the bifurcation, in units of its size, or nearer by halves.
DISTANCE = 0.02
NEAREST = 1e-6


def switch_branch(bifurcation: Bifurcation, *, solver: Solver | None = None) -> PeriodicOrbit:
    """An orbit on the branch that begins at a flip, or crosses at a branch point; continue it from there.

    It is a small distance from the bifurcation along the direction in which the equations of the orbit are
    singular: at a flip the eigenvector of the multiplier -1, for the orbit of twice the period. Where the
    sequence of transitions changes it is the orbit with the new sequence.

    Parameters
    ----------
    bifurcation
        Of a `Branch`: a ``"flip"``, a ``"branch point"``, or a change of the transitions.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-12, atol=1e-14)``.

    Returns
    -------
    PeriodicOrbit
        For `continue_orbit`.

    Raises
    ------
    ArgumentError
        If no branch begins at such a bifurcation, or none is found.

    References
    ----------
    R. Seydel, Practical Bifurcation and Stability Analysis, 3rd ed., Springer 2010, section 5.6.
    """
    arguments.instance("bifurcation", bifurcation, Bifurcation, "Take one of branch.bifurcations.")
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    if bifurcation.kind not in TIMES:
        beyond = None if bifurcation._change is None else bifurcation._change.onward.place
        if beyond is None:
            raise ArgumentError(
                f"bifurcation is a {bifurcation.kind}, where no other branch of orbits begins; allowed are a "
                "flip, a branch point, and a change of the transitions beyond which there is an orbit."
            )
        return orbit_of(beyond.orbit, Points(bifurcation.orbit.t0))
    # The value may be zero where another one is declared.
    declared = bifurcation.orbit.system.parameters[bifurcation.parameter]
    size = max(abs(bifurcation.value), abs(declared)) or 1.0
    place = _repeated(bifurcation, method, np.array([size]))
    matrix, _ = place.orbit.equations(place.orbit, place.units)
    # Of the two directions in which the equations are singular, that at a fixed parameter.
    one, other = np.linalg.svd(matrix)[2][-2:]
    direction = one * other[-1] - other * one[-1]
    direction /= np.linalg.norm(direction)
    distance = DISTANCE
    while distance > NEAREST:
        guess = place.orbit.loop.plus(distance * place.units * direction)
        found = place.family.corrected(guess, place.orbit, place.units, direction[None])
        if found is not None:
            return orbit_of(found[0], Points(bifurcation.orbit.t0))
        distance /= 2.0
    raise ArgumentError(f"no other branch is found near the {bifurcation.kind}: tighten solver=.")


def _repeated(bifurcation: Bifurcation, solver: Solver, sizes: np.ndarray) -> Place:
    """The orbit at the bifurcation, passed as often as the orbits of the other branch need."""
    times = TIMES[bifurcation.kind]
    place = bifurcation._place
    if place is None:
        place = place_on(bifurcation.orbit, (bifurcation.parameter,), sizes, solver)
    family, loop = place.family, place.orbit.loop
    again = [loop.times[:1], *(loop.times[1:] + k * loop.period for k in range(times))]
    family = attrs.evolve(family, solver=solver, periods=times * family.periods, route=times * family.route)
    orbit = family.around(Loop(np.tile(loop.x, (times, 1)), np.concatenate(again), loop.values))
    if orbit is None:
        raise ArgumentError("the orbit at the bifurcation is not found again: tighten solver=.")
    return Place(orbit, place.tangents, sizes)
