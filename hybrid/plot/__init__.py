"""Pictures: arcs over time, phase portraits, graphs of modes, work against precision."""

from hybrid.plot.arcs import plot_arc, plot_phase
from hybrid.plot.graph import plot_graph
from hybrid.plot.style import COLOURS
from hybrid.plot.work_precision import plot_work_precision

__all__ = ["COLOURS", "plot_arc", "plot_graph", "plot_phase", "plot_work_precision"]
