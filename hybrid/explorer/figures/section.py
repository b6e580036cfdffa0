"""The section, with the basins below it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import LinearColorMapper

from hybrid.explorer.figures.base import HELD, ORBIT, START, States, blank, empty, look_at, source
from hybrid.plot.basins import NONE_COLOUR, VIOLATES_COLOUR
from hybrid.plot.style import COLOURS, colour_of
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
        self.system, self.states = system, states
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
        count = len(system.mode_names) + 1
        colours = LinearColorMapper(palette=[colour_of(i) for i in range(count)], low=-0.5, high=count - 0.5)
        first, second = states.components[0], states.components[-1]
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
        # Two points that nobody sees keep the axes from looking at the rounding of a periodic orbit.
        self.least = states.source()
        self.in_plane.append(self.made.scatter(first, second, source=self.least, alpha=0.0))
        look_at(self.made, [drawn, self.in_plane[-1]])

    def choose(self, across: str, up: str) -> None:
        """Draw these components."""
        for each in self.in_plane:
            each.glyph.x, each.glyph.y = self.states.column(across), self.states.column(up)
        self.made.xaxis.axis_label, self.made.yaxis.axis_label = map(self.labels.label, (across, up))

    def show(self, x: np.ndarray, mode: np.ndarray, start: Any, extent: np.ndarray) -> None:
        """Draw points ``(N, n)`` with the names of their modes, and the start.

        The axes show at least a share of the ``extent (n,)`` of the arc.
        """
        names, place = np.unique(mode, return_inverse=True)
        numbers = np.array([self.system.mode_index(str(name)) for name in names], dtype=float)
        column = numbers[place] if len(mode) else np.empty(0)
        self.points.data = {**self.states.rows(x), "mode": column}
        self.start.data = self.states.rows(start)
        if len(x):
            middle, half = (x.min(axis=0) + x.max(axis=0)) / 2, LEAST * extent / 2
            self.least.data = self.states.rows([middle - half, middle + half])

    def hold(self, held: bool) -> None:
        """Keep what is drawn, in grey, to compare with; or let it go."""
        if held:
            self.held.data = {name: self.points.data[name] for name in ("t", *self.states.components)}
        else:
            empty(self.held)

    def show_orbit(self, x: Any) -> None:
        """Mark the points of an orbit; none takes the marks away."""
        self.orbit.data = self.states.rows(x)

    @property
    def plane(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Ranges of the axes: as the browser shows them, or those of the points if none has shown them."""
        glyph = self.in_plane[1].glyph
        across, up = (
            self._ends(axis, column)
            for axis, column in ((self.made.x_range, glyph.x), (self.made.y_range, glyph.y))
        )
        return across, up

    def _ends(self, axis: Any, column: str) -> tuple[float, float]:
        ends = (float(axis.start), float(axis.end))
        if np.isfinite(ends).all() and ends[0] < ends[1]:
            return ends
        found = np.asarray(self.points.data[column], dtype=float)
        low, high = (float(found.min()), float(found.max())) if len(found) else (-1.0, 1.0)
        margin = 0.1 * (high - low) or 1.0
        return low - margin, high + margin

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
