"""Legends and other texts beside the axes, no wider than the picture."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from hybrid.plot.styles import colour_of, small_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.legend import Legend

# Entries of a legend in one row.
MOST_COLUMNS = 5
# Largest number of members of a repeat that a legend lists.
MOST_LISTED = 5
# The least area of a dot in a legend, in square points.
LEAST_AREA = 9.0
# What stays free beside a legend that is as wide as the figure, and between a legend and a title, in points.
BESIDE, BETWEEN = 12.0, 6.0


def legend(ax: Axes, names: Sequence[str], modes: Iterable[int]) -> None:
    """Add a legend of ``modes`` above the axes, if the system has more than one."""
    if len(names) < 2:
        return
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colour_of(mode), label=names[mode]) for mode in modes]
    if handles:
        legend_above(ax, handles, side="left")


def small_legend(
    ax: Axes, handles: list[Any] | None = None, *, side: str = "right", most: int = MOST_COLUMNS
) -> None:
    """A legend in small letters above the axes, of the given handles or of what the axes hold."""
    found = ax.get_legend_handles_labels()[0] if handles is None else handles
    legend_above(ax, found, side=side, most=most, fontsize=small_text())


def legend_above(
    ax: Axes, handles: Sequence[Any], *, side: str, most: int = MOST_COLUMNS, fontsize: float | None = None
) -> None:
    """A legend above the axes with as many columns, up to ``most``, as fit into the picture."""
    for columns in range(max(min(len(handles), most), 1), 0, -1):
        made = ax.legend(
            handles=handles,
            loc="lower left" if side == "left" else "lower right",
            bbox_to_anchor=(0 if side == "left" else 1, 1),
            ncols=columns,
            frameon=False,
            borderaxespad=0.2,
            fontsize=fontsize,
        )
        _enlarge_dots(made)
        found = made.get_window_extent().width
        # The labels of the ordinate, which take long to measure, are no wider than half of the figure.
        if found <= room(ax) / 2 or found <= room(ax, side):
            return
    width = room(ax, side)
    _wrap(made, found - width, width)


def _enlarge_dots(made: Legend) -> None:
    """Dots of a legend are seen also where those of the cloud are small."""
    from matplotlib.collections import PathCollection

    for handle in made.legend_handles:
        if isinstance(handle, PathCollection):
            handle.set_sizes([max(LEAST_AREA, *handle.get_sizes())])


def _wrap(made: Legend, excess: float, width: float) -> None:
    """Break the long texts of a legend of one column, which is wider than it may be."""
    widest = max(text.get_window_extent().width for text in made.get_texts())
    free = max(widest - excess, 0.2 * width)
    for text in made.get_texts():
        text.set_text(wrapped(text.get_text(), text.get_window_extent().width, free))


def wrapped(text: str, width: float, free: float) -> str:
    """A text of some width in lines that fit into the ``free`` width."""
    if width <= free:
        return text
    return textwrap.fill(text, max(int(len(text) * free / width), 8), break_long_words=False)


def room(ax: Axes, side: str = "right") -> float:
    """The width in pixels that texts beside the axes may take: that of the axes' column of the figure.

    A text that begins at the left end of the axes must leave the labels of the ordinate free.
    """
    whole = ax.figure.bbox.width
    place = ax.get_subplotspec()
    share = 1.0 if place is None else len(place.colspan) / place.get_gridspec().ncols
    free = whole * share - BESIDE * ax.figure.dpi / 72
    labels = ax.yaxis.get_tightbbox() if side == "left" else None
    return float(free if labels is None else free - labels.width)


def title_above(ax: Axes, text: str) -> None:
    """A title on the left, above the legend if there is one, in as many lines as it takes."""
    made, pad = ax.get_legend(), BETWEEN
    if made is not None:
        pad += made.get_window_extent().height * 72 / ax.figure.dpi
    title = ax.set_title(text, loc="left", fontsize=small_text(), pad=pad)
    title.set_text(wrapped(text, title.get_window_extent().width, room(ax, "left")))


def member_legend(ax: Axes, names: Sequence[str], colours: Sequence[Any]) -> None:
    """A legend of the members of a repeat on the right: all of a few, otherwise the first and the last."""
    from matplotlib.lines import Line2D

    count = len(names)
    places = range(count) if count <= MOST_LISTED else (0, count - 1)
    handles = [Line2D([], [], color=colours[i], label=names[i].rpartition(".")[0]) for i in places]
    ax.legend(
        handles=handles,
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        frameon=False,
        fontsize=small_text(),
    )
