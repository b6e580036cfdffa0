"""Arcs over time, and one component over another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hybrid import arguments
from hybrid.plot.style import Rows, as_component, axes_for, colour_of, legend, plain
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.labelled import Names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

JUMP_COLOUR = "0.35"
# Each step of the solver is first drawn in FIRST_PARTS parts. A part is halved, at most MOST_HALVINGS times,
# while its middle is off the straight line by more than the fraction SMOOTH of the arc's extent.
FIRST_PARTS, MOST_HALVINGS, SMOOTH = 4, 8, 1e-3


def plot_arc(
    arc: HybridArc,
    components: Iterable[str | int] | None = None,
    *,
    ax: Axes | Iterable[Axes] | None = None,
    figsize: tuple[float, float] | None = None,
) -> Rows:
    """Draw an arc over time: one row per component, one colour per mode, dotted lines for resets.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate`; its dense output, if it has one, refines the curves between the steps.
    components
        Names or indices of the state's components; by default all.
    ax
        Axes to draw into, one per component; by default those of a new figure.
    figsize
        Width and height of a new figure in inches.

    Returns
    -------
    numpy.ndarray
        The axes, one per component; ``.figure`` is their figure.

    Raises
    ------
    ArgumentError
        If a component does not exist, or the number of axes differs from the number of components.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_arc
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> (ax,) = plot_arc(arc, ["q"])
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('t (s)', 'q (m)')
    """
    names = _as_arc(arc).system.state_names
    chosen = range(len(names)) if components is None else _components(names, components)
    axes = axes_for(ax, len(chosen), figsize=figsize)
    labels = Names(names, arc.system.units)
    lines = curves(arc)
    for row, i in zip(axes, chosen, strict=True):
        for mode, (t, x) in lines.items():
            row.plot(t, x[:, i], color=colour_of(mode), linewidth=1.4, solid_capstyle="round")
        if arc.keeps_jumps:
            t = np.repeat(arc.jumps.t, 3)
            ends = _with_gaps(arc.jumps.x_minus[:, i], arc.jumps.x_plus[:, i])
            row.plot(t, ends, color=JUMP_COLOUR, linewidth=0.9, linestyle=":", zorder=1)
        _shade(row, lines)
        row.set_ylabel(labels.label(names[i]))
        row.margins(x=0)
        plain(row)
    if len(axes):
        axes[-1].set_xlabel(labels.label("t"))
        legend(axes[0], arc.system.mode_names, lines)
    return axes


def plot_phase(
    arc: HybridArc,
    x: str | int,
    y: str | int,
    *,
    ax: Axes | None = None,
    figsize: tuple[float, float] | None = None,
) -> Axes:
    """Draw one component of an arc over another: one colour per mode, jumps dashed, a dot at the start.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate`; its dense output, if it has one, refines the curves between the steps.
    x, y
        Names or indices of the state's components.
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
    >>> from hybrid.plot import plot_phase
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> ax = plot_phase(arc, "q", "v")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('q (m)', 'v (m/s)')
    """
    names = _as_arc(arc).system.state_names
    i, j = as_component("x", names, x), as_component("y", names, y)
    (ax,) = axes_for(ax, 1, (5.0, 4.2), figsize)
    labels = Names(names, arc.system.units)
    lines = curves(arc)
    for mode, (_, states) in lines.items():
        ax.plot(states[:, i], states[:, j], color=colour_of(mode), linewidth=1.4, solid_capstyle="round")
    if arc.keeps_jumps:
        before, after = arc.jumps.x_minus, arc.jumps.x_plus
        ax.plot(
            _with_gaps(before[:, i], after[:, i]),
            _with_gaps(before[:, j], after[:, j]),
            color=JUMP_COLOUR,
            linewidth=0.9,
            linestyle=(0, (4, 3)),
            zorder=1,
        )
    if len(arc.x):
        ax.plot(arc.x[0, i], arc.x[0, j], "o", color="black", markersize=4)
    ax.set_xlabel(labels.label(names[i]))
    ax.set_ylabel(labels.label(names[j]))
    plain(ax)
    legend(ax, arc.system.mode_names, lines)
    return ax


def _as_arc(arc: object) -> HybridArc:
    return arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.")


def _components(names: Sequence[str], components: object) -> list[int]:
    wanted = "be names or indices of components of the state, at least one"
    given = arguments.items("components", components, wanted, least=1)
    return [as_component("components", names, each) for each in given]


def curves(arc: HybridArc) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Times and states per visited mode, fine enough to draw; a row of nan ends each visit."""
    if not len(arc.t):
        return {}
    t, x, visit = _refined(arc)
    # The point after the last one of each visit is a gap.
    ends = np.flatnonzero(np.diff(visit, append=visit[-1] + 1)) + 1
    firsts = np.flatnonzero(np.diff(arc.j, prepend=arc.j[0] - 1))
    modes = np.array([arc.system.mode_index(str(arc.mode[first])) for first in firsts])[visit]
    t, x = np.insert(t, ends, np.nan), np.insert(x, ends, np.nan, axis=0)
    modes = np.insert(modes, ends, modes[ends - 1])
    return {int(mode): (t[modes == mode], x[modes == mode]) for mode in np.unique(modes)}


def _refined(arc: HybridArc) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, states and visits (0, 1, ...), with dense output wherever the curve is not straight."""
    visit = np.cumsum(np.diff(arc.j, prepend=arc.j[0]) != 0)
    if arc._pieces is None or len(arc.t) < 2:
        return arc.t, arc.x, visit
    inside = np.flatnonzero(np.diff(visit) == 0)
    part = np.arange(1, FIRST_PARTS) / FIRST_PARTS
    added = (arc.t[inside, None] + (arc.t[inside + 1] - arc.t[inside])[:, None] * part).ravel()
    after = np.repeat(inside + 1, FIRST_PARTS - 1)
    # Known points keep their states: at a jump, the dense output has only the state after it.
    times, states = np.insert(arc.t, after, added), np.insert(arc.x, after, arc(added), axis=0)
    visit = np.insert(visit, after, visit[after - 1])
    size = np.ptp(arc.x, axis=0)
    size[size == 0.0] = np.inf
    bent = np.diff(visit) == 0
    for _ in range(MOST_HALVINGS):
        pieces = np.flatnonzero(bent)
        middles = 0.5 * (times[pieces] + times[pieces + 1])
        found = arc(middles)
        straight = 0.5 * (states[pieces] + states[pieces + 1])
        off = np.max(np.abs(found - straight) / size, axis=1) > SMOOTH
        where = pieces[off]
        if not len(where):
            break
        times = np.insert(times, where + 1, middles[off])
        states = np.insert(states, where + 1, found[off], axis=0)
        visit = np.insert(visit, where + 1, visit[where])
        bent = np.zeros(len(times) - 1, dtype=bool)
        halves = where + np.arange(len(where))
        bent[halves] = bent[halves + 1] = True
    return times, states, visit


def _with_gaps(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """``before, after, nan`` for each jump, so that one line draws all jumps."""
    return np.column_stack([before, after, np.full(len(before), np.nan)]).ravel()


def _shade(ax: Axes, lines: dict[int, tuple[np.ndarray, np.ndarray]]) -> None:
    """Shade the background except in the first mode."""
    for mode, (t, _) in lines.items():
        if mode == 0:
            continue
        ends = np.flatnonzero(np.isnan(t))
        starts = np.concatenate([[0], ends[:-1] + 1])
        spans = list(zip(t[starts], t[ends - 1] - t[starts], strict=True))
        ax.broken_barh(
            spans,
            (0, 1),
            transform=ax.get_xaxis_transform(),
            facecolor=colour_of(mode),
            alpha=0.12,
            linewidth=0,
            zorder=0,
        )
