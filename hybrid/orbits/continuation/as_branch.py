"""What a walk has met as a branch: its places as arrays, its events as bifurcations."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from hybrid.orbits.continuation.branch import Bifurcation, Branch
from hybrid.orbits.continuation.crossing import crossing, flip_coefficient, fold_coefficient, is_supercritical
from hybrid.orbits.continuation.event import Event, OfThisProcess
from hybrid.orbits.continuation.hopf import first_lyapunov
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import Place, moment
from hybrid.orbits.continuation.result import Points, mode_at, whole_orbit_of
from hybrid.orbits.continuation.watch import (
    Watch,
    units_of,
)
from hybrid.orbits.orbit import PeriodicOrbit, unaged
from hybrid.status import SUCCESS
from hybrid.system.entries import has_age
from hybrid.transform.aged import original_of

Item = Place | Event

# What the functions of a caller make of places.
Outputs = dict[Place, dict[str, float]]

# A multiplier is -1 if it is this near.
AT_MINUS_ONE = 1e-3


def branch_of(items: list[Item], outputs: Outputs, watch: Watch) -> Branch:
    """The branch through places and events, in order."""
    places = [item for item in items if isinstance(item, Place)]
    passes, points = [place.orbit for place in places], watch.points
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
            bifurcation_of(item, _beside(items, i, stable), watch)
            for i, item in enumerate(items)
            if isinstance(item, Event)
        ),
        status=SUCCESS,
        outputs={name: np.array([outputs[place][name] for place in places]) for name in watch.outputs},
        output_units=units_of(watch.outputs, family.system),
        events=tuple(watch.events),
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


@attrs.frozen
class Beside:
    """What is beside a bifurcation on a branch: how many places come before, and which sides are stable."""

    position: int
    stable: tuple[bool | None, bool | None]


def _beside(items: list[Item], i: int, stable: dict[int, bool]) -> Beside:
    """The places before and after an item; at an end of the branch no side is stable or unstable."""
    parts = items[:i], items[i + 1 :]
    before, after = ([each for each in part if isinstance(each, Place)] for part in parts)
    sides = (stable[id(before[-1])] if before else None, stable[id(after[0])] if after else None)
    return Beside(len(before), sides)


def bifurcation_of(event: Event, beside: Beside, watch: Watch) -> Bifurcation:
    """An event as a result."""
    points = watch.points
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
        beside.stable,
        coefficient,
        beside.position,
        watch.outputs_near(place.orbit),
        place,
        event.change,
        OfThisProcess(watch.events.get(event.kind)),
    )


def _normal_form(event: Event) -> tuple[np.ndarray | float | None, str]:
    """The coefficient of a bifurcation where theory has one, and what it says, in words."""
    place, name = event.place, event.place.family.names[0]
    if event.change is not None:
        return event.change.coefficient, ""
    if event.kind == "fold":
        found = fold_coefficient(place)
        return found, "" if found is None else f"; the orbits are on the side of {_side(found)} {name}"
    if event.kind == "Hopf":
        return first_lyapunov(place), ""
    begins = event.kind == "flip" and np.abs(place.orbit.free_multipliers + 1.0).min() < AT_MINUS_ONE
    doubled = crossing(place, 2) if begins else None
    if doubled is None:
        return None, ""
    found = flip_coefficient(place, doubled)
    stable = "stable" if is_supercritical(place, found) else "unstable"
    return found, f", {stable}, on the side of {_side(found)} {name}"


def _side(coefficient: float) -> str:
    return "larger" if coefficient > 0.0 else "smaller"
