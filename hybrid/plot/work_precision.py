"""Error over time, one line per method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import numpy as np

from hybrid import arguments
from hybrid.accuracy.work_precision import WorkPrecision
from hybrid.plot.axes import (
    axes_for,
    logarithmic,
    plain,
)
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import COLOURS, colour_of, dot_size, line_width, small_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = "osD^vP*"
# Height of a line of small text in points, which keeps labels apart.
LABEL_HEIGHT = 9.0


@picture
def plot_work_precision(result: WorkPrecision, quantity: str = "state", **look: Unpack[Look]) -> Axes:
    """Draw error over time on logarithmic scales: one line per method, the reference's own error in grey.

    Nearer to the lower left is better. Failed runs and errors of exactly zero are not drawn.

    Parameters
    ----------
    result
        From :func:`hybrid.work_precision`.
    quantity
        Which error: ``"state"``, ``"times"``, ``"saltation"``, ``"fundamental"`` or ``"exponents"``.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If the quantity was not measured.

    Examples
    --------
    >>> import hybrid, models
    >>> from hybrid.plot import plot_work_precision
    >>> found = hybrid.work_precision(
    ...     models.impact_oscillator(), (0.0, 0.0), (0.0, 10.0), tolerances=[1e-5, 1e-8], repeats=1
    ... )
    >>> ax = plot_work_precision(found)
    >>> ax.get_xscale(), ax.get_yscale()
    ('log', 'log')
    """
    if not isinstance(result, WorkPrecision):
        raise arguments.refusal("result", "be a WorkPrecision, from hybrid.work_precision", result)
    error = result.error_of(quantity)
    (ax,) = axes_for(look, 1, (6.4, 4.6))
    ends = []
    for index, method in enumerate(result.methods):
        rows = result.rows_of(method) & np.isfinite(error) & (error > 0)
        if not np.any(rows):
            continue
        colour, marker = colour_of(index), MARKERS[index // len(COLOURS) % len(MARKERS)]
        ax.loglog(
            result.seconds[rows],
            error[rows],
            marker=marker,
            color=colour,
            markersize=dot_size(4),
            linewidth=line_width(1.4),
        )
        ends.append((float(result.seconds[rows][-1]), float(error[rows][-1]), method, colour))
    floor = result.reference_error[quantity]
    if ends and np.isfinite(floor) and floor > 0:
        low = ax.get_ylim()[0]
        ax.axhspan(min(floor, low) / 10, floor, color="0.88", linewidth=0, zorder=0)
        ax.set_ylim(bottom=min(low, floor / 3))
    ax.set_xlabel("seconds")
    ax.set_ylabel(f"error of the {quantity}")
    plain(ax)
    if ends:
        _label_ends(ax, ends)
    return ax


def _label_ends(ax: Axes, ends: list[tuple[float, float, str, str]]) -> None:
    """Write the methods' names to the right of their points, moved apart so that none overlap."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    # The limits must be set before the layout: it would shift the points that the labels refer to.
    for axis in ("x", "y"):
        logarithmic(ax, axis)
    low, high = ax.get_xlim()
    ax.set_xlim(low, high * (high / low) ** 0.45)
    figure.draw_without_rendering()
    point = figure.dpi / 72
    placed: list[tuple[float, float, float]] = []
    for seconds, error, method, colour in sorted(ends, key=lambda end: end[1]):
        x, y = ax.transData.transform((seconds, error)) / point
        width, height = 0.55 * LABEL_HEIGHT * len(method), y
        for left, right, other in sorted(placed, key=lambda label: label[2]):
            if left < x + width and x < right and abs(height - other) < LABEL_HEIGHT:
                height = other + LABEL_HEIGHT
        placed.append((x, x + width, height))
        ax.annotate(
            method,
            (seconds, error),
            (6.0, height - y),
            textcoords="offset points",
            va="center",
            fontsize=small_text(),
            color=colour,
        )
