"""From a bifurcation to the branch that begins or crosses there."""

from __future__ import annotations

import numpy as np

from hybrid import arguments
from hybrid.continuation.branch import Bifurcation
from hybrid.continuation.continue_orbit import orbit_of, quiet_shot
from hybrid.errors import ArgumentError
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.shots import Family, Point
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor

# Number of periods of the orbits on the other branch.
PERIODS = {"flip": 2, "branch point": 1}
# The first orbit is this far from the bifurcation, in units of its size, or nearer by halves.
DISTANCE = 0.02
NEAREST = 1e-6


def switch_branch(bifurcation: Bifurcation, *, solver: Solver | None = None) -> PeriodicOrbit:
    """An orbit on the branch that begins at a flip, or crosses at a branch point; continue it from there.

    It is a small distance from the bifurcation along the direction in which the equations of the orbit are
    singular: at a flip the eigenvector of the multiplier -1, for the orbit of twice the period.

    Parameters
    ----------
    bifurcation
        A ``"flip"`` or a ``"branch point"`` of a `Branch`.
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
    if bifurcation.kind not in PERIODS:
        raise ArgumentError(
            f"bifurcation is a {bifurcation.kind}, where no other branch of orbits begins; allowed are a "
            "flip and a branch point."
        )
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    orbit, times = bifurcation.orbit, PERIODS[bifurcation.kind]
    periods, period = times * orbit.forcing_periods, times * orbit.period
    family = Family(orbit.system, bifurcation.parameter, dict(orbit.parameters), periods, method)
    point = Point(np.array(orbit.x0), orbit.t0, orbit.mode, period, bifurcation.value)
    shot = quiet_shot(family, point)
    # The value may be zero where another one is declared.
    size = max(abs(bifurcation.value), abs(orbit.system.parameters[bifurcation.parameter])) or 1.0
    units = np.append(shot.scale, [period, size])
    matrix, _ = family.equations(shot, shot, units)
    # Of the two directions in which the equations are singular, that at a fixed parameter.
    one, other = np.linalg.svd(matrix)[2][-2:]
    direction = one * other[-1] - other * one[-1]
    direction /= np.linalg.norm(direction)
    distance = DISTANCE
    while distance > NEAREST:
        guess = family.along(shot.point, distance * units * direction)
        found = None if guess is None else family.corrected(guess, shot, units, direction)
        if found is not None:
            return orbit_of(family, found[0], orbit.t0)
        distance /= 2.0
    raise ArgumentError(f"no other branch is found near the {bifurcation.kind}: tighten solver=.")
