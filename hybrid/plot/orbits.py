"""Sections as points, and periodic orbits as closed curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybrid import arguments
from hybrid.orbits.labelled import unfinished
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.sections import Section
from hybrid.plot.arcs import plot_phase
from hybrid.plot.style import as_component, axes_for, check_axes, colour_of, dot_area, legend, plain
from hybrid.simulation.labelled import Names

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_section(
    section: Section,
    x: str | int = 0,
    y: str | int | None = None,
    *,
    ax: Axes | None = None,
    figsize: tuple[float, float] | None = None,
    size: float | None = None,
) -> Axes:
    """Draw the points of a section in the plane of two components: one colour per mode.

    Parameters
    ----------
    section
        From :func:`hybrid.stroboscopic_section` or :func:`hybrid.poincare_section`.
    x, y
        Names or indices of the components; by default the first two. A state with one component is drawn
        over time.
    ax
        Axes to draw into; by default those of a new figure.
    figsize
        Width and height of a new figure in inches.
    size
        Diameter of the dots in points; by default smaller for more dots.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a component does not exist.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_section
    >>> section = hybrid.stroboscopic_section(models.impact_oscillator(), (0.0, 0.0), periods=50)
    >>> ax = plot_section(section)
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('x', 'v')
    """
    arguments.instance("section", section, Section, "Make one with hybrid.stroboscopic_section.")
    names = section.state_names
    i = as_component("x", names, x)
    j = second(len(names), i) if y is None else as_component("y", names, y)
    area = dot_area(len(section), size)
    (ax,) = axes_for(ax, 1, (5.0, 4.2), figsize)
    across, up = (section.t, section.x[:, i]) if j is None else (section.x[:, i], section.x[:, j])
    modes = section.mode_names
    visited = [index for index, mode in enumerate(modes) if np.any(section.mode == mode)]
    for index in visited:
        there = section.mode == modes[index]
        colour = colour_of(index)
        ax.scatter(across[there], up[there], s=area, color=colour, linewidths=0, rasterized=True)
    labels = Names(names, section.units)
    ax.set_xlabel(labels.label("t" if j is None else names[i]))
    ax.set_ylabel(labels.label(names[i] if j is None else names[j]))
    plain(ax)
    legend(ax, modes, visited)
    return ax


def plot_orbit(
    orbit: PeriodicOrbit,
    x: str | int = 0,
    y: str | int | None = None,
    *,
    ax: Axes | None = None,
    figsize: tuple[float, float] | None = None,
) -> Axes:
    """Draw a periodic orbit in the plane of two components, with its period and largest multiplier.

    Where the search did not converge the title says so, and has no multiplier.

    Parameters
    ----------
    orbit
        From :func:`hybrid.periodic_orbit`.
    x, y
        Names or indices of the components; by default the first two.
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
        If a component does not exist.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_orbit
    >>> orbit = hybrid.periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    >>> ax = plot_orbit(orbit, "x", "v")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('x', 'v')
    """
    arguments.instance("orbit", orbit, PeriodicOrbit, "Find one with hybrid.periodic_orbit.")
    names = orbit.system.state_names
    i = as_component("x", names, x)
    j = second(len(names), i) if y is None else as_component("y", names, y)
    check_axes(ax)
    ax = plot_phase(orbit.arc(), i, i if j is None else j, ax=ax, figsize=figsize)
    largest = orbit.multipliers[0]
    number = f"{largest.real:.4g}" if largest.imag == 0 else f"{largest:.4g}"
    period = f"{orbit.period:.6g} {orbit.system.units.get('t', '')}".rstrip()
    # The row of the legend stands between the axes and the title.
    pad = 6.0 if ax.get_legend() is None else 24.0
    told = f"period {period}, largest multiplier {number}" if orbit.closes else unfinished(orbit)
    ax.set_title(told, loc="left", fontsize=9, pad=pad)
    return ax


def second(dimension: int, first: int) -> int | None:
    """The component to draw over the component ``first``; None if there is no other."""
    if dimension == 1:
        return None
    return first + 1 if first + 1 < dimension else first - 1
