"""Sections as points, and periodic orbits as closed curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hybrid import arguments
from hybrid.orbits.labelled import unfinished
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.sections import Section
from hybrid.plot.arcs import plot_phase
from hybrid.plot.style import axes_for, check_axes, colour_of, dot_area, legend, named_quantity, plain
from hybrid.simulation.labelled import Names
from hybrid.system.graph import HybridSystem

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
    """Draw the points of a section in the plane of two components or outputs: one colour per mode.

    Parameters
    ----------
    section
        From :func:`hybrid.stroboscopic_section` or :func:`hybrid.poincare_section`.
    x, y
        Names or indices of components, or names of outputs; by default the first two components. A state
        with one component is drawn over time.
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
    system = section.system
    first, other = plane_of(system, x, y)
    area = dot_area(len(section), size)
    (ax,) = axes_for(ax, 1, (5.0, 4.2), figsize)
    across, up = (section.t, section[first]) if other is None else (section[first], section[other])
    modes = system.mode_names
    visited = [index for index, mode in enumerate(modes) if np.any(section.mode == mode)]
    for index in visited:
        there = section.mode == modes[index]
        colour = colour_of(index)
        ax.scatter(across[there], up[there], s=area, color=colour, linewidths=0, rasterized=True)
    labels = Names(system.state_names, system.units)
    ax.set_xlabel(labels.label("t" if other is None else first))
    ax.set_ylabel(labels.label(other or first))
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
    """Draw a periodic orbit in the plane of two components or outputs, with period and largest multiplier.

    Where the search did not converge the title says so, and has no multiplier.

    Parameters
    ----------
    orbit
        From :func:`hybrid.periodic_orbit`.
    x, y
        Names or indices of components, or names of outputs; by default the first two components.
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
    first, other = plane_of(orbit.system, x, y)
    check_axes(ax)
    ax = plot_phase(orbit.arc(), first, other or first, ax=ax, figsize=figsize)
    largest = orbit.multipliers[0]
    number = f"{largest.real:.4g}" if largest.imag == 0 else f"{largest:.4g}"
    period = f"{orbit.period:.6g} {orbit.system.units.get('t', '')}".rstrip()
    # The row of the legend stands between the axes and the title.
    pad = 6.0 if ax.get_legend() is None else 24.0
    told = f"period {period}, largest multiplier {number}" if orbit.closes else unfinished(orbit)
    ax.set_title(told, loc="left", fontsize=9, pad=pad)
    return ax


def plane_of(system: HybridSystem, x: str | int, y: str | int | None) -> tuple[str, str | None]:
    """What is drawn across and up; without ``y`` the component beside ``x``, or None if there is no other."""
    first = named_quantity("x", system, x)
    if y is not None:
        return first, named_quantity("y", system, y)
    return first, beside(system.own_names, first)


def beside(names: Sequence[str], first: str) -> str | None:
    """The component to draw over another one, or over an output; None if there is no other."""
    if first not in names:
        return names[0]
    if len(names) == 1:
        return None
    i = names.index(first)
    return names[i + 1 if i + 1 < len(names) else i - 1]
