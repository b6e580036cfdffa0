"""Whether an orbit or an equilibrium lies on a branch that is known already."""

from __future__ import annotations

import math
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
from hybrid.simulation.arc import HybridArc
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem
from hybrid.system.periodicity import closed_change, unclosed
from hybrid.transform.aged import original_of, without_age

# Two orbits are one if their periods and states differ by less, in units of the period and of the orbit.
SAME_PERIOD, SAME_STATE = 1e-7, 1e-5
# States along an autonomous orbit that are compared, which are this near to each other at least.
ALONG, NEAR = 4000, 2e-3
ROUNDING = 1e-13
# A component that moves by a smaller share of its size stands still.
STILL = 1e-9
# Orbits are compared at so much of a turn behind their points.
ASIDE = 0.382


def is_known(found: PeriodicOrbit | Equilibrium, branch: Branch | EquilibriumBranch, solver: Solver) -> bool:
    """Whether what was found is on the branch."""
    if isinstance(found, Equilibrium) and isinstance(branch, EquilibriumBranch):
        return branch.mode == found.mode and _is_on(found, branch)
    if isinstance(found, PeriodicOrbit) and isinstance(branch, Branch):
        return any(_is_same(found, near, solver) for near in _near(branch, found.parameters[branch.name]))
    return False


def is_same_value(one: float, other: float) -> bool:
    """Whether two values of a parameter are the same up to rounding."""
    return math.isclose(one, other, rel_tol=ROUNDING)


def _is_on(found: Equilibrium, branch: EquilibriumBranch) -> bool:
    """Whether a step from the nearest point of a branch, as far as the equilibrium is, leads to it."""
    n = found.system.variables.moving
    points = np.column_stack([branch.x[:, :n], branch.parameter])
    u = np.append(found.x[:n], found.parameters[branch.name])
    units = np.maximum(np.abs(points).max(axis=0), np.ptp(points, axis=0))
    units[units == 0.0] = 1.0
    change = closed_change(points - u, np.append(found.system.turn_lengths[:n], 0.0))
    i = int(np.argmin(np.linalg.norm(change / units, axis=1)))
    # Without whole turns.
    u = points[i] - change[i]
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
    # The end of a span may be missed by rounding.
    beside = ROUNDING * max(abs(value), float(np.abs(values).max()))
    for i in range(len(values) - 1):
        if min(values[i : i + 2]) - beside <= value <= max(values[i : i + 2]) + beside:
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
    arc, x = at.arc(), found.x0
    if forced:
        # The states at a phase beside that of the orbit that was found, at which there may be a jump.
        turn = at.period / at.forcing_periods
        phase = found.t0 + ASIDE * turn
        times = at.t0 + (phase - at.t0) % turn + turn * np.arange(at.forcing_periods)
        times, x, least = np.clip(times, arc.t[0], arc.t[-1]), found.arc()(phase), SAME_STATE
    else:
        times, least = np.linspace(arc.t[0], arc.t[-1], ALONG), NEAR
    return bool(distances(found.system, arc, times, x).min() <= least)


def distances(system: HybridSystem, arc: HybridArc, times: np.ndarray, x: np.ndarray) -> np.ndarray:
    """How far states of an arc at some times are from a state ``(N,)``, in units of what components move.

    Whole turns of angles and shifts do not count, nor do counters and the time since the entry of a mode.
    """
    system = original_of(system)
    n = system.tangent_dimension
    states, sizes, x = (without_age(system, each)[..., :n] for each in (arc(times), extents(arc), x))
    return np.asarray((np.abs(unclosed(system, states - x)) / sizes).max(axis=-1))


def extents(arc: HybridArc) -> np.ndarray:
    """How far the components move along an arc ``(n,)``; of one that stands still to rounding its size."""
    moved, sizes = np.ptp(arc.x, axis=0), np.abs(arc.x).max(axis=0)
    still = moved <= STILL * sizes
    return np.where(still, np.where(sizes > 0.0, sizes, 1.0), moved)
