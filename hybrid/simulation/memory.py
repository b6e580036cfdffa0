"""Memory of a run: what the kernels write to, laid out once for all runs of the same shapes."""

from __future__ import annotations

import math
import os
from contextlib import suppress
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hybrid.kernels.instructions.registers import whole_registers
from hybrid.kernels.types import codes
from hybrid.kernels.types.entries import COUNTERS, NUMBERS
from hybrid.kernels.types.layout import Record, Run, Task, Work
from hybrid.kernels.types.starts import Starts
from hybrid.kernels.types.structure import Layout
from hybrid.simulation.periods import split_time

# Deep enough for intervals halved down to rounding.
ISOLATION_DEPTH = 64
# Parts of a step on which a guard is judged by its leading powers: halves, quarters and eighths of it.
PARTS = 8
# Transitions remembered in the order in which they fired: enough to see which go round without end. A power
# of two.
RECENT = 64
# Solvers, and shapes of memory, that are kept for the next run.
MOST_LAYOUTS = 64
# Places of what is written at the start of every run: in the arrays, this takes a quarter of the time.
CYCLE, PHASE, HORIZON = COUNTERS.index("cycle"), NUMBERS.index("phase"), NUMBERS.index("horizon")
MODEL, RECORD, TANGENTS = (Task._places[name] for name in ("model", "record", "tangents"))


@cache
def memory_for_records() -> float:
    """Bytes that the kept steps and jumps of one run may fill; infinite if the memory is not known.

    An arc needs as much again when its steps are joined.
    """
    sizes = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")] if hasattr(os, "sysconf") else []
    with suppress(OSError, ValueError):
        # A container may have less; the limit is "max" if it has not.
        sizes.append(int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    return min(sizes, default=math.inf) / 3


def workspace(method: Any, dimension: int) -> Any:
    """Scratch memory for single jumps, without steps."""
    return work_layout(method, dimension, 0, 0, 0, 0).zeros()


class Memory:
    """The structures of a plan's run, which the next run takes over when this one is released."""

    def __init__(self, plan: Any) -> None:
        self.plan = plan
        self.run, self.work = plan.run_layout.unwritten(), plan.work_layout.unwritten()
        self._model: Any = None
        # Of the last runs from many starts (``starts_of``).
        self.starts: Any = None
        self._tasks: dict[tuple[bool, bool], Any] = {}
        self._driven = self._task(plan.model, orthonormal=False)
        # What every run writes first, found once: views of all words, of the state and of single numbers.
        self._run_words, self._fresh = plan.run_layout.words(self.run), plan.run_layout.first.view(np.int64)
        self._work_words = plan.work_layout.words(self.work)
        self._state = self.run.y[: plan.model.dimension]
        self._counters, self._numbers, self._scale = self.run.counters, self.run.numbers, self.run.scale

    def begin(
        self, model: Any, state: np.ndarray, tangent: np.ndarray | None, t0: float, horizon: float = 0.0
    ) -> float:
        """Put the run to its start, in no mode yet; the phase there. ``horizon`` is how long it takes."""
        plan, numbers = self.plan, self._numbers
        self._run_words[:] = self._fresh
        self._work_words.fill(0)
        cycle, phase = split_time(t0, model.period)
        self._counters[CYCLE], numbers[PHASE], numbers[HORIZON] = cycle, phase, horizon
        if plan.put_ticks is not None:
            plan.put_ticks(state, model.parameters, self.run.ticks, self.run.rows)
        self._state[:] = state
        if tangent is not None:
            put_tangents(self.run.y, model.dimension, tangent)
        np.abs(state, self._scale)
        return phase

    def model_at(self, values: np.ndarray, period: float, knots: dict[str, np.ndarray]) -> Any:
        """The plan's model at a parameter vector; it is changed when another run takes this memory.

        ``knots`` are those of ``CompiledSystem.knots_at``.
        """
        if self._model is None:
            model, own = self.plan.model, self.plan.model.parameters.copy()
            changes = {"programs": model.programs.replace(parameters=own)} if len(model.programs.rows) else {}
            changes |= {name: each.copy() for name, each in knots.items()}
            self._model = model.replace(parameters=own, **changes)
        self._model.parameters[: len(values)] = values
        for name, each in knots.items():
            getattr(self._model, name)[:] = each
        self._model.put(period=period)
        return self._model

    def driven(self, model: Any, record: Any, tangents: int) -> Any:
        """What the driver works on in the next burst: one task, whose words are changed for each.

        It does not hold the model and the record: they may go to somebody else when the burst is over.
        """
        task = self._driven
        words = task.table
        words[MODEL], words[RECORD], words[TANGENTS] = model.address, record.address, tangents
        return task

    def task(self, model: Any, *, orthonormal: bool) -> Any:
        """What a kernel that calls the driver works on in a run without a record."""
        key = model is self.plan.model, orthonormal
        if not (key[0] or model is self._model):
            return self._task(model, orthonormal)
        if key not in self._tasks:
            self._tasks[key] = self._task(model, orthonormal)
        return self._tasks[key]

    def _task(self, model: Any, orthonormal: bool) -> Any:
        return self.plan.task.replace(run=self.run, work=self.work, model=model, orthonormal=int(orthonormal))


def put_tangents(y: np.ndarray, n: int, matrix: np.ndarray) -> None:
    """Write tangent vectors, columns, behind the state ``(n,)``; their components for counters are zero."""
    rows = y[n:].reshape(-1, n)
    rows[:, : len(matrix)], rows[:, len(matrix) :] = matrix.T, 0.0


def starts_of(memory: Memory, origins: np.ndarray, queue: np.ndarray, **others: Any) -> Any:
    """The ``Starts`` of runs in a memory at the start of a run, with the other fields that they need.

    ``queue (1,)`` is shared by all memories of these runs.
    """
    plan, known = memory.plan, memory.starts
    if known is None:
        run_words = plan.run_layout.words(memory.run)
        known = memory.starts = Starts(
            counters=np.empty(1, dtype=np.int64),
            origins=origins,
            queue=queue,
            verdicts=np.zeros(len(plan.model.target), dtype=np.int64),
            run_words=run_words,
            fresh_run=run_words.copy(),
            work_words=plan.work_layout.words(memory.work),
            **others,
        )
    known.now = -1
    known.fresh_run[:] = known.run_words
    return known.replace(origins=origins, queue=queue, **others)


@lru_cache(MOST_LAYOUTS)
def work_layout(method: Any, dimension: int, tangents: int, guards: int, columns: int, rows: int) -> Any:
    """Where the arrays of a workspace lie.

    A mode has at most so many ``guards``; ``columns`` are those of series, ``rows`` those of programs.
    """
    n, length = dimension, dimension * (1 + tangents)
    stages, degree = len(method.a), len(method.interpolant) - 1
    coupled = len(method.b) if method.implicit else 0
    # Whole vectors of columns are evaluated: there may be a few more than are in use.
    width_of_series = whole_registers(columns, codes.WIDE)
    shapes = {
        "stages": (stages, length + 1),
        "speeds": (2, stages),
        "trial": (length,),
        "new": (length,),
        "error": (length,),
        "second_error": (length,),
        "jacobian": (n, n + 1),
        "reset_jacobian": (n, n + 1),
        "gradient": (n + 1,),
        "scalar": (1,),
        "field": (n,),
        "field_after": (n,),
        "state": (n,),
        "settled": (n,),
        "departure": (n,),
        "path_error": (n,),
        "scale_before": (n,),
        "saltation": (n, n),
        "sizes": (n, n),
        "rounding": (4, n),
        "path": (degree + 3, n + guards),
        "intervals": (ISOLATION_DEPTH, 2),
        "systems": (n + coupled * (n + 1) + 4, coupled * n),
        "pivots": ((coupled + 1) * n,),
        "series": (codes.HIGHEST_ORDER + 3, width_of_series) if method.order else (0, 0),
        "weights": (1, width_of_series),
        "polynomial": (codes.HIGHEST_ORDER + 4,),
        "stack": (PARTS, codes.LEADING + 4),
        "registers": (max(rows, 1), codes.REGISTERS),
        "samples": (max(len(method.nodes), len(method.series_nodes)) + 1, 2 * rows),
        "rates": (2, length),
    }
    return Layout(Work, shapes)


@cache
def no_record(dimension: int) -> Any:
    """A record that keeps nothing: as nobody writes to it, all runs share it."""
    return empty_record(dimension, 0)


def empty_record(dimension: int, degree: int, steps: int = 0, jumps: int = 0) -> Any:
    """A record with room for that many steps and jumps; none means that they are not kept."""
    # Room that is not used costs nothing, not even to be cleared: all is written before it is read.
    record = record_layout(dimension, degree, steps, jumps).unwritten()
    record.used[:] = 0
    return record


@lru_cache(MOST_LAYOUTS)
def record_layout(dimension: int, degree: int, steps: int, jumps: int) -> Any:
    """Where the arrays of a record lie."""
    n = dimension
    shapes = {
        "used": (4,),
        "step_time": (steps, 3),
        "step_place": (steps, 3),
        "step_coefficients": (steps, degree + 1, n + 1),
        "jump_time": (jumps, 3),
        "jump_place": (jumps, 5),
        "jump_states": (jumps, 2, n),
        "jump_saltation": (jumps, n, n),
        "grazing_time": (jumps, 3),
        "grazing_place": (jumps, 3),
        "grazing_state": (jumps, n),
    }
    return Layout(Record, shapes)


@lru_cache(MOST_LAYOUTS)
def run_layout(dimension: int, tangents: int, modes: int, transitions: int, ticks: int) -> Any:
    """Where the arrays of a run lie, and what they hold in one that has no mode yet and has not jumped."""
    n = dimension
    shapes = {
        "counters": (len(COUNTERS),),
        "numbers": (len(NUMBERS),),
        "y": (n * (1 + tangents),),
        **dict.fromkeys(("side", "on_guard", "due"), (transitions,)),
        "recent": (RECENT,),
        "fires": (transitions,),
        **dict.fromkeys(("side_before", "order_before", "unproved_before"), (transitions,)),
        **dict.fromkeys(("tried_side", "tried_due", "tried_order"), (transitions,)),
        "changes": (transitions,),
        "unproved": (transitions,),
        "visits": (RECENT, n + 2),
        "tick": (transitions,),
        "ticked": (transitions,),
        "ticks": (ticks,),
        "rows": (ticks,),
        "first_step": (modes,),
        "stay": (modes,),
        "scale": (n,),
        "stretch": (n,),
        "growth": (tangents,),
        "trail": (4, n + 1),
        "before": (n * tangents,),
        "growth_before": (tangents,),
        "instant": (n * (1 + n),),
    }
    layout = Layout(Run, shapes)
    first = layout.zeros()
    first.stage, first.previous_mode = codes.ENTERING, codes.NO_MODE
    first.last_fired = first.pending = codes.NO_TRANSITION
    first.last_jump_phase = np.nan
    first.tick[:] = first.ticked[:] = codes.FIRST_TICK
    layout.begin_as(first)
    return layout
