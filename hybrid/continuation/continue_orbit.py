"""Continue a periodic orbit over a parameter, in both directions."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid import arguments
from hybrid.continuation.branch import Bifurcation, Branch
from hybrid.continuation.walk import Event, Place, Walk
from hybrid.errors import ArgumentError
from hybrid.orbits.orbit import PeriodicOrbit, family_of
from hybrid.orbits.shots import Family, Point, Shot
from hybrid.simulation.interrupt import CTRL_C, interrupted_status
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor
from hybrid.status import SUCCESS, Status, StatusCode

ENDS = {
    "range": "the end of the range",
    "closed": "the branch closes",
    "grazing": "a grazing",
    "infinity": "an orbit that grows without bound",
    "most": "the limit of steps",
    "lost": "Newton's method finds no orbit farther on",
}


def continue_orbit(
    orbit: PeriodicOrbit,
    parameter: str,
    span: tuple[float, float],
    *,
    solver: Solver | None = None,
    max_steps: int = 2000,
) -> Branch:
    """The branch of a periodic orbit over a parameter, both ways from the orbit, and the bifurcations on it.

    Steps are taken along the branch (pseudo-arclength), so that it may turn back at folds. Each orbit is
    corrected by the shortest Newton step of the state, the period and the parameter together, with the
    derivatives of the run in all of them. The orbits keep their sequence of transitions: the branch ends
    where a guard is touched without speed. The section moves along the orbit, so that no jump is near it.

    Parameters
    ----------
    orbit
        From `periodic_orbit`.
    parameter
        Name of the parameter.
    span
        ``(low, high)``, which contains the value of the orbit.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-12, atol=1e-14)``.
    max_steps
        Largest number of steps in either direction.

    Returns
    -------
    Branch
        With a status; if it is interrupted or lost it keeps what there is.

    Raises
    ------
    ArgumentError
        If the orbit has not converged, the parameter does not exist, or the span does not contain its value.

    References
    ----------
    E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods, SIAM 2003, chapters 3 and 6.
    Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 4th ed., Springer 2023, chapter 10.

    Examples
    --------
    >>> import models
    >>> from hybrid import periodic_orbit
    >>> orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> branch = continue_orbit(orbit, "w", (0.9, 1.1))
    >>> branch.status.ok
    True
    """
    arguments.instance("orbit", orbit, PeriodicOrbit, "Call periodic_orbit first.")
    if not orbit.status.ok:
        raise ArgumentError(f"orbit has not converged: {orbit.status.message}")
    arguments.known("parameter: Parameter", parameter, orbit.system.parameters, "Parameters")
    ends = arguments.numbers("span", span, "be (low, high)")
    # The range is a unit: its square has to be a number.
    if ends.shape != (2,) or not np.all(np.abs(ends) < 1e150):
        raise arguments.refusal("span", "be (low, high)", span)
    low, high = ends.tolist()
    value = orbit.parameters[parameter]
    if not low <= value <= high or not low < high:
        got = arguments.shown(span)
        raise ArgumentError(f"span must be (low, high) around {parameter} = {value}; got {got}.")
    most = arguments.count("max_steps", max_steps, 1)
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    walk = Walk(family_of(orbit, parameter, method), high - low)
    point = Point(np.array(orbit.x0), orbit.t0, orbit.mode, orbit.period, value)
    with CTRL_C:
        found, why = _both_ways(walk, point, orbit, low, high, most)
        if CTRL_C.is_set():
            return attrs.evolve(found, status=interrupted_status("the orbits so far"))
    return attrs.evolve(found, status=_status(why))


def _both_ways(
    walk: Walk, point: Point, orbit: PeriodicOrbit, low: float, high: float, most: int
) -> tuple[Branch, list[str]]:
    places: list[Place] = []
    events: list[Event] = []
    why: list[str] = []
    begin = walk.begin(quiet_shot(walk.family, point))
    if begin is None:
        raise ArgumentError("orbit is not found again: solve it with tighter tolerances.")
    for sign in (-1.0, 1.0):
        found: list[Place] = []
        met: list[Event] = []
        for item in walk.walk(attrs.evolve(begin, tangent=sign * begin.tangent), low, high, most):
            if isinstance(item, Place):
                found.append(item)
            elif isinstance(item, Event):
                met.append(item)
            else:
                why.append(item)
            if CTRL_C.is_set():
                why.append("interrupted")
                break
        if sign < 0.0:
            places, events = [*found[::-1], begin], met[::-1]
        else:
            places, events = [*places, *found], [*events, *met]
        if why[-1] == "closed":
            break
    orbits = tuple(orbit_of(walk.family, place.shot, orbit.t0) for place in places)
    stable = np.array([bool(np.all(np.abs(walk.multipliers(place)) < 1.0)) for place in places])
    bifurcations = tuple(
        Bifurcation(
            each.kind,
            walk.family.name,
            each.place.value,
            orbit_of(walk.family, each.place.shot, orbit.t0),
            each.message,
        )
        for each in events
    )
    return Branch(walk.family.system, walk.family.name, orbits, stable, bifurcations, SUCCESS), why


def quiet_shot(family: Family, point: Point) -> Shot:
    """One pass around the orbit of a point, from a place away from its jumps."""
    shot = family.shoot(point)
    if not family.is_near_section(shot):
        return shot
    return family.shoot(family.moved(shot, np.zeros(len(point.x) + 2))[0])


def _status(why: list[str]) -> Status:
    told = " and at ".join(ENDS.get(each, each) for each in dict.fromkeys(why))
    if all(each in ("range", "closed", "grazing", "infinity") for each in why):
        return attrs.evolve(SUCCESS, message=f"The branch ends at {told}.")
    return Status(
        StatusCode.NOT_CONVERGED,
        f"The branch ends at {told}.",
        "Tighten the tolerances of solver=, raise max_steps, or continue from the last orbit.",
    )


def orbit_of(family: Family, shot: Shot, t0: float) -> PeriodicOrbit:
    """The orbit of a shot as a result; of a forced system at the phase of the time ``t0``."""
    point, arc = shot.point, shot.arc
    x, mode, t = point.x, point.mode, point.t
    if family.forced:
        ahead = (t0 - point.t) % point.period
        i = int(np.searchsorted(arc.t, point.t + ahead, side="right")) - 1
        x, mode, t = arc(point.t + ahead)[:-1], str(arc.mode[max(i, 0)]), t0
    multipliers = shot.multipliers
    with np.errstate(divide="ignore"):
        moduli = np.log(np.abs(multipliers))
    targets = [jump.target for jump in arc.jumps if jump.target is not None]
    return PeriodicOrbit(
        system=family.system,
        parameters={**family.system.parameters, **family.parameters, family.name: float(point.value)},
        x0=np.array(x),
        mode=mode,
        t0=t,
        period=point.period,
        multipliers=multipliers,
        log_moduli=moduli,
        fundamental=shot.fundamental,
        residual=float(np.linalg.norm(shot.gap)),
        iterations=0,
        signature=(point.mode, *targets),
        transitions=shot.transitions,
        status=SUCCESS,
    )
