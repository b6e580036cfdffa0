"""Regimes side by side: phase portrait, section and first exponent of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid import HybridArc, arguments
from hybrid.plot.axes import as_component
from hybrid.plot.styles import COLOURS
from lyapunov.plot import plot_convergence, plot_phase_portrait

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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

    wanted = "be a list of Panel objects, at least one"
    panels = arguments.items("panels", panels, wanted, least=1)
    for i, panel in enumerate(panels):
        system = arguments.instance(f"panels[{i}]", panel, Panel).arc.system
        x, y = (
            system.state_names[as_component(name, system.state_names, c)] for name, c in (("x", x), ("y", y))
        )
    labels = _axis_labels(labels, x, y)
    figure, axes = plt.subplots(3, len(panels), figsize=(3.2 * len(panels), 7.6), squeeze=False)
    for column, panel in zip(axes.T, panels, strict=True):
        plot_phase_portrait(panel.arc, x, y, section=panel.section, ax=column[0])
        column[0].set(xlabel=labels[0], ylabel=labels[1])
        _plot_section(column[1], panel, x, y, labels)
        plot_convergence({"first exponent": panel.history}, truth=0.0, ax=column[2])
        column[2].get_legend().remove()
        final = float(panel.history[-1]) if len(panel.history) else 0.0
        # The start of a history is far off; what it settles to is the news.
        column[2].set_ylim(final - panel.spread, final + panel.spread)
        column[0].set_title(panel.title)
    for row in axes:
        for ax in row[1:]:
            ax.set_ylabel("")
    for ax, title in zip(axes[1:, 0], ("Section, once per period", "First exponent"), strict=True):
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


def _axis_labels(labels: object, *names: str) -> tuple[str, str]:
    """Labels of the two axes."""
    if labels is None:
        return names[0], names[1]
    texts = arguments.items("labels", labels, "be a pair of texts")
    if len(texts) != 2 or not all(isinstance(text, str) for text in texts):
        raise arguments.refusal("labels", "be a pair of texts", labels)
    return texts[0], texts[1]
