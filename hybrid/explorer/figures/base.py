"""What the figures share: an empty figure, and sources of components and outputs."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, CustomLabelingPolicy, Range1d, Span
from bokeh.plotting import figure

from hybrid.system.graph import HybridSystem

TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
# A range is this share wider than what it shows, and becomes narrower when so little of it is used.
MARGIN, LEAST_USED = 0.06, 0.5
# Pixels between the labels of two ticks.
LABELS_APART = 8
# Every second label of an axis is left out, or two of three, and so on, until none runs into the next one.
EVERY_OTHER = """
    const all = [...indices];
    const near = (step) => all.some((each, i) => i >= step && distance(all[i - step], each) < apart);
    let step = 1;
    while (step < all.length && near(step)) step += 1;
    return all.filter((_, i) => i % step === 0);
"""
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
    made.axis.major_label_policy = CustomLabelingPolicy(args={"apart": LABELS_APART}, code=EVERY_OTHER)
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


def extent_of(table: np.ndarray) -> np.ndarray:
    """Least and largest finite value of each column, ``(2, columns)``; zeros where there is none."""
    return np.array([ends_of(column) for column in table.T]).reshape(-1, 2).T


class States:
    """Sources of what a system has names for: its components, and its outputs.

    Every name is a column, so that another choice of axes needs no other data. But an output is computed only
    while it is ``shown``; until then its column is nan.
    """

    def __init__(self, system: HybridSystem) -> None:
        self.names = system.quantity_names
        self.columns = [f"x{i}" for i in range(len(self.names))]
        self.own = self.shown = system.state_names
        self.modes = {name: i for i, name in enumerate(system.mode_names)}

    def place_of(self, mode: str) -> int:
        """The place of a mode among those seen, which tells its colour: a system may grow further ones."""
        return self.modes.setdefault(mode, len(self.modes))

    def choose(self, *chosen: str) -> bool:
        """Show these names, and all components; whether there is an output among them that is new."""
        before = self.shown
        self.shown = (*self.own, *(name for name in self.names[len(self.own) :] if name in chosen))
        return not set(self.shown) <= set(before)

    def column(self, name: str) -> str:
        """The column of a name."""
        return self.columns[self.names.index(name)]

    def source(self, *more: str) -> ColumnDataSource:
        """A source without rows: the time ``t``, a column for every name, and more columns."""
        return source("t", *self.columns, *more)

    def whole(self, table: Any) -> np.ndarray:
        """Rows of what is shown, ``(N, shown)``, as rows of all names, ``(N, names)``."""
        given = np.asarray(table, dtype=float).reshape(-1, len(self.shown))
        found = np.full((len(given), len(self.names)), np.nan)
        found[:, [self.names.index(name) for name in self.shown]] = given
        return found

    def rows(self, table: Any, t: Any = None) -> dict[str, Any]:
        """Rows of what is shown, ``(N, shown)``, and their times, as columns."""
        whole = self.whole(table)
        times = np.zeros(len(whole)) if t is None else np.asarray(t, dtype=float)
        columns = zip(self.columns, np.ascontiguousarray(whole.T), strict=True)
        return {"t": times, **dict(columns)}
