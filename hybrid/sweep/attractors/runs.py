"""Runs that settle on attractors, in compiled code."""

from __future__ import annotations

from copy import copy
from functools import lru_cache
from typing import Any

import numpy as np

from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress, silent
from hybrid.errors import ArgumentError
from hybrid.kernels.types import attractors as kernel_types
from hybrid.kernels.types import codes
from hybrid.kernels.types.starts import Settling
from hybrid.simulation.crew import TOGETHER, Crew, berths, together
from hybrid.simulation.interrupt import Bursts
from hybrid.simulation.memory import starts_of
from hybrid.simulation.plan import plan_of
from hybrid.status import StatusCode
from hybrid.sweep.attractors.setup import Setup
from hybrid.sweep.blocks import run_in_blocks
from hybrid.system.graph import starting_mode

# Columns of what is found of each start: attractor (-1 for none), points until decided, code, mode at start.
OWNER, POINTS, CODE, MODE = range(4)
COLUMNS = 4
NONE = -1


@lru_cache(16)
def runs_of(setup: Setup) -> Runs:
    """The runs of a setup, made once in each process."""
    return Runs(setup)


class Runs:
    """Takes starts to their attractors."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.compiled = compile_system(setup.marked)
        self.plan = plan_of(self.compiled, setup.solver, 0)
        self.model = self.compiled.given(setup.parameters, self.plan.model)
        mode = starting_mode(setup.marked, setup.mode)
        parts = [] if mode is None else setup.marked.parts_of(mode)
        self.named = parts[0] if len(parts) == 1 else codes.NO_MODE
        # The kernel does not choose among the parts of one mode.
        self.in_parts = len(parts) > 1
        # Before threads need the same kernels.
        load_kernels("hybrid.kernels.runs.settle")
        self.parts = self.plan.parts

    def settle(
        self, origins: np.ndarray, known: Any, most: int, threads: int = 1, bar: Progress | None = None
    ) -> np.ndarray:
        """What is found of each start: rows ``(N, 4)``; the code is NOT_RUN after an interrupt."""
        found = np.zeros((len(origins), COLUMNS), dtype=np.int64)
        found[:, OWNER], found[:, CODE] = NONE, StatusCode.NOT_RUN

        def run(block: range) -> None:
            size = 1 if self.in_parts else len(block)
            for i in range(block.start, block.stop, size):
                part = slice(i, i + size)
                settle = self._one if self.in_parts else self._block
                settle(np.ascontiguousarray(origins[part]), known, most, found[part])

        run_in_blocks(run, len(origins), threads, bar or silent())
        return found

    def _block(self, origins: np.ndarray, known: Any, most: int, found: np.ndarray) -> None:
        if not len(origins) or CTRL_C.is_set():
            return
        plan, count = self.plan, min(len(origins), TOGETHER)
        model = self.compiled.own(self.model)
        memories, phase0 = berths(plan, model, count, origins[0], self.setup.t0)
        queue = np.zeros(1, dtype=np.int64)
        starts = [starts_of(each, origins, queue, named=self.named, found=found) for each in memories]
        progress = self.progress(int(memories[0].run.cycle), phase0)
        common = Settling(
            starts=starts[0], known=known, section=self.section(phase0, most), progress=progress
        )
        # Each run has numbers of its own, which begin alike.
        of_each = [
            progress.replace(counters=progress.counters.copy(), numbers=progress.numbers.copy())
            for _ in memories
        ]
        jobs = [common.replace(starts=one, progress=own) for one, own in zip(starts, of_each, strict=True)]
        tasks = [each.task(model, orthonormal=False) for each in memories]
        crew = Crew(together(self.compiled, plan, 0), plan, tasks, jobs)
        crew.memory.max_steps[:] = self.setup.solver.max_steps
        onward = load_kernels("hybrid.kernels.runs.settle").settle
        under_way = list(range(count))
        while under_way:
            crew.memory.codes[:] = codes.DONE
            crew.memory.codes[under_way] = codes.GO_ON
            if not crew.go(onward, CTRL_C):
                # A run that is under way is not complete, nor is one that has not begun.
                over = found[:, CODE] != StatusCode.NOT_RUN
                found[~over, OWNER] = NONE
                return
            under_way = [row for row in under_way if jobs[row].starts.now >= 0]
            for row in under_way:
                first = int(jobs[row].starts.now)
                self._one(origins[first : first + 1], known, most, found[first : first + 1])
        for each in memories:
            plan.take_back(each)

    def _one(self, origin: np.ndarray, known: Any, most: int, found: np.ndarray) -> None:
        """A start whose mode Python has to find; an ArgumentError if more than one mode allows the start."""
        try:
            mode = self.setup.begin(origin[0], self.setup.mode, marked=True).mode
        except ArgumentError:
            if not self.in_parts:
                raise
            found[0] = NONE, 0, codes.REFUSED, codes.NO_MODE
            return
        other = copy(self)
        other.named, other.in_parts = self.setup.marked.mode_index(mode), False
        other._block(origin, known, most, found)

    def section(self, phase0: float, most: int) -> Any:
        """The section as the kernels see it."""
        setup = self.setup
        return kernel_types.Section(
            markers=setup.markers,
            phase=phase0,
            interval=0.0 if setup.forced else setup.interval,
            wanted=setup.recurrences,
            most=most,
        )

    def progress(self, cycle: int, phase: float) -> Any:
        """The progress of a run at its start."""
        counters = np.array([cycle, 0, 0, NONE, 0], dtype=np.int64)
        return kernel_types.Progress(counters=counters, numbers=np.array([phase]))


class Points:
    """The points of one run on the section, a few at a time."""

    def __init__(self, setup: Setup, x0: np.ndarray, mode: str | None) -> None:
        self.runs = runs_of(setup)
        self.trajectory = setup.begin(x0, mode, marked=True)
        self.task = self.trajectory.task(self.trajectory.no_record())
        self.section = self.runs.section(self.trajectory.phase0, 0)
        self.progress = self.runs.progress(int(self.trajectory.run.cycle), self.trajectory.phase0)
        self.code = codes.DONE

    def more(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The next states ``(N, n)``, with modes and jumps so far ``(N, 2)``; ``code`` tells why fewer."""
        states = np.empty((count, self.trajectory.model.dimension))
        places = np.zeros((count, 2), dtype=np.int64)
        kernel, advance = load_kernels("hybrid.kernels.runs.settle").collect, load_kernels().advance
        bursts, code = Bursts([self.trajectory]), codes.GO_ON
        self.progress.points = 0
        parts = self.trajectory.plan.parts
        while code == codes.GO_ON:
            code = kernel(
                advance, parts, self.task, self.section, self.progress, bursts.most(), states, places
            )
            code = bursts.judged(codes.MAX_STEPS if code == codes.GO_ON else code)
        self.code = code
        done = int(self.progress.points)
        return states[:done], places[:done]
