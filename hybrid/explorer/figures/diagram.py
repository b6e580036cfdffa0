"""The bifurcation diagram with the largest exponent below, and the branch of an orbit on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from bokeh.models import HoverTool, Span

from hybrid.explorer.figures.base import States, blank, empty, look_at, source, zero_line
from hybrid.orbits.continuation.branch import Branch
from hybrid.plot.style import COLOURS
from hybrid.simulation.labelled import Names
from hybrid.system.graph import HybridSystem

# Markers by kind of bifurcation, as in hybrid.plot.
MARKERS = {
    "fold": "circle",
    "flip": "square",
    "torus": "diamond",
    "branch point": "plus",
    "grazing": "inverted_triangle",
    "crossing-sliding": "triangle",
}
OTHER = "x"


class DiagramFigures:
    """Section over a parameter, and the largest exponent.

    Attributes
    ----------
    above, below
        The figures, with one axis of the parameter.
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
        component, colour = states.components[0], COLOURS[0]
        marks = self.above.scatter(
            "parameter", component, source=self.bifurcations, marker="marker", size=11, color=COLOURS[3]
        )
        self.in_plane = [
            self.above.scatter(
                "parameter", component, source=self.points, size=2, marker="square", color="#404040"
            ),
            self.above.line("parameter", component, source=self.stable, color=colour, line_width=2.5),
            self.above.line(
                "parameter", component,
                source=self.unstable, color=COLOURS[1], line_width=2, line_dash="dashed",
            ),
            marks,
        ]  # fmt: skip
        look_at(self.above, self.in_plane[:3])
        self.above.add_tools(
            HoverTool(renderers=[marks], tooltips=[("", "@kind"), ("at", "@parameter{0.000000}")])
        )
        self.below.add_layout(zero_line())
        self.below.scatter("parameter", "value", source=self.largest, size=3, color=colour)
        self.below.segment(
            "parameter", "low", "parameter", "high", source=self.largest, color=colour, alpha=0.5
        )
        self.below.yaxis.axis_label = "largest exponent"
        self.here = []
        for made in (self.above, self.below):
            span = Span(location=None, dimension="height", line_color=COLOURS[2], line_width=2)
            self.here.append(span)
            made.add_layout(span)

    def choose(self, component: str, over: str) -> None:
        """Draw this component over this parameter."""
        for each in self.in_plane:
            each.glyph.y = self.states.column(component)
        self.above.yaxis.axis_label = self.labels.label(component)
        self.below.xaxis.axis_label = self.labels.label(over) if over else ""

    def show_here(self, value: float) -> None:
        """Mark the value that the parameter has."""
        for span in self.here:
            span.location = value

    def begin(self) -> None:
        """Begin another diagram."""
        empty(self.points, self.largest)

    def add(self, name: str, chart: Any) -> None:
        """Add columns from a chart over the parameter."""
        values, points = chart[name].values, chart.section.values
        flat = points.reshape(-1, points.shape[2])
        told = np.isfinite(flat).all(axis=1)
        over = np.repeat(values, points.shape[1])[told]
        self.points.stream({**self.states.rows(flat[told]), "parameter": over})
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
            x = np.where(reaching[:, None], branch.x0, np.nan)
            made.data = {**self.states.rows(x), "parameter": branch.parameter}
        found = branch.bifurcations
        if found:
            self.bifurcations.data = {
                **self.states.rows([each.orbit.x0 for each in found]),
                "parameter": [each.value for each in found],
                "kind": [each.kind for each in found],
                "marker": [MARKERS.get(each.kind, OTHER) for each in found],
            }
