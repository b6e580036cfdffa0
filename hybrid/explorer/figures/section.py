"""The section, with the basins below it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import LinearColorMapper

from hybrid.explorer.figures.base import HELD, ORBIT, START, Axes, States, blank, empty, extent_of, source
from hybrid.plot.basins import NONE_COLOUR, VIOLATES_COLOUR
from hybrid.plot.styles import COLOURS
from hybrid.simulation.labelled import Names
from hybrid.system.graph import HybridSystem

# The axes show at least this share of the extent of the arc.
LEAST = 0.02


class SectionFigure:
    """Points of the section, one colour per mode.

    Attributes
    ----------
    made
        The figure.
    """

    def __init__(self, system: HybridSystem, states: States) -> None:
        self.states = states
        self.labels = Names(system.state_names, system.units)
        self.points = states.source("mode")
        self.held, self.start, self.orbit = (states.source() for _ in range(3))
        self.basins = source("image", "x", "y", "dw", "dh")
        self.made = blank("Section", "section", 320)
        palette = [VIOLATES_COLOUR, NONE_COLOUR, *COLOURS]
        self.made.image(
            "image", "x", "y", "dw", "dh",
            source=self.basins,
            color_mapper=LinearColorMapper(palette=palette, low=-1.5, high=len(COLOURS) + 0.5),
            alpha=0.45,
        )  # fmt: skip
        colours = LinearColorMapper(palette=list(COLOURS), low=-0.5, high=len(COLOURS) - 0.5)
        first, second = states.columns[0], states.columns[-1]
        held = self.made.scatter(first, second, source=self.held, size=2, marker="square", color=HELD)
        drawn = self.made.scatter(
            first, second,
            source=self.points,
            # The browser draws squares in half the time of discs.
            marker="square",
            size=2.5,
            line_color=None,
            fill_color={"field": "mode", "transform": colours},
        )  # fmt: skip
        cross = {"line_width": 2, "color": ORBIT}
        self.in_plane = [
            held,
            drawn,
            self.made.scatter(first, second, source=self.orbit, size=12, marker="x", **cross),
            self.made.scatter(first, second, source=self.start, size=9, marker="cross", color=START),
        ]
        self.axes = Axes(self.made)
        self.chosen: tuple[str, ...] = ()
        self.extent = np.zeros((2, len(states.names)))

    def choose(self, across: str, up: str) -> None:
        """Draw these components or outputs."""
        if (across, up) == self.chosen:
            return
        self.chosen = (across, up)
        for each in self.in_plane:
            each.glyph.x, each.glyph.y = self.states.column(across), self.states.column(up)
        self.made.xaxis.axis_label, self.made.yaxis.axis_label = map(self.labels.label, (across, up))
        self._fit(anew=True)

    def _fit(self, *, anew: bool = False) -> None:
        i, j = (self.states.names.index(each) for each in self.chosen)
        ends = [(float(low), float(high)) for low, high in self.extent.T]
        self.axes.show(ends[i], ends[j], anew=anew)

    def show(self, table: np.ndarray, mode: np.ndarray, start: Any, extent: np.ndarray) -> None:
        """Draw points, rows ``(N, shown)``, with the names of their modes, and the start.

        The axes show at least a share of the ``extent (shown,)`` of the arc.
        """
        names, place = np.unique(mode, return_inverse=True)
        numbers = np.array([self.states.place_of(str(name)) % len(COLOURS) for name in names], dtype=float)
        column = numbers[place] if len(mode) else np.empty(0)
        self.points.data = {**self.states.rows(table), "mode": column}
        self.start.data = self.states.rows(start)
        if len(table):
            # No less than a share of the arc: the points of a periodic orbit differ by rounding alone.
            low, high = extent_of(self.states.whole(table))
            least = LEAST * np.nan_to_num(self.states.whole(extent)[0])
            lacking = np.maximum(least - (high - low), 0.0) / 2
            self.extent = np.array([low - lacking, high + lacking])
            self._fit()

    def tell_speed(self, seconds: float) -> None:
        """Say in the title how many points there are, and how long the run took."""
        self.made.title.text = f"Section: {len(self.points.data['t'])} points, {1000 * seconds:.0f} ms"

    def hold(self, held: bool) -> None:
        """Keep what is drawn, in grey, to compare with; or let it go."""
        if held:
            self.held.data = {name: self.points.data[name] for name in ("t", *self.states.columns)}
        else:
            empty(self.held)

    def show_orbit(self, table: Any) -> None:
        """Mark the points of an orbit, rows of what is shown; none takes the marks away."""
        self.orbit.data = self.states.rows(table)

    @property
    def plane(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Ranges of the axes, as they are shown."""
        across, up = self.axes.ends
        return across, up

    def show_basins(self, label: np.ndarray, across: np.ndarray, up: np.ndarray) -> None:
        """Paint labels ``(rows, columns)`` over the values of both components."""
        # A cell reaches half way to the next start, also at the edge.
        dx, dy = across[1] - across[0], up[1] - up[0]
        self.basins.data = {
            "image": [np.clip(label, -1, len(COLOURS)).astype(float)],
            "x": [across[0] - dx / 2],
            "y": [up[0] - dy / 2],
            "dw": [len(across) * dx],
            "dh": [len(up) * dy],
        }

    def clear_basins(self) -> None:
        """Take the basins away."""
        empty(self.basins)
