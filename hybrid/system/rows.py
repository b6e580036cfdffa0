"""The row of a schedule that fires, as model functions see it while they are called."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError


@attrs.frozen(eq=False)
class Firing:
    """A row that fires.

    Attributes
    ----------
    row
        The number of the row, or what stands for it while a function is traced.
    entry
        The entry of a column ``(rows,)`` in the row.
    schedules
        Those whose columns may be read; None for all.
    """

    row: Any
    entry: Callable[[np.ndarray], Any]
    schedules: tuple[Any, ...] | None = None

    def reads(self, schedule: Any) -> bool:
        """Whether the columns of a schedule may be read; it may have been made anew, with the same ones."""
        return self.schedules is None or any(each.columns is schedule.columns for each in self.schedules)


def plain_firing(row: int, schedules: tuple[Any, ...] | None = None) -> Firing:
    """A row by its number."""
    return Firing(float(row), lambda column: float(column[row]), schedules)


_FIRING: ContextVar[Firing | None] = ContextVar("_FIRING", default=None)


@contextmanager
def fires(firing: Firing) -> Iterator[None]:
    """Let model functions see this row within the block."""
    token = _FIRING.set(firing)
    try:
        yield
    finally:
        _FIRING.reset(token)


def row_that_fires() -> Any:
    """The number of the row; 0 where none fires."""
    firing = _FIRING.get()
    return 0.0 if firing is None else firing.row


def entry_that_fires(schedule: Any, name: str, column: np.ndarray) -> Any:
    """The entry of a schedule's column in the row that fires.

    Raises
    ------
    ModelError
        If no row of this schedule fires.
    """
    firing = _FIRING.get()
    if firing is None or not firing.reads(schedule):
        raise ModelError(
            f"At.table: column {name!r} has a value only where a row fires: in the reset, and in the "
            "condition (when=), of a transition whose guard is this schedule. The whole column is "
            f"columns[{name!r}]."
        )
    return firing.entry(column)
