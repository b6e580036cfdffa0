"""Continue a periodic orbit over a parameter, in both directions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.errors import ArgumentError
from hybrid.measures.asked import Unmeasured
from hybrid.orbits.continuation.as_branch import Item, Outputs, branch_of
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.continuation.event import Event
from hybrid.orbits.continuation.monitors import Monitors
from hybrid.orbits.continuation.place import Place, place_on, share_of
from hybrid.orbits.continuation.result import Points
from hybrid.orbits.continuation.walk import walk
from hybrid.orbits.continuation.watch import (
    OfArc,
    Watch,
    checked_events,
    checked_outputs,
    checked_stop,
)
from hybrid.orbits.kinds import OF_ORBITS
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.sensitivity import is_isolated
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.transform.edges import switches

# And 1 if it is this near: that of a family is the double root of an equation.
NEAR_ONE = 1e-3

ENDS = {
    "range": "the end of the range",
    "closed": "its start: it is closed",
    "equilibrium": "a point, where the orbit has no size",
    "infinity": "an orbit that grows without bound",
    "homoclinic": "an orbit whose period grows without bound",
    "instant": "an orbit whose period becomes zero",
    "chatter": "an orbit whose chatter becomes incomplete",
    "family": "orbits that all have one value of the parameter",
    "most": "the limit of steps",
    "lost": "an orbit beyond which Newton's method finds none",
    "stop": "an orbit for which stop= is true",
    "unmeasured": "an orbit that a function fails on",
}
# A walk that ends where stop= names a kind says so with this before it.
STOPPED = "stop: "

MANY = (
    "A multiplier is 1, so there are other orbits beside each: the one that is nearest to the orbit before "
    "is taken."
)
NOTHING_HELD = "No conserved quantity is held."


def continue_orbit(
    orbit: PeriodicOrbit,
    parameter: str,
    span: tuple[float, float],
    *,
    outputs: Mapping[str, OfArc] | None = None,
    events: Mapping[str, OfArc] | None = None,
    stop: str | Iterable[str] | Callable[[PeriodicOrbit], Any] | None = None,
    solver: Solver | None = None,
    max_steps: int = 2000,
    progress: bool | None = None,
) -> Branch:
    """The branch of a periodic orbit over a parameter, both ways from the orbit, and the bifurcations on it.

    Steps are taken along the branch (pseudo-arclength), so that it may turn back at folds. Each orbit is
    corrected by the shortest Newton step of all its unknowns together: the states after its jumps, the times
    of these, and the parameter. A step is the next point if the corrections contract and are small beside the
    step.

    Where the transitions of the orbit change, as at a grazing, the branch goes on with the orbits beyond the
    change, if there are any: a change is no end. The status says where the branch ends.

    Quantities that the system declares with ``laws=Laws(conserved=...)`` are held at their values on the
    first orbit, as far as the jumps keep them, and the status names them. All orbits of the branch have these
    values, also where orbits of other values are beside each. The branch ends, at a point for example, where
    no orbit has them any more.

    Parameters
    ----------
    orbit
        From `periodic_orbit`.
    parameter
        Name of the parameter.
    span
        ``(low, high)``, which contains the value of the orbit.
    outputs
        Functions of an arc, by name, such as ``{"peak": hybrid.measures.maximum("x")}``. Each is called with
        a run once around every orbit and returns a number; ``branch["peak"]`` are these numbers.
    events
        Functions of an arc, by name. Where one changes its sign along the branch its zero is located, as a
        bifurcation of that kind: ``{"limit": lambda arc: hybrid.measures.maximum("x")(arc) - 2.0}``. Values
        below 1e-11, or 1e-11 of the largest one, count as zero, which has no sign.
    stop
        Where the branch ends, either way: at the first bifurcation of a kind or of one of several kinds,
        ``"fold"``, which ``events=`` may have named, or at the first orbit beyond this one at which a
        function of an orbit is true.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-12, atol=1e-14)``.
    max_steps
        Largest number of steps in either direction.
    progress
        Whether to show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    Branch
        With a status; if it is interrupted or lost it keeps what there is. So it does if a function raises
        an error, or gives no finite number, for a later orbit: the branch ends before that orbit, and the
        status says which it is.

    Raises
    ------
    ArgumentError
        If the orbit has not converged, the parameter does not exist, or the span does not contain its value;
        if a function in ``outputs`` or ``events`` gives no finite number for the orbit; if ``stop`` names a
        kind that there is not.

    References
    ----------
    E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods, SIAM 2003, chapters 3 and 6.
    Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 4th ed., Springer 2023, chapter 10.
    F. J. Muñoz-Almaraz, E. Freire, J. Galán, E. Doedel, A. Vanderbauwhede, "Continuation of periodic orbits
    in conservative and Hamiltonian systems", Physica D 181 (2003) 1, doi:10.1016/S0167-2789(03)00097-6: what
    conserved quantities do to the equations. Here they take the place of the equations that say nothing, and
    no unknown is added.

    Examples
    --------
    >>> import models
    >>> from hybrid import continue_orbit, periodic_orbit
    >>> orbit = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> branch = continue_orbit(orbit, "w", (0.9, 1.1))
    >>> branch.status.ok
    True

    The largest speed over the frequency, up to where it is 1.8:

    >>> from hybrid.measures import maximum
    >>> speed = maximum("v")
    >>> fast = {"fast": lambda arc: speed(arc) - 1.8}
    >>> branch = continue_orbit(orbit, "w", (0.9, 1.8), outputs={"speed": speed}, events=fast, stop="fast")
    >>> [round(each.outputs["speed"], 9) for each in branch.of("fast")]
    [1.8]
    """
    arguments.instance("orbit", orbit, PeriodicOrbit, "Call periodic_orbit first.")
    if not orbit.closes:
        raise ArgumentError(f"orbit has not converged: {orbit.status.message}")
    arguments.known("parameter: Parameter", parameter, orbit.system.parameters, "Parameters")
    low, high = arguments.span_around("span", span, parameter, orbit.parameters[parameter])
    most = arguments.count("max_steps", max_steps, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    located = checked_events(events)
    kinds, stops = checked_stop(stop, located)
    measured = checked_outputs(outputs, orbit.system)
    begin = place_on(orbit, (parameter,), np.array([high - low]), method)
    watch = Watch(method, points_of(orbit, begin), measured, located, kinds, stops)
    with CTRL_C, progress_bar(None, "Branch", progress, "orbit") as bar:
        found, why, notes, advice = _branch(begin, low, high, most, watch, bar)
        if CTRL_C.is_set():
            return attrs.evolve(found, status=interrupted_status("the orbits so far"))
    status = _status(why, advice)
    order = next((found.orbit(i).status for i in (0, -1) if not found.orbit(i).status.ok), None)
    if status.ok and order is not None:
        status = attrs.evolve(order, message=f"{status.message} {order.message}")
    return attrs.evolve(found, status=attrs.evolve(status, message=" ".join([status.message, *notes])))


def _branch(
    begin: Place, low: float, high: float, most: int, watch: Watch, bar: Progress
) -> tuple[Branch, list[str], list[str], str]:
    """The branch both ways, why it ends, what is to be noted of it, and advice if it is lost."""
    items: list[Item] = [begin]
    outputs = {begin: watch.outputs_of(begin.orbit)}
    monitors = Monitors(watch)
    monitors.start(begin)
    why, failures = list[str](), list[str]()
    advice = ""
    for sign in (-1.0, 1.0):
        items = items[::-1]
        start = attrs.evolve(begin, tangents=sign * begin.tangents)
        try:
            why.append(_walked(walk(start, low, high, most, monitors), items, outputs, watch, bar))
        except Unmeasured as error:
            why.append("unmeasured")
            failures.append(str(error))
        if why[-1] == "lost":
            advice = _advice(next(item for item in reversed(items) if isinstance(item, Place)))
        if why[-1] in ("closed", "interrupted"):
            break
    held = begin.family.held
    places = [item for item in items if isinstance(item, Place)]
    told = "" if all(place.family.held is not None for place in places) else ", where the jumps keep it"
    notes = failures if held is None else [*failures, f"Held as at the start{told}: {held.told}."]
    if _is_one_of_many(begin):
        notes = [*notes, MANY, NOTHING_HELD] if held is None else [*notes, MANY]
    return branch_of(items, outputs, watch), why, notes, advice


def _advice(place: Place) -> str:
    """What to do where Newton's method finds no orbit beyond a place."""
    system = place.family.system
    for name in dict.fromkeys(name for stretch in place.family.route for name in stretch.fired):
        if switches(system.transitions[system.transition_index(name)], system.variables):
            return (
                f"The reset of {name!r} has a kink or a jump inside: continue an orbit of split(system), "
                "where that is a transition."
            )
    return "Tighten the tolerances of solver=, or continue from the last orbit."


def _is_one_of_many(place: Place) -> bool:
    """Whether there are other orbits beside one at the same parameters.

    They have a multiplier that is 1. The equations may be nearly singular without one: their sizes differ.
    """
    ones = np.abs(place.orbit.free_multipliers - 1.0) <= NEAR_ONE
    return bool(np.any(ones)) and not is_isolated(place)


def _walked(
    found: Iterator[Item | str], items: list[Item], outputs: Outputs, watch: Watch, bar: Progress
) -> str:
    """Take a walk; what is met goes to the items, with its outputs. Returns why the walk ends."""
    with CTRL_C.ending():
        for item in found:
            if isinstance(item, str):
                return item
            if isinstance(item, Place):
                outputs[item] = watch.outputs_of(item.orbit)
            items.append(item)
            bar.update(isinstance(item, Place))
            if isinstance(item, Event) and item.kind in watch.kinds:
                return f"{STOPPED}{item.kind}"
            if isinstance(item, Place) and watch.is_last(item.orbit):
                return "stop"
            if CTRL_C.is_set():
                break
    return "interrupted"


def points_of(orbit: PeriodicOrbit, place: Place) -> Points:
    """The points that stand for the orbits of a branch from this orbit: on it, its own."""
    points = Points(orbit.t0)
    if not place.family.forced:
        points.shares[place.family.route] = share_of(place.orbit, orbit.t0)
    return points


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _status(why: list[str], advice: str) -> Status:
    told = " and at ".join(map(_told, dict.fromkeys(why)))
    message = f"The branch ends at {told}."
    if "unmeasured" in why:
        return Status(StatusCode.FAILED, message, "Correct the function, or end the span before that orbit.")
    if not {"lost", "most"} & set(why):
        return attrs.evolve(SUCCESS, message=message)
    return Status(
        StatusCode.NOT_CONVERGED, message, advice or "Raise max_steps, or continue from the last orbit."
    )


def _told(why: str) -> str:
    """Why a walk ends, in words."""
    if why.startswith(STOPPED):
        kind = why.removeprefix(STOPPED)
        return f"{_a(kind) if kind in OF_ORBITS else f'a zero of events[{kind!r}]'} (named in stop=)"
    return ENDS.get(why, _a(why))
