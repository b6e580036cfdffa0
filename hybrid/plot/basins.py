"""Basins of attraction as a map, and shares of attractors over a parameter as bands."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from hybrid import arguments
from hybrid.display.ranges import described
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError
from hybrid.plot.axes import (
    axes_for,
    dot_area,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, line_width

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

# No attractor, and starts that violate every mode: grey, and white with a hatch.
NONE_COLOUR, VIOLATES_COLOUR = "#BFBFBF", "#FFFFFF"


@picture
def plot_basins(basins: xarray.Dataset, *, size: float | None = None, **look: Unpack[Look]) -> Axes:
    """Draw which attractor each start leads to: one colour per attractor, over one or two components.

    Starts that lead to none are grey, those that violate every mode are hatched. The points of the
    attractors are drawn on top.

    Parameters
    ----------
    basins
        From :func:`hybrid.basins`, over one or two axes; ``.isel`` takes a plane of more.
    size
        Diameter of the attractors' points in points; by default smaller for more points.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If the basins are over other than one or two axes.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid, models
    >>> from hybrid.plot import plot_basins
    >>> over = {"x": np.linspace(-1.0, 0.9, 20), "v": np.linspace(-2.0, 2.0, 20)}
    >>> ax = plot_basins(hybrid.basins(models.impact_oscillator(), over))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('x', 'v')
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    if not {"label", "steps", "points"} <= set(getattr(basins, "data_vars", ())):
        raise arguments.refusal("basins", "be a dataset made with hybrid.basins", basins)
    dims = tuple(map(str, basins.label.dims))
    if len(dims) not in (1, 2):
        taken = ", ".join(f"{name}=0" for name in dims[2:])
        raise ArgumentError(
            f"basins must be over one or two axes to be drawn; these are over {', '.join(dims) or 'none'}. "
            + (f"Take a plane: basins.isel({taken})." if taken else "Print them.")
        )
    count = basins.sizes["attractor"]
    points = basins.points.values.reshape(-1, basins.sizes["state"])
    area = dot_area(points[:, 0], points[:, -1], size)
    (ax,) = axes_for(look, 1, (6.4, 4.6) if len(dims) == 2 else (6.4, 1.8))
    colours = [VIOLATES_COLOUR, NONE_COLOUR, *(_colour(i) for i in range(count))]
    across, up = dims[0], dims[1] if len(dims) == 2 else None
    x = basins[across].values
    y = basins[up].values if up else np.array([0.0])
    values = basins.label.values.reshape(len(x), len(y)).T
    shades: dict[str, Any] = {
        "cmap": ListedColormap(colours),
        "vmin": -1.5,
        "vmax": count + 0.5,
        "rasterized": True,
    }
    ax.pcolormesh(x, y, values, shading="nearest", **shades)
    if (values == -1).any() and min(values.shape) > 1:
        outside = np.where(values == -1, 1.0, 0.0)
        ax.contourf(x, y, outside, levels=[0.5, 1.5], colors="none", hatches=["////"])
    _draw_points(ax, basins, dims, area)
    ax.set_xlabel(label_of(across, basins[across].attrs.get("units")))
    if up:
        ax.set_ylabel(label_of(up, basins[up].attrs.get("units")))
    else:
        ax.set_yticks([])
    violated = json.loads(basins.attrs.get("violated_modes", "[]"))
    names = [f"violates {' and '.join(violated)}", "no attractor", *_described(basins)]
    present = [i for i in range(count + 2) if (values == i - 1).any()]
    handles = [
        Patch(
            facecolor=colours[i],
            edgecolor="0.4",
            linewidth=line_width(0.5),
            label=names[i],
            hatch="////" * (i == 0),
        )
        for i in present
    ]
    small_legend(ax, handles, side="left", most=1)
    return ax


def _colour(attractor: int) -> str:
    return colour_of(attractor)


def _described(basins: xarray.Dataset) -> list[str]:
    """Each attractor in words, with its share of the starts."""
    found = []
    for i in range(basins.sizes["attractor"]):
        each = basins.isel(attractor=i)
        share = float((basins.label == i + 1).mean())
        motion = _features(each, _sizes(basins)) or _words(
            str(each.kind.values), int(each["round"]), float(each.jumps)
        )
        found.append(f"{i + 1}: {motion} ({share:.1%} of the starts)")
    return found


def _features(found: xarray.Dataset, sizes: list[float]) -> str:
    """The features of an attractor in words, of all values of a parameter if there are several.

    ``sizes`` are those of the features of all attractors.
    """
    if "features" not in found.data_vars:
        return ""
    low, high = (found[name] for name in ("lowest_feature", "highest_feature"))
    along = [dim for dim in low.dims if dim != "feature"]
    low, high = low.min(along), high.max(along)
    if not np.isfinite(low.values).all():
        return ""
    names = [str(name) for name in found.feature.values]
    ends = zip(low.values.tolist(), high.values.tolist(), strict=True)
    return described(dict(zip(names, ends, strict=True)), dict(zip(names, sizes, strict=True)))


def _sizes(found: xarray.Dataset) -> list[float]:
    """The largest size of each feature among all attractors; empty without features."""
    if "features" not in found.data_vars:
        return []
    sizes: list[float] = (
        abs(found.features).max([dim for dim in found.features.dims if dim != "feature"]).values.tolist()
    )
    return sizes


def _words(kind: str, points: int, jumps: float) -> str:
    if points and kind == "periodic":
        return f"{kind}, {counted(points, 'point')} and {counted(round(jumps), 'jump')} per round"
    return kind


def _draw_points(ax: Axes, basins: xarray.Dataset, dims: tuple[str, ...], area: float) -> None:
    names = list(map(str, basins.state.values))
    limits = ax.get_xlim(), ax.get_ylim()
    for i in range(basins.sizes["attractor"]):
        points = basins.points.values[i]
        points = points[np.isfinite(points).all(axis=1)]
        up = points[:, names.index(dims[1])] if len(dims) == 2 else np.zeros(len(points))
        across = points[:, names.index(dims[0])]
        ax.scatter(across, up, s=area, color="black", edgecolors="white", linewidths=0.3, rasterized=True)
    ax.set_xlim(limits[0])
    ax.set_ylim(limits[1])


@picture
def plot_fractions(fractions: xarray.Dataset, **look: Unpack[Look]) -> Axes:
    """Draw the shares of starts that lead to each attractor: bands over a parameter, or bars without one.

    Parameters
    ----------
    fractions
        From :func:`hybrid.basin_fractions`.

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_fractions
    >>> ranges = {"x": (-1.0, 0.9), "v": (-2.0, 2.0)}
    >>> found = hybrid.basin_fractions(models.impact_oscillator(), ranges, starts=50)
    >>> plot_fractions(found).get_ylabel()
    'share of the starts'
    """
    if not {"fraction", "standard_error"} <= set(getattr(fractions, "data_vars", ())):
        raise arguments.refusal("fractions", "be a dataset made with hybrid.basin_fractions", fractions)
    (ax,) = axes_for(look, 1, (6.4, 3.6))
    labels = fractions.label.values.tolist()
    colours = {-1: VIOLATES_COLOUR, 0: NONE_COLOUR}
    shown = [label for label in [*(each for each in labels if each > 0), 0, -1] if label in labels]
    along = [str(dim) for dim in fractions.fraction.dims if dim != "label"]
    if along and fractions.sizes[along[0]] == 1:
        fractions, along = fractions.isel({along[0]: 0}), []
    below: Any = 0.0
    for label in shown:
        colour, name = colours.get(label, _colour(label - 1)), _name(fractions, label)
        share = np.nan_to_num(fractions.fraction.sel(label=label).values)
        edge: dict[str, Any] = {"facecolor": colour, "edgecolor": "0.4", "linewidth": 0.5}
        if not np.any(share):
            continue
        if along:
            ax.fill_between(fractions[along[0]].values, below, below + share, label=name, **edge)
            below = below + share
        else:
            error = float(fractions.standard_error.sel(label=label))
            ax.bar(str(label), float(share), yerr=error, label=name, capsize=3, **edge)
    if along:
        ax.set_xlabel(label_of(along[0], fractions[along[0]].attrs.get("units")))
        ax.set_xlim(fractions[along[0]].values.min(), fractions[along[0]].values.max())
        ax.set_ylim(0.0, 1.0)
    ax.set_ylabel("share of the starts")
    small_legend(ax, side="left", most=2)
    return ax


def _name(fractions: xarray.Dataset, label: int) -> str:
    if label < 1:
        return "no attractor" if label == 0 else "violates every mode"
    told = _features(fractions.sel(label=label), _sizes(fractions))
    if told:
        return f"{label}: {told}"
    kinds = fractions.kind.sel(label=label).values
    kinds = [str(each) for each in np.atleast_1d(kinds).tolist() if each]
    return f"{label}: {', '.join(dict.fromkeys(kinds))}"
