"""What the figures share: an empty figure, and sources of states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, Span
from bokeh.plotting import figure

TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
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


def look_at(made: Any, renderers: Sequence[Any]) -> None:
    """Let the axes follow these renderers alone."""
    for axis in (made.x_range, made.y_range):
        axis.renderers = list(renderers)


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
