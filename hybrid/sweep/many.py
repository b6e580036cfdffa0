"""Thousands of starts of one system in one call, without a loop in Python."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import progress_bar
from hybrid.errors import ArgumentError, HybridError
from hybrid.kernels.types import codes
from hybrid.kernels.types.starts import Sampled
from hybrid.simulation.crew import TOGETHER, Crew, berths, together
from hybrid.simulation.ending import status_of
from hybrid.simulation.extra import load_xarray
from hybrid.simulation.labelled import Names, attributes, with_outputs
from hybrid.simulation.memory import starts_of
from hybrid.simulation.periods import check_time, split_time
from hybrid.simulation.plan import check_solver, plan_of
from hybrid.simulation.quantities import mode_indices, output_names, table_of
from hybrid.simulation.simulate import simulate
from hybrid.simulation.trajectory import Trajectory
from hybrid.solvers import Solver
from hybrid.status import Status, StatusCode
from hybrid.sweep.blocks import run_in_blocks
from hybrid.sweep.local import cores
from hybrid.sweep.outcome import text_of
from hybrid.sweep.sheet import UNTOUCHED, flags
from hybrid.system.graph import HybridSystem, as_system, starting_mode
from hybrid.system.growth import stage_of

if TYPE_CHECKING:
    import xarray

STARTS = "be states of shape (N, n), or map each component to a number or to N of them"


@arguments.without_tolerances
def simulate_many(
    system: HybridSystem,
    x0: ArrayLike | Mapping[str, ArrayLike],
    t_span: tuple[float, float],
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: Solver | None = None,
    samples: ArrayLike | None = None,
    outputs: Iterable[str] = (),
    max_jumps: int = 100_000,
    executor: int | None = None,
    progress: bool | None = None,
) -> xarray.Dataset:
    """Run a system from many starts: where each run ends, and its state at the samples.

    The ends are those of :func:`hybrid.simulate`, up to rounding: runs take their steps together, but what
    one finds depends on no other. A run that fails does so alone.
    Ctrl-C ends the call, not the program: runs that are not complete have the status ``NOT_RUN``.

    Parameters
    ----------
    system, t_span, mode, parameters, solver, max_jumps
        As for :func:`hybrid.simulate`, the same for all starts.
    x0
        Starts ``(N, n)``; or a mapping of each component to a number or to ``N`` numbers. A DataArray or
        a DataFrame with the names of the components as a coordinate or as columns is read by these. Held
        components and counters come last and may be left out: they are 0 then.
    samples
        Increasing times at which to store the state. A step ends at each of them.
    outputs
        Names of outputs to compute at the ends, and at the samples.
    executor
        Number of threads; by default all cores.
    progress
        Whether to show a progress bar with the time left; by default in a terminal or a notebook, after two
        seconds.

    Returns
    -------
    xarray.Dataset
        Over the axis ``start``: ``x0`` and ``x_end`` (axis ``state``), ``t_end``, ``mode_end``, ``jumps``,
        ``status`` and ``message``; with samples also ``x`` (axes ``start``, ``t``, ``state``), nan after the
        end of a run; with outputs also ``outputs_end`` (axis ``output``) and, with samples, ``outputs``
        (axes ``start``, ``t``, ``output``). The attributes tell how many
        ``steps_together`` and ``steps_alone`` the runs took.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate_many
    >>> drops = simulate_many(models.bouncing_ball(), {"q": [1.0, 2.0, 3.0], "v": 0.0}, (0.0, 1.0))
    >>> drops.jumps.values.tolist()
    [1, 1, 1]
    """
    as_system("system", system)
    load_xarray()

    t0, t1 = arguments.time_span("t_span", t_span)
    times = np.empty(0) if samples is None else arguments.increasing_times("samples", samples, t0, t1)
    origins = _origins(system, x0)
    asked = output_names("outputs", outputs, system)
    progress = None if progress is None else arguments.flag("progress", progress)
    most = arguments.count("max_jumps", max_jumps, 0)
    threads = cores() if executor is None else arguments.count("executor", executor, 1)
    system.parameter_values(parameters)
    overrides = system.variables.overrides(parameters)
    mode = starting_mode(system, mode)
    options = {"mode": mode, "parameters": overrides, "solver": check_solver(solver)}
    found = _Found(origins, times, t1, system.mode_names)
    if system.growth is not None or (mode is not None and len(system.parts_of(mode)) > 1):
        work: Any = _OneByOne(system, (t0, t1), options, most, found)
    else:
        work = _Runs(system, (t0, t1), options, most, found)
    with CTRL_C, progress_bar(len(origins), "Runs", progress, "start") as bar:
        run_in_blocks(work.run, len(origins), threads, bar)
        # An interrupt that came too late to stop anything is not raised either.
        CTRL_C.is_set()
    grown = stage_of(system)
    table = found.outputs(grown, asked, grown.parameter_values(parameters))
    tables: dict[str, Any] = {"outputs_end": (("start",), table[:, -1])}
    if len(times):
        tables["outputs"] = (("start", "t"), table[:, :-1])
    return with_outputs(found.dataset(system, overrides), system, tables, asked)


def _origins(system: HybridSystem, x0: Any) -> np.ndarray:
    names = system.state_names
    by_name = system.variables.by_component("x0", x0)
    if by_name is not None:
        columns = [arguments.numbers(f"x0[{name!r}]", by_name[name], STARTS) for name in names]
        try:
            states = np.stack(np.broadcast_arrays(*columns), axis=-1)
        except ValueError:
            raise arguments.refusal("x0", STARTS, x0) from None
    else:
        states = system.variables.completed(arguments.numbers("x0", x0, STARTS))
    if states.ndim != 2 or states.shape[1] != system.dimension:
        raise ArgumentError(f"x0 must {STARTS}, here n = {system.dimension}; got shape {states.shape}.")
    bad = np.flatnonzero(~np.isfinite(states).all(axis=1))
    if bad.size:
        raise ArgumentError(f"x0 must be finite; got x0[{bad[0]}] = {states[bad[0]].tolist()}.")
    system.variables.check_counts("x0", states)
    return np.ascontiguousarray(states)


class _Found:
    """The results, which threads fill in."""

    def __init__(self, origins: np.ndarray, times: np.ndarray, t1: float, mode_names: Iterable[str]) -> None:
        count, n = origins.shape
        self.origins, self.times, self.t1 = origins, times, t1
        # A system that grows adds to them.
        self.mode_names = [*mode_names]
        # The last time is the end.
        self.states = np.full((count, len(times) + 1, n), np.nan)
        self.modes = np.full(self.states.shape[:2], codes.NO_MODE, dtype=np.int64)
        self.t_end = np.full(count, np.nan)
        self.jumps = np.zeros(count, dtype=np.int64)
        self.codes = np.full(count, StatusCode.NOT_RUN, dtype=np.int16)
        self.messages = np.full(count, UNTOUCHED, dtype=object)
        # Steps that runs took together, and alone.
        self.steps: list[tuple[int, int]] = []

    def tell(self, i: int, status: Status) -> None:
        """Keep how a run ended."""
        self.codes[i], self.messages[i] = status.code, text_of(status)

    def mode_index(self, name: str) -> int:
        """The index of a mode among ``mode_names``."""
        if name not in self.mode_names:
            self.mode_names.append(name)
        return self.mode_names.index(name)

    def outputs(self, system: HybridSystem, names: tuple[str, ...], values: np.ndarray) -> np.ndarray:
        """Outputs at the samples and the end ``(N, S + 1, len(names))``; nan where a run has none."""
        times = np.column_stack([np.tile(self.times, (len(self.t_end), 1)), self.t_end])
        table, reached = np.full((*times.shape, len(names)), np.nan), self.modes != codes.NO_MODE
        modes = mode_indices(system, np.array(self.mode_names)[self.modes[reached]])
        table[reached] = table_of(system, names, times[reached], self.states[reached], modes, values)
        return table

    def dataset(self, system: HybridSystem, parameters: Mapping[str, float]) -> xarray.Dataset:
        """The results with their names."""
        import xarray

        names = Names(system.state_names, system.units)
        variables: dict[str, Any] = {
            "x0": (("start", "state"), self.origins, names.states),
            "x_end": (("start", "state"), self.states[:, -1], names.states),
            "t_end": ("start", self.t_end, names.of("t")),
            "mode_end": ("start", np.array([*self.mode_names, ""], dtype=object)[self.modes[:, -1]]),
            "jumps": ("start", self.jumps),
        }
        coords = {"start": np.arange(len(self.origins)), **names.coords()}
        if len(self.times):
            variables["x"] = (("start", "t", "state"), self.states[:, :-1], names.states)
            coords["t"] = ("t", self.times, names.of("t"))
        variables["status"] = ("start", self.codes, flags())
        variables["message"] = ("start", self.messages)
        used = {**system.parameters, **parameters}
        taken, alone = np.sum(self.steps, axis=0) if self.steps else (0, 0)
        facts = attributes("ends", system=system, parameters=used)
        steps = {"steps_together": int(taken), "steps_alone": int(alone)}
        return xarray.Dataset(variables, coords, {**facts, **steps})


@attrs.frozen(eq=False)
class _OneByOne:
    """Runs by `simulate`, for systems whose modes are made or chosen in Python."""

    system: HybridSystem
    t_span: tuple[float, float]
    options: dict[str, Any]
    max_jumps: int
    found: _Found

    def run(self, block: range) -> None:
        """Run from these starts."""
        found = self.found
        for i in block:
            if CTRL_C.is_set():
                return
            try:
                arc = simulate(
                    self.system,
                    found.origins[i],
                    self.t_span,
                    max_jumps=self.max_jumps,
                    **self.options,
                )
            except HybridError as failure:
                found.tell(i, Status(StatusCode.FAILED, str(failure)))
                continue
            reached = found.times[found.times <= arc.t[-1]]
            modes = np.array([found.mode_index(name) for name in arc.system.mode_names])
            found.states[i, : len(reached)], places = arc._dense(reached)
            found.modes[i, : len(reached)] = modes[places]
            found.states[i, -1], found.t_end[i] = arc.x[-1], arc.t[-1]
            found.modes[i, -1], found.jumps[i] = found.mode_index(str(arc.mode[-1])), arc.jump_count
            found.tell(i, arc.status)


class _Runs:
    """Runs in compiled code; Python looks at those that do not simply reach their end."""

    def __init__(
        self,
        system: HybridSystem,
        t_span: tuple[float, float],
        options: dict[str, Any],
        max_jumps: int,
        found: _Found,
    ) -> None:
        self.system, self.t_span, self.options, self.found = system, t_span, options, found
        self.max_jumps = max_jumps
        self.one_by_one = _OneByOne(system, t_span, options, max_jumps, found)
        compiled = self.compiled = compile_system(system)
        # Before threads need the same kernels.
        plan = self.plan = plan_of(compiled, options["solver"], 0)
        load_kernels("hybrid.kernels.runs.many")
        self.model = compiled.given(options["parameters"], plan.model)
        for time in t_span:
            check_time("t_span", time, self.model.period)
        mode = options["mode"]
        if mode is None and len(system.modes) == 1:
            [mode] = system.mode_names
        self.named = codes.NO_MODE if mode is None else system.mode_index(mode)
        places = [split_time(time, self.model.period) for time in (*found.times.tolist(), t_span[1])]
        self.cycles = np.array([cycle for cycle, _ in places], dtype=np.int64)
        self.phases = np.array([phase for _, phase in places])

    def run(self, block: range) -> None:
        """Run from these starts, in memories of this thread."""
        if CTRL_C.is_set():
            return
        plan, found, part = self.plan, self.found, slice(block.start, block.stop)
        origins, states, modes = found.origins[part], found.states[part], found.modes[part]
        jumps = np.zeros((len(block), 1), dtype=np.int64)
        (t0, t1), count = self.t_span, min(len(block), TOGETHER)
        model = self.compiled.own(self.model)
        memories, phase0 = berths(plan, model, count, origins[0], t0, t1 - t0)
        queue, counters = np.zeros(1, dtype=np.int64), np.zeros((count, 1), dtype=np.int64)
        starts = [starts_of(each, origins, queue, named=self.named, found=jumps) for each in memories]
        common = Sampled(
            counters=counters[0],
            starts=starts[0],
            cycles=self.cycles,
            phases=self.phases,
            states=states,
            modes=modes,
        )
        jobs = [common.replace(counters=counters[i], starts=each) for i, each in enumerate(starts)]
        tasks = [each.task(model, orthonormal=False) for each in memories]
        crew = Crew(together(self.compiled, plan, 0), plan, tasks, jobs)
        most = self.options["solver"].max_steps
        crew.memory.max_steps[:], crew.memory.max_jumps[:] = most, self.max_jumps
        onward = load_kernels("hybrid.kernels.runs.many").sampled
        is_told = np.zeros(len(block), dtype=bool)
        under_way = list(range(count))
        while under_way:
            crew.memory.codes[:] = codes.DONE
            crew.memory.codes[under_way] = codes.GO_ON
            finished = crew.go(onward, CTRL_C)
            found.steps.append((int(crew.memory.steps), int(crew.memory.alone)))
            now = [int(each.starts.now) for each in jobs]
            if not finished:
                is_told[
                    [i for i, code in zip(now, crew.memory.codes, strict=True) if code == codes.GO_ON]
                ] = True
                break
            # A run of which there is something to tell waits until that has been told.
            under_way = [row for row in under_way if now[row] >= 0]
            for row in under_way:
                i, code = now[row], int(crew.memory.codes[row])
                is_told[i] = True
                if code == codes.REFUSED:
                    # Python finds a mode where a guard of another one is not finite, takes steps in time
                    # where series hold the root of a guard that the start lies beyond, or says why no mode
                    # is allowed.
                    self.one_by_one.run(range(block.start + i, block.start + i + 1))
                    continue
                trajectory = Trajectory(self.compiled, plan, model, memories[row], 0, most, phase0)
                self._tell(block.start + i, trajectory, code, jobs[row].starts.verdicts)
        done = np.arange(len(block)) < queue[0]
        done &= ~is_told
        rows = block.start + np.flatnonzero(done)
        if rows.size:
            plain = Status(StatusCode.SUCCESS, "Reached the end.")
            found.codes[rows], found.messages[rows] = plain.code, text_of(plain)
            found.t_end[rows] = found.t1
            found.jumps[rows] = jumps[done, 0]
        for each in memories:
            plan.take_back(each)

    def _tell(self, i: int, trajectory: Trajectory, code: int, verdicts: np.ndarray) -> None:
        """Keep the end of a run of which there is something to tell."""
        found, names = self.found, self.system.transition_names
        if self.named != codes.NO_MODE:
            beyond = tuple(names[k] for k in np.flatnonzero(verdicts == codes.BEYOND))
            trajectory = attrs.evolve(trajectory, beyond=beyond)
        found.states[i, -1] = trajectory.x
        found.t_end[i] = found.t1 if code == codes.DONE else trajectory.t
        found.modes[i, -1], found.jumps[i] = found.mode_index(trajectory.mode), trajectory.jumps
        found.tell(i, status_of(trajectory, code))
