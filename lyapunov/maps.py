"""Maps of exponents over two axes of a chart, and what motion their signs tell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from hybrid import ArgumentError, StatusCode, arguments
from hybrid.plot.axes import (
    axes_for,
    check_look,
    told,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import current, line_width

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

FIGURE = (5.6, 4.4)
KINDS = ("not known", "at rest", "periodic", "torus", "chaotic")
# Grey where nothing is known; the others are distinct for the colour-blind, and in grey.
COLOURS_OF_KINDS = ("#BFBFBF", "#FFFFFF", "#56B4E9", "#F0E442", "#B2182B")
# Exponents of minus infinity; darker than any blue of the scale.
LOST = "#10103F"
# Share of the values that the colours tell apart: a few large exponents do not leave the rest pale.
SHOWN = 0.98
# Share of a step by which equally spaced values may differ.
EVEN = 1e-6


def as_chart(value: Any) -> Any:
    """A dataset of :func:`lyapunov.chart`."""
    if "exponents" not in getattr(value, "data_vars", ()):
        raise arguments.refusal("chart", "be a dataset made with lyapunov.chart", value)
    return value


def axes_of(chart: Any) -> tuple[str, ...]:
    """Names of the axes of the grid."""
    return tuple(map(str, chart.status.dims))


def settled(chart: xarray.Dataset) -> np.ndarray:
    """The exponents ``(*grid, k)``; those within two standard errors of zero are zero."""
    values = chart.exponents.values
    return np.where(np.abs(values) <= 2 * chart.standard_error.values, 0.0, values)


def kinds(chart: xarray.Dataset) -> xarray.DataArray:
    """What motion each row settles on, by the signs of its exponents: an index into ``KINDS``.

    An exponent within two standard errors of zero counts as zero. Chaotic: some exponent is positive. Torus:
    an exponent is zero. Periodic: all are negative. A system without a forcing period has one more zero, that
    of the direction of the flow, unless it comes to rest; so it takes ``k=2`` to tell a torus there. Nothing
    is known of rows that did not reach their end.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over any axes.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> from lyapunov.maps import KINDS
    >>> from lyapunov.plot import kinds
    >>> swept = chart(models.impact_oscillator(), {"c": [0.1, 0.2]}, (0.0, 0.0), k=2, intervals=1000)
    >>> [KINDS[int(kind)] for kind in kinds(swept)]
    ['periodic', 'periodic']
    """
    values = settled(as_chart(chart))
    known = np.isfinite(values[..., 0]) | np.isneginf(values[..., 0])
    known &= chart.status.values == StatusCode.SUCCESS
    zeros = (values == 0.0).sum(axis=-1)
    if chart.attrs.get("forced", "yes") == "yes":
        regular = np.where(zeros > 0, KINDS.index("torus"), KINDS.index("periodic"))
    else:
        regular = np.choose(np.minimum(zeros, 2), [KINDS.index(name) for name in KINDS[1:4]])
    found = np.where((values > 0.0).any(axis=-1), KINDS.index("chaotic"), regular)
    words = " ".join(name.replace(" ", "_") for name in KINDS)
    flags = {"flag_values": list(range(len(KINDS))), "flag_meanings": words}
    return chart.status.copy(data=np.where(known, found, 0)).assign_attrs(flags).rename("kind")


@picture
def plot_map(chart: xarray.Dataset, exponent: int = 0, **look: Unpack[Look]) -> Axes:
    """Map of an exponent over two axes: red if positive, blue if negative.

    Rows that failed are grey, and exponents of minus infinity dark blue; a legend says so.
    An exponent within two standard errors of zero is drawn as zero, in white: noise does not look like chaos.
    The scale ends at the value that 98 % of the others do not exceed.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over two axes; ``.sel`` takes a plane of three axes.
    exponent
        Index of the exponent, 0 for the largest.

    Raises
    ------
    ArgumentError
        If the chart is not over two axes.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> from lyapunov.plot import plot_map
    >>> over = {"c": [0.1, 0.2], "r": [0.7, 0.8]}
    >>> ax = plot_map(chart(models.impact_oscillator(), over, (0.0, 0.0), intervals=200))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('r', 'c')
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    check_look(look)
    exponent = arguments.count("exponent", exponent, 0, as_chart(chart).sizes["exponent"] - 1)
    two_axes(chart)
    values = settled(chart)[..., exponent]
    failed = (chart.status.values != StatusCode.SUCCESS) | np.isnan(values) | np.isposinf(values)
    lost = np.isneginf(values) & ~failed
    values = np.where(failed | lost, np.nan, values)
    sizes = np.abs(values[np.isfinite(values) & (values != 0.0)])
    limit = float(np.quantile(sizes, SHOWN)) if sizes.size else 1.0
    (ax,) = axes_for(look, 1, FIGURE)
    shades = {"cmap": current().diverging, "vmin": -limit, "vmax": limit}
    picture = _drawn(chart, np.ma.masked_invalid(values), ax, shades)
    label = label_of(f"$\\lambda_{{{exponent + 1}}}$", chart.exponents.attrs.get("units"))
    ax.figure.colorbar(picture, ax=ax, extend="both", label=label)
    said = told(chart.status.values, "chart.message")
    marked = [(failed, COLOURS_OF_KINDS[0], said), (lost, LOST, "minus infinity")]
    if lost.any():
        shade = {"cmap": ListedColormap([LOST]), "vmin": 0.0, "vmax": 1.0}
        _drawn(chart, np.ma.masked_array(np.ones(lost.shape), ~lost), ax, shade)
    handles = [Patch(facecolor=colour, label=text) for where, colour, text in marked if where.any()]
    if handles:
        small_legend(ax, handles)
    return ax


@picture
def plot_kinds(chart: xarray.Dataset, **look: Unpack[Look]) -> Axes:
    """Map of the kinds of motion over two axes: periodic, torus, chaotic (see :func:`kinds`).

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over two axes; ``.sel`` takes a plane of three axes.

    Raises
    ------
    ArgumentError
        If the chart is not over two axes.

    Examples
    --------
    >>> import models
    >>> from lyapunov import chart
    >>> from lyapunov.plot import plot_kinds
    >>> over = {"c": [0.1, 0.2], "r": [0.7, 0.8]}
    >>> ax = plot_kinds(chart(models.impact_oscillator(), over, (0.0, 0.0), k=2, intervals=200))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('r', 'c')
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    check_look(look)
    two_axes(as_chart(chart))
    found = kinds(chart).values
    (ax,) = axes_for(look, 1, FIGURE)
    shades = {"cmap": ListedColormap(COLOURS_OF_KINDS), "vmin": -0.5, "vmax": len(KINDS) - 0.5}
    _drawn(chart, found, ax, shades)
    patches = [
        Patch(facecolor=COLOURS_OF_KINDS[i], edgecolor="0.4", linewidth=line_width(0.5), label=KINDS[i])
        for i in np.unique(found)
    ]
    small_legend(ax, patches)
    return ax


def _drawn(chart: xarray.Dataset, values: Any, ax: Axes, shades: dict[str, Any]) -> Any:
    """Values over the two axes of a chart: an image where both are evenly spaced, else a mesh."""
    down, across = two_axes(chart)
    x, y = chart[across].values, chart[down].values
    ax.set_facecolor(COLOURS_OF_KINDS[0])
    if _is_even(x) and _is_even(y):
        dx, dy = (x[1] - x[0]) / 2, (y[1] - y[0]) / 2
        extent = (x[0] - dx, x[-1] + dx, y[0] - dy, y[-1] + dy)
        options: dict[str, Any] = {"origin": "lower", "aspect": "auto", "interpolation": "nearest"}
        picture: Any = ax.imshow(values, extent=extent, **options, **shades)
    else:
        picture = ax.pcolormesh(x, y, values, shading="nearest", rasterized=True, **shades)
    ax.set_xlabel(label_of(across, chart[across].attrs.get("units")))
    ax.set_ylabel(label_of(down, chart[down].attrs.get("units")))
    return picture


def _is_even(values: np.ndarray) -> bool:
    """Whether values rise in equal steps."""
    steps = np.diff(values)
    return len(steps) > 0 and steps.min() > 0 and np.ptp(steps) <= EVEN * steps.max()


def two_axes(chart: xarray.Dataset) -> tuple[str, str]:
    """Names of the two axes of a chart, or an ArgumentError."""
    names = axes_of(chart)
    if len(names) != 2:
        taken = ", ".join(f"{name}=0" for name in names[:-2])
        remedy = f"Take a plane: chart.isel({taken})." if taken else "Use plot_exponents."
        raise ArgumentError(
            f"chart must be over two parameters for a map; this one is over {' and '.join(names) or 'none'}. "
            f"{remedy}"
        )
    return names[0], names[1]
