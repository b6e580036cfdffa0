"""What is asked of each orbit of a branch: its outputs, functions whose zeros are located, where to stop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.measures.asked import Unmeasured, answer, told
from hybrid.measures.measure import Measure
from hybrid.orbits.continuation.labelled import THERE
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.result import Points, arc_of, orbit_of
from hybrid.orbits.kinds import OF_ORBITS
from hybrid.orbits.orbit import PeriodicOrbit, closes
from hybrid.simulation.arc import HybridArc
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem

OfArc = Callable[[HybridArc], float]

# Variables that the dataset of a branch, a curve or a diagram has in any case.
TAKEN = (
    *("x0", "mode", "t0", "period", "multipliers", "stable", "kind", "value", "message", "stable_beside"),
    *("position", "outputs", "point", "bifurcation", "state", "output", "multiplier", "side", "unit"),
    *("output_unit", "coefficient", "coefficients", "eigenvalues", "admissible", "other_modes", "barrier"),
    *("branch", "family", "parent", "parent_bifurcation", "states", "directions", "made_by"),
)


@attrs.frozen(eq=False)
class Watch:
    """What a caller asks of each orbit of a branch or a curve.

    Attributes
    ----------
    solver
        With which the orbits are run once around.
    points
        Where these runs start.
    outputs
        Functions of an arc whose values are kept, by name.
    events
        Functions of an arc whose zeros are located, by name.
    kinds
        Kinds of bifurcations at which a walk ends.
    stops
        A function of an orbit that is true where a walk ends; None if there is none.
    """

    solver: Solver
    points: Points
    outputs: Mapping[str, OfArc] = attrs.field(factory=dict)
    events: Mapping[str, OfArc] = attrs.field(factory=dict)
    kinds: tuple[str, ...] = ()
    stops: Callable[[PeriodicOrbit], Any] | None = None
    _known: WeakKeyDictionary[Pass, dict[str, float]] = attrs.field(factory=WeakKeyDictionary, init=False)

    def value(self, name: str, orbit: Pass) -> float:
        """The value of one of ``events``.

        Raises
        ------
        Unmeasured
            If there is none.
        """
        known = self._known.setdefault(orbit, {})
        if name not in known:
            known[name] = self._values("events", {name: self.events[name]}, orbit)[name]
        return known[name]

    def outputs_of(self, orbit: Pass) -> dict[str, float]:
        """The values of all ``outputs``, by name.

        Raises
        ------
        Unmeasured
            If one has none.
        """
        return self._values("outputs", self.outputs, orbit) if self.outputs else {}

    def outputs_near(self, orbit: Pass) -> dict[str, float]:
        """The values of all ``outputs`` at a bifurcation: nan where the orbit is too singular for them."""
        try:
            return self.outputs_of(orbit)
        except Unmeasured:
            return dict.fromkeys(self.outputs, np.nan)

    def is_last(self, orbit: Pass) -> bool:
        """Whether the walk ends at an orbit.

        Raises
        ------
        Unmeasured
            If the function does not say so.
        """
        if self.stops is None:
            return False
        found = orbit_of(orbit, self.points)
        try:
            return bool(self.stops(found))
        except Exception as error:
            raise Unmeasured(f"stop raised {told(error)} at {_where(orbit)}.") from error

    def _values(self, argument: str, functions: Mapping[str, OfArc], orbit: Pass) -> dict[str, float]:
        arc = arc_of(orbit, self.points, self.solver)
        where = _where(orbit)
        if not closes(arc.status):
            raise Unmeasured(f"{argument}: the orbit at {where} cannot be run around: {arc.status.message}")
        return {
            name: _number(f"{argument}[{name!r}]", function, arc, where)
            for name, function in functions.items()
        }


def _number(title: str, function: OfArc, arc: HybridArc, where: str) -> float:
    found = answer(title, function, arc, where)
    try:
        return arguments.number(title, found)
    except ArgumentError as error:
        raise Unmeasured(f"{str(error).removesuffix('.')} at {where}.") from error


def _where(orbit: Pass) -> str:
    pairs = zip(orbit.family.names, orbit.loop.values.tolist(), strict=True)
    return ", ".join(f"{name} = {value:.10g}" for name, value in pairs)


def checked_outputs(given: object, system: HybridSystem) -> dict[str, OfArc]:
    """The functions that ``outputs=`` gives, whose names must be new, and the shifts of cyclic components."""
    found = _functions("outputs", given)
    for name in found:
        if name in (*system.quantity_names, *system.parameters):
            raise ArgumentError(
                f"outputs: {name!r} is the name of a component, an output or a parameter of the system; name "
                f"what is measured of it, as in {'peak_' + name!r}."
            )
        if name in TAKEN or name.endswith(THERE):
            raise ArgumentError(f"outputs: {name!r} is a name that every branch has; give it another one.")
    shifts = {f"shift of {name}": ShiftOf(name) for name in system.cyclic}
    for name in found:
        if name in shifts and found[name] != shifts[name]:
            raise ArgumentError(f"outputs: {name!r} is on every branch of this system; leave it out.")
    return {**shifts, **found}


@attrs.frozen
class ShiftOf:
    """By how much a cyclic component is larger at the end of an arc; a class, to be pickled."""

    name: str

    def __call__(self, arc: HybridArc) -> float:
        """The difference of the two ends."""
        values = arc[self.name]
        return float(values[-1] - values[0])


def checked_events(given: object) -> dict[str, OfArc]:
    """The functions that ``events=`` gives; empty for None."""
    found = _functions("events", given)
    for name in found:
        if name in OF_ORBITS:
            raise ArgumentError(f"events: {name!r} is a kind that every branch has; give it another name.")
    return found


def _functions(argument: str, given: object) -> dict[str, OfArc]:
    found = arguments.mapping(argument, given, "map names to functions of an arc")
    for name, function in found.items():
        if not isinstance(name, str) or not name:
            raise arguments.refusal(f"{argument}: each name", "be a text", name)
        arguments.function(f"{argument}[{name!r}]", function, "an arc")
    return found


def checked_stop(
    given: object, events: Iterable[str]
) -> tuple[tuple[str, ...], Callable[[PeriodicOrbit], Any] | None]:
    """Kinds, and a function of an orbit, that ``stop=`` gives: one or the other."""
    if given is None:
        return (), None
    if callable(given):
        return (), given
    wanted = "be a kind of bifurcation, several of them, or a function of an orbit"
    names = [given] if isinstance(given, str) else arguments.items("stop", given, wanted, least=1)
    for name in names:
        arguments.known("stop: Kind", name, (*OF_ORBITS, *events), "Kinds")
    return tuple(names), None


def units_of(outputs: Mapping[str, OfArc], system: HybridSystem) -> dict[str, str]:
    """Units of outputs, by name: of measures, if the system gives them."""
    found = {name: each.unit(system) for name, each in outputs.items() if isinstance(each, Measure)}
    found |= {
        name: system.units.get(each.name) for name, each in outputs.items() if isinstance(each, ShiftOf)
    }
    return {name: unit for name, unit in found.items() if unit is not None}
