"""What a sweep has to compute: a task, its points, and which of them are missing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice
from time import perf_counter
from typing import Any

import attrs
import numpy as np

from hybrid.simulation.crew import TOGETHER
from hybrid.sweep.outcome import Batch, Part, attempt, attempts
from hybrid.sweep.points import Points

# Seconds between two parts in memory, and on disk at least; a long sweep writes larger parts, up to a limit.
BETWEEN_REPORTS = 0.1
BETWEEN_WRITES, SHARE_OF_A_WRITE, LONGEST_BETWEEN_WRITES = 1.0, 0.02, 30.0


@attrs.frozen(eq=False)
class Job:
    """The points of a sweep that are missing.

    A task with an attribute ``along``, the name of an axis, has points that depend on the one before on their
    line: ``task.carry(point, state)`` gives the state for the next point, and ``task(point, state)`` the
    result. The state is None at the start of a line.

    Attributes
    ----------
    rows
        Indices of the missing points in order.
    lines
        For a task with ``along``: rows ``(lines, length)``, of which some may not be missing.
    """

    task: Callable[..., Any]
    points: Points
    rows: np.ndarray
    lines: np.ndarray | None

    def units(self) -> list[list[int]]:
        """Rows to be computed one after the other: single points, or lines up to the last missing point."""
        if self.lines is None:
            return [[row] for row in self.rows.tolist()]
        missing = np.zeros(len(self.points), dtype=bool)
        missing[self.rows] = True
        wanted = missing[self.lines]
        lengths = wanted.shape[1] - np.argmax(wanted[:, ::-1], axis=1)
        return [
            line[:length].tolist()
            for line, length, any_wanted in zip(self.lines, lengths, wanted.any(axis=1), strict=True)
            if any_wanted
        ]


def carried(task: Any, point: dict[str, float], state: Any) -> Any:
    """The state for the next point of a line; None, which is a new start, if the task fails here."""
    try:
        return task.carry(point, state)
    except Exception:  # the point itself reports the error
        return None


class Rhythm:
    """When a worker passes on what it has: rarely enough to cost nothing."""

    def __init__(self, stored: bool) -> None:
        self.stored = stored
        self.begin = self.last = perf_counter()

    def is_due(self) -> bool:
        """Whether the time has come; if so, the next interval begins."""
        now = perf_counter()
        wait = BETWEEN_REPORTS
        if self.stored:
            wait = max(BETWEEN_WRITES, min(LONGEST_BETWEEN_WRITES, SHARE_OF_A_WRITE * (now - self.begin)))
        if now - self.last < wait:
            return False
        self.last = now
        return True


def computed(
    task: Any,
    names: tuple[str, ...],
    lines: list[tuple[list[int], list[list[float]]]],
    wanted: set[int] | None,
    is_stopped: Callable[[], bool],
) -> Iterator[Part]:
    """Compute lines of points one after the other, in a worker; ``wanted`` are the rows that are missing."""
    batch = Batch()
    if wanted is None and hasattr(task, "together"):
        every = iter([pair for rows, values in lines for pair in zip(rows, values, strict=True)])
        while some := list(islice(every, TOGETHER)):
            points = [dict(zip(names, value, strict=True)) for _, value in some]
            found = attempts(task, points, [None] * len(points))
            if is_stopped():
                break
            for (row, _), each in zip(some, found, strict=True):
                batch.add(row, each)
        yield from batch.taken()
        return
    for rows, values in lines:
        state = None
        for row, value in zip(rows, values, strict=True):
            point = dict(zip(names, value, strict=True))
            if wanted is None:
                outcome = attempt(task, point)
            elif row in wanted:
                outcome = attempt(task, point, state)
            else:
                outcome = None
            if wanted is not None and row != rows[-1]:
                state = carried(task, point, state)
            if is_stopped():
                yield from batch.taken()
                return
            if outcome is not None:
                batch.add(row, outcome)
    yield from batch.taken()
