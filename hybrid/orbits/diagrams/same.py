"""Whether an orbit or an equilibrium lies on a branch that is known already."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.orbits.equilibria.curve import spot_at
from hybrid.orbits.equilibria.equations import Equations, reduced
from hybrid.orbits.equilibria.equilibrium import Equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.solvers import Solver

# Two orbits are one if their periods and states differ by less, in units of the period and of the orbit.
SAME_PERIOD, SAME_STATE = 1e-7, 1e-5
# States along an autonomous orbit that are compared, which are this near to each other at least.
ALONG, NEAR = 4000, 2e-3


def is_known(found: PeriodicOrbit | Equilibrium, branch: Branch | EquilibriumBranch, solver: Solver) -> bool:
    """Whether what was found is on the branch."""
    if isinstance(found, Equilibrium) and isinstance(branch, EquilibriumBranch):
        return branch.mode == found.mode and _is_on(found, branch)
    if isinstance(found, PeriodicOrbit) and isinstance(branch, Branch):
        return any(_is_same(found, near, solver) for near in _near(branch, found.parameters[branch.name]))
    return False


def _is_on(found: Equilibrium, branch: EquilibriumBranch) -> bool:
    """Whether a step from the nearest point of a branch, as far as the equilibrium is, leads to it."""
    n = found.system.variables.moving
    points = np.column_stack([branch.x[:, :n], branch.parameter])
    u = np.append(found.x[:n], found.parameters[branch.name])
    units = np.maximum(np.abs(points).max(axis=0), np.ptp(points, axis=0))
    units[units == 0.0] = 1.0
    i = int(np.argmin(np.linalg.norm((points - u) / units, axis=1)))
    vector = found.system.parameter_values(branch.equilibrium(i).parameters)
    equations = Equations(found.system, found.mode, (branch.name,), branch.x[i], vector)
    beside = (points[min(i + 1, len(points) - 1)] - points[max(i - 1, 0)]) / units
    spot = spot_at(reduced(equations, points[i]), points[i], units, beside)
    if spot is None:
        return False
    made = spot.step(float(spot.tangent @ ((u - points[i]) / units)))
    return made is not None and bool(np.all(np.abs(made[0].u - u) <= SAME_STATE * units))


def _near(branch: Branch, value: float) -> Iterator[PeriodicOrbit]:
    """The orbits before and after which the parameter of a branch passes a value, bifurcations among them."""
    values = np.insert(
        branch.parameter,
        [each.position for each in branch.bifurcations],
        [each.value for each in branch.bifurcations],
    )
    numbers: list[int | PeriodicOrbit] = [*range(len(branch))]
    for bifurcation in reversed(branch.bifurcations):
        numbers.insert(bifurcation.position, bifurcation.orbit)
    for i in range(len(values) - 1):
        if min(values[i : i + 2]) <= value <= max(values[i : i + 2]):
            for each in numbers[i : i + 2]:
                yield branch.orbit(each) if isinstance(each, int) else each


def _is_same(found: PeriodicOrbit, near: PeriodicOrbit, solver: Solver) -> bool:
    """Whether Newton's method leads from an orbit nearby to the one that was found."""
    forced = found.system.forcing_period(found.parameters) is not None
    if forced and near.forcing_periods != found.forcing_periods:
        return False
    if abs(near.period - found.period) > 0.2 * found.period:
        return False
    how = {"periods": near.forcing_periods} if forced else {"period": near.period}
    try:
        at = periodic_orbit(
            near.system,
            near.x0,
            mode=near.mode,
            parameters=found.parameters,
            t0=near.t0,
            solver=solver,
            **how,
        )
    except ArgumentError:
        return False
    if not at.closes or abs(at.period - found.period) > SAME_PERIOD * found.period:
        return False
    arc, n = at.arc(), found.system.dimension
    if forced:
        # The states at the phase of the orbit that was found.
        turn = at.period / at.forcing_periods
        times = at.t0 + (found.t0 - at.t0) % turn + turn * np.arange(at.forcing_periods)
        least = SAME_STATE
    else:
        times, least = np.linspace(arc.t[0], arc.t[-1], ALONG), NEAR
    sizes = np.ptp(arc.x[:, :n], axis=0)
    sizes[sizes == 0.0] = 1.0
    apart = np.abs(arc(times)[:, :n] - found.x0[:n]) / sizes
    return bool(apart.max(axis=1).min() <= least)
