"""The points, the jumps and the smooth pieces of an arc, made of what a run wrote down when somebody asks."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import Any, NamedTuple

import attrs
import numpy as np

from hybrid.compiler.cache.loader import load_kernels
from hybrid.simulation.end import ArcEnd
from hybrid.simulation.ending import Ending
from hybrid.simulation.jumps import Jumps
from hybrid.simulation.periods import time_at
from hybrid.status import Status
from hybrid.system.graph import HybridSystem

# Dense output is evaluated at so many times per call of a kernel.
TIMES_AT_ONCE = 100_000


class StepRows(NamedTuple):
    """What kernels write of ``S`` steps, but for their polynomials: ``(S, 3)`` each, as in a record."""

    time: np.ndarray
    place: np.ndarray


class JumpRows(NamedTuple):
    """What kernels write of ``J`` jumps: ``(J, 3)``, ``(J, 5)``, ``(J, 2, n)``, and matrices of some."""

    time: np.ndarray
    place: np.ndarray
    states: np.ndarray
    saltation: np.ndarray


class Last(NamedTuple):
    """The last point of a run: time, state ``(n,)``, mode and number of jumps."""

    t: float
    x: np.ndarray
    mode: int
    jumps: int


@attrs.frozen(eq=False)
class Course:
    """The run that an arc is of: system, parameter vector, forcing period, and where and how it ended."""

    system: HybridSystem
    values: np.ndarray
    period: float
    end: Last
    ending: Ending

    @property
    def parameters(self) -> dict[str, float]:
        """The values of all parameters, by name."""
        return dict(zip(self.system.variables.parameter_names, self.values.tolist(), strict=True))

    @property
    def status(self) -> Status:
        """How the run ended."""
        return self.ending.status

    @property
    def go_on(self) -> ArcEnd:
        """Where the run ended, with its memory."""
        return self.ending.end(self.end.t, self.parameters)

    def jumps(self, rows: JumpRows) -> Jumps:
        """The jumps that a run wrote down."""
        phase, low, transversality = rows.time.T.copy()
        cycle, transition, kind, has_matrix, row = rows.place.T.copy()
        t = time_at(cycle, phase, low, self.period)
        columns = t, phase, transition, transversality, kind, has_matrix, row, rows.states, rows.saltation
        return Jumps(self.system, self.values, *columns)


@attrs.frozen(eq=False)
class Steps:
    """The points of a run that kept its steps: their starts, the states before jumps, the end.

    ``blocks`` are the polynomials, see ``Pieces``.
    """

    course: Course
    steps: StepRows
    blocks: list[np.ndarray]
    rows: JumpRows

    @cached_property
    def jumps(self) -> Jumps:
        """The jumps."""
        return self.course.jumps(self.rows)

    @cached_property
    def pieces(self) -> Pieces:
        """The smooth pieces."""
        return Pieces.of_rows(self.steps, self.blocks, self.course.period)

    @cached_property
    def t(self) -> np.ndarray:
        """Times ``(N,)``."""
        return self._in_order(self.pieces.t, self.jumps.t, self.course.end.t)

    @cached_property
    def j(self) -> np.ndarray:
        """Jump counts ``(N,)``."""
        count = len(self.rows.time)
        return self._in_order(self.steps.place[:, 2], np.arange(count), count)

    @cached_property
    def x(self) -> np.ndarray:
        """States ``(N, n)``."""
        return self._in_order(starts_of(self.blocks), self.rows.states[:, 0], self.course.end.x)

    @cached_property
    def mode(self) -> np.ndarray:
        """Indices of the modes ``(N,)``."""
        system, fired = self.course.system, self.rows.place[:, 1]
        sources = np.array([system.mode_index(tr.source) for tr in system.transitions], dtype=np.int64)
        return self._in_order(self.steps.place[:, 1], sources[fired], self.course.end.mode)

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Which points are starts of steps, and the places of those before jumps; the end is neither."""
        count = np.arange(len(self.rows.time))
        # The state before a jump follows the starts of all steps with as many jumps.
        before = np.searchsorted(self.steps.place[:, 2], count, side="right") + count
        starts = np.ones(len(self.steps.time) + len(count) + 1, dtype=bool)
        starts[before] = starts[-1] = False
        return starts, before

    def _in_order(self, of_steps: np.ndarray, of_jumps: np.ndarray, at_end: Any) -> np.ndarray:
        """A column of the points in order."""
        starts, before = self._places
        column = np.empty((len(starts), *of_steps.shape[1:]), of_steps.dtype)
        column[starts], column[before], column[-1] = of_steps, of_jumps, at_end
        return column


class Filled(NamedTuple):
    """States ``(N, n)``, and modes and jump counts ``(2, N)``, of which the first ``known`` are filled."""

    states: np.ndarray
    places: np.ndarray
    known: int


@attrs.frozen(eq=False)
class Samples:
    """The points of a run that kept samples at ``times``: those before its end, and those on the end.

    The ones on the end are those after the last jump.
    """

    course: Course
    times: np.ndarray
    before: Filled | None
    rows: JumpRows | None

    pieces = None

    @cached_property
    def jumps(self) -> Jumps | None:
        """The jumps, if they were kept."""
        return None if self.rows is None else self.course.jumps(self.rows)

    @property
    def t(self) -> np.ndarray:
        """Times ``(N,)``."""
        return self.times[: self._filled.known]

    @property
    def j(self) -> np.ndarray:
        """Jump counts ``(N,)``."""
        return self._filled.places[1, : self._filled.known]

    @property
    def x(self) -> np.ndarray:
        """States ``(N, n)``."""
        return self._filled.states[: self._filled.known]

    @property
    def mode(self) -> np.ndarray:
        """Indices of the modes ``(N,)``."""
        return self._filled.places[0, : self._filled.known]

    @cached_property
    def _filled(self) -> Filled:
        """All samples of the run."""
        end = self.course.end
        states, places, known = self.before or unfilled(len(self.times), len(end.x))
        stop = int(self.times.searchsorted(end.t, side="right"))
        last = slice(known, stop)
        states[last] = end.x
        places[0, last], places[1, last] = end.mode, end.jumps
        return Filled(states, places, stop)


def starts_of(blocks: Sequence[np.ndarray]) -> np.ndarray:
    """States at the starts of the steps, ``(S, n)``, from their polynomials."""
    return np.concatenate([block[:, 0, :-1] for block in blocks])


def unfilled(samples: int, dimension: int) -> Filled:
    """Room for samples."""
    return Filled(np.empty((samples, dimension)), np.empty((2, samples), dtype=np.int64), 0)


@cache
def no_jumps(dimension: int) -> JumpRows:
    """No jumps; any number of arcs can have the same."""
    n = dimension
    place = np.empty((0, 5), dtype=np.int64)
    return JumpRows(np.empty((0, 3)), place, np.empty((0, 2, n)), np.empty((0, n, n)))


def joined(chunks: Sequence[tuple[Any, ...]]) -> tuple[np.ndarray, ...]:
    """Concatenate the columns of rows of arrays."""
    if len(chunks) == 1:
        return chunks[0]
    return tuple(np.concatenate(column) for column in zip(*chunks, strict=True))


@attrs.frozen(eq=False)
class Pieces:
    """The smooth steps of a run: ``S`` polynomials, each in a variable on ``[0, 1]``.

    Attributes
    ----------
    blocks
        The polynomials of successive steps, ``(steps of a block, d + 1, n + 1)`` each: coefficients of
        ``1, theta, theta^2, ...`` of the state and, in the last column, of the time since the start of the
        step. In a desingularised mode the time is not proportional to ``theta``.
    t, low, h
        Start of each step, the rounding error of that start, and the length of the step, ``(S,)``.
    mode, j
        Mode index and jump count of each, ``(S,)``.
    """

    blocks: list[np.ndarray]
    t: np.ndarray
    low: np.ndarray
    h: np.ndarray
    mode: np.ndarray
    j: np.ndarray

    @classmethod
    def of_rows(cls, rows: StepRows, blocks: list[np.ndarray], period: float) -> Pieces:
        """The pieces from what kernels wrote."""
        phase, low, length = rows.time.T.copy()
        cycle, mode, jumps = rows.place.T.copy()
        return cls(blocks, time_at(cycle, phase, low, period), low, length, mode, jumps)

    @property
    def coefficients(self) -> np.ndarray:
        """The polynomials in one array, ``(S, d + 1, n + 1)``.

        They are joined when somebody first asks: of a long run, that takes longer than the run.
        """
        if len(self.blocks) > 1:
            self.blocks[:] = [np.concatenate(self.blocks)]
        return self.blocks[0]

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States ``(len(times), n)``, and the steps they are taken from; at a jump, the state after it."""
        coefficients = self.coefficients
        states = np.empty((len(times), coefficients.shape[2] - 1))
        index = np.empty(len(times), dtype=np.int64)
        kernel = load_kernels("hybrid.kernels.steps.dense").states_at
        times = np.ascontiguousarray(times)
        # Between two calls Ctrl-C is heard.
        for first in range(0, len(times), TIMES_AT_ONCE):
            part = slice(first, first + TIMES_AT_ONCE)
            kernel(times[part], self.t, self.low, self.h, coefficients, states[part], index[part])
        return states, index
