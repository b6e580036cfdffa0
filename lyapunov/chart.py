"""Lyapunov exponents over one or two parameters, on all cores."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any, Literal

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridError, HybridSystem, Status, StatusCode, arguments, compile_system
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import progress_bar
from hybrid.kernels.types import codes
from hybrid.orbits.sections import strobe
from hybrid.simulation.interrupt import Told
from hybrid.simulation.plan import check_solver, plan_of
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver
from hybrid.system.graph import as_system
from hybrid.system.growth import growing
from lyapunov.spectrum import Estimate, first_vectors, interval_length

UNTOUCHED = Status(
    StatusCode.NOT_RUN, "The chart was interrupted before this row was complete.", "Compute this row again."
)


@attrs.frozen(eq=False, repr=False)
class Chart:
    """Lyapunov exponents over a grid of parameter values; rows that were not run hold nan.

    Attributes
    ----------
    system
        The model.
    over
        Maps one or two parameter names to their values, the axes of the grid.
    exponents, standard_error
        ``(*grid, k)``, as in :class:`lyapunov.LyapunovSpectrum`.
    sum_rule, jumps_per_interval
        ``grid``, as in :class:`lyapunov.LyapunovSpectrum`.
    x, mode
        ``(*grid, n)`` and ``grid``: state and name of the mode at the end of each row's spectrum.
    section
        ``(*grid, points, n)``: states once per forcing period after ``x``, for a bifurcation diagram.
    status
        ``grid`` of :class:`hybrid.Status`.
    """

    system: HybridSystem
    over: dict[str, np.ndarray]
    exponents: np.ndarray
    standard_error: np.ndarray
    sum_rule: np.ndarray
    jumps_per_interval: np.ndarray
    x: np.ndarray
    mode: np.ndarray
    section: np.ndarray
    status: np.ndarray

    @property
    def ok(self) -> np.ndarray:
        """Whether each row is complete and valid: a ``grid`` of booleans."""
        return np.vectorize(lambda status: status.ok, otypes=[bool])(self.status)

    def __repr__(self) -> str:
        counts = Counter(status.code.name for status in self.status.flat)
        ends = ", ".join(f"{count} {name}" for name, count in counts.most_common())
        return f"<Chart over {' and '.join(self.over)}, {self.status.size} rows: {ends}>"


@growing
def chart(
    system: HybridSystem,
    over: Mapping[str, ArrayLike],
    x0: ArrayLike,
    *,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    k: int | None = 1,
    intervals: int = 1000,
    interval: float | None = None,
    transient: int = 200,
    t0: float = 0.0,
    solver: Solver | None = None,
    section: int = 0,
    continue_from: Literal["previous"] | None = None,
    threads: int | None = None,
    progress: bool = False,
) -> Chart:
    """Lyapunov exponents at every point of a grid of parameter values, computed in threads.

    The result is the same to the last bit for any number of threads. Ctrl-C ends the chart, not the program:
    completed rows are returned, and the others have the status ``NOT_RUN``.

    Parameters
    ----------
    system
        The model.
    over
        ``{"omega": values}`` for a line, ``{"omega": values, "e": values}`` for a grid; the last parameter
        varies fastest.
    x0, mode, t0
        Start of each row, as for :func:`hybrid.simulate`.
    parameters
        Values of the other parameters.
    k
        Number of exponents, 1 to n, or None for all.
    intervals, interval, transient, solver
        As for :func:`lyapunov.lyapunov_spectrum`.
    section
        Number of points of the stroboscopic section to keep per row, for a bifurcation diagram.
    continue_from
        ``"previous"`` follows the attractor along the last axis: the first row starts from ``x0``, each other
        row from the end of the previous row's transient. A row starts from ``x0`` if it cannot start there or
        if the previous transient failed. The attractor is followed without tangent vectors ahead of the rows,
        so that rows still run in parallel; this costs a second transient per row.
    threads
        Number of threads; by default the number of cores available to the process.
    progress
        Whether to show a progress bar.

    Returns
    -------
    Chart

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError). A problem with the
        values of a single row is reported in the status of that row instead.

    Examples
    --------
    >>> import models
    >>> damping = chart(models.impact_oscillator(), {"c": [0.1, 0.2, 0.4]}, (0.0, 0.0), intervals=200)
    >>> damping
    <Chart over c, 3 rows: 3 SUCCESS>
    >>> bool((damping.exponents[:, 0] < 0).all())
    True
    """
    as_system("system", system)
    axes = _axes(system, over, parameters)
    vectors = first_vectors(system, k)
    intervals = arguments.count("intervals", intervals, 1)
    continue_from = arguments.one_of("continue_from", continue_from, (None, "previous"))
    transient = arguments.count("transient", transient, 1 if continue_from else 0)
    section = arguments.count("section", section, 0)
    if interval is not None:
        interval = arguments.positive("interval", interval, "be a positive time")
    t0 = arguments.number("t0", t0)
    threads = None if threads is None else arguments.count("threads", threads, 1)
    progress = arguments.flag("progress", progress)
    if section and system.period is None:
        raise ArgumentError(
            "section= takes one point per forcing period, but the system declares no period. Give "
            "HybridSystem period=, or omit section=."
        )
    if mode is not None:
        system.mode_index(mode)
    work = _Rows(
        system=system,
        x0=system.variables.state_values("x0", x0),
        mode=mode,
        t0=t0,
        parameters=arguments.mapping("parameters", parameters),
        vectors=vectors,
        intervals=intervals,
        interval=interval,
        transient=transient,
        solver=check_solver(solver),
        points=section,
    )
    work.load()
    sheet = _Sheet(axes, vectors.shape, section)
    sweep = _Sweep(work, sheet, bool(continue_from))
    with progress_bar(len(sheet.status), "Chart", progress, "row") as bar:
        sweep.run(threads or _cores(), bar.update)
    return sheet.chart(system)


def _axes(
    system: HybridSystem, over: Mapping[str, ArrayLike], parameters: Mapping[str, float] | None
) -> dict[str, np.ndarray]:
    wanted = "map one or two parameter names to values"
    given = arguments.mapping("over", over, wanted)
    if not 1 <= len(given) <= 2:
        raise arguments.refusal("over", wanted, over)
    others = arguments.mapping("parameters", parameters)
    numbers = "be a list of finite numbers, one or more"
    axes = {}
    for name, each in given.items():
        arguments.known("over: Parameter", name, system.parameters, "Parameters")
        axes[name] = values = arguments.numbers(f"over[{name!r}]", each, numbers)
        if values.ndim != 1 or values.size == 0:
            raise ArgumentError(f"over[{name!r}] must {numbers}; got shape {values.shape}.")
        if not np.isfinite(values).all():
            raise arguments.refusal(f"over[{name!r}]", numbers, each)
        if name in others:
            raise ArgumentError(f"over: Parameter {name!r} is given twice: in over and in parameters.")
    system.parameter_values(others)
    return axes


def _cores() -> int:
    """Number of cores available to this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@attrs.frozen(eq=False)
class _Rows:
    """Data common to all rows, and the computation of a row."""

    system: HybridSystem
    x0: np.ndarray
    mode: str | None
    t0: float
    parameters: dict[str, float]
    vectors: np.ndarray
    intervals: int
    interval: float | None
    transient: int
    solver: Solver
    points: int
    stop: Told = attrs.field(factory=Told)

    def load(self) -> None:
        """Load all kernels that rows need, so that threads do not load them at the same time."""
        load_kernels("lyapunov.kernels")
        load_kernels("hybrid.kernels.events.sections")
        plan_of(compile_system(self.system), self.solver, self.vectors.shape[1])

    def start(
        self, values: Mapping[str, float], state: np.ndarray, mode: str | None, vectors: np.ndarray | None
    ) -> tuple[Trajectory, float]:
        """A trajectory at its start, and the length of an interval."""
        trajectory = start(
            self.system,
            state,
            self.t0,
            mode=mode,
            parameters={**self.parameters, **values},
            solver=self.solver,
            tangent=vectors,
            stop=self.stop,
        )
        return trajectory, interval_length(trajectory, self.interval, self.transient + self.intervals)

    def carried(
        self, values: Mapping[str, float], state: np.ndarray, mode: str | None
    ) -> tuple[np.ndarray, str | None]:
        """State and mode after the transient, rounded up to whole forcing periods to keep the phase."""
        try:
            trajectory, length = self.start(values, state, mode, None)
        except HybridError:
            trajectory, length = self.start(values, self.x0, self.mode, None)
        period, clock = trajectory.model.period, trajectory.run
        span = self.transient * length
        cycles = math.ceil(span / period * (1 - 1e-12)) if period else 0
        phase = clock.phase + (0.0 if period else span)
        code = trajectory.advance_to(int(clock.cycle) + cycles, float(phase), trajectory.no_record())
        if code != codes.DONE:
            return self.x0, self.mode
        # With a single mode pass on the caller's mode: None makes the start check that it allows the state.
        return trajectory.x, self.mode if len(self.system.modes) == 1 else trajectory.mode


class _Sheet:
    """Results of all rows, stored as rows finish, in any order."""

    def __init__(self, axes: dict[str, np.ndarray], shape: tuple[int, ...], points: int) -> None:
        self.axes = axes
        self.grid = tuple(len(values) for values in axes.values())
        rows, (n, k) = math.prod(self.grid), shape
        self.numbers = np.full((rows, 2 * k + 2), np.nan)
        self.x = np.full((rows, n), np.nan)
        self.section = np.full((rows, points, n), np.nan)
        self.mode = [""] * rows
        self.status = [UNTOUCHED] * rows

    def values(self, row: int) -> dict[str, float]:
        """The parameter values of a row."""
        place = np.unravel_index(row, self.grid)
        return {name: float(axis[i]) for (name, axis), i in zip(self.axes.items(), place, strict=True)}

    def fill(self, row: int, trajectory: Trajectory, spectrum: Any, points: int) -> None:
        """Store a spectrum and the section points that its trajectory reaches, at most ``points``."""
        states = np.empty((0, len(spectrum.x)))
        if points and spectrum.status.ok:
            states, _, code = strobe(trajectory, points)
            if code == StatusCode.INTERRUPTED:
                return
        self.section[row, : len(states)] = states
        self.numbers[row] = np.concatenate(
            [
                spectrum.exponents,
                spectrum.standard_error,
                [spectrum.sum_rule, spectrum.jumps_per_interval],
            ]
        )
        self.x[row], self.mode[row] = spectrum.x, spectrum.mode
        self.status[row] = spectrum.status

    def chart(self, system: HybridSystem) -> Chart:
        """All rows in the shape of the grid."""
        k = self.numbers.shape[1] // 2 - 1
        exponents, errors, rest = np.split(self.numbers.reshape(*self.grid, -1), (k, 2 * k), axis=-1)
        status = np.empty(len(self.status), dtype=object)
        status[:] = self.status
        return Chart(
            system=system,
            over=self.axes,
            exponents=exponents,
            standard_error=errors,
            sum_rule=rest[..., 0],
            jumps_per_interval=rest[..., 1],
            x=self.x.reshape(*self.grid, -1),
            mode=np.array(self.mode).reshape(self.grid),
            section=self.section.reshape(*self.grid, *self.section.shape[1:]),
            status=status.reshape(self.grid),
        )


class _StoppedError(Exception):
    """The row was not computed because the chart was interrupted."""


class _Sweep:
    """Rows in a pool of threads, which run in parallel because kernels release the interpreter lock."""

    def __init__(self, work: _Rows, sheet: _Sheet, chained: bool) -> None:
        self.work = work
        self.sheet = sheet
        self.chained = chained
        self.stop = work.stop
        self.ended: SimpleQueue[BaseException | None] = SimpleQueue()

    def run(self, threads: int, done: Callable[[], object]) -> None:
        """Compute all rows, or the rows up to an interrupt."""
        rows, origin = len(self.sheet.status), (self.work.x0, self.work.mode)
        chain = self.sheet.grid[-1]
        with ThreadPoolExecutor(threads) as self.pool:
            try:
                for row in range(0, rows, chain if self.chained else 1):
                    self.pool.submit(self._guarded, self._link if self.chained else self._row, row, *origin)
                for _ in range(rows):
                    failure = self.ended.get()
                    if failure is not None:
                        raise failure
                    done()
            except KeyboardInterrupt:
                pass
            finally:
                self.stop.set()

    def update(self, n: float = 1) -> None:
        """Called by a row to report its intervals; raises to stop the row after an interrupt."""
        if self.stop.is_set():
            raise _StoppedError

    def _guarded(self, task: Callable[..., None], row: int, state: np.ndarray, mode: str | None) -> None:
        try:
            self.update()
            task(row, state, mode)
        except _StoppedError:
            pass
        except HybridError as refusal:
            self.sheet.status[row] = Status(StatusCode.NOT_RUN, f"This row could not start. {refusal}")
            self.ended.put(None)
        except BaseException as failure:
            self.ended.put(failure)

    def _link(self, row: int, state: np.ndarray, mode: str | None) -> None:
        """Carry the attractor through one row; submit the next link before this row's spectrum."""
        work = self.work
        try:
            state, mode = work.carried(self.sheet.values(row), state, mode)
        except HybridError:
            state, mode = work.x0, work.mode
        if (row + 1) % self.sheet.grid[-1]:
            self.pool.submit(self._guarded, self._link, row + 1, state, mode)
        self.pool.submit(self._guarded, self._row, row, state, mode)

    def _row(self, row: int, state: np.ndarray, mode: str | None) -> None:
        work = self.work
        trajectory, length = work.start(self.sheet.values(row), state, mode, work.vectors)
        spectrum = Estimate(trajectory, length).run(work.transient, work.intervals, False, self)
        self.update()
        self.sheet.fill(row, trajectory, spectrum, work.points)
        self.ended.put(None)
