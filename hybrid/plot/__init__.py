"""Plots: arcs over time, phase portraits, sections, orbits, mode graphs, work-precision diagrams, and styles.

The module can be called: ``hybrid.plot(arc)`` is ``hybrid.plot.plot(arc)``.
"""

import sys
from collections.abc import Callable
from functools import singledispatch
from types import ModuleType
from typing import Any

from hybrid import arguments
from hybrid.accuracy.global_error import GlobalError
from hybrid.accuracy.work_precision import WorkPrecision
from hybrid.orbits.continuation.bifurcation_curve import BifurcationCurve
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.diagrams.diagram import Diagram
from hybrid.orbits.equilibria.bifurcation_curve import EquilibriumCurve
from hybrid.orbits.equilibria.branch import EquilibriumBranch
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.sections import Section
from hybrid.plot.arcs import plot_arc, plot_phase
from hybrid.plot.basins import plot_basins, plot_fractions
from hybrid.plot.branches import plot_branch, plot_curve
from hybrid.plot.contacts import plot_contacts
from hybrid.plot.datasets import plot_ends, plot_sweep
from hybrid.plot.diagrams import plot_diagram
from hybrid.plot.graph import plot_graph
from hybrid.plot.jumps import plot_global_error, plot_jumps
from hybrid.plot.orbits import plot_orbit, plot_section
from hybrid.plot.styles import COLOURS, style
from hybrid.plot.work_precision import plot_work_precision
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jumps
from hybrid.system.graph import HybridSystem

__all__ = [
    "COLOURS",
    "DATASETS",
    "drawn",
    "plot",
    "plot_arc",
    "plot_basins",
    "plot_branch",
    "plot_contacts",
    "plot_curve",
    "plot_diagram",
    "plot_ends",
    "plot_fractions",
    "plot_global_error",
    "plot_graph",
    "plot_jumps",
    "plot_orbit",
    "plot_phase",
    "plot_section",
    "plot_sweep",
    "plot_work_precision",
    "style",
]


# Functions that draw datasets, by the name of a variable that the dataset has.
DATASETS: dict[str, Callable[..., Any]] = {}


@singledispatch
def drawn(result: Any, **options: Any) -> Any:
    """The plot of a result; register the function that draws a class of results, as below.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from hybrid.plot import drawn, plot
    >>> class Reading:
    ...     values = [1.0, 3.0, 2.0]
    >>> def plot_reading(reading, **options):
    ...     ax = plt.figure().gca()
    ...     ax.plot(reading.values)
    ...     return ax
    >>> draw = drawn.register(Reading, plot_reading)
    >>> len(plot(Reading()).lines)
    1
    """
    for name, draw in DATASETS.items():
        if name in getattr(result, "data_vars", ()):
            return draw(result, **options)
    # A dataset has an attribute plot that only says that it cannot be called.
    if callable(getattr(result, "plot", None)) and not hasattr(result, "data_vars"):
        return result.plot(**options)
    if {"status", "message"} <= set(getattr(result, "data_vars", ())):
        # Any sweep has these two, a chart too, so the names above come first.
        return plot_sweep(result, **options)
    wanted = (
        "be a system, an arc, a section, an orbit, a branch, a spectrum, jumps, a GlobalError, a comparison "
        "of models, or a dataset of chart, basins, basin_fractions, simulate_many or sweep; print other "
        "results"
    )
    raise arguments.refusal("result", wanted, result)


drawn.register(HybridArc, plot_arc)
drawn.register(Branch, plot_branch)
drawn.register(EquilibriumBranch, plot_branch)
drawn.register(EquilibriumCurve, plot_curve)
drawn.register(Diagram, plot_diagram)
drawn.register(list, plot_branch)
drawn.register(tuple, plot_branch)
drawn.register(BifurcationCurve, plot_curve)
drawn.register(HybridSystem, plot_graph)
drawn.register(GlobalError, plot_global_error)
drawn.register(Jumps, plot_jumps)
drawn.register(Section, plot_section)
drawn.register(PeriodicOrbit, plot_orbit)
drawn.register(WorkPrecision, plot_work_precision)
DATASETS["t_end"] = plot_ends
DATASETS["label"] = plot_basins
DATASETS["fraction"] = plot_fractions


def plot(result: Any, **options: Any) -> Any:
    """Draw a system or a result with the function for its type.

    An arc is drawn by :func:`plot_arc`, a system by :func:`plot_graph`, a section by :func:`plot_section`,
    a periodic orbit by :func:`plot_orbit`, jumps by :func:`plot_jumps`, what ``global_error`` finds by
    :func:`plot_global_error` and what ``work_precision`` finds by :func:`plot_work_precision`. A dataset of
    ``simulate_many`` is drawn by :func:`plot_ends`, one of ``basins`` by :func:`plot_basins`, one of
    ``basin_fractions`` by :func:`plot_fractions` and one of ``sweep`` by :func:`plot_sweep`. A spectrum, a
    chart, a comparison of models and exponents from two orbits are drawn by ``lyapunov.plot``, and any other
    object by its method ``plot``. A list of branches is drawn into one picture.

    Parameters
    ----------
    result
        What to draw.
    **options
        Options of the function that draws the result, such as ``y=``, and those of all plots: ``ax=``,
        ``figsize=``, ``labels=`` and ``style=``.

    Returns
    -------
    matplotlib.axes.Axes, or an array of them for an arc, a chart, a sweep or a GlobalError

    Raises
    ------
    ArgumentError
        If there is no plot for this type of object.

    Examples
    --------
    >>> import hybrid, models
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> [ax.get_ylabel() for ax in hybrid.plot(arc)]
    ['q (m)', 'v (m/s)']
    """
    return drawn(result, **options)


class _Plot(ModuleType):
    """The class of this module, which draws what it is called with."""

    def __call__(self, result: Any, **options: Any) -> Any:
        """As :func:`plot`."""
        return plot(result, **options)


sys.modules[__name__].__class__ = _Plot
