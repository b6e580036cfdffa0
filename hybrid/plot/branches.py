"""Branches of orbits over a parameter, and curves of bifurcations over two."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid import arguments
from hybrid.orbits.continuation.branch import Branch
from hybrid.orbits.continuation.continue_bifurcation import BifurcationCurve
from hybrid.orbits.labelled import table_at
from hybrid.plot.datasets import SECTION, column
from hybrid.plot.style import COLOURS, axes_for, dot_area, named_quantity, small_legend
from hybrid.simulation.labelled import Names

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

# Markers by kind of bifurcation. The sliding ones and others that have none here share one.
MARKERS = {
    "fold": "o",
    "flip": "s",
    "torus": "D",
    "branch point": "P",
    "grazing": "v",
    "corner": "<",
    "border": ">",
    "crossing-sliding": "^",
    "grazing-sliding": "p",
    "switching-sliding": "h",
    "adding-sliding": "d",
}
OTHER = "X"


def plot_branch(
    branch: Branch,
    y: str | int = 0,
    *,
    over: xarray.Dataset | Axes | None = None,
    ax: Axes | None = None,
    figsize: tuple[float, float] | None = None,
) -> Axes:
    """Draw a component or an output at the orbits' points over the parameter, with the bifurcations.

    Stable parts are full, unstable ones dashed.

    Parameters
    ----------
    branch
        From :func:`hybrid.continue_orbit`.
    y
        Name or index of the component, or name of the output; by default the first component.
    over
        A chart over the same parameter with points of the section, from ``lyapunov.chart(section=...)``,
        which is drawn below the branch; or the axes of a picture of one.
    ax
        Axes to draw into; by default those of a new figure.
    figsize
        Width and height of a new figure in inches.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a component does not exist, or the chart has no points over the parameter.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_branch
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> ax = plot_branch(hybrid.continue_orbit(orbit, "w", (0.9, 1.1)), "x")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('w', 'x')
    """
    arguments.instance("branch", branch, Branch, "Make one with hybrid.continue_orbit.")
    system = branch.system
    name = named_quantity("y", system, y)
    cloud = None
    if over is not None:
        if hasattr(over, "data_vars"):
            cloud = _points_of(over, branch.name, name)
        elif ax is None and hasattr(over, "plot"):
            ax = over
        else:
            wanted = "be a chart with points of its section, or axes in place of ax"
            raise arguments.refusal("over", wanted, over)
    (ax,) = axes_for(ax, 1, (6.4, 4.2), figsize)
    if cloud is not None:
        ax.scatter(*cloud, s=dot_area(len(cloud[0])), color="0.6", linewidths=0, rasterized=True, zorder=0)
    across, values = branch.parameter, branch[name]
    for stable, part in groupby(range(len(branch)), key=lambda k: bool(branch.stable[k])):
        inside = list(part)
        # The line reaches to the next part.
        shown = [*inside, *([inside[-1] + 1] if inside[-1] + 1 < len(branch) else [])]
        ax.plot(across[shown], values[shown], "-" if stable else "--", color=COLOURS[0], lw=1.4)
    found = branch.bifurcations
    there = table_at(system, [name], [each.orbit for each in found])[:, 0]
    _mark(ax, [(each.kind, each.value, up) for each, up in zip(found, there, strict=True)])
    names = Names(system.state_names, system.units)
    ax.set_xlabel(names.label(branch.name))
    ax.set_ylabel(names.label(name))
    return ax


def plot_curve(
    curve: BifurcationCurve,
    *,
    ax: Axes | None = None,
    figsize: tuple[float, float] | None = None,
) -> Axes:
    """Draw a curve of bifurcations in the plane of its two parameters, with its points of codimension two.

    Parameters
    ----------
    curve
        From :func:`hybrid.continue_bifurcation`.
    ax
        Axes to draw into, such as those of other curves; by default those of a new figure.
    figsize
        Width and height of a new figure in inches.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_curve
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> fold = hybrid.continue_orbit(orbit, "w", (0.9, 1.8)).bifurcations[0]
    >>> ax = plot_curve(hybrid.continue_bifurcation(fold, {"w": (1.7, 1.8), "r": (0.75, 0.85)}))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('w', 'r')
    """
    arguments.instance("curve", curve, BifurcationCurve, "Make one with hybrid.continue_bifurcation.")
    (ax,) = axes_for(ax, 1, (5.4, 4.2), figsize)
    first, second = curve.names
    ax.plot(curve[first], curve[second], lw=1.4, label=curve.kind)
    _mark(ax, [(each.kind, each.values[first], each.values[second]) for each in curve.points])
    names = Names(curve.system.state_names, curve.system.units)
    ax.set_xlabel(names.label(first))
    ax.set_ylabel(names.label(second))
    small_legend(ax)
    return ax


def _mark(ax: Axes, found: list[tuple[str, float, float]]) -> None:
    """Signs for what has a kind and a place, with a legend."""
    for kind in dict.fromkeys(each[0] for each in found):
        at = np.array([each[1:] for each in found if each[0] == kind])
        marker = MARKERS.get(kind, OTHER)
        ax.plot(at[:, 0], at[:, 1], marker, color=COLOURS[1], ms=6, label=kind, zorder=3)
    if found:
        small_legend(ax)


def _points_of(chart: Any, name: str, component: str) -> tuple[np.ndarray, np.ndarray]:
    """Parameter and component ``(N,)`` of the points of a chart's section."""
    points = chart.get("section")
    if points is None or name not in points.dims or points.sizes.get("sample", 0) == 0:
        raise arguments.refusal("over", f"be a chart over {name!r} alone, computed with section=100", chart)
    values = column("y", chart.transpose(name, "sample", ...), component, SECTION)[1]
    return np.repeat(np.asarray(points[name], dtype=float), values.shape[1]), values.ravel()
