"""Continue a periodic orbit over a parameter, in both directions."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, progress_bar
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.crossing import crossing, flip_coefficient, fold_coefficient, is_supercritical
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import Place, moment, place_on, share_of
from hybrid.orbits.continuation.result import Points, mode_at, whole_orbit_of
from hybrid.orbits.continuation.walk import Event, walk
from hybrid.orbits.orbit import PeriodicOrbit, unaged
from hybrid.orbits.sensitivity import is_isolated
from hybrid.simulation.interrupt import interrupted_status
from hybrid.simulation.plan import check_solver
from hybrid.solvers import Solver, Taylor
from hybrid.status import SUCCESS, Status, StatusCode
from hybrid.system.entries import has_age
from hybrid.transform.aged import original_of
from hybrid.transform.edges import switches

Item = Place | Event

# A multiplier is -1 if it is this near.
AT_MINUS_ONE = 1e-3
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
}

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
    solver: Solver | None = None,
    max_steps: int = 2000,
    progress: bool | None = None,
) -> Branch:
    """The branch of a periodic orbit over a parameter, both ways from the orbit, and the bifurcations on it.

    Steps are taken along the branch (pseudo-arclength), so that it may turn back at folds. Each orbit is
    corrected by the shortest Newton step of the state, the period and the parameter together, with the
    derivatives of the run in all of them. A step is the next point if the corrections contract and are small
    beside the step. The section moves along the orbit, so that no jump is near it.

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
    """
    arguments.instance("orbit", orbit, PeriodicOrbit, "Call periodic_orbit first.")
    if not orbit.closes:
        raise ArgumentError(f"orbit has not converged: {orbit.status.message}")
    arguments.known("parameter: Parameter", parameter, orbit.system.parameters, "Parameters")
    ends = arguments.numbers("span", span, "be (low, high)")
    # The range is a unit: its square has to be a number.
    if ends.shape != (2,) or not np.all(np.abs(ends) < 1e150):
        raise arguments.refusal("span", "be (low, high)", span)
    low, high = ends.tolist()
    value = orbit.parameters[parameter]
    if arguments.within(np.array([value]), low, high) is None or not low < high:
        got = arguments.shown(span)
        raise ArgumentError(f"span must be (low, high) around {parameter} = {value}; got {got}.")
    low, high = min(low, value), max(high, value)
    most = arguments.count("max_steps", max_steps, 1)
    progress = None if progress is None else arguments.flag("progress", progress)
    method = Taylor(rtol=1e-12, atol=1e-14) if solver is None else check_solver(solver)
    with CTRL_C, progress_bar(None, "Branch", progress, "orbit") as bar:
        found, why, notes, advice = _branch(orbit, parameter, low, high, method, most, bar)
        if CTRL_C.is_set():
            return attrs.evolve(found, status=interrupted_status("the orbits so far"))
    status = _status(why, advice)
    order = next((found.orbit(i).status for i in (0, -1) if not found.orbit(i).status.ok), None)
    if status.ok and order is not None:
        status = attrs.evolve(order, message=f"{status.message} {order.message}")
    return attrs.evolve(found, status=attrs.evolve(status, message=" ".join([status.message, *notes])))


def _branch(
    orbit: PeriodicOrbit, name: str, low: float, high: float, solver: Solver, most: int, bar: Progress
) -> tuple[Branch, list[str], list[str], str]:
    """The branch both ways, why it ends, what is to be noted of its first orbit, and advice if it is lost."""
    begin = place_on(orbit, (name,), np.array([high - low]), solver)
    points = points_of(orbit, begin)
    items: list[Item] = [begin]
    why: list[str] = []
    advice = ""
    for sign in (-1.0, 1.0):
        items = items[::-1]
        why.append(_walked(attrs.evolve(begin, tangents=sign * begin.tangents), low, high, most, items, bar))
        if why[-1] == "lost":
            advice = _advice(next(item for item in reversed(items) if isinstance(item, Place)))
        if why[-1] in ("closed", "interrupted"):
            break
    held = begin.family.held
    places = [item for item in items if isinstance(item, Place)]
    told = "" if all(place.family.held is not None for place in places) else ", where the jumps keep it"
    notes = [] if held is None else [f"Held as at the start{told}: {held.told}."]
    if _is_one_of_many(begin):
        notes += [MANY, NOTHING_HELD] if held is None else [MANY]
    return branch_of(items, points), why, notes, advice


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


def _walked(begin: Place, low: float, high: float, most: int, items: list[Item], bar: Progress) -> str:
    """Walk from a place; what is met goes to the items. Returns why the walk ends."""
    with CTRL_C.ending():
        for item in walk(begin, low, high, most):
            if isinstance(item, str):
                return item
            items.append(item)
            bar.update(isinstance(item, Place))
            if CTRL_C.is_set():
                break
    return "interrupted"


def branch_of(items: list[Item], points: Points) -> Branch:
    """The branch through places and events, in order."""
    places = [item for item in items if isinstance(item, Place)]
    passes = [place.orbit for place in places]
    family = passes[0].family
    where = [points.at(each) for each in passes]
    stable = {id(place): place.orbit.stable for place in places}
    moments = [moment(each, *at) for each, at in zip(passes, where, strict=True)]
    branch = Branch(
        system=family.system,
        name=family.names[0],
        parameter=np.array([place.value for place in places]),
        x0=np.array([x for _, x in moments]),
        mode=np.array([mode_at(each, *at) for each, at in zip(passes, where, strict=True)]),
        t0=np.array([points.t0 if family.forced else t for t, _ in moments]),
        period=np.array([each.period for each in passes]),
        multipliers=np.array([each.multipliers for each in passes]),
        stable=np.array([stable[id(place)] for place in places]),
        bifurcations=tuple(
            bifurcation_of(item, _sides(items, i, stable), points)
            for i, item in enumerate(items)
            if isinstance(item, Event)
        ),
        status=SUCCESS,
        orbit=_OrbitOf(passes, points),
    )
    return _unaged(branch)


# Functions that remember are classes here: a branch is pickled with them.
@attrs.frozen(eq=False)
class _OrbitOf:
    """The orbit of a point of a branch."""

    passes: list[Pass]
    points: Points

    def __call__(self, i: int) -> PeriodicOrbit:
        return whole_orbit_of(self.passes[i], self.points)


@attrs.frozen(eq=False)
class _WithoutAge:
    """The orbit of a point of a branch, without the age."""

    orbit: Callable[[int], PeriodicOrbit]

    def __call__(self, i: int) -> PeriodicOrbit:
        return unaged([self.orbit(i)])[0]


def _unaged(branch: Branch) -> Branch:
    """The branch without the age, if the age counts for nothing at all of its points."""
    system, age = branch.system, branch.system.age
    modes = {*branch.mode.tolist(), *(each.orbit.mode for each in branch.bifurcations)}
    if age is None or any(has_age(system, mode) for mode in modes):
        return branch
    return attrs.evolve(
        branch,
        system=original_of(system),
        x0=np.delete(branch.x0, age, axis=1),
        multipliers=branch.multipliers[:, :-1],
        bifurcations=tuple(_without_component(each, age) for each in branch.bifurcations),
        orbit=_WithoutAge(branch.orbit),
    )


def _without_component(bifurcation: Bifurcation, age: int) -> Bifurcation:
    coefficient = bifurcation.coefficient
    if isinstance(coefficient, np.ndarray):
        coefficient = np.delete(coefficient, age)
    return attrs.evolve(bifurcation, orbit=unaged([bifurcation.orbit])[0], coefficient=coefficient)


def _sides(items: list[Item], i: int, stable: dict[int, bool]) -> tuple[bool | None, bool | None]:
    """Whether the orbits before and after an item are stable; None at an end of the branch."""
    sides = []
    for part in (items[:i][::-1], items[i + 1 :]):
        near = next((each for each in part if isinstance(each, Place)), None)
        sides.append(None if near is None else stable[id(near)])
    return sides[0], sides[1]


def points_of(orbit: PeriodicOrbit, place: Place) -> Points:
    """The points that stand for the orbits of a branch from this orbit: on it, its own."""
    points = Points(orbit.t0)
    if not place.family.forced:
        points.shares[place.family.route] = share_of(place.orbit, orbit.t0)
    return points


def bifurcation_of(event: Event, stable: tuple[bool | None, bool | None], points: Points) -> Bifurcation:
    """An event as a result."""
    place = event.place if event.change is None else event.change.exact.place
    orbit = whole_orbit_of(place.orbit, points)
    if event.change is not None and not np.all(np.isfinite(orbit.fundamental)):
        # Where a guard loses its speed the derivatives have no bound: they are those of an orbit nearby.
        near = whole_orbit_of(event.change.exact.before.orbit, points)
        orbit = attrs.evolve(
            orbit,
            multipliers=near.multipliers,
            log_moduli=near.log_moduli,
            fundamental=near.fundamental,
        )
    coefficient, further = _normal_form(event)
    return Bifurcation(
        event.kind,
        place.family.names[0],
        place.value,
        orbit,
        event.message + further,
        stable,
        coefficient,
        place,
        event.change,
    )


def _normal_form(event: Event) -> tuple[np.ndarray | float | None, str]:
    """The coefficient of a bifurcation where theory has one, and what it says, in words."""
    place, name = event.place, event.place.family.names[0]
    if event.change is not None:
        return event.change.coefficient, ""
    if event.kind == "fold":
        found = fold_coefficient(place)
        return found, "" if found is None else f"; the orbits are on the side of {_side(found)} {name}"
    begins = event.kind == "flip" and np.abs(place.orbit.free_multipliers + 1.0).min() < AT_MINUS_ONE
    doubled = crossing(place, 2) if begins else None
    if doubled is None:
        return None, ""
    found = flip_coefficient(place, doubled)
    stable = "stable" if is_supercritical(place, found) else "unstable"
    return found, f", {stable}, on the side of {_side(found)} {name}"


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def _side(coefficient: float) -> str:
    return "larger" if coefficient > 0.0 else "smaller"


def _status(why: list[str], advice: str) -> Status:
    told = " and at ".join(ENDS.get(each, _a(each)) for each in dict.fromkeys(why))
    if not {"lost", "most"} & set(why):
        return attrs.evolve(SUCCESS, message=f"The branch ends at {told}.")
    return Status(
        StatusCode.NOT_CONVERGED,
        f"The branch ends at {told}.",
        advice or "Raise max_steps, or continue from the last orbit.",
    )
