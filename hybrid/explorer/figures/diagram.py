"""The bifurcation diagram with the largest exponent below, and the branch of an orbit on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import HoverTool
from bokeh.plotting import figure

from hybrid.explorer.figures.base import States, blank, empty, source, zero_line
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.kinds import KINDS
from hybrid.orbits.labelled import table_at
from hybrid.plot.styles import COLOURS
from hybrid.simulation.labelled import Names
from hybrid.system.graph import HybridSystem

# Bokeh's names of the markers that kinds of bifurcations have in pictures; it lacks some.
MARKERS = {
    "o": "circle", "s": "square", "D": "diamond", "*": "star", "P": "plus", "h": "hex",
    "v": "inverted_triangle", "^": "triangle",
}  # fmt: skip
OTHER = "x"


class DiagramFigures:
    """Section over a parameter, and the largest exponent.

    Attributes
    ----------
    above, pointer, below
        The figures, with one axis of the parameter: diagram, mark of the present value, exponent.
    """

    def __init__(self, system: HybridSystem, states: States) -> None:
        self.states = states
        self.labels = Names(system.state_names, system.units)
        self.points = states.source("parameter")
        self.largest = source("parameter", "value", "low", "high")
        self.stable, self.unstable = (states.source("parameter") for _ in range(2))
        self.bifurcations = states.source("parameter", "kind", "marker")
        self.above = blank("Bifurcation diagram", "diagram", 300)
        self.below = blank("", "largest", 170, x_range=self.above.x_range)
        component, colour = states.columns[0], COLOURS[0]
        marks = self.above.scatter(
            "parameter", component, source=self.bifurcations, marker="marker", size=11, color=COLOURS[3]
        )
        self.in_plane = [
            self.above.scatter(
                "parameter", component,
                source=self.points, size=1.5, marker="square", fill_color="#404040", line_color=None,
            ),
            self.above.line("parameter", component, source=self.stable, color=colour, line_width=2.5),
            self.above.line(
                "parameter", component,
                source=self.unstable, color=COLOURS[1], line_width=2, line_dash="dashed",
            ),
            marks,
        ]  # fmt: skip
        for axis in (self.above.x_range, self.above.y_range):
            axis.renderers = self.in_plane[:3]
        self.above.add_tools(
            HoverTool(renderers=[marks], tooltips=[("", "@kind"), ("at", "@parameter{0.000000}")])
        )
        self.below.add_layout(zero_line())
        self.below.scatter("parameter", "value", source=self.largest, size=3, color=colour)
        self.below.segment(
            "parameter", "low", "parameter", "high", source=self.largest, color=colour, alpha=0.5
        )
        self.below.yaxis.axis_label = "largest exponent"
        # A figure of its own: the mark moves with each drag, and the diagram takes long to draw.
        self.here = source("parameter", "y")
        self.pointer = figure(
            height=22, name="pointer", sizing_mode="stretch_width", toolbar_location=None,
            x_range=self.above.x_range, y_range=(0, 1), outline_line_color=None, tools="",
        )  # fmt: skip
        self.pointer.xaxis.visible = self.pointer.yaxis.visible = self.pointer.grid.visible = False
        self.pointer.min_border = 0
        self.pointer.scatter(
            "parameter", "y", source=self.here, marker="inverted_triangle", size=14, color=COLOURS[2]
        )
        # The frames of all three must stand one above the other.
        for made in (self.above, self.pointer, self.below):
            made.min_border_left, made.min_border_right = 70, 10

    def choose(self, component: str, over: str) -> None:
        """Draw this component or output over this parameter."""
        for each in self.in_plane:
            each.glyph.y = self.states.column(component)
        self.above.yaxis.axis_label = self.labels.label(component)
        self.below.xaxis.axis_label = self.labels.label(over) if over else ""

    def show_here(self, value: float) -> None:
        """Mark the value that the parameter has."""
        self.here.data = {"parameter": [value], "y": [0.5]}

    def begin(self) -> None:
        """Begin another diagram."""
        empty(self.points, self.largest)

    def add(self, name: str, chart: Any) -> None:
        """Add columns from a chart over the parameter; one in which every column failed has none."""
        if "section" not in chart:
            return
        values, points = chart[name].values, chart.section.values
        flat = points.reshape(-1, points.shape[2])
        told = np.isfinite(flat).all(axis=1)
        over = np.repeat(values, points.shape[1])[told]
        # The chart has the output of its axis alone.
        outputs = chart.output.values if "section_outputs" in chart else ()
        more = [_output(chart, each, outputs)[told] for each in self.states.shown[points.shape[2] :]]
        self.points.stream({**self.states.rows(np.column_stack([flat[told], *more])), "parameter": over})
        largest, error = chart.exponents.values[:, 0], chart.standard_error.values[:, 0]
        columns = {
            "parameter": values,
            "value": largest,
            "low": largest - error,
            "high": largest + error,
        }
        told = np.isfinite(largest)
        self.largest.stream({name: column[told] for name, column in columns.items()})

    def show_branch(self, branch: Branch | None) -> None:
        """Draw a branch with its bifurcations; None takes it away."""
        empty(self.stable, self.unstable, self.bifurcations)
        if branch is None:
            return
        stable = np.asarray(branch.stable, dtype=bool)
        for made, part in ((self.stable, stable), (self.unstable, ~stable)):
            # A part reaches to the next one, so that the line has no gap.
            reaching = part.copy()
            reaching[1:] |= part[:-1]
            table = np.where(reaching[:, None], branch._table(self.states.shown), np.nan)
            made.data = {**self.states.rows(table), "parameter": branch.parameter}
        found = branch.bifurcations
        if found:
            self.bifurcations.data = {
                **self.states.rows(
                    table_at(branch.system, self.states.shown, [each.orbit for each in found])
                ),
                "parameter": [each.value for each in found],
                "kind": [each.kind for each in found],
                "marker": [_marker(each.kind) for each in found],
            }


def _output(chart: Any, name: str, outputs: Any) -> np.ndarray:
    """An output at all points of a chart's section, ``(N,)``; nan if the chart does not have it."""
    if name not in outputs:
        return np.full(chart.section.shape[0] * chart.section.shape[1], np.nan)
    return np.ravel(chart.section_outputs.sel(output=name).values)


def _marker(kind: str) -> str:
    return MARKERS.get(KINDS[kind].marker, OTHER) if kind in KINDS else OTHER
