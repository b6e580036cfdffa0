"""What the figures share: an empty figure, and sources of states."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, Range1d, Span
from bokeh.plotting import figure

TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
# A range is this share wider than what it shows, and becomes narrower when so little of it is used.
MARGIN, LEAST_USED = 0.06, 0.5
HELD, JUMP, ORBIT, START = "#B0B0B0", "#595959", "#000000", "#000000"


def blank(title: str, name: str, height: int, **options: Any) -> Any:
    """A figure without contents; ``name`` finds it in the document."""
    made = figure(
        title=title,
        name=name,
        height=height,
        sizing_mode="stretch_width",
        tools=TOOLS,
        active_drag="pan",
        active_scroll=None,
        **options,
    )
    made.toolbar.logo = None
    made.toolbar.autohide = True
    made.grid.grid_line_alpha = 0.4
    return made


def source(*columns: str) -> ColumnDataSource:
    """An empty source with these columns."""
    return ColumnDataSource({name: [] for name in columns})


def empty(*sources: ColumnDataSource) -> None:
    """Take all rows away."""
    for each in sources:
        each.data = {name: [] for name in each.data}


def zero_line() -> Span:
    """A dashed line across the figure at zero."""
    return Span(location=0.0, dimension="width", line_color=JUMP, line_dash="dashed")


class Axes:
    """The ranges of a figure, which follow what is shown until a visitor pans or zooms.

    Ranges that the browser finds would let it draw twice, and labels that change their width would let it lay
    out the page anew: a range grows with what is shown, and shrinks when less than half of it is used.
    """

    def __init__(self, made: Any) -> None:
        self.ranges = (Range1d(-1.0, 1.0), Range1d(-1.0, 1.0))
        made.x_range, made.y_range = self.ranges
        self.held = False
        self.wanted: tuple[tuple[float, float], ...] = ((-1.0, 1.0), (-1.0, 1.0))
        made.on_event("rangesupdate", lambda event: self._moved())
        made.on_event("reset", lambda event: self._release())

    def show(self, *ends: tuple[float, float], anew: bool = False) -> None:
        """Show at least these ends ``(low, high)`` across and up; ``anew``, and no more than these."""
        self.wanted = tuple((low, high) if low < high else (low - 1.0, high + 1.0) for low, high in ends)
        if anew:
            self.held = False
        if self.held:
            return
        for axis, (low, high) in zip(self.ranges, self.wanted, strict=True):
            used = (high - low) / (axis.end - axis.start)
            if anew or low < axis.start or high > axis.end or used < LEAST_USED:
                margin = MARGIN * (high - low)
                axis.start, axis.end = low - margin, high + margin

    def _moved(self) -> None:
        self.held = True

    def _release(self) -> None:
        self.show(*self.wanted, anew=True)

    @property
    def ends(self) -> tuple[tuple[float, float], ...]:
        """What is shown, ``(low, high)`` across and up."""
        return tuple((float(axis.start), float(axis.end)) for axis in self.ranges)


def ends_of(*columns: Any) -> tuple[float, float]:
    """Least and largest finite value of some columns; zeros if there is none."""
    values = np.concatenate([np.ravel(np.asarray(each, dtype=float)) for each in columns])
    values = values[np.isfinite(values)]
    return (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)


class States:
    """Sources of states of a system.

    Every component is a column, so that another choice of axes needs no other data.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.components = [f"x{i}" for i in range(len(names))]

    def column(self, name: str) -> str:
        """The column of a component."""
        return self.components[self.names.index(name)]

    def source(self, *more: str) -> ColumnDataSource:
        """A source without rows: the time ``t``, the components, and more columns."""
        return source("t", *self.components, *more)

    def rows(self, x: Any, t: Any = None) -> dict[str, Any]:
        """States ``(N, n)`` and their times as columns."""
        states = np.asarray(x, dtype=float).reshape(-1, len(self.names))
        times = np.zeros(len(states)) if t is None else np.asarray(t, dtype=float)
        columns = zip(self.components, np.ascontiguousarray(states.T), strict=True)
        return {"t": times, **dict(columns)}
