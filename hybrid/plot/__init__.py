"""Plots: arcs over time, phase portraits, sections, orbits, mode graphs, work-precision diagrams.

The module can be called: ``hybrid.plot(arc)`` is ``hybrid.plot.plot(arc)``.
"""

import sys
from collections.abc import Callable
from functools import singledispatch
from types import ModuleType
from typing import Any

from hybrid import arguments
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.sections import Section
from hybrid.plot.arcs import plot_arc, plot_phase
from hybrid.plot.graph import plot_graph
from hybrid.plot.orbits import plot_orbit, plot_section
from hybrid.plot.style import COLOURS
from hybrid.plot.work_precision import plot_work_precision
from hybrid.simulation.arc import HybridArc
from hybrid.system.graph import HybridSystem

__all__ = [
    "COLOURS",
    "DATASETS",
    "drawn",
    "plot",
    "plot_arc",
    "plot_graph",
    "plot_orbit",
    "plot_phase",
    "plot_section",
    "plot_work_precision",
]


# Functions that draw datasets, by the name of a variable that the dataset has.
DATASETS: dict[str, Callable[..., Any]] = {}


@singledispatch
def drawn(result: Any, **options: Any) -> Any:
    """The plot of a result; register the function that draws a class of results, as below."""
    for name, draw in DATASETS.items():
        if name in getattr(result, "data_vars", ()):
            return draw(result, **options)
    # A dataset has an attribute plot that only says that it cannot be called.
    if callable(getattr(result, "plot", None)) and not hasattr(result, "data_vars"):
        return result.plot(**options)
    wanted = "be a system, an arc, a section, an orbit, a spectrum or a chart"
    raise arguments.refusal("result", wanted, result)


drawn.register(HybridArc, plot_arc)
drawn.register(HybridSystem, plot_graph)
drawn.register(Section, plot_section)
drawn.register(PeriodicOrbit, plot_orbit)


def plot(result: Any, **options: Any) -> Any:
    """Draw a system or a result with the function for its type.

    An arc is drawn by :func:`plot_arc`, a system by :func:`plot_graph`, a section by :func:`plot_section`,
    and a periodic orbit by :func:`plot_orbit`. A spectrum or a chart is drawn by ``lyapunov.plot``, and any
    other object by its method ``plot``.

    Parameters
    ----------
    result
        What to draw.
    **options
        Options of the function that draws the result, such as ``ax=``.

    Returns
    -------
    matplotlib.axes.Axes, or an array of them for an arc, or a figure for a chart

    Raises
    ------
    ArgumentError
        If there is no plot for this type of object.
    """
    return drawn(result, **options)


class _Plot(ModuleType):
    """The class of this module, which draws what it is called with."""

    def __call__(self, result: Any, **options: Any) -> Any:
        """As :func:`plot`."""
        return plot(result, **options)


sys.modules[__name__].__class__ = _Plot
