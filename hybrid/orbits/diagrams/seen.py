"""What a sweep has seen over the span of a diagram, and on which branch each attractor lies."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError, HybridError
from hybrid.measures.measure import Measure
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.continuation.watch import OfArc
from hybrid.orbits.diagrams.same import ASIDE, SAME_STATE, distances, is_known, is_same_value
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.orbits.equilibria.equilibrium import Equilibrium, equilibrium
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.identity import model_hash
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Solver
from hybrid.system.graph import HybridSystem
from hybrid.transform.aged import aged, original_of, without_age

if TYPE_CHECKING:
    import xarray

Start = PeriodicOrbit | Equilibrium
# Index of a value of the parameter, and of a label.
Place = tuple[int, int]

# Orbits of more points per round are listed, and not followed.
LONGEST = 8
# A time is a number of forcing periods to this.
WHOLE = 1e-6
# An orbit is the attractor if its point is no farther, in units of the size of the orbit.
NEAR = 1e-2
# States along an autonomous orbit that are compared.
ALONG = 1000
# Periods of an attractor without a round from which values of outputs are taken, at most.
PERIODS = 32
WANTED = "be a dataset of basin_fractions(..., along={parameter: values})"


@attrs.define(eq=False)
class SeenAttractors:
    """A sweep over the parameter of a diagram, compared with branches as these are found.

    Attributes
    ----------
    sweep
        The values of the sweep that are in the span.
    system, parameters, name
        The model, its parameters, and the one over which the sweep is.
    solver
        Method and tolerances of orbits.
    branch
        Number of the branch of each attractor ``(values, labels)``, -1 for none.
    position
        How many of the places were compared already.
    """

    sweep: xarray.Dataset
    system: HybridSystem
    parameters: dict[str, float]
    name: str
    solver: Solver
    branch: np.ndarray
    position: int = 0
    _closed: dict[Place, Start | None] = attrs.field(factory=dict, init=False)

    @cached_property
    def places(self) -> list[Place]:
        """Where there is an attractor, by label."""
        there = np.argwhere((self.sweep["kind"].values != "").T)
        return [(int(i), int(j)) for j, i in there]

    def unknown(self, branches: Sequence[Branch | EquilibriumBranch]) -> Start | None:
        """The next attractor that is on none of the branches, closed; it counts as that of the next branch.

        Attractors that cannot be followed are passed over. None if there are no more.
        """
        while self.position < len(self.places):
            place = self.places[self.position]
            found = self.closed(place)
            if CTRL_C.is_set():
                break
            self.position += 1
            if found is None:
                continue
            on = (i for i, each in enumerate(branches) if is_known(found, each, self.solver))
            self.branch[place] = next(on, len(branches))
            if self.branch[place] == len(branches):
                return found
        return None

    def closed(self, place: Place) -> Start | None:
        """The orbit or the equilibrium of an attractor; None if it has none that can be followed."""
        if place not in self._closed:
            self._closed[place] = self._close(place)
        return self._closed[place]

    def _close(self, place: Place) -> Start | None:
        at = self._at(place)
        kind, count, mode = str(at["kind"].values), int(at["round"]), str(at["mode_of_point"].values[0])
        x, values = at["points"].values[0], self.parameters_at(place)
        forcing = self.system.forcing_period(values)
        if kind not in ("periodic", "equilibrium") or count > LONGEST:
            return None
        try:
            if kind == "equilibrium" and forcing is None:
                own = without_age(self.system, x)
                rest = equilibrium(self.system, own, mode=mode, parameters=values)
                return rest if rest.status.ok else None
            orbit = self._orbit(x, mode, values, count, float(at["period"]))
        except HybridError:
            return None
        return orbit if orbit.closes and self._is_near(orbit, x) else None

    def _orbit(
        self, x: np.ndarray, mode: str, values: dict[str, float], count: int, period: float
    ) -> PeriodicOrbit:
        """The orbit near an attractor of so many points, passed once: its points may be of several rounds."""
        forced = self.system.forcing_period(values) is not None
        system = self.system if len(x) == self.system.dimension else aged(self.system)

        def shot(rounds: int) -> PeriodicOrbit:
            how: dict[str, Any] = {"period": period * rounds / max(count, 1)}
            if forced:
                how = {"periods": rounds, "t0": float(self.sweep.attrs["t0"])}
            return periodic_orbit(system, x, mode=mode, parameters=values, solver=self.solver, **how)

        orbit = shot(max(count, 1))
        for rounds in range(1, count if orbit.closes else 1):
            if count % rounds == 0 and _comes_back(orbit, count, rounds):
                return shot(rounds)
        return orbit

    def _is_near(self, orbit: PeriodicOrbit, x: np.ndarray) -> bool:
        """Whether Newton's method has stayed at the attractor, of which this is a point."""
        arc, times, near = orbit.arc(), np.array([orbit.t0]), NEAR
        if orbit.system.period is None:
            # The point of an autonomous orbit is another one.
            times, near = np.linspace(arc.t[0], arc.t[-1], ALONG), NEAR + 2.0 * np.pi / ALONG
        times = np.clip(times, arc.t[0], arc.t[-1])
        return bool(distances(self.system, arc, times, x).min() <= near)

    def parameters_at(self, place: Place) -> dict[str, float]:
        """All parameters of a place."""
        return {**self.parameters, self.name: float(self.sweep[self.name].values[place[0]])}

    def _at(self, place: Place) -> xarray.Dataset:
        return self.sweep.isel({self.name: place[0], "label": place[1]})

    def notes(self) -> Iterator[str]:
        """What was seen and is on no branch, in words, with the ranges of the parameter."""
        values = self.sweep[self.name].values
        left: dict[str, list[int]] = {}
        for place in self.places[: self.position]:
            if self.branch[place] < 0:
                left.setdefault(self._told(place), []).append(place[0])
        for what, rows in left.items():
            for _, run in groupby(enumerate(sorted(set(rows))), key=lambda each: each[1] - each[0]):
                inside = [values[row] for _, row in run]
                where = f"{self.name} = {min(inside):.6g}"
                if len(inside) > 1:
                    where += f" to {max(inside):.6g} ({len(inside)} values)"
                yield f"Seen in the sweep and on no branch: {what}, {where}."

    def _told(self, place: Place) -> str:
        at = self._at(place)
        kind, count = str(at["kind"].values), int(at["round"])
        if kind == "periodic" and count > LONGEST:
            return f"periodic motion of {counted(count, 'point')}"
        if kind in ("periodic", "equilibrium"):
            return f"{kind}, not found again by Newton's method"
        return {"torus": "motion on a torus", "chaotic": "chaotic motion"}.get(kind, f"motion, {kind}")

    def dataset(self, outputs: dict[str, OfArc], count: int) -> xarray.Dataset:
        """The sweep with the branches of its attractors, so many, and values of outputs on them."""
        # The last one may have been interrupted before it had a point.
        known = np.where(self.branch < count, self.branch, -1)
        made = self.sweep.assign({"branch": ((self.name, "label"), known)})
        if not outputs or CTRL_C.is_set():
            return made
        shape = (len(outputs), *self.branch.shape, made.sizes["point"])
        values = np.full(shape, np.nan)
        for place in self.places:
            found = np.array([*self._measured(place, [*outputs.values()])])
            values[:, *place, : len(found)] = found.T.reshape(len(outputs), -1)
        reached = (("measured", self.name, "label", "point"), values)
        return made.assign({"reached": reached}).assign_coords(measured=[*outputs])

    def _measured(self, place: Place, functions: Sequence[OfArc]) -> Iterator[list[float]]:
        """What functions of an arc make of an attractor: once around its orbit, or over some periods."""
        found = self.closed(place)
        if isinstance(found, Equilibrium):
            yield [_at_rest(each, found) for each in functions]
            return
        for arc in self._periods(place) if found is None else [found.arc()]:
            yield [_number(each, arc) for each in functions]

    def _periods(self, place: Place) -> Iterator[HybridArc]:
        """Runs over one forcing period from points of an attractor."""
        values, at = self.parameters_at(place), self._at(place)
        length, t0 = self.system.forcing_period(values), float(self.sweep.attrs["t0"])
        points, modes = at["points"].values[:PERIODS], at["mode_of_point"].values[:PERIODS]
        for x, mode in zip(points, modes, strict=True):
            if length is None or not np.isfinite(x).all():
                return
            own = without_age(self.system, x)
            with suppress(HybridError):
                yield simulate(self.system, own, (t0, t0 + length), mode=str(mode), parameters=values)


def _comes_back(orbit: PeriodicOrbit, count: int, rounds: int) -> bool:
    """Whether an orbit of so many rounds repeats after some of them, at a phase where no clock ticks."""
    arc, turn = orbit.arc(), orbit.period / count
    here = arc.t[0] + ASIDE * turn
    apart = distances(orbit.system, arc, np.array([here + rounds * turn]), arc(here))
    return bool(apart[0] <= SAME_STATE)


def _at_rest(function: object, rest: Equilibrium) -> float:
    """What a measure is at an equilibrium; nan for other functions, which need an arc."""
    if not isinstance(function, Measure):
        return np.nan
    value = float(rest[function.name][0])
    return {"amplitude": 0.0, "rms": abs(value)}.get(function.kind, value)


def _number(function: Callable[[Any], float], arc: Any) -> float:
    """What a function makes of an arc; nan if it fails, as it may on motion that no branch has."""
    try:
        return float(function(arc))
    except (HybridError, ArithmeticError, ValueError, TypeError, LookupError):
        return np.nan


def seen_of(
    given: object, start: Start, name: str, span: tuple[float, float], solver: Solver
) -> SeenAttractors:
    """A sweep that fits a diagram from a start, or an ArgumentError."""
    if not {"kind", "round", "period", "points", "mode_of_point"} <= set(getattr(given, "data_vars", ())):
        raise arguments.refusal("sweep", WANTED, given)
    dataset: Any = given
    if name not in dataset["kind"].dims:
        over = [str(dim) for dim in dataset["kind"].dims if dim != "label"]
        raise ArgumentError(
            f"sweep must be over {name!r}, the parameter of the diagram; it is over "
            f"{', '.join(over) or 'no parameter'}. Call basin_fractions(..., along={{{name!r}: values}})."
        )
    if "section" in dataset.attrs and start.system.period is not None:
        raise ArgumentError(
            "sweep: its points are on a surface, so their phases are not known. Call basin_fractions without "
            "section=."
        )
    _check_model(dataset, start, name)
    low, high = sorted(span)
    inside = dataset.isel({name: np.flatnonzero((dataset[name] >= low) & (dataset[name] <= high))})
    if not inside.sizes[name]:
        raise ArgumentError(f"sweep has no value of {name!r} within the span ({low}, {high}).")
    texts = {key: inside[key].astype(str) for key in ("kind", "mode_of_point")}
    shape = inside["kind"].transpose(name, "label").shape
    return SeenAttractors(
        sweep=inside.transpose(name, "label", ...).assign(texts),
        system=original_of(start.system),
        parameters=dict(start.parameters),
        name=name,
        solver=solver,
        branch=np.full(shape, -1),
    )


def _check_model(dataset: Any, start: Start, name: str) -> None:
    """ArgumentError unless the sweep is one of the model, the parameters and the phase of the start."""
    if dataset.attrs.get("model_hash") != model_hash(original_of(start.system)):
        raise ArgumentError(
            f"sweep is one of another model, {dataset.attrs.get('model', 'unnamed')!r}; the start is one of "
            f"{start.system.name or 'unnamed'!r}. Make both with the same system."
        )
    given = json.loads(dataset.attrs["model_parameters"])
    others = {
        key: (value, start.parameters[key])
        for key, value in given.items()
        if key != name and not is_same_value(value, start.parameters[key])
    }
    if others:
        told = ", ".join(f"{key} = {one:.12g} and {other:.12g}" for key, (one, other) in others.items())
        raise ArgumentError(f"sweep has other parameters than the start: {told}. Make both with the same.")
    period = start.system.forcing_period(start.parameters)
    if period is None or not isinstance(start, PeriodicOrbit):
        return
    apart = (start.t0 - dataset.attrs["t0"]) / period
    if abs(apart - round(apart)) > WHOLE:
        raise ArgumentError(
            f"sweep has its points at the phase of t0 = {dataset.attrs['t0']:g}, and the start at that of "
            f"{start.t0:g}: give basin_fractions and periodic_orbit the same t0=."
        )
