"""A run that writes down what its arc is made of."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.compiler.cache.loader import load_kernels
from hybrid.kernels.types import codes
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.ending import Ending
from hybrid.simulation.jumps import Grazing
from hybrid.simulation.memory import memory_for_records, record_layout
from hybrid.simulation.points import (
    Course,
    Filled,
    JumpRows,
    Last,
    Pieces,
    Samples,
    StepRows,
    Steps,
    joined,
    no_jumps,
    unfilled,
)
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem

# Room of the record that kernels fill before Python empties it: large enough that the crossing costs nothing.
STEPS_AT_ONCE = 2048
JUMPS_AT_ONCE = 1024


class Recorder:
    """Runs a trajectory in bursts and copies what the kernel wrote down in each.

    ``times`` are those of samples, if only these are kept.
    """

    def __init__(
        self, trajectory: Trajectory, times: np.ndarray | None, t1: float, keeps_jumps: bool
    ) -> None:
        self.trajectory, self.times, self.keeps_jumps = trajectory, times, keeps_jumps
        self.before = trajectory.first_jump
        # The state at the end is at hand without any polynomial.
        only_the_end = times is not None and not (times.size and times.item(0) < t1)
        self.steps_at_once = 0 if only_the_end else STEPS_AT_ONCE
        dimension = trajectory.model.dimension
        self.samples: Filled | None = None
        if times is not None and self.steps_at_once:
            # Compiled before the run, not in the middle of it, where an interrupt would meet the compiler.
            load_kernels("hybrid.kernels.steps.dense")
            self.samples = unfilled(len(times), dimension)
        jumps_at_once = JUMPS_AT_ONCE if keeps_jumps else 0
        self.layout = record_layout(dimension, trajectory.plan.degree, self.steps_at_once, jumps_at_once)
        self.steps: list[StepRows] = []
        self.blocks: list[np.ndarray] = []
        self.jumps: list[JumpRows] = []
        self.grazings: list[Grazing] = []
        # Bytes of the steps and jumps that are kept.
        self.kept = 0
        # The code that the run ended with.
        self.code = codes.DONE

    def run(self, t1: float, max_jumps: int) -> HybridArc:
        """Run to ``t1`` or until something else ends the run."""
        trajectory = self.trajectory
        # Kernels count the jumps of the runs before, too.
        max_jumps += self.before
        code = self._advance(t1, max_jumps)
        if code == codes.RECORD_FULL:
            code = self._go_on(t1, max_jumps)
        self.code = code
        run = trajectory.run
        jumps = run.jumps - self.before
        end = Last(t1 if code == codes.DONE else trajectory.t, trajectory.x, run.mode, jumps)
        ending = Ending(trajectory, code)
        course = Course(trajectory.system, trajectory.parameters, trajectory.model.period, end, ending)
        rows = None
        if self.keeps_jumps:
            rows = JumpRows(*joined(self.jumps)) if self.jumps else no_jumps(trajectory.model.dimension)
        if self.times is not None:
            points: Samples | Steps = Samples(course, self.times, self.samples, rows)
        else:
            assert rows is not None
            points = Steps(course, StepRows(*joined(self.steps)), self.blocks, rows)
        return HybridArc.of_run(
            points,
            system=course.system,
            jump_count=jumps,
            grazings=tuple(self.grazings),
            fundamental=trajectory.tangent_matrix if trajectory.tangents else None,
            propagators=trajectory.plan.propagators.copy(),
            steps=run.steps,
            rejected=run.rejected,
        )

    def _go_on(self, t1: float, max_jumps: int) -> int:
        """Run on after the record was full; the code."""
        code = codes.RECORD_FULL
        with self.trajectory.stop:
            while code == codes.RECORD_FULL:
                if self.trajectory.stop.is_set():
                    code = StatusCode.INTERRUPTED
                elif self.kept > memory_for_records():
                    code = StatusCode.OUT_OF_MEMORY
                else:
                    code = self._advance(t1, max_jumps)
        return code

    def _advance(self, t1: float, max_jumps: int) -> int:
        """Run until the record is full or the run ends; the code."""
        record = self.layout.unwritten()
        record.used.fill(0)
        code = self.trajectory.advance(t1, record, max_jumps)
        steps, jumps, grazings, matrices = record.used.tolist()
        if self.before:
            record.step_jumps[:steps] -= self.before
            record.grazing_jumps[:grazings] -= self.before
        if jumps and self.keeps_jumps:
            self.jumps.append(self._copied_jumps(record, jumps, matrices))
        if grazings:
            self.grazings += _grazings(self.trajectory.system, record, grazings, self.trajectory.model.period)
        if self.times is None:
            rows = StepRows(record.step_time[:steps].copy(), record.step_place[:steps].copy())
            polynomials = record.step_coefficients[:steps]
            self.steps.append(rows)
            self.kept += rows.time.nbytes + rows.place.nbytes + polynomials.nbytes
            if 2 * steps > self.steps_at_once:
                # The arc keeps the record: new memory costs more than what of this was not used.
                self.blocks.append(polynomials)
                return code
            self.blocks.append(polynomials.copy())
        elif steps:
            self._sample(record, steps)
        self.layout.take_back(record)
        return code

    def _copied_jumps(self, record: Any, used: int, matrices: int) -> JumpRows:
        rows = JumpRows(
            record.jump_time[:used].copy(),
            record.jump_place[:used].copy(),
            record.jump_states[:used].copy(),
            record.jump_saltation[:matrices].copy(),
        )
        self.kept += sum(each.nbytes for each in rows)
        return rows

    def _sample(self, record: Any, steps: int) -> None:
        """States at the samples that fall before the current end of the run."""
        assert self.times is not None
        assert self.samples is not None
        states, places, first = self.samples
        stop = int(self.times.searchsorted(self.trajectory.t, side="left"))
        if stop > first:
            rows = StepRows(record.step_time[:steps], record.step_place[:steps])
            pieces = Pieces.of_rows(rows, [record.step_coefficients[:steps]], self.trajectory.model.period)
            part = slice(first, stop)
            states[part], index = pieces.at(self.times[part])
            places[:, part] = pieces.mode[index], pieces.j[index]
            self.samples = Filled(states, places, stop)


def _grazings(system: HybridSystem, record: Any, used: int, period: float) -> list[Grazing]:
    phase, value, acceleration = record.grazing_time[:used].T
    cycle, transition, jumps = record.grazing_place[:used].T
    x = record.grazing_state[:used].copy()
    columns = cycle * period + phase, jumps, transition, x, value, acceleration
    return [
        Grazing(float(t), int(j), system.transition_names[transition], x, float(value), float(acceleration))
        for t, j, transition, x, value, acceleration in zip(*columns, strict=True)
    ]
