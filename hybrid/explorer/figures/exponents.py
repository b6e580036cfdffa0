"""Lyapunov exponents with their errors, and multipliers beside the unit circle."""

from __future__ import annotations

import numpy as np
from bokeh.models import HoverTool, Range1d, Whisker

from hybrid.explorer.figures.base import JUMP, Axes, blank, empty, ends_of, source, zero_line
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.plot.styles import COLOURS
from hybrid.system.graph import HybridSystem
from lyapunov.spectrum import LyapunovSpectrum


class ExponentsFigure:
    """Exponents with their standard errors.

    Attributes
    ----------
    made
        The figure.
    """

    def __init__(self, system: HybridSystem) -> None:
        self.values = source("index", "value", "low", "high", "text")
        self.made = blank("Lyapunov exponents", "exponents", 240)
        self.made.add_layout(zero_line())
        self.axes = Axes(self.made)
        self.index = (0.7, system.tangent_dimension + 0.3)
        self.made.scatter("index", "value", source=self.values, size=8, color=COLOURS[0])
        self.made.add_layout(Whisker(base="index", lower="low", upper="high", source=self.values))
        self.made.add_tools(HoverTool(tooltips=[("exponent", "@text")]))
        self.made.xaxis.ticker = list(range(1, system.tangent_dimension + 1))
        self.made.xaxis.axis_label = "exponent"
        unit = system.units.get("t")
        self.made.yaxis.axis_label = f"1/{unit}" if unit else "per unit of time"

    def show(self, spectrum: LyapunovSpectrum) -> None:
        """Draw a spectrum."""
        values, error = spectrum.exponents, spectrum.standard_error
        # The axis holds zero, since the sign counts.
        self.axes.show(self.index, ends_of(values - error, values + error, [0.0]))
        self.values.data = {
            "index": np.arange(1, len(values) + 1),
            "value": values,
            "low": values - error,
            "high": values + error,
            "text": [f"{v:.6g} ± {e:.2g}" for v, e in zip(values, error, strict=True)],
        }

    def clear(self) -> None:
        """Take the exponents away."""
        empty(self.values)


class MultipliersFigure:
    """Multipliers of an orbit in the complex plane.

    Attributes
    ----------
    made
        The figure.
    """

    def __init__(self) -> None:
        self.values = source("re", "im", "text")
        self.made = blank(
            "Multipliers", "multipliers", 330, x_range=Range1d(-1.5, 1.5), y_range=Range1d(-1.5, 1.5)
        )
        # A circle must look like one, in a narrow column too.
        self.made.sizing_mode, self.made.width, self.made.max_width = "scale_width", 340, 340
        self.made.ellipse(0.0, 0.0, 2.0, 2.0, fill_alpha=0.0, line_color=JUMP)
        self.made.scatter("re", "im", source=self.values, size=10, marker="x", line_width=2, color=COLOURS[1])
        self.made.add_tools(HoverTool(tooltips=[("multiplier", "@text")]))
        self.made.xaxis.axis_label, self.made.yaxis.axis_label = "real part", "imaginary part"

    def show(self, orbit: PeriodicOrbit | None) -> None:
        """Draw the multipliers of an orbit; None takes them away."""
        if orbit is None:
            empty(self.values)
            return
        values = orbit.multipliers
        self.values.data = {
            "re": values.real,
            "im": values.imag,
            "text": [f"{value:.6g}, modulus {abs(value):.6g}" for value in values],
        }
        reach = max(1.5, 1.1 * float(np.abs(values[np.isfinite(values)]).max(initial=1.0)))
        for each in (self.made.x_range, self.made.y_range):
            each.start, each.end = -reach, reach
