"""Lyapunov exponents over parameters and starts, as a labelled dataset."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from os import PathLike
from typing import TYPE_CHECKING, Any, Unpack

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import HybridSystem, arguments, sweep
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import silent
from hybrid.errors import ArgumentError, HybridError
from hybrid.orbits.closing import advance_to_close
from hybrid.shared import shares
from hybrid.simulation.trajectory import Common, Trajectory
from hybrid.status import Status
from hybrid.sweep.rows import At, Place, Rows, rows_of
from hybrid.sweep.sheet import Labels
from hybrid.transform.aged import aged, without_age
from lyapunov.asked import Averaging
from lyapunov.directions import first_vectors, number_of_exponents, orthonormal_at_start
from lyapunov.estimates import Estimates, Flight, Means, interval_length
from lyapunov.together import alike, means_together, result_of

if TYPE_CHECKING:
    import xarray

DIMS = {
    "exponents": ("exponent",),
    "standard_error": ("exponent",),
    "x_end": ("state",),
    "section": ("sample", "state"),
    "section_outputs": ("sample", "output"),
}
RESULTS = (
    "exponents",
    "standard_error",
    "sum_rule",
    "jumps_per_interval",
    "x_end",
    "mode_end",
    "section",
    "section_outputs",
)


@arguments.without_tolerances
@shares(Averaging)
def chart(
    system: HybridSystem,
    over: Any,
    x0: ArrayLike | Mapping[str, float],
    *,
    k: int | None = 1,
    section: int = 0,
    at: At = None,
    outputs: Iterable[str] = (),
    continue_from: str | None = None,
    store: str | PathLike[str] | None = None,
    executor: Any = None,
    progress: bool | None = None,
    **asked: Unpack[Averaging],
) -> xarray.Dataset:
    """Lyapunov exponents at every point of a grid of parameters and starts, by :func:`hybrid.sweep`.

    The result is the same to the last bit for any executor. Ctrl-C ends the chart, not the program: completed
    rows are returned, and the others have the status ``NOT_RUN``.

    Parameters
    ----------
    system
        The model.
    over : Mapping[str, ArrayLike] | Sequence[Mapping[str, float]] | xarray.Dataset
        ``{"omega": values, "e": values}`` for a grid of any number of axes, of which the last varies fastest;
        or a table of points, as for :func:`hybrid.sweep`. A name is that of a parameter, or of a component
        of the state: the row then starts there.
    x0, mode, t0
        Start of each row, as for :func:`hybrid.simulate`. By name, components in ``over`` may be left out.
    parameters
        Values of the other parameters.
    k
        Number of exponents, 1 to n, or None for all. By default the largest alone, where
        :func:`lyapunov.lyapunov_spectrum` computes all.
    section
        Number of points of the section to keep per row, for a bifurcation diagram.
    at
        Where the section is taken: by default once per forcing period; ``Guard(...)`` at each crossing of its
        surface; ``"jumps"`` at each jump, with the state before it.
    outputs
        Names of outputs to compute at the points of the section.
    continue_from
        Name of an axis along which the attractor is followed, or ``"previous"`` for the last axis. The first
        row starts from ``x0``, each other row from the end of the transient of the row before. A row starts
        from ``x0`` if it cannot start there or if the transient before failed. The attractor is followed
        without tangent vectors ahead of the rows, so that rows still run in parallel; this costs a second
        transient per row.
    store, executor, progress
        As for :func:`hybrid.sweep`.

    Returns
    -------
    xarray.Dataset
        Over the axes of ``over``: ``exponents`` and ``standard_error`` with the axis ``exponent``,
        ``sum_rule``, ``jumps_per_interval``, the state ``x_end`` (axis ``state``) and mode ``mode_end`` at
        the end of each row's spectrum, ``section`` (axes ``sample`` and ``state``), ``section_outputs`` (axes
        ``sample`` and ``output``), ``status`` and ``message``. Rows that were not run hold nan.

    Raises
    ------
    ModelError
        If the model cannot be compiled, or an argument does not fit it (ArgumentError). A problem with the
        values of a single row is reported in the status of that row instead.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> damping = chart(models.impact_oscillator(), {"c": [0.1, 0.2, 0.4]}, (0.0, 0.0), intervals=200)
    >>> dict(damping.exponents.sizes)
    {'c': 3, 'exponent': 1}
    >>> bool((damping.exponents.sel(exponent=1) < 0).all())
    True
    """
    section = arguments.count("section", section, 0)
    outputs = tuple(arguments.items("outputs", outputs, "be a list of names of outputs"))
    if outputs and not section:
        raise ArgumentError(
            "outputs are computed at the points of a section, and this chart has none. Give section=100 too."
        )
    interval = asked["interval"]
    rows = rows_of(
        system,
        over,
        x0,
        mode=asked["mode"],
        parameters=asked["parameters"],
        t0=asked["t0"],
        solver=asked["solver"],
        points=section,
        at=at,
        continue_from=continue_from,
        results=(*RESULTS, "exponent", "sample", "state", "output"),
        outputs=outputs,
    )
    task = Exponents(
        rows,
        k=number_of_exponents(system, k),
        intervals=arguments.count("intervals", asked["intervals"], 1),
        interval=None if interval is None else arguments.positive("interval", interval, "be a positive time"),
        transient=arguments.count("transient", asked["transient"], 1 if rows.along else 0),
        points=section,
    )
    return sweep(task, over, store=store, executor=executor, progress=progress)


@attrs.frozen(eq=False)
class Exponents:
    """The task of a chart: the exponents, and the section after them, at one point."""

    rows: Rows
    k: int
    intervals: int
    interval: float | None
    transient: int
    points: int

    def __call__(self, point: Mapping[str, float], place: Place | None = None) -> dict[str, Any]:
        """The results of one row."""
        [found] = self.together([point], [place])
        if isinstance(found, Exception):
            raise found
        return found

    def together(
        self, points: Sequence[Mapping[str, float]], places: Sequence[Place | None]
    ) -> list[dict[str, Any] | Exception]:
        """The results of several rows, each of which is what it is alone; or the error of a row."""
        # Rows that go on from one another come one at a time: few would take their steps together.
        if self.rows.system.growth is not None or self.along is not None:
            return [
                result_of(partial(self.rows.grown, partial(self._row, point=point, place=place)))
                for point, place in zip(points, places, strict=True)
            ]
        begin = partial(self._begun, self.rows, self._common(self.rows))
        begun = [result_of(partial(begin, *each)) for each in zip(points, places, strict=True)]
        found: list[Any] = list(begun)
        for runs in alike(begun):
            estimates = Estimates([found[i] for i in runs], self.k)
            means = result_of(partial(means_together, estimates, self.transient, self.intervals))
            for row, i in enumerate(runs):
                found[i] = means
                if not isinstance(means, Exception):
                    found[i] = result_of(partial(self._results, self.rows, points[i], estimates, means, row))
            estimates.release()
        return found

    def _row(self, rows: Rows, point: Mapping[str, float], place: Place | None) -> dict[str, Any]:
        estimates = Estimates([self._begun(rows, self._common(rows), point, place)], self.k)
        means = estimates.means(self.transient, self.intervals, False, partial(estimates.alone, silent()))
        found = self._results(rows, point, estimates, means, 0)
        estimates.release()
        return found

    def _common(self, rows: Rows) -> Common:
        return rows.common(rows.system, self._vectors, rows.t0)

    def _begun(self, rows: Rows, common: Common, point: Mapping[str, float], place: Place | None) -> Flight:
        trajectory = rows.begin(point, place, common)
        orthonormal_at_start(trajectory)
        return Flight(trajectory, self._length(trajectory))

    def _results(
        self, rows: Rows, point: Mapping[str, float], estimates: Estimates, means: Means, row: int
    ) -> dict[str, Any]:
        trajectory, status = estimates.trajectories[row], estimates.status(row)
        return {
            "exponents": means.exponents[row],
            "standard_error": means.standard_error[row],
            "sum_rule": means.sum_rule[row],
            "jumps_per_interval": means.jumps_per_interval[row],
            "x_end": without_age(rows.system, trajectory.x),
            "mode_end": trajectory.mode,
            **(self._section(rows, point, trajectory, status) if self.points else {}),
            "status": status,
        }

    def carry(self, point: Mapping[str, float], place: Place | None) -> Place | None:
        """State and mode after the transient, rounded up to whole forcing periods to keep the phase."""
        return self.rows.grown(lambda rows: self._carried(rows, point, place))

    def _carried(self, rows: Rows, point: Mapping[str, float], place: Place | None) -> Place | None:
        trajectory = rows.begin(point, place, rows.common(rows.system, None, rows.t0))
        span = self.transient * self._length(trajectory)
        period, clock = trajectory.model.period, trajectory.run
        cycles = math.ceil(span / period * (1 - 1e-12)) if period else 0
        end = int(clock.cycle) + cycles, float(clock.phase) + (0.0 if period else span)
        if period:
            # The next row starts at the phase of this one, and makes the jumps there itself.
            code = advance_to_close(trajectory, *end)
        else:
            code = trajectory.advance_to(*end, trajectory.no_record())
        return rows.end_of(trajectory, code)

    def prepare(self) -> None:
        """Load what the rows need."""
        load_kernels("lyapunov.kernels")
        self.rows.prepare(self._vectors.shape[1])

    @property
    def along(self) -> str | None:
        """The axis along which the attractor is followed."""
        return self.rows.along

    @property
    def system(self) -> HybridSystem:
        """The model."""
        return self.rows.system

    @property
    def labels(self) -> Labels:
        """Names of the inner axes."""
        labels = self.rows.labels(DIMS)
        return attrs.evolve(
            labels, coords={**labels.coords, "exponent": (("exponent",), list(range(1, self.k + 1)))}
        )

    @property
    def facts(self) -> dict[str, Any]:
        """What decides the results."""
        names = ("k", "intervals", "interval", "transient")
        forced = "no" if self.system.period is None else "yes"
        own = {name: getattr(self, name) for name in names}
        return {**self.rows.facts(), **own, "section": self.points, "forced": forced}

    @cached_property
    def _vectors(self) -> np.ndarray:
        return first_vectors(self.rows.system, self.k, self.rows.solver)

    def _length(self, trajectory: Trajectory) -> float:
        return interval_length(trajectory, self.interval, self.transient + self.intervals)

    def _section(
        self, rows: Rows, point: Mapping[str, float], trajectory: Trajectory, status: Status
    ) -> dict[str, np.ndarray]:
        """The points of the section, and outputs at them, by the names of the results."""
        states, outputs = self._points(rows, point, trajectory, status)
        # An axis of length zero could not be read back from a file.
        return {"section": states, **({"section_outputs": outputs} if rows.outputs else {})}

    def _points(
        self, rows: Rows, point: Mapping[str, float], trajectory: Trajectory, status: Status
    ) -> tuple[np.ndarray, np.ndarray]:
        if not status.ok:
            return rows.no_section(self.points)
        if rows.marked is not rows.system:
            # The system with the surface goes on from here; with a period the phase is all of the time.
            place, now = (trajectory.x, trajectory.mode), float(trajectory.run.phase)
            system = rows.marked if trajectory.system.age is None else aged(rows.marked)
            try:
                marked = rows.go_on(point, place, rows.common(system, None, now))
            except HybridError:
                return rows.no_section(self.points)
            marked.goes_on_from(trajectory)
            found = rows.section(marked, self.points)
            marked.release()
            return found
        return rows.section(trajectory, self.points)
