"""The arc in the plane of two components or outputs, and one of them over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.explorer.figures.base import (
    HELD,
    JUMP,
    ORBIT,
    START,
    Axes,
    States,
    blank,
    empty,
    extent_of,
    source,
)
from hybrid.plot.arcs import curves
from hybrid.plot.styles import colour_of
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.labelled import Names
from hybrid.system.graph import HybridSystem


class ArcFigures:
    """Phase portrait and time series, one colour per mode.

    Attributes
    ----------
    portrait, series
        The figures.
    """

    def __init__(self, system: HybridSystem, states: States) -> None:
        self.states = states
        self.labels = Names(system.state_names, system.units)
        self.curves: dict[int, Any] = {}
        self.held, self.start, self.orbit, self.at = (states.source() for _ in range(4))
        ends = [f"{end}{i}" for end in ("a", "b") for i in range(len(states.columns))]
        self.jumps = source("t", *ends)
        self.portrait = blank("Phase portrait", "portrait", 320)
        self.series = blank("Time series", "series", 240)
        self.series.xaxis.axis_label = f"since the begin of the arc, {self.labels.label('t')}"
        self.begin = self.length = 0.0
        first, second = states.columns[0], states.columns[-1]
        point = {"size": 10, "color": "white", "line_color": "black", "line_width": 2}
        # The renderers that follow the choice of axes.
        self.in_plane = [
            self.portrait.line(first, second, source=self.held, color=HELD),
            self.portrait.line(first, second, source=self.orbit, color=ORBIT, line_width=2.5, alpha=0.75),
            self.portrait.scatter(first, second, source=self.start, size=9, marker="cross", color=START),
            self.portrait.scatter(first, second, source=self.at, **point),
        ]
        self.over_time = [self.series.scatter("t", first, source=self.at, **point)]
        self.plane_jumps = self.portrait.segment(
            "a0", "a0", "b0", "b0", source=self.jumps, color=JUMP, line_dash="dashed"
        )
        self.time_jumps = self.series.segment(
            "t", "a0", "t", "b0", source=self.jumps, color=JUMP, line_dash="dotted"
        )
        self.portrait_axes, self.series_axes = Axes(self.portrait), Axes(self.series)
        self.chosen: tuple[str, ...] = ()
        self.extent = np.zeros((2, len(states.names)))

    def choose(self, across: str, up: str, component: str) -> None:
        """Draw these components or outputs."""
        if (across, up, component) == self.chosen:
            return
        self.chosen = (across, up, component)
        for each in self.in_plane:
            each.glyph.x, each.glyph.y = self.states.column(across), self.states.column(up)
        for each in self.over_time:
            each.glyph.y = self.states.column(component)
        i, j, k = (self.states.names.index(each) for each in (across, up, component))
        glyph = self.plane_jumps.glyph
        glyph.x0, glyph.y0, glyph.x1, glyph.y1 = f"a{i}", f"a{j}", f"b{i}", f"b{j}"
        self.time_jumps.glyph.y0, self.time_jumps.glyph.y1 = f"a{k}", f"b{k}"
        self.portrait.xaxis.axis_label = self.labels.label(across)
        self.portrait.yaxis.axis_label = self.labels.label(up)
        self.series.yaxis.axis_label = self.labels.label(component)
        self._fit(anew=True)

    def _fit(self, *, anew: bool = False) -> None:
        """Show the whole arc; the start may be far away from it."""
        i, j, k = (self.states.names.index(each) for each in self.chosen)
        ends = [(float(low), float(high)) for low, high in self.extent.T]
        self.portrait_axes.show(ends[i], ends[j], anew=anew)
        self.series_axes.show((0.0, self.length), ends[k], anew=anew)

    def show(self, arc: HybridArc, start: Any) -> None:
        """Draw an arc, and the start, a row of what is shown."""
        names = arc.system.mode_names
        drawn = {
            self.states.place_of(names[mode]): lines for mode, lines in curves(arc, self.states.shown).items()
        }
        self.begin = float(arc.t[0]) if len(arc.t) else 0.0
        self.length = float(arc.t[-1]) - self.begin if len(arc.t) else 0.0
        for mode in {*self.curves, *drawn}:
            t, table = drawn.get(mode, (np.empty(0), np.empty(0)))
            self._curve_of(mode).data = self.states.rows(table, t - self.begin)
        if drawn:
            self.extent = extent_of(self.states.whole(np.concatenate([table for _, table in drawn.values()])))
        self._fit()
        jumps = arc.jumps
        columns = {"t": np.asarray(jumps.t, dtype=float) - self.begin}
        for end, side in (("a", jumps.before), ("b", jumps.after)):
            table = self.states.whole(np.column_stack([side(name) for name in self.states.shown]))
            columns |= {f"{end}{i}": np.ascontiguousarray(each) for i, each in enumerate(table.T)}
        self.jumps.data = columns
        self.start.data = self.states.rows(start)

    def _curve_of(self, mode: int) -> Any:
        """The source of the parts of the arc in a mode; each has a line in both figures."""
        if mode not in self.curves:
            made = self.curves[mode] = self.states.source()
            options = {"source": made, "color": colour_of(mode), "line_width": 1.6}
            across, up = self.in_plane[0].glyph.x, self.in_plane[0].glyph.y
            names = list(self.states.modes)
            several = len(names) > 1
            legend = {"legend_label": names[mode]} if several else {}
            self.in_plane.append(self.portrait.line(across, up, **options, **legend))
            self.over_time.append(self.series.line("t", self.over_time[0].glyph.y, **options))
            if several:
                legends = self.portrait.legend
                legends.label_text_font_size, legends.background_fill_alpha = "8pt", 0.6
                legends.padding = legends.margin = 3
        return self.curves[mode]

    def hold(self, held: bool) -> None:
        """Keep what is drawn, in grey, to compare with; or let it go."""
        if not held:
            empty(self.held)
            return
        parts = [each.data for each in (self.held, *self.curves.values())]
        self.held.data = {
            name: np.concatenate([np.asarray(part[name], dtype=float) for part in parts])
            for name in ("t", *self.states.columns)
        }

    def show_orbit(self, arc: HybridArc | None) -> None:
        """Draw an orbit on top; None takes it away."""
        if arc is None:
            empty(self.orbit)
            return
        drawn = list(curves(arc, self.states.shown).values())
        x, t = np.concatenate([x for _, x in drawn]), np.concatenate([t for t, _ in drawn])
        self.orbit.data = self.states.rows(x, t)

    def show_at(self, t: float, row: Any) -> None:
        """Move the point that runs along the arc to a row of what is shown."""
        self.at.data = self.states.rows(row, [t - self.begin])
