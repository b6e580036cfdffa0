"""Shared parts of all plots: axes, components and dots; matplotlib is imported only when needed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.plot.picture import Look
from hybrid.plot.styles import USUAL_FONT, USUAL_MARKER, current, dot_size, text_size
from hybrid.simulation.quantities import words_for
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Widths of ticks with their labels, in heights of letters, and of axes in widths of the figure.
POINTS_OF_INCH, WIDTH_OF_TICK, SHARE_OF_AXES, MOST_TICKS = 72, 4.5, 0.85, 9
# Diameter in points of a dot that fills a page.
LARGEST_DOT = 1000.0
# Areas of dots in square points: the least that is seen, that of a few dots, and of all dots together.
LEAST_DOT, USUAL_DOT, LARGEST_SHARE = 1.5, 20.0, 6000.0
# Points whose spread is this share of their size are one; the picture shows this share on either side.
ROUNDING, WIDE = 1e-9, 0.05
# Dots nearer than this part of the height or the width of a picture are drawn on each other.
CELLS = 300


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


def check_look(look: Look) -> None:
    """Raise an ArgumentError if ``ax`` is neither None nor matplotlib axes, or ``figsize`` no size."""
    if look.get("ax") is not None:
        _as_axes(look["ax"])
    figsize = look.get("figsize")
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
    look: Look, count: int, default: tuple[float, float] | None = None, *, shared: bool = True
) -> Rows:
    """The given axes, or those of a new figure in a column, as an array of ``count``.

    The size of the figure is ``figsize`` if a caller gives one, else ``default`` as the style has it. Axes
    that are ``shared`` have one abscissa.
    """
    ax, figsize = look.get("ax"), look.get("figsize")
    if figsize is not None:
        figsize = _as_figsize(figsize)
    if ax is None:
        # pyplot knows the figure, so a notebook and plt.show() show it: once, since no plot returns it.
        import matplotlib.pyplot as plt

        size = figsize or current().size(default or (7.0, 0.8 + 1.5 * count))
        options: dict[str, Any] = {"figsize": size, "layout": "constrained", **_kept_style()}
        _, made = plt.subplots(count, 1, sharex=shared, squeeze=False, **options)
        for each in made[:, 0]:
            _set_ticks(each, size[0])
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


def _set_ticks(ax: Axes, width: float) -> None:
    """At most so many ticks on the abscissa that numbers of six characters are apart, ``width`` in inches."""
    from matplotlib.ticker import MaxNLocator

    most = int(POINTS_OF_INCH * width * SHARE_OF_AXES / (WIDTH_OF_TICK * text_size(USUAL_FONT)))
    ax.xaxis.set_major_locator(MaxNLocator(min(max(most, 2), MOST_TICKS), steps=[1, 2, 2.5, 5, 10]))


def _kept_style() -> dict[str, Any]:
    """What makes a new figure keep the settings of the style."""
    settings = current().settings
    if not settings:
        return {}
    from hybrid.plot.figure import StyledFigure

    return {"FigureClass": StyledFigure, "settings": settings}


def _as_figsize(value: object) -> tuple[float, float]:
    wanted = "be a width and a height in inches, both positive"
    found = arguments.numbers("figsize", value, wanted)
    if found.shape != (2,) or not np.all(np.isfinite(found) & (found > 0)):
        raise arguments.refusal("figsize", wanted, value)
    return float(found[0]), float(found[1])


def member_colours(count: int) -> list[Any]:
    """Colours of the members of a repeat: a scale from dark to light."""
    from matplotlib import colormaps

    return [colormaps["viridis"](place) for place in np.linspace(0.0, 0.85, count)]


def logarithmic(ax: Axes, axis: str) -> None:
    """A logarithmic scale with two labels at least, those of powers of ten alone.

    ``axis`` is ``"x"`` or ``"y"``.
    """
    from matplotlib.ticker import NullFormatter

    getattr(ax, f"set_{axis}scale")("log")
    getattr(ax, f"{axis}axis").set_minor_formatter(NullFormatter())
    low, high = np.log10(getattr(ax, f"get_{axis}lim")())
    if np.floor(high) - np.ceil(low) < 1:
        getattr(ax, f"set_{axis}lim")(*np.power(10.0, [np.floor(low), np.ceil(high)]))


def show_spread(ax: Axes, across: ArrayLike, up: ArrayLike) -> None:
    """Limits around points that differ by rounding alone, as one point has them."""
    for values, limit in ((across, ax.set_xlim), (up, ax.set_ylim)):
        found = np.asarray(values, dtype=float)
        found = found[np.isfinite(found)]
        size = float(np.abs(found).max(initial=0.0))
        if len(found) and np.ptp(found) <= ROUNDING * size:
            limit(found.mean() - WIDE * size, found.mean() + WIDE * size)


def plain(ax: Axes) -> None:
    """Hide the frame at the top and on the right."""
    ax.spines[["top", "right"]].set_visible(False)


def dot_area(across: ArrayLike, up: ArrayLike, size: float | None = None) -> float:
    """Area of each dot of a cloud, as the square of its diameter in points.

    The diameter is ``size``. By default it follows from the number of dots that can be told apart: larger
    for few, smaller for many, but large enough to be seen. Points that lie on each other are one dot.
    """
    if size is not None:
        return diameter(size) ** 2
    share = (dot_size(USUAL_MARKER) / USUAL_MARKER) ** 2
    return max(LEAST_DOT, share * min(LARGEST_SHARE / max(_apart(across, up), 1), USUAL_DOT))


def diameter(size: object) -> float:
    """The diameter of a dot in points."""
    wanted = "be a positive diameter in points, at most 1000"
    found = arguments.positive("size", size, wanted)
    if found > LARGEST_DOT:
        raise arguments.refusal("size", wanted, size)
    return found


def _apart(across: ArrayLike, up: ArrayLike) -> int:
    """How many dots can be told apart: cells of the picture that hold some."""
    points = np.column_stack([np.asarray(each, dtype=float).ravel() for each in (across, up)])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return 0
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    cells = np.floor((points - low) / np.where(extent > 0, extent, 1.0) * CELLS).astype(int)
    return len(np.unique(cells[:, 0] * (CELLS + 1) + cells[:, 1]))


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
        markersize=dot_size(size),
        transform=ax.get_xaxis_transform(),
        label=label,
        clip_on=False,
    )
