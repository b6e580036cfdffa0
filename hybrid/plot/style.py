"""Shared parts of all plots: colours, axes and legends; matplotlib is imported only when needed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.simulation.quantities import words_for
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# One colour per mode: the palette of Okabe and Ito, distinguishable with any colour vision, faint hues last.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

# Entries of a legend in one row.
MOST_COLUMNS = 5

# Characters in a row of the legend of modes, and those that the line before each name takes.
ROW, HANDLE = 72, 7

# Largest number of members of a repeat that a legend lists.
MOST_LISTED = 5
# Diameter in points of a dot that fills a page.
LARGEST_DOT = 1000.0


def as_component(name: str, names: Sequence[str], component: object, outputs: Iterable[str] = ()) -> int:
    """Index in ``(*names, *outputs)`` of what the argument ``name`` gives.

    Components of the state are given by name or index, outputs by name.
    """
    index = arguments.whole_number(component)
    if index is not None:
        if not -len(names) <= index < len(names):
            raise ArgumentError(
                f"{name}: State component {arguments.shown(index)} does not exist; the state has "
                f"{len(names)} components."
            )
        return index % len(names)
    both = [*names, *outputs]
    what, kind = words_for(len(both) > len(names))
    return both.index(arguments.known(f"{name}: {what}", component, both, kind))


def named_quantity(argument: str, system: HybridSystem, given: object) -> str:
    """The name of a component, which may be given by its index, or of an output."""
    return system.quantity_names[as_component(argument, system.state_names, given, system.outputs)]


def check_axes(ax: object, figsize: object = None) -> None:
    """Raise an ArgumentError if ``ax`` is neither None nor matplotlib axes, or ``figsize`` no size."""
    if ax is not None:
        _as_axes(ax)
    if figsize is not None:
        _as_figsize(figsize)


def _as_axes(value: object) -> Axes:
    from matplotlib.axes import Axes

    return arguments.instance("ax", value, Axes, "Make them with matplotlib.pyplot.subplots.")


class Rows(np.ndarray):
    """Axes of one figure, from the top; short to print, as a notebook does with the last value of a cell."""

    @property
    def figure(self) -> Figure:
        """The figure that the axes belong to, for instance to save it."""
        return self.ravel()[0].get_figure(root=True)

    def __repr__(self) -> str:
        names = [each.get_ylabel() for each in self.ravel().tolist()]
        return f"<{len(names)} axes: {', '.join(names)}>"

    __str__ = __repr__


def axes_for(
    ax: Any,
    count: int,
    default: tuple[float, float] | None = None,
    figsize: tuple[float, float] | None = None,
    *,
    shared: bool = True,
) -> Rows:
    """The given axes, or those of a new figure in a column, as an array of ``count``.

    The size of the figure is ``figsize`` if a caller gives one, else ``default``. Axes that are ``shared``
    have one abscissa.
    """
    if figsize is not None:
        figsize = _as_figsize(figsize)
    if ax is None:
        # pyplot knows the figure, so a notebook and plt.show() show it: once, since no plot returns it.
        import matplotlib.pyplot as plt

        size = figsize or default or (7.0, 0.8 + 1.5 * count)
        _, made = plt.subplots(count, 1, sharex=shared, squeeze=False, figsize=size, layout="constrained")
        return made[:, 0].view(Rows)
    try:
        axes = np.atleast_1d(np.array(ax, dtype=object)).ravel()
    except Exception:  # whatever an object that is no array of axes raises when it is converted
        axes = np.array([_as_axes(ax)], dtype=object)
    for each in axes:
        _as_axes(each)
    if len(axes) != count:
        raise ArgumentError(f"ax must hold {count} axes, one per row of the picture; got {len(axes)}.")
    return axes.view(Rows)


def _as_figsize(value: object) -> tuple[float, float]:
    wanted = "be a width and a height in inches, both positive"
    found = arguments.numbers("figsize", value, wanted)
    if found.shape != (2,) or not np.all(np.isfinite(found) & (found > 0)):
        raise arguments.refusal("figsize", wanted, value)
    return float(found[0]), float(found[1])


def colour_of(mode: int) -> str:
    """The colour of the mode with this index."""
    return COLOURS[mode % len(COLOURS)]


def member_colours(count: int) -> list[Any]:
    """Colours of the members of a repeat: a scale from dark to light."""
    from matplotlib import colormaps

    return [colormaps["viridis"](place) for place in np.linspace(0.0, 0.85, count)]


def member_legend(ax: Axes, names: Sequence[str], colours: Sequence[Any]) -> None:
    """A legend of the members of a repeat on the right: all of a few, otherwise the first and the last."""
    from matplotlib.lines import Line2D

    count = len(names)
    places = range(count) if count <= MOST_LISTED else (0, count - 1)
    handles = [Line2D([], [], color=colours[i], label=names[i].rpartition(".")[0]) for i in places]
    ax.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)


def plain(ax: Axes) -> None:
    """Hide the frame at the top and on the right."""
    ax.spines[["top", "right"]].set_visible(False)


def legend(ax: Axes, names: Sequence[str], modes: Iterable[int]) -> None:
    """Add a legend of ``modes`` above the axes, if the system has more than one."""
    if len(names) < 2:
        return
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colour_of(mode), label=names[mode]) for mode in modes]
    if not handles:
        return
    # Long names take several rows, so that they are no wider than the picture.
    widths = [HANDLE + len(str(each.get_label())) for each in handles]
    columns = len(handles) if sum(widths) <= ROW else max(1, ROW // max(widths))
    ax.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=columns,
        frameon=False,
        borderaxespad=0.2,
    )


def dot_area(count: int, size: float | None = None) -> float:
    """Area of each dot, as the square of its diameter in points.

    The diameter is ``size``; by default larger for few dots, smaller for many, and a point at least.
    """
    if size is not None:
        wanted = "be a positive diameter in points, at most 1000"
        diameter = arguments.positive("size", size, wanted)
        if diameter > LARGEST_DOT:
            raise arguments.refusal("size", wanted, size)
        return diameter**2
    return float(np.clip(4000 / max(count, 1), 1.0, 20.0))


def small_legend(ax: Axes, handles: list[Any] | None = None) -> None:
    """A legend above the axes, in rows of five, of the given handles or of what the axes hold."""
    found = ax.get_legend_handles_labels()[0] if handles is None else handles
    ax.legend(
        handles=found,
        loc="lower right",
        bbox_to_anchor=(1, 1),
        ncols=min(len(found), MOST_COLUMNS),
        frameon=False,
        borderaxespad=0.2,
        fontsize=8,
    )


def told(codes: Any, where: str) -> str:
    """What a legend says of points whose status is not ok: names of the codes, and where to read more."""
    names = sorted({StatusCode(int(code)).name for code in np.ravel(codes)} - {StatusCode.SUCCESS.name})
    return f"{', '.join(names)}, see {where}"


def mark(ax: Axes, at: Any, marker: str, colour: str, label: str, *, size: float = 7.0) -> None:
    """Marks at the bottom of the axes, for values that have no place in them."""
    ax.plot(
        at,
        np.full(len(at), 0.02),
        marker,
        color=colour,
        markersize=size,
        transform=ax.get_xaxis_transform(),
        label=label,
        clip_on=False,
    )
