"""Datasets of many runs, and of a task at every point of a grid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.plot.axes import (
    Rows,
    as_component,
    axes_for,
    dot_area,
    mark,
    plain,
    show_spread,
    told,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.orbits import beside
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import colour_of, dot_size, line_width
from hybrid.status import StatusCode

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

WHERE = ".message"
FAILED_COLOUR = "#B2182B"
# Variables with the states and the outputs of datasets.
ENDS, SECTION = ("x_end", "outputs_end"), ("section", "section_outputs")


@picture
def plot_ends(
    ends: xarray.Dataset,
    x: str | int = 0,
    y: str | int | None = None,
    *,
    size: float | None = None,
    **look: Unpack[Look],
) -> Axes:
    """Draw where many runs end, in the plane of two components or outputs: one colour per mode.

    Crosses are runs that failed.

    Parameters
    ----------
    ends
        From :func:`hybrid.simulate_many`.
    x, y
        Names or indices of components, or names of outputs that the dataset has; by default the first two
        components. The ends of a state with one component are drawn over the starts.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a component does not exist.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid, models
    >>> from hybrid.plot import plot_ends
    >>> starts = np.column_stack([np.linspace(-1.0, 0.9, 20), np.zeros(20)])
    >>> ax = plot_ends(hybrid.simulate_many(models.impact_oscillator(), starts, (0.0, 10.0)))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('x', 'v')
    """
    if not {"x0", "x_end", "mode_end", "status"} <= set(getattr(ends, "data_vars", ())):
        raise arguments.refusal("ends", "be a dataset made with hybrid.simulate_many", ends)
    first, across = column("x", ends, x, ENDS)
    other = beside([*map(str, ends.state.values)], first) if y is None else y
    over = column_label(ends, first)
    if other is None:
        across, other, over = ends.x0.values[:, 0], first, f"start of {over}"
    last, up = column("y", ends, other, ENDS)
    area = dot_area(across, up, size)
    (ax,) = axes_for(look, 1, (5.0, 4.2))
    modes, good = ends.mode_end.values.astype(str), ends.status.values == StatusCode.SUCCESS
    for index, mode in enumerate(sorted(set(modes[good]))):
        there = good & (modes == mode)
        colour = colour_of(index)
        ax.scatter(across[there], up[there], s=area, color=colour, linewidths=0, label=mode, rasterized=True)
    if not good.all():
        label = told(ends.status.values, WHERE)
        ax.scatter(across[~good], up[~good], s=25.0, color=FAILED_COLOUR, marker="x", label=label)
    ax.set_xlabel(over)
    ax.set_ylabel(column_label(ends, last))
    show_spread(ax, across[good], up[good])
    plain(ax)
    if len(set(modes[good])) > 1 or not good.all():
        small_legend(ax)
    return ax


@picture
def plot_sweep(swept: xarray.Dataset, *, size: float | None = None, **look: Unpack[Look]) -> Rows:
    """Draw each number of a sweep: over one axis as dots on a line, over two axes as a map.

    Parameters
    ----------
    swept
        From :func:`hybrid.sweep`, over one or two axes.
    ax
        Axes to draw into, one per number; by default those of a new figure.

    Returns
    -------
    numpy.ndarray
        The axes, one per number; ``.figure`` is their figure.

    Raises
    ------
    ArgumentError
        If the sweep is over other than one or two axes, or no result is one real number per point.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_sweep
    >>> ball = models.bouncing_ball()
    >>> def task(point):
    ...     return {"jumps": len(hybrid.simulate(ball, (1.0, 0.0), (0.0, 2.0), parameters=point).jumps)}
    >>> (ax,) = plot_sweep(hybrid.sweep(task, {"e": [0.5, 0.6, 0.7]}))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('e', 'jumps')
    """
    if not {"status", "message"} <= set(getattr(swept, "data_vars", ())):
        raise arguments.refusal("swept", "be a dataset made with hybrid.sweep", swept)
    dims = tuple(map(str, swept.status.dims))
    _check_axes(swept, dims)
    numbers = [
        str(name)
        for name, values in swept.data_vars.items()
        if values.dims == dims and values.dtype.kind in "fiu" and name != "status"
    ]
    if not numbers:
        raise ArgumentError(f"swept must hold one real number per point to be drawn; {_instead(swept, dims)}")
    places = np.arange(swept.status.size)
    area = dot_area(places, places, size)
    high = 1.5 if len(dims) == 1 else 3.0
    axes = axes_for(look, len(numbers), (6.4, 0.8 + high * len(numbers)))
    failed = swept.status.values != StatusCode.SUCCESS
    for row, name in zip(axes, numbers, strict=True):
        label = label_of(name, swept[name].attrs.get("units"))
        if len(dims) == 1:
            _draw_line(row, swept, dims[0], name, failed, area)
            row.set_ylabel(label)
        else:
            _draw_map(row, swept, dims, name, failed, label)
        plain(row)
    for row in axes if len(dims) == 2 else axes[-1:]:
        row.set_xlabel(_axis_label(swept, dims[-1]))
    if failed.any():
        small_legend(axes[0])
    return axes


def _draw_line(ax: Axes, swept: xarray.Dataset, dim: str, name: str, failed: np.ndarray, area: float) -> None:
    at, values = swept[dim].values, swept[name].values
    order = np.argsort(at)
    ax.plot(
        at[order],
        values[order],
        "o-",
        color=colour_of(0),
        linewidth=line_width(0.9),
        markersize=np.sqrt(area),
    )
    if failed.any():
        mark(ax, at[failed], "|", FAILED_COLOUR, told(swept.status.values, WHERE))


def _draw_map(
    ax: Axes, swept: xarray.Dataset, dims: tuple[str, ...], name: str, failed: np.ndarray, label: str
) -> None:
    down, across = dims
    x, y = swept[across].values, swept[down].values
    values = np.ma.masked_invalid(np.where(failed, np.nan, swept[name].values.astype(float)))
    picture = ax.pcolormesh(x, y, values, shading="nearest", cmap="viridis", rasterized=True)
    ax.figure.colorbar(picture, ax=ax, label=label)
    if failed.any():
        rows, columns = np.nonzero(failed)
        said = told(swept.status.values, WHERE)
        ax.plot(
            x[columns], y[rows], "x", color=FAILED_COLOUR, markersize=dot_size(5), label=said, clip_on=False
        )
    ax.set_ylabel(_axis_label(swept, down))


def _check_axes(swept: xarray.Dataset, dims: tuple[str, ...]) -> None:
    if len(dims) not in (1, 2):
        taken = ", ".join(f"{name}=0" for name in dims[:-2])
        remedy = f"Take a plane: swept.isel({taken})." if dims else "Print it."
        raise ArgumentError(
            f"swept must be over one or two axes to be drawn; this one is over {', '.join(dims) or 'none'}. "
            f"{remedy}"
        )
    for dim in dims:
        columns = [str(name) for name, values in swept.coords.items() if values.dims == (dim,)]
        if dim not in swept.coords and columns:
            raise ArgumentError(
                f"swept must be over axes with values; this one is over a table of points of "
                f"{', '.join(columns)}. Name the one to draw over: swept.swap_dims({dim}={columns[0]!r})."
            )


def _instead(swept: xarray.Dataset, dims: tuple[str, ...]) -> str:
    """What the dataset holds instead, and how to get one number per point."""
    for name, values in swept.data_vars.items():
        inner = [str(dim) for dim in values.dims if dim not in dims]
        if inner and values.dtype.kind in "fiu":
            taken = ", ".join(f"{dim}=0" for dim in inner)
            return f"{name} is an array per point. Take an entry: swept.isel({taken})."
    return "this one holds none. Let the task return a mapping of names to numbers."


def _axis_label(swept: xarray.Dataset, name: str) -> str:
    return label_of(name, swept[name].attrs.get("units"))


def column(
    argument: str, dataset: xarray.Dataset, given: object, variables: tuple[str, str]
) -> tuple[str, np.ndarray]:
    """A component or an output by the name or index that the argument gives, and its values.

    ``variables`` hold the states and the outputs of the dataset.
    """
    states, outputs = variables
    name = column_name(argument, dataset, given, outputs)
    of_state = name in dataset.state.values
    found = dataset[states].sel(state=name) if of_state else dataset[outputs].sel(output=name)
    return name, found.values


def column_name(argument: str, dataset: xarray.Dataset, given: object, outputs: str) -> str:
    """The name of a component, or of an output that the dataset holds in the variable ``outputs``."""
    names = [*map(str, dataset.state.values)]
    more = [*map(str, dataset.output.values)] if outputs in dataset.data_vars else []
    return [*names, *more][as_component(argument, names, given, more)]


def column_label(dataset: xarray.Dataset, name: str) -> str:
    """The name of a component or an output with its unit, if the dataset has one."""
    for axis, unit in (("state", "unit"), ("output", "output_unit")):
        if unit in dataset.coords and name in dataset[axis].values:
            return label_of(name, str(dataset[unit].sel({axis: name}).values))
    return name
