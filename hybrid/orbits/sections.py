"""Sections of orbits: once a forcing period, or at each crossing of a surface."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.display.progress import progress_bar
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.kernels.types.codes import UNLIMITED
from hybrid.simulation.ending import status_of
from hybrid.simulation.interrupt import Bursts
from hybrid.simulation.labelled import Names, attributes, with_outputs
from hybrid.simulation.memory import empty_record
from hybrid.simulation.quantities import Asked, mode_indices, table_of
from hybrid.simulation.trajectory import Trajectory, start
from hybrid.solvers import Solver
from hybrid.status import Status, StatusCode
from hybrid.system.elements import Guard
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.growth import growing
from hybrid.transform.markers import with_section

if TYPE_CHECKING:
    import xarray

POINTS_AT_ONCE = 500
# A surface that is not met within this many steps is taken to be missed for good.
STEPS_BETWEEN_POINTS = 1_000_000


@attrs.frozen(eq=False, repr=False)
class Section(Asked):
    """Points of an orbit on a section; ``section["q"]`` is a component of the state, or an output, over them.

    Attributes
    ----------
    system, parameters
        The model, and the values of all its parameters in the run, by name.
    t
        Times ``(N,)``.
    x
        States ``(N, n)``.
    mode
        Names of the modes ``(N,)``.
    jumps
        Jumps since the previous point ``(N,)``, without the crossings of the section.
    status
        How the run ended.

    Examples
    --------
    >>> import hybrid, models
    >>> section = hybrid.stroboscopic_section(models.impact_oscillator(), (0.0, 0.0), periods=50)
    >>> section.x.shape, section.jumps.shape
    ((50, 2), (50,))
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    t: np.ndarray
    x: np.ndarray
    mode: np.ndarray
    jumps: np.ndarray
    status: Status

    def __len__(self) -> int:
        return len(self.t)

    def _table(self, names: Iterable[str]) -> np.ndarray:
        modes, values = mode_indices(self.system, self.mode), self.system.parameter_values(self.parameters)
        return table_of(self.system, [*names], self.t, self.x, modes, values)

    def to_xarray(self) -> xarray.Dataset:
        """The points over the axis ``sample``: ``x`` (axes ``sample`` and ``state``), ``mode``, ``jumps``.

        If the system has outputs they are in ``outputs`` (axes ``sample`` and ``output``).
        """
        import xarray

        names = Names(self.system.state_names, self.system.units)
        found = xarray.Dataset(
            {
                "x": (("sample", "state"), self.x, names.states),
                "mode": ("sample", self.mode),
                "jumps": ("sample", self.jumps),
            },
            {"t": ("sample", self.t, names.of("t")), **names.coords()},
            attributes("section", self.status, self.system, self.parameters),
        )
        return with_outputs(found, self.system, {"outputs": (("sample",), self._table(self.system.outputs))})

    def __repr__(self) -> str:
        return f"<Section of {counted(len(self), 'point')}, {self.status.brief}>"


@growing
def stroboscopic_section(
    system: HybridSystem,
    x0: ArrayLike,
    *,
    periods: int,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    transient: int = 0,
    t0: float = 0.0,
    solver: Solver | None = None,
    progress: bool = False,
) -> Section:
    """State once per forcing period, at the phase of ``t0``.

    Parameters
    ----------
    system, x0, mode, parameters, solver
        As for :func:`hybrid.simulate`; the system must declare a period.
    periods, transient
        Number of points, and number of forcing periods to run before the first point: none by default,
        since a section may show how an orbit settles. (Exponents leave out 200 intervals by default.)
    t0
        Time at the start; its phase is that of the section.
    progress
        Whether to show a progress bar.

    Raises
    ------
    ArgumentError
        If the system declares no period, or an argument does not fit it.

    Examples
    --------
    >>> import models
    >>> from hybrid import stroboscopic_section
    >>> section = stroboscopic_section(models.impact_oscillator(), (0.0, 0.0), periods=10)
    >>> section.x.shape
    (10, 2)
    """
    periods = arguments.count("periods", periods, 1)
    transient = arguments.count("transient", transient, 0)
    progress = arguments.flag("progress", progress)
    trajectory = start(system, x0, t0, mode=mode, parameters=parameters, solver=solver)
    if trajectory.model.period <= 0:
        raise ArgumentError(
            "A stroboscopic section needs a forcing period, and the system declares none. "
            "Give HybridSystem a period=, or use poincare_section."
        )
    chunks = [(np.empty((0, system.dimension)), np.empty((0, 3), dtype=np.int64))]
    code, before = codes.DONE, 0
    with trajectory.stop, progress_bar(transient + periods, "Section", progress, "period") as bar:
        for kept, left in ((False, transient), (True, periods)):
            while left > 0 and code == codes.DONE:
                states, places, code = strobe(trajectory, min(left, POINTS_AT_ONCE))
                if kept:
                    chunks.append((states, places))
                elif len(places):
                    before = places[-1, 2]
                left -= len(states)
                bar.update(len(states))
    states, places = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    cycle, index, count = places.T
    status = status_of(trajectory, code)
    trajectory.release()
    return Section(
        system=system,
        parameters=trajectory.named_parameters,
        t=cycle * trajectory.model.period + trajectory.phase0,
        x=states,
        mode=np.array(system.mode_names)[index],
        jumps=np.diff(count, prepend=before),
        status=status,
    )


def strobe(trajectory: Trajectory, count: int) -> tuple[np.ndarray, np.ndarray, int]:
    """States ``(N, n)`` and places ``(N, 3)`` of the next ``count`` periods at the phase of the start.

    The places are cycle, mode and jump count; the code says why there may be fewer.
    """
    states = np.empty((count, trajectory.model.dimension))
    places = np.empty((count, 3), dtype=np.int64)
    kernel = load_kernels("hybrid.kernels.runs.sections").strobe
    reached = np.zeros(1, dtype=np.int64)
    record, bursts = trajectory.no_record(), Bursts([trajectory])
    advance, phase = load_kernels().advance, trajectory.phase0
    first, total, code = int(trajectory.run.cycle) + 1, 0, codes.GO_ON
    # Points need no tangent vectors, which the trajectory may have.
    plain = attrs.evolve(trajectory, tangents=0)
    task = plain.task(record)
    while code == codes.GO_ON:
        most = bursts.most()
        reached[0] = 0

        def more(parts: Any, most: int = most, total: int = total) -> int:
            return kernel(advance, parts, task, phase, most, states[total:], places[total:], reached)

        code = trajectory.plan.called(more, trajectory.run, trajectory.work, reached)
        total += int(reached[0])
        code = bursts.judged(code)
        if code == codes.GO_ON:
            # The burst ended within a period; the kernel would begin the next one.
            code = plain.advance_to(first + total, trajectory.phase0, record)
            if code == codes.DONE:
                run = trajectory.run
                places[total] = run.cycle, run.mode, run.jumps
                states[total] = trajectory.x
                total += 1
                code = codes.GO_ON if total < count else codes.DONE
    return states[:total], places[:total], code


@growing
def poincare_section(
    system: HybridSystem,
    x0: ArrayLike,
    section: Guard,
    *,
    points: int,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    transient: int = 0,
    t0: float = 0.0,
    solver: Solver | None = None,
    progress: bool = False,
) -> Section:
    """State at each crossing of a surface, located as exactly as any event.

    Parameters
    ----------
    system, x0, mode, parameters, solver
        As for :func:`hybrid.simulate`.
    section
        Guard whose zeros are the surface; its direction says which crossings count.
    points, transient
        Number of points, and number of crossings to skip before the first point: none by default.
    t0
        Time at the start.
    progress
        Whether to show a progress bar.

    Returns
    -------
    Section
        With fewer points and a status if the orbit no longer meets the surface.

    Raises
    ------
    ArgumentError
        If ``section`` is not a Guard, or another argument does not fit.

    Examples
    --------
    >>> import models
    >>> from hybrid import Guard, poincare_section
    >>> apex = Guard(lambda t, x, p: x.v, direction=-1)
    >>> section = poincare_section(models.bouncing_ball(), (1.0, 0.0), apex, points=3)
    >>> [round(float(q), 4) for q in section.x[:, 0]]
    [0.64, 0.4096, 0.2621]
    """
    points = arguments.count("points", points, 1)
    transient = arguments.count("transient", transient, 0)
    progress = arguments.flag("progress", progress)
    arguments.instance("section", section, Guard, "Write Guard(function, direction=...).")
    marked = with_section(as_system("system", system), section)
    trajectory = start(marked, x0, t0, mode=mode, parameters=parameters, solver=solver)
    with trajectory.stop, progress_bar(transient + points, "Section", progress, "point") as bar:
        return _collect(trajectory, system, transient, points, bar)


def _collect(trajectory: Trajectory, system: HybridSystem, transient: int, points: int, bar: Any) -> Section:
    """The points of a run of a system with markers, which come first, as those of the system without."""
    counted = np.arange(len(trajectory.system.transitions)) < len(system.modes)
    t, x, index, count, code = crossings(trajectory, counted, transient + points, bar)
    keep = slice(transient, None)
    return Section(
        system=system,
        parameters=trajectory.named_parameters,
        t=t[keep],
        x=x[keep],
        mode=np.array(system.mode_names)[index[keep]],
        jumps=np.diff(count, prepend=0)[keep],
        status=status_of(trajectory, code),
    )


def crossings(
    trajectory: Trajectory, counted: np.ndarray, points: int, bar: Any = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
    """The next jumps of the counted transitions: times, states before, transitions, other jumps so far.

    The code says why there may be fewer than ``points``; the trajectory ends at the last one, or soon after.
    """
    model, run = trajectory.model, trajectory.run
    record = empty_record(model.dimension, 0, 0, POINTS_AT_ONCE)
    rows: list[tuple[np.ndarray, ...]] = []
    found, others, steps_at_point, code = 0, 0, int(run.steps), codes.DONE
    while found < points:
        record.used[:] = 0
        limit = min(trajectory.max_steps, steps_at_point + STEPS_BETWEEN_POINTS)
        # Not more jumps than are wanted, so that the run does not go on beyond the last one.
        most = min(int(run.jumps) + points - found, UNLIMITED)
        code = trajectory.advance_to(
            UNLIMITED if model.period else 0, np.inf, record, max_steps=limit, max_jumps=most
        )
        used = record.jumps
        cycle, transition = record.jump_cycle[:used], record.jump_transition[:used]
        marked = counted[transition]
        count = others + np.cumsum(~marked)
        rows.append(
            (
                (cycle * model.period + record.jump_phase[:used])[marked],
                record.jump_states[:used, 0][marked],
                transition[marked],
                count[marked],
            )
        )
        others = int(count[-1]) if used else others
        found += int(marked.sum())
        if marked.any():
            steps_at_point = int(run.steps)
        if bar is not None:
            bar.update(int(marked.sum()))
        goes_on = code in (codes.RECORD_FULL, codes.MAX_JUMPS)
        if not goes_on and not (code == codes.MAX_STEPS and marked.any()):
            break
        # Each part of the run may be too short to ask.
        if trajectory.stop.is_set() and found < points:
            code = StatusCode.INTERRUPTED
            break
    else:
        code = codes.DONE
    t, x, index, count = (np.concatenate(column)[:points] for column in zip(*rows, strict=True))
    return t, x, index, count, code
