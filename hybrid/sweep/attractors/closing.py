"""The saddle that an edge trajectory has come to: an equilibrium or a periodic orbit, by Newton's method."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybrid.errors import HybridError
from hybrid.orbits.equilibria.equilibrium import Equilibrium, equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.simulation.simulate import simulate
from hybrid.sweep.attractors.tracking import APART, Tracking
from hybrid.system.periodicity import closed_change

# Points of an edge trajectory have come back if they are as near as this, as a share of the extent.
BACK = 1e-2
# Newton's method has found the orbit that the trajectory has come to if it moved the point by no more than
# so many times the distance by which the points came back.
MOVED = 10.0
# Another return than the first one is looked at if it is nearer by this factor.
NEARER = 0.1
# States in which the returns of a run are looked for.
LOOKED_AT = 4096


def closed(tracking: Tracking) -> Equilibrium | PeriodicOrbit | None:
    """The saddle near the pair of an edge trajectory; None if it has not come to one."""
    pair = tracking.pair
    if pair.mode is None:
        return None
    x = tracking.middle(pair.one, pair.other)
    if tracking.setup.forced:
        return _orbit_of_periods(tracking, x, pair.mode)
    return _rest(tracking, x, pair.mode) or _cycle(tracking, x, pair.mode)


def _orbit_of_periods(tracking: Tracking, x: np.ndarray, mode: str) -> PeriodicOrbit | None:
    """The orbit that closes after as many forcing periods as the points of the trajectory come back after."""
    modes = np.array(tracking.modes)
    far = tracking.width(tracking.points[:-1], tracking.points[-1])[::-1]
    far = np.where(modes[-2::-1] == modes[-1], far, np.inf)
    back = np.flatnonzero(far <= BACK)
    if not back.size:
        return None
    first, nearest = int(back[0]), int(np.argmin(far))
    # Points of a long orbit come near each other before they come back.
    counts = [first, nearest] if far[nearest] < NEARER * far[first] else [first]
    for i in counts:
        orbit = _near_orbit(tracking, x, mode, i + 1, float(far[i]))
        if orbit is not None:
            return orbit
    return None


def _near_orbit(
    tracking: Tracking, x: np.ndarray, mode: str, periods: int, distance: float
) -> PeriodicOrbit | None:
    """The orbit of so many forcing periods, if it is as near as the points came back."""
    setup = tracking.setup
    options: dict[str, Any] = {"mode": mode, "parameters": setup.parameters, "t0": setup.t0}
    try:
        orbit = periodic_orbit(setup.system, x, periods=periods, **options)
    except HybridError:
        return None
    near = orbit.closes and _moved(tracking, orbit.x0, x) <= MOVED * max(distance, APART)
    return orbit if near and _has_one_way_out(tracking, orbit) else None


def _rest(tracking: Tracking, x: np.ndarray, mode: str) -> Equilibrium | None:
    """The equilibrium near a state."""
    setup = tracking.setup
    if len(tracking.points) < 2:
        return None
    distance = float(tracking.width(tracking.points[-2], tracking.points[-1]))
    if distance > BACK:
        return None
    try:
        rest = equilibrium(setup.system, x, mode=mode, parameters=setup.parameters)
    except HybridError:
        return None
    near = rest.status.ok and rest.admissible and _moved(tracking, rest.x, x) <= MOVED * max(distance, APART)
    if not near:
        return None
    return rest if int(np.sum(rest.eigenvalues.real > _zero(tracking))) == 1 else None


def _cycle(tracking: Tracking, x: np.ndarray, mode: str) -> PeriodicOrbit | None:
    """The periodic orbit of an autonomous system through a state to which its run returns."""
    setup = tracking.setup
    period = _first_return(tracking, x, mode)
    if period is None:
        return None
    try:
        orbit = periodic_orbit(
            setup.system, x, mode=mode, parameters=setup.parameters, t0=setup.t0, period=period
        )
    except HybridError:
        return None
    if not orbit.closes or not _has_one_way_out(tracking, orbit):
        return None
    # Newton's method may move the point along the orbit.
    arc = orbit.arc()
    states = arc(np.linspace(arc.t[0], arc.t[-1], LOOKED_AT))
    return orbit if np.min(_moved(tracking, states, x)) <= BACK else None


def _first_return(tracking: Tracking, x: np.ndarray, mode: str) -> float | None:
    """After what time a run first comes back near its start, at the plane through it across its field."""
    setup = tracking.setup
    # The run from the middle of the pair stays with the boundary for longer than the pair stayed together.
    length = 1.5 * tracking.together * setup.interval
    arc = simulate(
        setup.system,
        x,
        (setup.t0, setup.t0 + length),
        mode=mode,
        parameters=setup.parameters,
        solver=setup.solver,
    )
    times = np.linspace(arc.t[0], arc.t[-1], LOOKED_AT)
    away = closed_change(arc(times) - x, setup.turns) / tracking.extent
    rate = setup.begin(x, mode).field() / tracking.extent[: tracking.moving]
    height = away[:, : tracking.moving] @ rate
    for i in np.flatnonzero((height[:-1] < 0.0) & (height[1:] >= 0.0)):
        share = height[i] / (height[i] - height[i + 1])
        there = away[i] + share * (away[i + 1] - away[i])
        if np.abs(there[: tracking.moving]).max() <= BACK:
            return float(times[i] + share * (times[i + 1] - times[i]) - setup.t0)
    return None


def _moved(tracking: Tracking, states: np.ndarray, x: np.ndarray) -> np.ndarray:
    """How far states ``(..., n)`` are from one of the trajectory; an age that they lack does not count."""
    age = tracking.setup.system.age
    if age is not None and states.shape[-1] < len(x):
        states = np.insert(states, age, x[age], axis=-1)
    return tracking.width(states, x)


def _has_one_way_out(tracking: Tracking, orbit: PeriodicOrbit) -> bool:
    """Whether an orbit is unstable in one direction, as a saddle within the boundary is."""
    return int(np.sum(orbit.log_moduli > _zero(tracking))) == 1


def _zero(tracking: Tracking) -> float:
    """Below this the rate of a direction counts as zero."""
    return math.sqrt(tracking.setup.solver.rtol)
