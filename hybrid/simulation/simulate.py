"""From a model and a start to a hybrid arc."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.simulation.arc import HybridArc, Pieces, hybrid_points, join, without_component
from hybrid.simulation.ending import status_of
from hybrid.simulation.jumps import Grazing, Jumps
from hybrid.simulation.memory import empty_record, memory_for_records, record_layout
from hybrid.simulation.periods import check_time, time_at
from hybrid.simulation.sensitivity import with_sensitivities
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.growth import growing

# Room of the record that kernels fill before Python empties it: large enough that the crossing costs nothing.
STEPS_AT_ONCE = 2048
JUMPS_AT_ONCE = 1024


@growing
def simulate(
    system: HybridSystem,
    x0: ArrayLike,
    t_span: tuple[float, float],
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    solver: Solver | None = None,
    tangent: ArrayLike | bool | None = None,
    samples: ArrayLike | None = None,
    keep_jumps: bool | None = None,
    max_jumps: int = 100_000,
    sensitivities: Iterable[str] = (),
) -> HybridArc:
    """Solve a hybrid system from ``x0`` over ``t_span``.

    Parameters
    ----------
    system
        The model.
    x0
        State ``(n,)`` at the start, in order or by name: ``{"q": 1.0, "v": 0.0}``. A Series of pandas or a
        DataArray of xarray that is labelled with the names is read by these, in any order. Held components
        and counters come last and may be left out: they are 0 then.
    t_span
        ``(t0, t1)`` with ``t0 <= t1``. Events at ``t1`` belong to the run.
    mode
        Mode to start in; by default the only one, or the ``start`` of the system, or the only one whose
        guards allow ``x0``. In a mode that is known so, a guard that ``x0`` lies beyond counts as crossed,
        and the status says so.
    parameters
        Values that override the system's.
    solver
        Method and tolerances, by default ``Taylor(rtol=1e-10, atol=1e-12)``: what fits each mode.
    tangent
        True for the fundamental matrix, or an ``(n, k)`` matrix of tangent vectors to carry, with a row for
        every component but the counters; their error is controlled with the state's.
    samples
        Increasing times at which to store the state; only these states are then stored, so the memory of a
        run does not grow with its length.
    keep_jumps
        Whether the arc holds its jumps; by default it does without ``samples``, and not with them.
        ``arc.jump_count`` is their number in any case.
    max_jumps
        The run ends with a status at this many jumps.
    sensitivities
        Names of parameters: the arc then has the derivatives of its end, its samples and the times of its
        jumps in these parameters and in the start, at fixed times; see :class:`HybridArc`.

    Returns
    -------
    HybridArc
        With a status; a run that ends early keeps its results up to there. Ctrl-C ends a run that takes
        longer than a few milliseconds with the status ``INTERRUPTED``.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError).

    Examples
    --------
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.bouncing_ball(), x0=(1.0, 0.0), t_span=(0.0, 1.0))
    >>> round(arc.jumps[0].t, 4)
    0.4515
    """
    as_system("system", system)
    t0, t1 = arguments.time_span("t_span", t_span)
    times = None if samples is None else arguments.increasing_times("samples", samples, t0, t1)
    vectors = None if tangent is None or tangent is False else _tangent_matrix(tangent, system)
    most = arguments.count("max_jumps", max_jumps, 0)
    if keep_jumps is None:
        keep_jumps = times is None
    elif not arguments.flag("keep_jumps", keep_jumps) and times is None:
        raise ArgumentError(
            "keep_jumps=False needs samples=: the points of an arc are made of its jumps too."
        )
    names = _parameter_names(system, sensitivities)
    trajectory = start(
        system,
        x0,
        t0,
        mode=mode,
        parameters=parameters,
        solver=solver,
        tangent=vectors,
        time="t_span",
        horizon=t1 - t0,
    )
    check_time("t_span", t1, trajectory.model.period)
    begun = (trajectory.x, trajectory.mode) if names else None
    arc = _Recorder(trajectory, times, t1, bool(keep_jumps)).run(t1, most)
    trajectory.release()
    age = arc.system.age
    if age is not None and system.age is None:
        # The age was there for the tangent vectors alone.
        arc = without_component(arc, age, system)
        begun = None if begun is None else (np.delete(begun[0], age), begun[1])
    if begun is None:
        return arc
    return with_sensitivities(
        arc, names, *begun, (t0, t1), solver=solver, max_jumps=most, samples=times, simulate=simulate
    )


def _parameter_names(system: HybridSystem, given: Any) -> tuple[str, ...]:
    if isinstance(given, tuple) and not given:
        return ()
    names = arguments.items("sensitivities", given, "be names of parameters")
    for name in names:
        arguments.known("sensitivities: Parameter", name, system.parameters, "Parameters")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ArgumentError(f"sensitivities: {twice[0]!r} is given twice. Give each name once.")
    return tuple(names)


def _tangent_matrix(tangent: Any, system: HybridSystem) -> np.ndarray:
    n = system.tangent_dimension
    if tangent is True:
        return np.eye(n)
    wanted = f"be True or a finite matrix of shape ({n}, k), one tangent vector per column"
    matrix = arguments.numbers("tangent", tangent, wanted)
    if matrix.ndim == 1:
        matrix = matrix[:, None]
    if matrix.ndim != 2 or matrix.shape[0] != n or matrix.shape[1] == 0 or not np.all(np.isfinite(matrix)):
        raise arguments.refusal("tangent", wanted, matrix)
    return matrix


class _Recorder:
    """Runs a trajectory in bursts and files what the kernel wrote down in each."""

    def __init__(
        self, trajectory: Trajectory, times: np.ndarray | None, t1: float, keeps_jumps: bool
    ) -> None:
        self.trajectory, self.keeps_jumps = trajectory, keeps_jumps
        self.times = times
        # The state at the end is at hand without any polynomial.
        only_the_end = times is not None and not (times.size and times[0] < t1)
        self.steps_at_once = 0 if only_the_end else STEPS_AT_ONCE
        if times is not None and self.steps_at_once:
            # Compiled before the run, not in the middle of it, where an interrupt would meet the compiler.
            load_kernels("hybrid.kernels.steps.dense")
        n, degree = trajectory.model.dimension, trajectory.plan.degree
        jumps_at_once = JUMPS_AT_ONCE if keeps_jumps else 0
        self.layout = record_layout(n, degree, self.steps_at_once, jumps_at_once)
        self.steps: list[tuple[np.ndarray, ...]] = []
        self.blocks: list[np.ndarray] = []
        self.jumps: list[tuple[np.ndarray, ...]] = []
        self.grazings: list[Grazing] = []
        self.states = np.empty((0 if times is None else len(times), trajectory.model.dimension))
        self.places = np.empty((2, len(self.states)), dtype=np.int64)
        self.sampled = 0
        # Bytes of the steps and jumps that are kept.
        self.kept = 0

    def run(self, t1: float, max_jumps: int) -> HybridArc:
        trajectory, run = self.trajectory, self.trajectory.run
        code = self._advance(t1, max_jumps)
        if code == codes.RECORD_FULL:
            with trajectory.stop:
                while code == codes.RECORD_FULL:
                    if trajectory.stop.is_set():
                        code = StatusCode.INTERRUPTED
                    elif self.kept > memory_for_records():
                        code = StatusCode.OUT_OF_MEMORY
                    else:
                        code = self._advance(t1, max_jumps)
        system = trajectory.system
        jumps = self._jumps()
        t_end = t1 if code == codes.DONE else trajectory.t
        end = (t_end, trajectory.x, run.mode)
        pieces = None
        if self.times is None:
            assert jumps is not None
            pieces = Pieces(self.blocks, *join(self.steps))
            t, j, x, mode = hybrid_points(system, pieces, jumps, end)
        else:
            self._sample_end(*end)
            t, x = self.times[: self.sampled], self.states[: self.sampled]
            mode, j = self.places[:, : self.sampled]
        return HybridArc(
            system,
            dict(zip(system.variables.parameter_names, trajectory.parameters.tolist(), strict=True)),
            t,
            j,
            x,
            mode,
            jumps,
            trajectory.jumps,
            tuple(self.grazings),
            status_of(trajectory, code),
            trajectory.tangent_matrix if trajectory.tangents else None,
            trajectory.plan.propagators.copy(),
            run.steps,
            run.rejected,
            pieces,
        )

    def _jumps(self) -> Jumps | None:
        """The jumps that were kept."""
        if not self.keeps_jumps:
            return None
        model = self.trajectory.model
        columns: Any = join(self.jumps) if self.jumps else _no_jumps(model.dimension)
        return Jumps(self.trajectory.system, self.trajectory.parameters, *columns)

    def _advance(self, t1: float, max_jumps: int) -> int:
        """Run until the record is full or the run ends; the code."""
        record = self.layout.unwritten()
        record.used.fill(0)
        code = self.trajectory.advance(t1, record, max_jumps)
        self._file(record)
        return code

    def _file(self, record: Any) -> None:
        period = self.trajectory.model.period
        steps, jumps, grazings, matrices = record.used.tolist()
        if jumps and self.keeps_jumps:
            self._keep(self.jumps, _jump_columns(record, jumps, matrices, period))
        if grazings:
            self.grazings += _grazings(self.trajectory.system, record, grazings, period)
        if self.times is None:
            self._keep(self.steps, _places_of_steps(record, steps, period))
            polynomials = record.step_coefficients[:steps]
            self.kept += polynomials.nbytes
            if 2 * steps > self.steps_at_once:
                # The arc keeps the record: new memory costs more than what of this was not used.
                self.blocks.append(polynomials)
                return
            self.blocks.append(polynomials.copy())
        elif steps:
            places = _places_of_steps(record, steps, period)
            self._sample(Pieces([record.step_coefficients[:steps]], *places))
        self.layout.take_back(record)

    def _keep(self, parts: list[tuple[np.ndarray, ...]], columns: tuple[np.ndarray, ...]) -> None:
        parts.append(columns)
        self.kept += sum(column.nbytes for column in columns)

    def _sample(self, pieces: Pieces) -> None:
        """States at the samples that fall before the current end of the run."""
        assert self.times is not None
        stop = int(self.times.searchsorted(self.trajectory.t, side="left"))
        if stop > self.sampled:
            part = slice(self.sampled, stop)
            self.states[part], index = pieces.at(self.times[part])
            self.places[:, part] = pieces.mode[index], pieces.j[index]
            self.sampled = stop

    def _sample_end(self, t: float, x: np.ndarray, mode: int) -> None:
        """States at the samples that fall on the very end of the run: those after its last jump."""
        assert self.times is not None
        stop = int(self.times.searchsorted(t, side="right"))
        last = slice(self.sampled, stop)
        self.states[last] = x
        self.places[0, last], self.places[1, last] = mode, self.trajectory.jumps
        self.sampled = stop


def _places_of_steps(
    record: Any, used: int, period: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Start in two parts, length, mode and jump count of the steps in a record."""
    phase, low, length = record.step_time[:used].T.copy()
    cycle, mode, jumps = record.step_place[:used].T.copy()
    return time_at(cycle, phase, low, period), low, length, mode, jumps


@cache
def _no_jumps(dimension: int) -> tuple[np.ndarray, ...]:
    """Columns of jumps, empty, so that any number of arcs can have the same."""
    return _jump_columns(empty_record(dimension, 0), 0, 0, 0.0)


def _jump_columns(record: Any, used: int, matrices: int, period: float) -> tuple[np.ndarray, ...]:
    phase, low, transversality = record.jump_time[:used].T.copy()
    cycle, transition, kind, has_matrix = record.jump_place[:used].T.copy()
    states, saltation = record.jump_states[:used].copy(), record.jump_saltation[:matrices].copy()
    t = time_at(cycle, phase, low, period)
    return t, phase, transition, transversality, kind, has_matrix, states, saltation


def _grazings(system: HybridSystem, record: Any, used: int, period: float) -> list[Grazing]:
    phase, value, acceleration = record.grazing_time[:used].T
    cycle, transition, jumps = record.grazing_place[:used].T
    x = record.grazing_state[:used].copy()
    columns = cycle * period + phase, jumps, transition, x, value, acceleration
    return [
        Grazing(float(t), int(j), system.transition_names[transition], x, float(value), float(acceleration))
        for t, j, transition, x, value, acceleration in zip(*columns, strict=True)
    ]
