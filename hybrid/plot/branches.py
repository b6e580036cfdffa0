"""Branches of orbits over a parameter: stable parts full, unstable ones dashed, bifurcations marked."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from hybrid import arguments
from hybrid.orbits.continuation.branch import Branch
from hybrid.plot.style import COLOURS, as_component, axes_for, small_legend
from hybrid.simulation.labelled import Names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Markers by kind of bifurcation.
MARKERS = {"fold": "o", "flip": "s", "torus": "D", "branch point": "P", "grazing": "v"}


def plot_branch(
    branch: Branch,
    y: str | int = 0,
    *,
    ax: Axes | None = None,
    figsize: tuple[float, float] | None = None,
) -> Axes:
    """Draw a component of the orbits' points over the parameter, with the bifurcations.

    Parameters
    ----------
    branch
        From :func:`hybrid.continue_orbit`.
    y
        Name or index of the component; by default the first.
    ax
        Axes to draw into, such as those of a chart over the same parameter; by default those of a new figure.
    figsize
        Width and height of a new figure in inches.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a component does not exist.
    """
    arguments.instance("branch", branch, Branch, "Make one with hybrid.continue_orbit.")
    system = branch.system
    i = as_component("y", system.state_names, y)
    (ax,) = axes_for(ax, 1, (6.4, 4.2), figsize)
    over, values = branch.parameter, branch.x0[:, i]
    for stable, part in groupby(range(len(branch)), key=lambda k: bool(branch.stable[k])):
        inside = list(part)
        # The line reaches to the next part.
        shown = [*inside, *([inside[-1] + 1] if inside[-1] + 1 < len(branch) else [])]
        ax.plot(over[shown], values[shown], "-" if stable else "--", color=COLOURS[0], lw=1.4)
    for kind in dict.fromkeys(each.kind for each in branch.bifurcations):
        found = [each for each in branch.bifurcations if each.kind == kind]
        at = np.array([(each.value, each.orbit.x0[i]) for each in found])
        ax.plot(at[:, 0], at[:, 1], MARKERS.get(kind, "x"), color=COLOURS[1], ms=6, label=kind, zorder=3)
    names = Names(system.state_names, system.units)
    ax.set_xlabel(names.label(branch.name))
    ax.set_ylabel(names.label(system.state_names[i]))
    if branch.bifurcations:
        small_legend(ax)
    return ax
