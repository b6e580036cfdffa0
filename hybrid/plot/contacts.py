"""What holds at the contacts of a mechanical system over time: one band for each contact."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.plot.axes import (
    axes_for,
    plain,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, line_width
from hybrid.simulation.arc import HybridArc
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# What a band shows, with the index of its colour; where a contact is open the band is a thin line.
STATES = {"held": 0, "sticks": 2, "slips +": 1, "slips -": 4}
OPEN_COLOUR = "0.6"
# Heights of a band, as shares of the distance of two contacts.
HEIGHT, MARK = 0.6, 0.8
IMPACT_COLOUR = "0.15"


@picture
def plot_contacts(arc: HybridArc, **look: Unpack[Look]) -> Axes:
    """Draw what holds at each contact over time: open, held, sticks, slips; ticks are impacts.

    Parameters
    ----------
    arc
        From :func:`hybrid.simulate` of a system made by :func:`hybrid.mechanics`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If the system of the arc has no contacts.

    Examples
    --------
    >>> from hybrid import Contact, mechanics, simulate
    >>> from hybrid.plot import plot_contacts
    >>> ball = mechanics(
    ...     coordinates=("y",),
    ...     velocities=("v",),
    ...     mass=lambda t, x, p: (1.0,),
    ...     forces=lambda t, x, p: (-9.81,),
    ...     contacts=[Contact("floor", gap=lambda t, x, p: x.y, restitution=0.5)],
    ... )
    >>> ax = plot_contacts(simulate(ball, (1.0, 0.0), (0.0, 2.0)))
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['floor']
    """
    arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.")
    names = contact_names(arc.system)
    if not names:
        raise ArgumentError("plot_contacts: the system of arc has no contacts. Make one with mechanics().")
    (row,) = axes_for(look, 1, (7.0, 1.2 + 0.35 * len(names)))
    draw_contacts(arc, row)
    row.set_xlabel(label_of("t", arc.system.units.get("t")))
    return row


def contact_names(system: HybridSystem) -> list[str]:
    """The contacts of a system; none if it is not made by `mechanics`."""
    if system.growth is None:
        return []
    # What makes modes of contacts is imported with the first system that has some.
    from hybrid.transform.contacts.growth import contacts_of

    growth = contacts_of(system)
    return [] if growth is None else [each.name for each in growth.contacts]


def draw_contacts(arc: HybridArc, ax: Axes) -> None:
    """Draw a band for each contact into axes, the first on top."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from hybrid.transform.contacts.growth import contacts_of

    growth, names = contacts_of(arc.system), contact_names(arc.system)
    assert growth is not None, "the system has contacts"
    seen: set[str] = set()
    for start, end, mode in _stays(arc):
        for k, status in enumerate(growth.statuses_in(mode)):
            state = _state(status)
            if state is None:
                continue
            seen.add(state)
            colour, place = colour_of(STATES[state]), (k - 0.5 * HEIGHT, HEIGHT)
            ax.broken_barh([(start, end - start)], place, facecolor=colour, linewidth=0)
    if len(arc.t):
        ax.hlines(
            range(len(names)), arc.t[0], arc.t[-1], color=OPEN_COLOUR, linewidth=line_width(0.9), zorder=0
        )
    for k, name in enumerate(names):
        times = _impacts(arc, name)
        ax.vlines(times, k - 0.5 * MARK, k + 0.5 * MARK, color=IMPACT_COLOUR, linewidth=line_width(0.9))
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.margins(x=0)
    plain(ax)
    shown = [state for state in STATES if state in seen]
    bands = [Patch(facecolor=colour_of(STATES[state]), label=state) for state in shown]
    small_legend(
        ax,
        [
            Line2D([], [], color=OPEN_COLOUR, linewidth=line_width(0.9), label="open"),
            *bands,
            Line2D([], [], color=IMPACT_COLOUR, marker="|", linestyle="", label="impact"),
        ],
    )


def _state(status: str) -> str | None:
    """What a band shows; None where the contact is open. A contact that is closed without a force is held."""
    from hybrid.transform.contacts.statuses import HELD, IDLE, OPEN

    if status == OPEN:
        return None
    return "held" if status in (HELD, IDLE) else status


def _stays(arc: HybridArc) -> list[tuple[float, float, str]]:
    """Begin, end and mode of each stay in a mode that takes time."""
    if not len(arc.t):
        return []
    firsts = np.flatnonzero(np.diff(arc.j, prepend=arc.j[0] - 1))
    lasts = np.append(firsts[1:] - 1, len(arc.t) - 1)
    stays = zip(arc.t[firsts], arc.t[lasts], arc.mode[firsts], strict=True)
    return [(float(start), float(end), str(mode)) for start, end, mode in stays if end > start]


def _impacts(arc: HybridArc, name: str) -> list[float]:
    """The times at which a contact closes."""
    if not arc.keeps_jumps:
        return []
    titles = {each.name: each.part_of or "" for each in arc.system.transitions}
    return [jump.t for jump in arc.jumps if name in titles[jump.transition].split("+")]
