"""Estimates of exponents over the number of intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, arguments
from hybrid.plot.axes import (
    axes_for,
    logarithmic,
    mark,
)
from hybrid.plot.labels import label_of
from hybrid.plot.legends import small_legend
from hybrid.plot.picture import Look, picture
from hybrid.plot.styles import INK, colour_of, dot_size, line_width
from lyapunov.spectrum import LyapunovSpectrum
from lyapunov.two_orbit import TwoOrbitExponents

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MINUS_INFINITY = "minus infinity"
POINTS_OF_A_LINE = 1500
# What stays free behind the last estimate, as a factor, so that its bar is seen.
LITTLE = 1.1
FIGURE = (6.4, 3.8)


@picture
def plot_convergence(
    estimates: Mapping[str, ArrayLike],
    *,
    points: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    points_label: str = "published",
    truth: float | None = None,
    truth_label: str = "exact",
    unit: str = "",
    **look: Unpack[Look],
) -> Axes:
    """Estimates of an exponent against the number of intervals.

    Parameters
    ----------
    estimates
        Maps each label to its history ``(M,)`` over 1, 2, ..., M intervals.
    points
        Maps a label to a pair, numbers of intervals and values: other estimates, drawn in the label's colour.
    truth
        Exact value, drawn as a line.
    points_label, truth_label
        Names of the points and of the line in the legend.
    unit
        Unit of the estimates, for the axis.

    Examples
    --------
    >>> import numpy as np
    >>> from lyapunov.plot import plot_convergence
    >>> ax = plot_convergence({"one": 1.0 + 1.0 / np.arange(1, 100)}, truth=1.0)
    >>> [line.get_label() for line in ax.lines]
    ['exact', 'one']
    """
    histories = {
        label: numbers(f"estimates[{arguments.shown(label)}]", estimate, 1)
        for label, estimate in arguments.mapping("estimates", estimates, "map labels to histories").items()
    }
    points = {
        label: _pair(f"points[{arguments.shown(label)}]", pair)
        for label, pair in arguments.mapping("points", points, "map labels to numbers and values").items()
    }
    for name, text in (("points_label", points_label), ("truth_label", truth_label), ("unit", unit)):
        arguments.instance(name, text, str)
    truth = None if truth is None else arguments.number("truth", truth)
    (ax,) = axes_for(look, 1, FIGURE)
    # Later lines are thinner, so that both of two coinciding lines are visible.
    widths = (2.2, 0.9) if len(histories) > 1 else (1.3,)
    if truth is not None:
        ax.axhline(
            truth, color=INK, linewidth=line_width(0.8), linestyle=(0, (4, 3)), label=truth_label, zorder=1
        )
    for i, (label, history) in enumerate(histories.items()):
        at = np.unique(np.geomspace(1, len(history) + 0.5, POINTS_OF_A_LINE).astype(int))
        at = at[(at > 0) & (at <= len(history))]
        width, colour = widths[min(i, 1)], colour_of(i)
        ax.plot(at, history[at - 1], color=colour, label=label, linewidth=width)
        if label in points:
            ax.plot(*points[label], "o", color=colour, markersize=dot_size(4.5), markerfacecolor="white")
    if not any(np.isfinite(history).any() for history in histories.values()):
        # Lines without a point give the axes no length.
        ax.set_xlim(1.0, 1.0 + max([1, *map(len, histories.values())]))
    if points:
        ax.plot([], [], "o", color=INK, markersize=dot_size(4.5), markerfacecolor="white", label=points_label)
    logarithmic(ax, "x")
    ax.set_xlabel("intervals $M$")
    ax.set_ylabel(label_of("exponent estimate", unit))
    ax.grid(True, axis="y")
    if ax.get_legend_handles_labels()[0]:
        small_legend(ax)
    return ax


@picture
def plot_spectrum(spectrum: LyapunovSpectrum, **look: Unpack[Look]) -> Axes:
    """Estimates of the exponents against the number of intervals, with a bar of two standard errors.

    Parameters
    ----------
    spectrum
        From :func:`lyapunov.lyapunov_spectrum`, with its history.

    Raises
    ------
    ArgumentError
        If the spectrum has no history.

    Examples
    --------
    >>> import models
    >>> from lyapunov import lyapunov_spectrum
    >>> from lyapunov.plot import plot_spectrum
    >>> spectrum = lyapunov_spectrum(models.impact_oscillator(), (0.0, 0.0), intervals=300)
    >>> plot_spectrum(spectrum).get_xlabel()
    'intervals $M$'
    """
    arguments.instance("spectrum", spectrum, LyapunovSpectrum, "Make one with lyapunov.lyapunov_spectrum.")
    if not len(spectrum.growths):
        raise ArgumentError("spectrum must have a history; this one has none. Compute it with history=True.")
    labels = [f"$\\lambda_{{{i + 1}}}$ = {value:.5g}" for i, value in enumerate(spectrum.exponents)]
    history = {label: spectrum.history[:, i] for i, label in enumerate(labels)}
    ax = plot_convergence(
        history,
        truth=0.0,
        truth_label="zero",
        unit=spectrum.names.rate.get("units", ""),
        **look,
    )
    values, errors = spectrum.exponents, 2 * spectrum.standard_error
    shown = np.isfinite(values)
    if np.isneginf(values).any():
        mark(ax, [len(spectrum.growths)], "v", INK, MINUS_INFINITY)
        small_legend(ax)
    for i in np.flatnonzero(shown):
        ax.errorbar(
            len(spectrum.growths),
            values[i],
            errors[i],
            color=colour_of(int(i)),
            capsize=3,
            linewidth=line_width(1),
        )
    _frame(ax, spectrum.history[:, shown], [*(values - errors)[shown], *(values + errors)[shown], 0.0])
    return ax


def _frame(ax: Axes, history: np.ndarray, least: list[float]) -> None:
    """Limits that no curve leaves: the first estimates, which are far off, are left out.

    The height fits the later nine tenths, and the values ``least``.
    """
    late = history[len(history) // 10 :].ravel()
    inside = [*least, *late[np.isfinite(late)]]
    bottom, top = min(inside), max(inside)
    margin = 0.1 * (top - bottom) or 1.0
    bottom, top = bottom - margin, top + margin
    ax.set_ylim(bottom, top)
    out = np.flatnonzero(((history < bottom) | (history > top)).any(axis=1))
    # The row i is the estimate after i + 1 intervals.
    first, last = (int(out[-1]) + 2 if len(out) else 1), max(len(history), 2)
    for line in ax.lines:
        x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        if len(x) == len(y) > 2:
            line.set_data(x[x >= first], y[x >= first])
    # Two powers of ten are shown.
    left = 10.0 ** min(np.floor(np.log10(first)), np.floor(np.log10(last)) - 1)
    ax.set_xlim(max(left, 1.0), last * LITTLE)


@picture
def plot_two_orbits(result: TwoOrbitExponents, **look: Unpack[Look]) -> Axes:
    """Estimates from two orbits over the number of intervals: two that saturate, one that converges.

    Parameters
    ----------
    result
        From :func:`lyapunov.two_orbit_exponents`.

    Examples
    --------
    >>> import models
    >>> from lyapunov import two_orbit_exponents
    >>> from lyapunov.plot import plot_two_orbits
    >>> result = two_orbit_exponents(models.impact_oscillator(), (0.0, 0.0), intervals=300)
    >>> len(plot_two_orbits(result).lines)
    4
    """
    arguments.instance("result", result, TwoOrbitExponents, "Make one with lyapunov.two_orbit_exponents.")
    histories = {
        "renormalised, converges": result.renormalised,
        "one piece, saturates": result.single_piece,
        "undivided, saturates": result.undivided,
    }
    return plot_convergence(histories, truth=0.0, truth_label="zero", unit=result.unit, **look)


def numbers(name: str, value: object, axes: int) -> np.ndarray:
    """An array of numbers with the given number of axes."""
    wanted = f"be an array of numbers of {axes} dimension{'s' if axes > 1 else ''}"
    found = arguments.numbers(name, value, wanted)
    if found.ndim != axes:
        raise arguments.refusal(name, wanted, value)
    return found


def _pair(name: str, value: object) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of intervals, and the values after them."""
    wanted = "be two lists of numbers of one length"
    both = arguments.items(name, value, wanted)
    if len(both) != 2:
        raise arguments.refusal(name, wanted, value)
    at, values = (numbers(name, each, 1) for each in both)
    if len(at) != len(values):
        raise arguments.refusal(name, wanted, value)
    return at, values
