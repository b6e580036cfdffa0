"""Sections as points, and periodic orbits as closed curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Unpack

import numpy as np

from hybrid import arguments
from hybrid.display.tables import measured
from hybrid.orbits.labelled import unfinished
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.sections import Section
from hybrid.plot.arcs import plot_phase
from hybrid.plot.axes import (
    axes_for,
    check_look,
    dot_area,
    named_quantity,
    plain,
    show_spread,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import legend, title_above
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@picture
def plot_section(
    section: Section,
    x: str | int = 0,
    y: str | int | None = None,
    *,
    size: float | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw the points of a section in the plane of two components or outputs: one colour per mode.

    Parameters
    ----------
    section
        From :func:`hybrid.stroboscopic_section` or :func:`hybrid.poincare_section`.
    x, y
        Names or indices of components, or names of outputs; by default the first two components. A state
        with one component is drawn over time.

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
    (ax,) = axes_for(look, 1, (5.0, 4.2))
    across, up = (section.t, section[first]) if other is None else (section[first], section[other])
    area, modes = dot_area(across, up, size), system.mode_names
    visited = [index for index, mode in enumerate(modes) if np.any(section.mode == mode)]
    for index in visited:
        there = section.mode == modes[index]
        colour = colour_of(index)
        ax.scatter(across[there], up[there], s=area, color=colour, linewidths=0, rasterized=True)
    across_name, up_name = ("t", first) if other is None else (first, other)
    ax.set_xlabel(label_of(across_name, system.units.get(across_name)))
    ax.set_ylabel(label_of(up_name, system.units.get(up_name)))
    show_spread(ax, across, up)
    plain(ax)
    legend(ax, modes, visited)
    return ax


@picture
def plot_orbit(
    orbit: PeriodicOrbit, x: str | int = 0, y: str | int | None = None, **look: Unpack[Look]
) -> Axes:
    """Draw a periodic orbit in the plane of two components or outputs, with period and largest multiplier.

    Where the search did not converge the title says so, and has no multiplier.

    Parameters
    ----------
    orbit
        From :func:`hybrid.periodic_orbit`.
    x, y
        Names or indices of components, or names of outputs; by default the first two components.

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
    check_look(look)
    ax = plot_phase(orbit.arc(), first, other or first, **look)
    largest = orbit.multipliers[0]
    number = f"{largest.real:.4g}" if largest.imag == 0 else f"{largest:.4g}"
    period = measured(f"{orbit.period:.6g}", orbit.system.units.get("t"))
    told = f"period {period}, largest multiplier {number}" if orbit.closes else unfinished(orbit)
    title_above(ax, told)
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
