"""The jumps of an arc over time, and the bounds of the errors of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import numpy as np

from hybrid import arguments
from hybrid.accuracy.global_error import GlobalError
from hybrid.plot.axes import (
    Rows,
    axes_for,
    logarithmic,
    mark,
    plain,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, dot_size
from hybrid.simulation.jumps import Jumps
from hybrid.system.members import about_all, shared_name, shared_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKS = {"transverse": "|", "grazing": "o", "limit": ">"}
# Height of the row of a further member of a repeat, in rows.
MEMBER = 0.25
# The least error drawn on a logarithmic scale.
LEAST = 1e-300


@picture
def plot_jumps(jumps: Jumps, **look: Unpack[Look]) -> Axes:
    """Draw jumps over time: one row per transition, dots for grazings, triangles for limits of chatter.

    The row of a clock says when it ticks. The members of a repeat have a line each, in one row.

    Parameters
    ----------
    jumps
        From an arc, ``arc.jumps``.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_jumps
    >>> arc = hybrid.simulate(models.vibroimpact(), (0.0, 0.02, 0.0, 0.0), (0.0, 10.0))
    >>> ax = plot_jumps(arc.jumps)
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['impact', 'release']
    """
    arguments.instance("jumps", jumps, Jumps, "Take those of an arc: arc.jumps.")
    system, names = jumps.system, jumps.system.transition_names
    seen_names = {*np.unique(jumps.transition).tolist()}
    fired = [*dict.fromkeys(shared_name(name) for name in names if name in seen_names)]
    members = [shared_names(names).get(name, (name,)) for name in fired]
    heights = np.array([1.0 + MEMBER * (len(each) - 1) for each in members])
    ends = np.cumsum(heights) - 0.5
    rows = ends - heights / 2
    (ax,) = axes_for(look, 1, (7.0, 1.0 + 0.4 * max(heights.sum(), 1.0)))
    for i, each in enumerate(members):
        places = rows[i] + MEMBER * (np.arange(len(each)) - (len(each) - 1) / 2)
        for name, place in zip(each, places, strict=True):
            _mark(ax, jumps, name, place, colour_of(i), 7 if len(each) == 1 else 4)
    seen = [kind for kind in MARKS if np.any(jumps.kind == kind)]
    first = [system.transitions[system.copies_of(name)[0]] for name in fired]
    clocks = [each.clock and about_all(each.clock.told, each.name) for each in first]
    pairs = zip(fired, clocks, strict=True)
    labels = [name if clock is None else f"{name} ({clock})" for name, clock in pairs]
    ax.set_yticks(rows, labels)
    ax.set_ylim(heights.sum() - 0.5 if fired else 0.5, -0.5)
    ax.set_xlabel(label_of("t", system.units.get("t")))
    plain(ax)
    if seen and seen != ["transverse"]:
        for kind in seen:
            ax.plot([], [], MARKS[kind], color="0.35", label=kind)
        small_legend(ax)
    return ax


def _mark(ax: Axes, jumps: Jumps, name: str, height: float, colour: str, size: float) -> None:
    """Marks for the jumps of a transition."""
    for kind, marker in MARKS.items():
        at = jumps.t[(jumps.transition == name) & (jumps.kind == kind)]
        if len(at):
            ax.plot(at, np.full(len(at), height), marker, color=colour, markersize=size)


@picture
def plot_global_error(result: GlobalError, **look: Unpack[Look]) -> Rows:
    """Draw the bounds of the errors: of the last state per component, below of the times of the jumps.

    Parameters
    ----------
    result
        From :func:`hybrid.global_error`.
    ax
        Axes to draw into, two if the run has jumps, else one; by default those of a new figure.

    Returns
    -------
    numpy.ndarray
        The axes; ``.figure`` is their figure.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_global_error
    >>> found = hybrid.global_error(models.impact_oscillator(), (0.0, 0.0), (0.0, 20.0))
    >>> len(plot_global_error(found))
    2
    """
    if not isinstance(result, GlobalError):
        raise arguments.refusal("result", "be a GlobalError, from hybrid.global_error", result)
    system, bounds = result.arc.system, result.jumps
    count = 2 if len(bounds) else 1
    axes = axes_for(look, count, (6.4, 0.8 + 2.2 * count), shared=False)
    errors = result.x[[system.state_names.index(name) for name in system.own_names]]
    places, known = np.arange(len(errors)), np.isfinite(errors)
    axes[0].plot(places[known], np.maximum(errors[known], LEAST), "o", color=colour_of(0))
    if not known.all():
        mark(axes[0], places[~known], "^", colour_of(1), "not known")
        small_legend(axes[0])
    axes[0].set_xticks(places, [label_of(name, system.units.get(name)) for name in system.own_names])
    axes[0].set_xlim(-0.5, len(places) - 0.5)
    axes[0].set_ylabel("error of the last state")
    if len(bounds):
        t, known = result.arc.jumps.t, np.isfinite(bounds)
        axes[1].plot(
            t[known], np.maximum(bounds[known], LEAST), "o", color=colour_of(0), markersize=dot_size(4)
        )
        if not known.all():
            told = "not known: tighter runs jump differently"
            mark(axes[1], t[~known], "|", colour_of(1), told)
            small_legend(axes[1])
        axes[1].set_xlabel(label_of("t", system.units.get("t")))
        axes[1].set_ylabel(label_of("error of jump times", system.units.get("t")))
    for row in axes:
        logarithmic(row, "y")
        row.grid(True, axis="y", color="0.9")
        plain(row)
    return axes
