"""Orbits over a sweep: where each row starts, how it is carried to the next row, and its section."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any, Literal, TypeVar

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.errors import ArgumentError, HybridError
from hybrid.kernels.types import codes
from hybrid.orbits.sections import crossings, strobe
from hybrid.simulation.ending import status_of
from hybrid.simulation.labelled import Names, output_coords
from hybrid.simulation.plan import check_solver, plan_of
from hybrid.simulation.quantities import output_names, table_of
from hybrid.simulation.trajectory import Common, Trajectory, directed, explore
from hybrid.solvers import Solver
from hybrid.sweep.points import as_points
from hybrid.sweep.sheet import Labels
from hybrid.system.elements import Guard
from hybrid.system.graph import HybridSystem, as_system, check_mode, starting_mode
from hybrid.system.growth import Unexplored, stage_of
from hybrid.system.labels import by_label, plain_name
from hybrid.system.members import shared_names
from hybrid.transform.aged import aged, with_age, without_age
from hybrid.transform.markers import with_section

# Where the points of a section are taken: per forcing period, at crossings of a surface, or at each jump.
At = Guard | Literal["jumps"] | None
# State and mode from which a row goes on.
Place = tuple[np.ndarray, str | None]
R = TypeVar("R")


@attrs.frozen(eq=False)
class Rows:
    """What the rows of a sweep over parameters and starts have in common.

    Attributes
    ----------
    system, x0, mode, t0, parameters, solver
        As for :func:`hybrid.simulate`; a name of a swept start overrides its component of ``x0``.
    starts
        Names in the sweep that are components of the start; the others are parameters.
    at, marked
        Where the section is taken, and the system with the markers of a surface.
    along
        The axis along which the attractor is followed, or None.
    outputs
        Names of the outputs that are computed at the points of the section.
    """

    system: HybridSystem
    x0: np.ndarray
    mode: str | None
    t0: float
    parameters: dict[str, float]
    solver: Solver
    starts: tuple[str, ...]
    at: At
    marked: HybridSystem
    along: str | None
    outputs: tuple[str, ...]
    # The rows on each stage of a growing system.
    _stages: dict[int, Rows] = attrs.field(factory=dict, init=False, repr=False)

    def grown(self, work: Callable[[Rows], R]) -> R:
        """The result of some work, repeated until the system has all modes that the work needs."""
        growth = self.system.growth
        while growth is not None:
            try:
                return work(self._with(stage_of(self.system)))
            except Unexplored:
                continue
        return work(self)

    def _with(self, stage: HybridSystem) -> Rows:
        """The rows on a stage of a growing system; stages are kept, as they hold what is compiled."""
        rows = self._stages.get(id(stage))
        if rows is None or rows.system is not stage:
            marked = with_section(stage, self.at) if isinstance(self.at, Guard) else stage
            rows = self._stages[id(stage)] = attrs.evolve(self, system=stage, marked=marked)
        return rows

    def prepare(self, tangents: int) -> None:
        """Compile and load all that the rows need, so that threads do not do so at the same time."""
        load_kernels("hybrid.kernels.runs.sections")
        with_tangents = aged(self.system) if tangents else self.system
        for system, count in {(with_tangents, tangents), (self.system, 0), (self.marked, 0)}:
            plan_of(compile_system(system), self.solver, count)

    def common(self, system: HybridSystem, tangent: np.ndarray | None, t0: float) -> Common:
        """What runs of rows share that begin on a system with these tangent vectors."""
        system, _, tangent = directed(system, self.x0, tangent)
        return Common(compile_system(system), self.solver, tangent, t0)

    def begin(self, point: Mapping[str, float], place: Place | None, common: Common) -> Trajectory:
        """A trajectory at the start of a row: at the place, if the system can start there beyond no guard."""
        if place is not None:
            with suppress(HybridError):
                trajectory = self.go_on(point, place, common)
                if not trajectory.beyond:
                    return trajectory
        return self.go_on(point, (self.origin(point), self.mode), common)

    def go_on(self, point: Mapping[str, float], place: Place, common: Common) -> Trajectory:
        """A trajectory from a place, whose state may lack the age."""
        system, values, (state, mode) = common.compiled.system, self.values(point), place
        if len(state) < system.dimension:
            state = with_age(self.system, state)
        mode = starting_mode(system, mode)
        mode = explore(system, common.t0, state, values, mode)
        return common.begin_at(state, mode, values)

    def values(self, point: Mapping[str, float]) -> np.ndarray:
        """The parameter vector of a row."""
        values = self._values.copy()
        given = [
            (self._places[plain_name(name)], each) for name, each in point.items() if name not in self.starts
        ]
        # What is given to one member counts more than what is given to all.
        for places, value in sorted(given, key=lambda each: -len(each[0])):
            values[places] = value
        return values

    @cached_property
    def _values(self) -> np.ndarray:
        return self.system.parameter_values(self.parameters)

    @cached_property
    def _places(self) -> dict[str, list[int]]:
        names = self.system.variables.parameter_names
        shared = {
            name: [names.index(each) for each in members] for name, members in shared_names(names).items()
        }
        return {name: [i] for i, name in enumerate(names)} | shared

    def origin(self, point: Mapping[str, float]) -> np.ndarray:
        """The start of a row that does not go on from another row."""
        if not self.starts:
            return self.x0
        state = self.x0.copy()
        for name in self.starts:
            state[self.system.state_names.index(plain_name(name))] = point[name]
        return state

    def end_of(self, trajectory: Trajectory, code: int) -> Place | None:
        """Where the next row goes on."""
        # A run that needs a mode which has not been made yet is repeated.
        status_of(trajectory, code)
        if code != codes.DONE:
            return None
        return without_age(self.system, trajectory.x), trajectory.mode

    def section(self, trajectory: Trajectory, points: int) -> tuple[np.ndarray, np.ndarray]:
        """The next points of the section ``(points, n)``, and outputs at them, filled up with nan."""
        states, outputs = self.no_section(points)
        if not points:
            return states, outputs
        if self.at is None:
            found, places, code = strobe(trajectory, points)
            t, modes = places[:, 0] * trajectory.model.period + trajectory.phase0, places[:, 1]
        else:
            counted = np.ones(len(trajectory.system.transitions), dtype=bool)
            if self.at != "jumps":
                counted = np.arange(len(counted)) < len(self.system.modes)
            plain = attrs.evolve(trajectory, tangents=0)
            t, found, fired, _, code = crossings(plain, counted, points)
            sources = [self.system.mode_index(each.source) for each in trajectory.system.transitions]
            modes = np.array(sources, dtype=np.int64)[fired]
        status_of(trajectory, code)
        found = without_age(self.system, found[:points])
        states[: len(found)] = found
        table = table_of(self.system, self.outputs, t[:points], found, modes[:points], trajectory.parameters)
        outputs[: len(found)] = table
        return states, outputs

    def no_section(self, points: int) -> tuple[np.ndarray, np.ndarray]:
        """What stands for the points of a section that are not known, and for the outputs at them."""
        shapes = (points, self.system.dimension), (points, len(self.outputs))
        return np.full(shapes[0], np.nan), np.full(shapes[1], np.nan)

    def facts(self) -> dict[str, Any]:
        """What decides the rows, by name."""
        fixed = {
            name: value
            for name, value in zip(self.system.state_names, self.x0.tolist(), strict=True)
            if name not in map(plain_name, self.starts)
        }
        return {
            "model": self.system,
            "x0": fixed,
            "mode": self.mode,
            "t0": self.t0,
            **{f"parameter_{name}": value for name, value in self.parameters.items()},
            "solver": self.solver,
            "at": self.at,
            "continue_from": self.along,
            **{f"output_{name}": self.system.outputs[name] for name in self.outputs},
        }

    def labels(self, dims: Mapping[str, tuple[str, ...]]) -> Labels:
        """Names of the inner axes of results, and units."""
        names = Names(self.system.state_names, self.system.units)
        both = names.coords() | (output_coords([*self.outputs], names.units) if self.outputs else {})
        coords = {name: ((dim,), values) for name, (dim, values) in both.items()}
        rates = dict.fromkeys(("exponents", "standard_error", "sum_rule"), names.rate)
        states = dict.fromkeys(("x_end", "section"), names.states)
        own = {name: names.of(name) for name in self.system.units}
        return Labels(dims, coords, {**own, **rates, **states})


def rows_of(
    system: HybridSystem,
    over: Any,
    x0: Any,
    *,
    mode: str | None,
    parameters: Mapping[str, float] | None,
    t0: float,
    solver: Solver | None,
    points: int,
    at: At,
    continue_from: str | None,
    results: tuple[str, ...],
    outputs: Iterable[str] = (),
) -> Rows:
    """The rows of a sweep over parameters and components of the start, with every argument checked."""
    as_system("system", system)
    swept = as_points(over)
    names, shared = system.state_names, shared_names(system.variables.parameter_names)
    others = system.variables.overrides(parameters)
    for name in map(plain_name, swept.names):
        if name not in names:
            arguments.known("over: Parameter", name, (*system.parameters, *shared), "Parameters")
        if name in others or any(each in others for each in shared.get(name, ())):
            raise ArgumentError(f"over: Parameter {name!r} is given twice: in over and in parameters.")
        if name in results:
            raise ArgumentError(
                f"over: {name!r} is also the name of a result. Rename the parameter or state of the model."
            )
    starts = tuple(name for name in swept.names if plain_name(name) in names)
    by_name = by_label("x0", x0)
    if by_name is not None:
        x0 = {**dict.fromkeys(map(plain_name, starts), 0.0), **by_name}
    state = system.variables.state_values("x0", x0)
    system.parameter_values(others)
    if mode is not None:
        check_mode(system, mode)
    along = _axis(continue_from, swept.dims)
    if along in starts:
        raise ArgumentError(
            f"continue_from must be an axis of parameters, because rows that go on from other rows have no "
            f"start of their own; got {along!r}."
        )
    return Rows(
        system=system,
        x0=state,
        mode=mode,
        t0=arguments.number("t0", t0),
        parameters=others,
        solver=check_solver(solver),
        starts=starts,
        at=_place_of_section(system, at, points),
        marked=with_section(system, at) if isinstance(at, Guard) else system,
        along=along,
        outputs=output_names("outputs", outputs, system),
    )


def _axis(continue_from: str | None, dims: tuple[str, ...]) -> str | None:
    if continue_from is None:
        return None
    allowed = (None, "previous", *dims)
    found = arguments.one_of("continue_from", continue_from, allowed)
    return dims[-1] if found == "previous" and "previous" not in dims else str(found)


def _place_of_section(system: HybridSystem, at: At, points: int) -> At:
    if at is None:
        if points and system.period is None:
            raise ArgumentError(
                "section= takes one point per forcing period, but the system declares no period. Give "
                'HybridSystem period=, say where with at=Guard(...) or at="jumps", or omit section=.'
            )
        return None
    if isinstance(at, Guard):
        return at
    if isinstance(at, str) and at == "jumps":
        if points and not system.transitions:
            raise ArgumentError('at="jumps" takes a point at each jump, but the system has no transitions.')
        return "jumps"
    raise arguments.refusal("at", 'be None, a Guard or "jumps"', at)
