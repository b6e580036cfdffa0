"""Arcs over time, and one component over another."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Unpack

import numpy as np

from hybrid import arguments
from hybrid.plot.axes import (
    Rows,
    axes_for,
    member_colours,
    named_quantity,
    plain,
)
from hybrid.plot.contacts import contact_names, draw_contacts
from hybrid.plot.labels import label_of
from hybrid.plot.legends import legend, member_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, dot_size, line_width
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.quantities import members, table_of
from hybrid.system.graph import HybridSystem
from hybrid.system.members import condensed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

JUMP_COLOUR = "0.35"
# Each step of the solver is first drawn in FIRST_PARTS parts. A part is halved, at most MOST_HALVINGS times,
# while its middle is off the straight line by more than the fraction SMOOTH of the arc's extent.
FIRST_PARTS, MOST_HALVINGS, SMOOTH = 4, 8, 1e-3


@picture
def plot_arc(arc: HybridArc, components: Iterable[str | int] | None = None, **look: Unpack[Look]) -> Rows:
    """Draw an arc over time: one row per component or output, one colour per mode, dotted lines for resets.

    The members of a repeat share a row, with one colour per member. Below all components of a system with
    contacts a last row shows what holds at each, as :func:`plot_contacts` does.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate`; its dense output, if it has one, refines the curves between the steps.
    components
        Names or indices of the state's components, or names of outputs; by default all components. A name
        such as ``cell.soc`` draws those of all members.
    ax
        Axes to draw into, one per row; by default those of a new figure.

    Returns
    -------
    numpy.ndarray
        The axes, one per row; ``.figure`` is their figure.

    Raises
    ------
    ArgumentError
        If a name does not exist, or the number of axes differs from the number of rows.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_arc
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> (ax,) = plot_arc(arc, ["q"])
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('t (s)', 'q (m)')
    """
    system = _as_arc(arc).system
    chosen = list(condensed(system.own_names)) if components is None else _names(system, components)
    touches = components is None and bool(contact_names(system))
    axes = axes_for(look, len(chosen) + touches)
    drawn = [members(name, system) or (name,) for name in chosen]
    columns = [name for names in drawn for name in names]
    lines = curves(arc, columns)
    for row, name, names in zip(axes, chosen, drawn, strict=False):
        shades = member_colours(len(names))
        for k, one in enumerate(names):
            for mode, (t, values) in lines.items():
                colour = colour_of(mode) if one == name else shades[k]
                found = values[:, columns.index(one)]
                row.plot(t, found, color=colour, linewidth=line_width(1.4), solid_capstyle="round")
            if arc.keeps_jumps:
                t, ends = np.repeat(arc.jumps.t, 3), _over_jumps(arc, one)
                row.plot(t, ends, color=JUMP_COLOUR, linewidth=line_width(0.9), linestyle=":", zorder=1)
        if name not in names:
            member_legend(row, names, shades)
        _shade(row, lines)
        row.set_ylabel(label_of(name, system.units.get(names[0])))
        row.margins(x=0)
        plain(row)
    if touches:
        draw_contacts(arc, axes[-1])
    if len(axes):
        axes[-1].set_xlabel(label_of("t", system.units.get("t")))
        legend(axes[0], system.mode_names, lines)
    return axes


@picture
def plot_phase(arc: HybridArc, x: str | int, y: str | int, **look: Unpack[Look]) -> Axes:
    """Draw an arc in the plane of two components or outputs: one colour per mode, jumps dashed.

    A dot marks the start.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate`; its dense output, if it has one, refines the curves between the steps.
    x, y
        Names or indices of the state's components, or names of outputs.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a name does not exist.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_phase
    >>> arc = hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 2.0))
    >>> ax = plot_phase(arc, "q", "v")
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('q (m)', 'v (m/s)')
    """
    system = _as_arc(arc).system
    across, up = (named_quantity("x", system, x), named_quantity("y", system, y))
    (ax,) = axes_for(look, 1, (5.0, 4.2))
    lines = curves(arc, (across, up))
    for mode, (_, values) in lines.items():
        ax.plot(*values.T, color=colour_of(mode), linewidth=line_width(1.4), solid_capstyle="round")
    if arc.keeps_jumps:
        ends = _over_jumps(arc, across), _over_jumps(arc, up)
        ax.plot(*ends, color=JUMP_COLOUR, linewidth=line_width(0.9), linestyle=(0, (4, 3)), zorder=1)
    if len(arc.x):
        ax.plot(arc[across][0], arc[up][0], "o", color="black", markersize=dot_size(4))
    ax.set_xlabel(label_of(across, system.units.get(across)))
    ax.set_ylabel(label_of(up, system.units.get(up)))
    plain(ax)
    legend(ax, system.mode_names, lines)
    return ax


def _as_arc(arc: object) -> HybridArc:
    return arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.")


def _names(system: HybridSystem, components: object) -> list[str]:
    wanted = "be names or indices of components of the state, or names of outputs, at least one"
    given = arguments.items("components", components, wanted, least=1)
    return [
        str(each) if members(each, system) else named_quantity("components", system, each) for each in given
    ]


def curves(arc: HybridArc, names: Sequence[str]) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Times, and components and outputs ``(N, len(names))``, per visited mode; a row of nan ends each visit.

    They are fine enough to draw.
    """
    if not len(arc.t):
        return {}
    firsts = np.flatnonzero(np.diff(arc.j, prepend=arc.j[0] - 1))
    visited = np.array([arc.system.mode_index(str(arc.mode[first])) for first in firsts])
    values = arc.system.parameter_values(arc.parameters)

    def table(t: np.ndarray, x: np.ndarray, visit: np.ndarray) -> np.ndarray:
        return table_of(arc.system, names, t, x, visited[visit], values)

    t, drawn, visit = _refined(arc, table)
    # The point after the last one of each visit is a gap.
    ends = np.flatnonzero(np.diff(visit, append=visit[-1] + 1)) + 1
    modes = visited[visit]
    t, drawn = np.insert(t, ends, np.nan), np.insert(drawn, ends, np.nan, axis=0)
    modes = np.insert(modes, ends, modes[ends - 1])
    return {int(mode): (t[modes == mode], drawn[modes == mode]) for mode in np.unique(modes)}


def _refined(
    arc: HybridArc, table: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, rows of a table and visits (0, 1, ...), with dense output wherever a curve is not straight."""
    visit = np.cumsum(np.diff(arc.j, prepend=arc.j[0]) != 0)
    known = table(arc.t, arc.x, visit)
    if arc._pieces is None or len(arc.t) < 2:
        return arc.t, known, visit
    inside = np.flatnonzero(np.diff(visit) == 0)
    part = np.arange(1, FIRST_PARTS) / FIRST_PARTS
    added = (arc.t[inside, None] + (arc.t[inside + 1] - arc.t[inside])[:, None] * part).ravel()
    after, between = np.repeat(inside + 1, FIRST_PARTS - 1), np.repeat(visit[inside], FIRST_PARTS - 1)
    # Known points keep their states: at a jump, the dense output has only the state after it.
    times, rows = (
        np.insert(arc.t, after, added),
        np.insert(known, after, table(added, arc(added), between), axis=0),
    )
    visit = np.insert(visit, after, between)
    with np.errstate(invalid="ignore"):
        size = np.nanmax(known, axis=0, initial=-np.inf) - np.nanmin(known, axis=0, initial=np.inf)
    size[~(size > 0.0)] = np.inf
    bent = np.diff(visit) == 0
    for _ in range(MOST_HALVINGS):
        pieces = np.flatnonzero(bent)
        middles = 0.5 * (times[pieces] + times[pieces + 1])
        found = table(middles, arc(middles), visit[pieces])
        straight = 0.5 * (rows[pieces] + rows[pieces + 1])
        off = np.any(np.abs(found - straight) / size > SMOOTH, axis=1)
        where = pieces[off]
        if not len(where):
            break
        times = np.insert(times, where + 1, middles[off])
        rows = np.insert(rows, where + 1, found[off], axis=0)
        visit = np.insert(visit, where + 1, visit[where])
        bent = np.zeros(len(times) - 1, dtype=bool)
        halves = where + np.arange(len(where))
        bent[halves] = bent[halves + 1] = True
    return times, rows, visit


def _over_jumps(arc: HybridArc, name: str) -> np.ndarray:
    """``before, after, nan`` of each jump, so that one line draws all jumps."""
    before, after = arc.jumps.before(name), arc.jumps.after(name)
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
