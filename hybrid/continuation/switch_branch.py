"""From a bifurcation to the branch that begins or crosses there."""

from __future__ import annotations

import numpy as np

from hybrid import arguments
from hybrid.continuation.branch import Bifurcation
from hybrid.continuation.continue_orbit import orbit_of, quiet_point
from hybrid.errors import ArgumentError
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.shots import CLOSED, MOST_CORRECTIONS, Family, Point, Shot
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor

# Number of periods of the orbits on the other branch.
PERIODS = {"flip": 2, "branch point": 1}
# The first orbit is this far from the bifurcation, in units of its size, or nearer by halves.
DISTANCE = 0.02
NEAREST = 1e-6
# Near a bifurcation the equations are nearly singular, and rounding moves the unknowns by more than the gap.
SETTLED = 1e-8


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
    shot = family.shoot(quiet_point(family, point))
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
        found = _at_distance(family, shot, units, direction, distance)
        if found is not None:
            return orbit_of(family, found, orbit.t0)
        distance /= 2.0
    raise ArgumentError(f"no other branch is found near the {bifurcation.kind}: tighten solver=.")


def _at_distance(
    family: Family, shot: Shot, units: np.ndarray, direction: np.ndarray, distance: float
) -> Shot | None:
    """The orbit at a distance from a shot along a direction ``(n + 2,)``, in units of the unknowns."""
    begin = shot.point
    point = family.along(begin, distance * units * direction)
    for _ in range(MOST_CORRECTIONS):
        if point is None:
            return None
        try:
            trial = family.shoot(point)
        except ArgumentError:
            return None
        if not trial.whole or trial.transitions != shot.transitions:
            return None
        matrix, right = family.equations(trial, shot, units)
        gone = np.append(point.x - begin.x, [point.period - begin.period, point.value - begin.value]) / units
        row = direction.copy()
        if family.forced:
            row[-2] = 0.0
        bordered = np.vstack([matrix, row])
        change = np.linalg.lstsq(bordered, np.append(right, distance - row @ gone), rcond=None)[0]
        if np.all(np.abs(trial.gap) <= CLOSED * trial.scale) and np.abs(change).max() <= SETTLED:
            return trial
        point = family.along(point, units * change)
    return None
