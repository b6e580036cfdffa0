"""Charts of exponents and orbits: each function draws on the given axes or makes a new figure."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridArc, StatusCode, arguments
from hybrid.plot import DATASETS, drawn
from hybrid.plot.style import as_component, axes_for, dot_area
from lyapunov.maps import as_chart, axes_of, kinds, label_of, plot_kinds, plot_map, two_axes
from lyapunov.spectrum import LyapunovSpectrum

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Distinct for the colour-blind and in grey: M. Okabe, K. Ito, "Color universal design" (2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555")
INK = "#333333"
# Points of a section that spread less than this share of the orbit are drawn as one fixed point.
SAME_POINT = 1e-6
STYLE: Any = {
    "figure.constrained_layout.use": True,
    "savefig.dpi": 160,
    "font.size": 9,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.6,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "legend.fontsize": 8,
    "lines.linewidth": 1.3,
}

__all__ = [
    "kinds",
    "plot_bifurcation",
    "plot_chart",
    "plot_convergence",
    "plot_exponents",
    "plot_kinds",
    "plot_map",
    "plot_phase_portrait",
    "plot_spectrum",
    "style",
]

POINTS_OF_A_LINE = 1500
POINTS_OF_A_PORTRAIT = 40_000
FIGURE = (6.4, 3.8)


def style() -> AbstractContextManager[None]:
    """Matplotlib settings for these charts: ``with style(): ...``."""
    import matplotlib

    return matplotlib.rc_context(STYLE)


def plot_convergence(
    estimates: Mapping[str, ArrayLike],
    *,
    points: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    points_label: str = "published",
    truth: float | None = None,
    truth_label: str = "exact",
    ax: Axes | None = None,
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
    ax
        Axes to draw into; by default those of a new figure.
    """
    histories = {
        label: _numbers(f"estimates[{arguments.shown(label)}]", estimate, 1)
        for label, estimate in arguments.mapping("estimates", estimates, "map labels to histories").items()
    }
    points = {
        label: _pair(f"points[{arguments.shown(label)}]", pair)
        for label, pair in arguments.mapping("points", points, "map labels to numbers and values").items()
    }
    for name, text in (("points_label", points_label), ("truth_label", truth_label)):
        arguments.instance(name, text, str)
    truth = None if truth is None else arguments.number("truth", truth)
    (ax,) = axes_for(ax, 1, figsize=FIGURE)
    # Later lines are thinner, so that both of two coinciding lines are visible.
    widths = (2.2, 0.9) if len(histories) > 1 else (1.3,)
    if truth is not None:
        ax.axhline(truth, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), label=truth_label, zorder=1)
    for i, (label, history) in enumerate(histories.items()):
        at = np.unique(np.geomspace(1, len(history) + 0.5, POINTS_OF_A_LINE).astype(int))
        at = at[(at > 0) & (at <= len(history))]
        width, colour = widths[min(i, 1)], COLOURS[i % len(COLOURS)]
        ax.plot(at, history[at - 1], color=colour, label=label, linewidth=width)
        if label in points:
            ax.plot(*points[label], "o", color=colour, markersize=4.5, markerfacecolor="white")
    if points:
        ax.plot([], [], "o", color=INK, markersize=4.5, markerfacecolor="white", label=points_label)
    ax.set_xscale("log")
    ax.set_xlabel("intervals $M$")
    ax.set_ylabel("exponent estimate")
    ax.grid(True, axis="y")
    if ax.get_legend_handles_labels()[0]:
        ax.legend()
    return ax


def plot_phase_portrait(
    arc: HybridArc,
    x: str,
    y: str,
    *,
    section: ArrayLike | None = None,
    labels: tuple[str, str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Orbit in the plane of two state components, with jumps as straight lines and points of a section.

    Parameters
    ----------
    arc
        An arc with dense output, simulated without ``samples``.
    x, y
        Names of the components.
    section
        Points ``(N, n)`` to mark.
    labels
        Labels of the axes; by default the names.
    ax
        Axes to draw into; by default those of a new figure.
    """
    system = arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.").system
    i, j = as_component("x", system.state_names, x), as_component("y", system.state_names, y)
    marks = None if section is None else _numbers("section", section, 2)
    if marks is not None and marks.shape[1] != system.dimension:
        raise arguments.refusal("section", f"hold points of {system.dimension} components", section)
    across, up = axis_labels(labels, system.state_names[i], system.state_names[j])
    (ax,) = axes_for(ax, 1, figsize=FIGURE)
    orbit = _dense(arc)
    ax.plot(orbit[:, i], orbit[:, j], color=COLOURS[5], linewidth=0.5, alpha=0.8, rasterized=True)
    if marks is not None:
        # A large dot makes a fixed point visible; small dots keep a cloud of points readable.
        spread = np.ptp(marks, axis=0) > SAME_POINT * np.ptp(orbit, axis=0) if len(marks) else False
        size = 2.0 if np.any(spread) else 26.0
        ax.scatter(
            marks[:, i], marks[:, j], s=size, color=COLOURS[1], linewidths=0, zorder=3, rasterized=True
        )
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    return ax


def _numbers(name: str, value: object, axes: int) -> np.ndarray:
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
    at, values = (_numbers(name, each, 1) for each in both)
    if len(at) != len(values):
        raise arguments.refusal(name, wanted, value)
    return at, values


def axis_labels(labels: object, *names: str) -> tuple[str, str]:
    """Labels of the two axes."""
    if labels is None:
        return names[0], names[1]
    texts = arguments.items("labels", labels, "be a pair of texts")
    if len(texts) != 2 or not all(isinstance(text, str) for text in texts):
        raise arguments.refusal("labels", "be a pair of texts", labels)
    return texts[0], texts[1]


def _dense(arc: HybridArc) -> np.ndarray:
    """Points along an arc in order, dense enough for a smooth line, with both sides of each jump."""
    times = np.linspace(arc.t[0], arc.t[-1], POINTS_OF_A_PORTRAIT)
    jumps = np.searchsorted(arc.jumps.t, times, side="right")
    order = np.lexsort((np.concatenate([arc.t, times]), np.concatenate([arc.j, jumps])))
    return np.concatenate([arc.x, arc(times)])[order]


def plot_spectrum(spectrum: LyapunovSpectrum, *, ax: Axes | None = None) -> Axes:
    """Estimates of the exponents against the number of intervals, with a bar of two standard errors.

    Parameters
    ----------
    spectrum
        From :func:`lyapunov.lyapunov_spectrum`, with its history.
    ax
        Axes to draw into; by default those of a new figure.

    Raises
    ------
    ArgumentError
        If the spectrum has no history.
    """
    arguments.instance("spectrum", spectrum, LyapunovSpectrum, "Make one with lyapunov.lyapunov_spectrum.")
    if not len(spectrum.growths):
        raise ArgumentError("spectrum must have a history; this one has none. Compute it with history=True.")
    labels = [f"$\\lambda_{{{i + 1}}}$ = {value:.5g}" for i, value in enumerate(spectrum.exponents)]
    history = {label: spectrum.history[:, i] for i, label in enumerate(labels)}
    ax = plot_convergence(history, truth=0.0, truth_label="zero", ax=ax)
    values, errors = spectrum.exponents, 2 * spectrum.standard_error
    shown = np.isfinite(values)
    for i in np.flatnonzero(shown):
        ax.errorbar(
            len(spectrum.growths),
            values[i],
            errors[i],
            color=COLOURS[i % len(COLOURS)],
            capsize=3,
            linewidth=1,
        )
    # The first estimates are far off, so the limits fit the later nine tenths.
    late = spectrum.history[len(spectrum.growths) // 10 :, shown].ravel()
    inside = [*(values - errors)[shown], *(values + errors)[shown], *late, 0.0]
    bottom, top = min(inside), max(inside)
    margin = 0.1 * (top - bottom) or 1.0
    ax.set_ylim(bottom - margin, top + margin)
    return ax


def plot_exponents(chart: xarray.Dataset, *, ax: Axes | None = None) -> Axes:
    """Exponents of a chart over one axis, with bands of two standard errors and a line at zero.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over one axis; ``.sel`` takes a line of a grid.
    ax
        Axes to draw into; by default those of a new figure.
    """
    name, values = _only_axis(as_chart(chart))
    exponents, errors = chart.exponents.values, chart.standard_error.values
    (ax,) = axes_for(ax, 1, figsize=FIGURE)
    ax.axhline(0.0, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    order = np.argsort(values)
    for i in range(exponents.shape[-1]):
        middle, error = exponents[order, i], 2 * errors[order, i]
        middle = np.where(np.isfinite(middle), middle, np.nan)
        colour = COLOURS[i % len(COLOURS)]
        ax.plot(values[order], middle, color=colour, linewidth=0.9, label=f"$\\lambda_{{{i + 1}}}$")
        ax.fill_between(values[order], middle - error, middle + error, color=colour, alpha=0.25, linewidth=0)
    _mark_failures(ax, values[chart.status.values != StatusCode.SUCCESS])
    ax.set_xlabel(label_of(chart, name))
    ax.set_ylabel("Lyapunov exponents")
    ax.grid(True, axis="y")
    if exponents.shape[-1] > 1:
        ax.legend()
    return ax


def plot_bifurcation(chart: xarray.Dataset, component: str | None = None, *, ax: Axes | None = None) -> Axes:
    """Bifurcation diagram: points of the section over the parameter.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`, over one axis and with ``section=``.
    component
        Name of the state component to show; by default the first.
    ax
        Axes to draw into; by default those of a new figure.

    Raises
    ------
    ArgumentError
        If the chart is over two axes or has no section.
    """
    name, values = _only_axis(as_chart(chart))
    points = chart.sizes.get("sample", 0)
    if points == 0:
        raise ArgumentError("chart must have section points; this one has none. Compute it with section=100.")
    names = _state_names(chart)
    i = 0 if component is None else as_component("component", names, component)
    (ax,) = axes_for(ax, 1, figsize=FIGURE)
    across, up = np.repeat(values, points), chart.section.values[:, :, i].ravel()
    ax.scatter(across, up, s=dot_area(len(up)), color=COLOURS[0], linewidths=0, rasterized=True)
    ax.set_xlabel(label_of(chart, name))
    ax.set_ylabel(names[i])
    return ax


def plot_chart(chart: xarray.Dataset, component: str | None = None) -> Figure:
    """A figure of a chart: exponents below a bifurcation diagram, or a map of the largest exponent.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`. A chart over one axis with ``section=`` also gets the bifurcation
        diagram.
    component
        Name of the state component in the diagram; by default the first.
    """
    import matplotlib.pyplot as plt

    if component is not None:
        as_component("component", _state_names(as_chart(chart)), component)
    if len(axes_of(as_chart(chart))) > 1:
        two_axes(chart)
        figure, ax = plt.subplots(figsize=(5.6, 4.4), layout="constrained")
        plot_map(chart, ax=ax)
        return figure
    if not chart.sizes.get("sample", 0):
        figure, ax = plt.subplots(figsize=(7.2, 3.2), layout="constrained")
        plot_exponents(chart, ax=ax)
        return figure
    figure, (above, below) = plt.subplots(2, figsize=(7.2, 5.4), sharex=True, layout="constrained")
    plot_bifurcation(chart, component, ax=above).set_xlabel("")
    plot_exponents(chart, ax=below)
    return figure


def _state_names(chart: xarray.Dataset) -> tuple[str, ...]:
    return tuple(map(str, chart.state.values))


def _only_axis(chart: xarray.Dataset) -> tuple[str, np.ndarray]:
    names = axes_of(chart)
    if len(names) != 1:
        raise ArgumentError(
            f"chart must be over one parameter; this one is over {' and '.join(names) or 'none'}. Use "
            "plot_map, or take a line with chart.sel."
        )
    (name,) = names
    if name not in chart.coords:
        raise ArgumentError("chart must be over one parameter; this one is over a table of points.")
    return name, chart[name].values


def _mark_failures(ax: Axes, bad: np.ndarray) -> None:
    """Ticks at the bottom of the axes for the rows whose status is not ok."""
    if len(bad):
        ax.plot(
            bad,
            np.zeros(len(bad)),
            "|",
            color=COLOURS[1],
            markersize=8,
            transform=ax.get_xaxis_transform(),
            label="not to be trusted",
            clip_on=False,
        )


drawn.register(LyapunovSpectrum, plot_spectrum)
DATASETS["exponents"] = plot_chart
