"""Shared parts of all plots: colours, axes and legends; matplotlib is imported only when needed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# One colour per mode: the palette of Okabe and Ito, distinguishable with any colour vision, faint hues last.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def as_component(name: str, names: Sequence[str], component: object) -> int:
    """Index of a component of the state, given by name or index in the argument ``name``."""
    index = arguments.whole_number(component)
    if index is not None:
        if not -len(names) <= index < len(names):
            raise ArgumentError(
                f"{name}: State component {arguments.shown(index)} does not exist; the state has "
                f"{len(names)} components."
            )
        return index % len(names)
    return list(names).index(
        arguments.known(f"{name}: State component", component, names, "State components")
    )


def check_axes(value: object) -> None:
    """Raise an ArgumentError if an argument ``ax`` is neither None nor matplotlib axes."""
    if value is not None:
        _as_axes(value)


def _as_axes(value: object) -> Axes:
    from matplotlib.axes import Axes

    return arguments.instance("ax", value, Axes, "Make them with matplotlib.pyplot.subplots.")


def axes_for(ax: Any, count: int, figsize: tuple[float, float] | None = None) -> np.ndarray:
    """The given axes, or those of a new figure, as an array of ``count``."""
    if ax is None:
        import matplotlib.pyplot as plt

        size = figsize or (7.0, 0.8 + 1.5 * count)
        return plt.subplots(count, 1, sharex=True, squeeze=False, figsize=size, layout="constrained")[1][:, 0]
    try:
        axes = np.atleast_1d(np.array(ax, dtype=object)).ravel()
    except Exception:  # whatever an object that is no array of axes raises when it is converted
        axes = np.array([_as_axes(ax)], dtype=object)
    for each in axes:
        _as_axes(each)
    if len(axes) != count:
        raise ArgumentError(f"ax must hold {count} axes, one per component; got {len(axes)}.")
    return axes


def colour_of(mode: int) -> str:
    """The colour of the mode with this index."""
    return COLOURS[mode % len(COLOURS)]


def plain(ax: Axes) -> None:
    """Hide the frame at the top and on the right."""
    ax.spines[["top", "right"]].set_visible(False)


def legend(ax: Axes, names: Sequence[str], modes: Iterable[int]) -> None:
    """Add a legend of ``modes`` above the axes, if the system has more than one."""
    if len(names) < 2:
        return
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colour_of(mode), label=names[mode]) for mode in modes]
    ax.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=len(handles),
        frameon=False,
        borderaxespad=0.2,
    )


def dot_area(count: int) -> float:
    """Area of each dot in square points: larger for few dots, smaller for many."""
    return float(np.clip(4000 / max(count, 1), 0.6, 20.0))
