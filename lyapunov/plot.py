"""Charts of exponents and orbits: each function draws on the axes it is given, or makes a whole figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import ArgumentError, HybridArc, arguments
from hybrid.plot.style import as_axes, as_component
from lyapunov.chart import Chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Told apart by every kind of eye, and in grey: M. Okabe, K. Ito, "Color universal design" (2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#555555")
INK = "#333333"
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

POINTS_OF_A_LINE = 1500
POINTS_OF_A_PORTRAIT = 40_000


def style() -> AbstractContextManager[None]:
    """Settings of Matplotlib under which these charts look as meant: ``with style(): ...``."""
    import matplotlib

    return matplotlib.rc_context(STYLE)


def plot_convergence(
    ax: Axes,
    estimates: Mapping[str, ArrayLike],
    *,
    points: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    points_label: str = "published",
    truth: float | None = None,
    truth_label: str = "exact",
) -> Axes:
    """Estimates of an exponent against the number of intervals.

    Parameters
    ----------
    ax
        Where to draw.
    estimates
        Label to history ``(M,)`` over 1, 2, ..., M intervals.
    points
        Label to numbers of intervals and values there: estimates from elsewhere, in the colour of the label.
    truth
        Value to converge to, drawn as a line.
    points_label, truth_label
        What the legend calls them.
    """
    as_axes("ax", ax)
    histories = {
        label: _numbers(f"estimates[{label!r}]", estimate, 1)
        for label, estimate in arguments.mapping("estimates", estimates, "map labels to histories").items()
    }
    points = {
        label: _pair(f"points[{label!r}]", pair)
        for label, pair in arguments.mapping("points", points, "map labels to numbers and values").items()
    }
    for name, text in (("points_label", points_label), ("truth_label", truth_label)):
        arguments.instance(name, text, str)
    truth = None if truth is None else arguments.number("truth", truth)
    # What comes later is drawn thinner, so that of two lines that coincide both are seen.
    widths = (2.2, 0.9) if len(histories) > 1 else (1.3,)
    if truth is not None:
        ax.axhline(truth, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), label=truth_label, zorder=1)
    for i, (label, history) in enumerate(histories.items()):
        at = np.unique(np.geomspace(1, len(history) + 0.5, POINTS_OF_A_LINE).astype(int))
        at = at[at <= len(history)]
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
    ax.legend()
    return ax


def plot_phase_portrait(
    ax: Axes,
    arc: HybridArc,
    x: str,
    y: str,
    *,
    section: ArrayLike | None = None,
    labels: tuple[str, str] | None = None,
) -> Axes:
    """Orbit in the plane of two components of the state, jumps as straight lines, with points of a section.

    Parameters
    ----------
    ax
        Where to draw.
    arc
        With dense output, that is, simulated without ``samples``.
    x, y
        Names of the components.
    section
        Points ``(N, n)`` to mark.
    labels
        Texts at the axes; by default the names.
    """
    as_axes("ax", ax)
    system = arguments.instance("arc", arc, HybridArc, "Make one with hybrid.simulate.").system
    i, j = as_component("x", system, x), as_component("y", system, y)
    marks = None if section is None else _numbers("section", section, 2)
    across, up = _labels(labels, system.state_names[i], system.state_names[j])
    orbit = _dense(arc)
    ax.plot(orbit[:, i], orbit[:, j], color=COLOURS[5], linewidth=0.5, alpha=0.8, rasterized=True)
    if marks is not None:
        # A fixed point must be seen and a cloud must not clot.
        size = 2.0 if np.ptp(marks, axis=0).max() > 1e-6 else 26.0
        ax.scatter(
            marks[:, i], marks[:, j], s=size, color=COLOURS[1], linewidths=0, zorder=3, rasterized=True
        )
    ax.set_xlabel(across)
    ax.set_ylabel(up)
    return ax


def _numbers(name: str, value: object, axes: int) -> np.ndarray:
    """Numbers in a list or in rows."""
    wanted = f"be an array of numbers of {axes} dimension{'s' if axes > 1 else ''}"
    found = arguments.numbers(name, value, wanted)
    if found.ndim != axes:
        raise arguments.refusal(name, wanted, value)
    return found


def _pair(name: str, value: object) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of intervals, and values there."""
    wanted = "be two lists of numbers of one length"
    both = arguments.items(name, value, wanted)
    if len(both) != 2:
        raise arguments.refusal(name, wanted, value)
    at, values = (_numbers(name, each, 1) for each in both)
    if len(at) != len(values):
        raise arguments.refusal(name, wanted, value)
    return at, values


def _labels(labels: object, *names: str) -> tuple[str, str]:
    """Texts at two axes."""
    if labels is None:
        return names[0], names[1]
    texts = arguments.items("labels", labels, "be a pair of texts")
    if len(texts) != 2 or not all(isinstance(text, str) for text in texts):
        raise arguments.refusal("labels", "be a pair of texts", labels)
    return texts[0], texts[1]


def _as_chart(value: object) -> Chart:
    return arguments.instance("chart", value, Chart, "Make one with lyapunov.chart.")


def _dense(arc: HybridArc) -> np.ndarray:
    """Points along an arc in order, close enough for a smooth line, with both sides of each jump."""
    times = np.linspace(arc.t[0], arc.t[-1], POINTS_OF_A_PORTRAIT)
    jumps = np.searchsorted(arc.jumps.t, times, side="right")
    order = np.lexsort((np.concatenate([arc.t, times]), np.concatenate([arc.j, jumps])))
    return np.concatenate([arc.x, arc(times)])[order]


@attrs.frozen(eq=False)
class Panel:
    """One column of :func:`plot_regimes`.

    Attributes
    ----------
    title
        Text over the column.
    arc, section
        An orbit, and points ``(N, n)`` of its section.
    history, spread
        First exponent ``(M,)`` over the intervals, and how far above and below its end the axis reaches.
    """

    title: str
    arc: HybridArc
    section: np.ndarray
    history: np.ndarray
    spread: float


def plot_regimes(panels: Sequence[Panel], x: str, y: str, *, labels: tuple[str, str] | None = None) -> Figure:
    """Small multiples, a column a regime: phase portrait, section, first exponent over the intervals."""
    import matplotlib.pyplot as plt

    for i, panel in enumerate(arguments.items("panels", panels, "be a list of Panel objects")):
        system = arguments.instance(f"panels[{i}]", panel, Panel).arc.system
        x, y = (system.state_names[as_component(name, system, c)] for name, c in (("x", x), ("y", y)))
    labels = _labels(labels, x, y)
    figure, axes = plt.subplots(3, len(panels), figsize=(3.2 * len(panels), 7.6), squeeze=False)
    for column, panel in zip(axes.T, panels, strict=True):
        plot_phase_portrait(column[0], panel.arc, x, y, section=panel.section, labels=labels)
        _plot_section(column[1], panel, x, y, labels)
        plot_convergence(column[2], {"first exponent": panel.history}, truth=0.0)
        column[2].get_legend().remove()
        final = float(panel.history[-1]) if len(panel.history) else 0.0
        # The start of a history is far off; what it settles to is the news.
        column[2].set_ylim(final - panel.spread, final + panel.spread)
        column[0].set_title(panel.title)
    for row in axes:
        for ax in row[1:]:
            ax.set_ylabel("")
    for ax, title in zip(axes[1:, 0], ("Section, once a period", "First exponent"), strict=True):
        ax.set_title(title)
    return figure


def _plot_section(ax: Axes, panel: Panel, x: str, y: str, labels: tuple[str, str]) -> None:
    names = panel.arc.system.state_names
    points = panel.section[:, [names.index(x), names.index(y)]]
    fixed = np.ptp(points, axis=0).max() <= 1e-6
    ax.scatter(
        points[:, 0], points[:, 1], s=26.0 if fixed else 2.0, color=COLOURS[1], linewidths=0, rasterized=True
    )
    if fixed:
        (a, b), radius = points.mean(axis=0), np.maximum(np.abs(points.mean(axis=0)), 1e-3) * 0.2
        ax.set_xlim(a - radius[0], a + radius[0])
        ax.set_ylim(b - radius[1], b + radius[1])
    ax.set_xlabel(labels[0])
    ax.set_ylabel(labels[1])


def plot_exponents(ax: Axes, chart: Chart) -> Axes:
    """Exponents of a chart over one parameter, with a band of two standard errors, and the line of zero.

    Parameters
    ----------
    ax
        Where to draw.
    chart
        From :func:`lyapunov.chart`, over one parameter.
    """
    as_axes("ax", ax)
    name, values = _only_axis(_as_chart(chart))
    ax.axhline(0.0, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
    order = np.argsort(values)
    for i in range(chart.exponents.shape[-1]):
        middle, error = chart.exponents[order, i], 2 * chart.standard_error[order, i]
        middle = np.where(np.isfinite(middle), middle, np.nan)
        colour = COLOURS[i % len(COLOURS)]
        ax.plot(values[order], middle, color=colour, linewidth=0.9, label=f"$\\lambda_{{{i + 1}}}$")
        ax.fill_between(values[order], middle - error, middle + error, color=colour, alpha=0.25, linewidth=0)
    _mark_failures(ax, chart)
    ax.set_xlabel(name)
    ax.set_ylabel("Lyapunov exponents")
    ax.grid(True, axis="y")
    if chart.exponents.shape[-1] > 1:
        ax.legend()
    return ax


def plot_bifurcation(ax: Axes, chart: Chart, component: str | None = None) -> Axes:
    """Points of the section over the parameter: a bifurcation diagram.

    Parameters
    ----------
    ax
        Where to draw.
    chart
        From :func:`lyapunov.chart`, over one parameter and with ``section=``.
    component
        Name of the state's component to show, by default the first.

    Raises
    ------
    ArgumentError
        If the chart is over two parameters or has no section.
    """
    as_axes("ax", ax)
    name, values = _only_axis(_as_chart(chart))
    points = chart.section.shape[1]
    if points == 0:
        raise ArgumentError("This chart has no points of a section. Make it with section=100, for instance.")
    names = chart.system.state_names
    i = 0 if component is None else as_component("component", chart.system, component)
    ax.plot(np.repeat(values, points), chart.section[:, :, i].ravel(), ",", color=COLOURS[0], rasterized=True)
    ax.set_xlabel(name)
    ax.set_ylabel(names[i])
    return ax


def plot_map(ax: Axes, chart: Chart, exponent: int = 0) -> Axes:
    """Map of an exponent over two parameters, red where it is positive, blue where negative, grey where not.

    Parameters
    ----------
    ax
        Where to draw; a colour bar is set beside it.
    chart
        From :func:`lyapunov.chart`, over two parameters.
    exponent
        Which exponent, 0 for the largest.

    Raises
    ------
    ArgumentError
        If the chart is over one parameter.
    """
    as_axes("ax", ax)
    exponent = arguments.count("exponent", exponent, 0, _as_chart(chart).exponents.shape[-1] - 1)
    if len(chart.over) != 2:
        raise ArgumentError("A map needs a chart over two parameters. Use plot_exponents for one.")
    (down, rows), (across, columns) = chart.over.items()
    values = chart.exponents[..., exponent]
    finite = np.abs(values[np.isfinite(values)])
    # A few extremes would leave the rest pale.
    limit = float(np.quantile(finite, 0.98)) if finite.size and finite.max() > 0 else 1.0
    ax.set_facecolor("0.75")
    mesh = ax.pcolormesh(
        columns,
        rows,
        np.ma.masked_invalid(values),
        cmap="RdBu_r",
        vmin=-limit,
        vmax=limit,
        shading="nearest",
        rasterized=True,
    )
    ax.figure.colorbar(mesh, ax=ax, extend="both", label=f"$\\lambda_{{{exponent + 1}}}$")
    ax.set_xlabel(across)
    ax.set_ylabel(down)
    return ax


def plot_chart(chart: Chart, component: str | None = None) -> Figure:
    """A figure of a chart: exponents under their bifurcation diagram, or a map of the largest one.

    Parameters
    ----------
    chart
        From :func:`lyapunov.chart`. With ``section=`` the diagram is drawn.
    component
        Name of the state's component in the diagram, by default the first.
    """
    import matplotlib.pyplot as plt

    if component is not None:
        as_component("component", _as_chart(chart).system, component)
    if len(_as_chart(chart).over) == 2:
        figure, ax = plt.subplots(figsize=(5.6, 4.4), layout="constrained")
        plot_map(ax, chart)
        return figure
    if chart.section.shape[1] == 0:
        figure, ax = plt.subplots(figsize=(7.2, 3.2), layout="constrained")
        plot_exponents(ax, chart)
        return figure
    figure, (above, below) = plt.subplots(2, figsize=(7.2, 5.4), sharex=True, layout="constrained")
    plot_bifurcation(above, chart, component).set_xlabel("")
    plot_exponents(below, chart)
    return figure


def _only_axis(chart: Chart) -> tuple[str, np.ndarray]:
    if len(chart.over) != 1:
        raise ArgumentError(
            f"This chart is over {' and '.join(chart.over)}: lines need one parameter. Use plot_map."
        )
    return next(iter(chart.over.items()))


def _mark_failures(ax: Axes, chart: Chart) -> None:
    """Ticks at the foot of the axes where a row has a status other than success."""
    bad = next(iter(chart.over.values()))[~chart.ok]
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
