"""Figures of the study, written as PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hybrid.plot.styles import COLOURS, INK
from lyapunov.floquet import floquet_exponents
from lyapunov.plot import plot_convergence, plot_phase_portrait, style
from lyapunov.study.paper import ROWS
from lyapunov.study.regimes import Panel, plot_regimes
from lyapunov.study.report import histories, paper_columns
from lyapunov.study.runs import Regime
from lyapunov.study.tangents import Trap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BODIES = (
    ("main body", "x1", "v1", ("$x_1$, m", "$\\dot x_1$, m/s")),
    ("attached body", "x2", "v2", ("$x_2$, m", "$\\dot x_2$, m/s")),
)
# First number of periods shown; earlier estimates fluctuate too much.
FIRST_SHOWN = 10
# Least height of the axes, in 1/s; the limits fit the late estimates, since the first ones are far off.
LEAST_HEIGHT = 0.03
ESTIMATES = (
    ("Two orbits, formulas (7) and (8)", ("(7)", "(8)")),
    ("Two orbits, formula (9)", ("(9)",)),
    ("Benettin, two starts", ("(10) I", "(10) II")),
    ("Estimates that converge", ("two-orbit", "tapered")),
)


def write_figures(folder: Path, regimes: Sequence[Regime]) -> list[Path]:
    """Write a phase portrait and the convergence of each regime, and a comparison; return the paths."""
    paths = []
    with style("chart"):
        for regime in regimes:
            paths.append(_save(portrait(regime), folder / f"portrait_{regime.omega:.2f}.png"))
            paths.append(_save(convergence(regime), folder / f"convergence_{regime.omega:.2f}.png"))
        paths.append(_save(comparison(regimes), folder / "regimes.png"))
    return paths


def write_tolerance_figure(folder: Path, trap: Trap) -> Path:
    """Write the errors of tangent vectors outside the error control as ``tolerances.png``."""
    with style("chart"):
        return _save(tolerances(trap), folder / "tolerances.png")


def _title(regime: Regime) -> str:
    return f"$\\omega$ = {regime.omega:.2f} rad/s, {regime.kind}"


def portrait(regime: Regime) -> Figure:
    """Phase portraits of both bodies, with one section point per period."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.8))
    for ax, (body, x, v, labels) in zip(axes, BODIES, strict=True):
        plot_phase_portrait(regime.arc, x, v, section=regime.section.x, ax=ax)
        ax.set(xlabel=labels[0], ylabel=labels[1])
        ax.set_title(body)
    figure.suptitle(f"{_title(regime)}: orbit and stroboscopic section", x=0.01, ha="left", fontsize=10.5)
    return figure


def convergence(regime: Regime) -> Figure:
    """Every estimate over M, with the paper's figures as open circles."""
    import matplotlib.pyplot as plt

    ours, theirs = histories(regime), paper_columns(regime.omega)
    truth, label = _truth(regime)
    figure, axes = plt.subplots(2, 2, figsize=(8.4, 6.4), sharex=True)
    for ax, (title, names) in zip(axes.flat, ESTIMATES, strict=True):
        points = {name: _printed(theirs[name]) for name in names if name in theirs}
        points = {name: point for name, point in points.items() if len(point[0])}
        shown = {name: ours[name] for name in names}
        plot_convergence(shown, points=points, points_label="paper", truth=truth, truth_label=label, ax=ax)
        if names != ("(9)",):
            _fit_height(ax, list(shown.values()), [point[1] for point in points.values()], truth)
        ax.set_title(title)
    axes[0, 0].set_xlim(left=FIRST_SHOWN if len(ours["(7)"]) > 10 * FIRST_SHOWN else 1)
    for ax in axes[0]:
        ax.set_xlabel("")
    for ax in axes[:, 1]:
        ax.set_ylabel("")
    figure.suptitle(
        f"{_title(regime)}: first exponent after M periods, 1/s", x=0.01, ha="left", fontsize=10.5
    )
    return figure


def _truth(regime: Regime) -> tuple[float, str]:
    """The best known value and its label."""
    if regime.kind == "periodic" and regime.orbit.status.ok:
        return float(floquet_exponents(regime.orbit)[0]), "Floquet exponent"
    if regime.kind == "quasi-periodic":
        return 0.0, "zero for a torus"
    return float(regime.spectra[0].exponents[0]), "last tapered estimate"


def _printed(column: tuple[float | None, ...]) -> tuple[list[int], list[float]]:
    pairs = [(M, value) for M, value in zip(ROWS, column, strict=True) if value is not None]
    return [M for M, _ in pairs], [value for _, value in pairs]


def _fit_height(
    ax: Axes, estimates: Sequence[np.ndarray], printed: Sequence[Sequence[float]], truth: float
) -> None:
    """Set limits that show the paper's points, the truth, and the last 99 % of the histories."""
    shown = [history[len(history) // 100 :] for history in estimates]
    values = np.concatenate([*shown, *map(np.asarray, printed), [truth]])
    values = values[np.isfinite(values)]
    low, high = values.min(), values.max()
    margin = max(0.08 * (high - low), (LEAST_HEIGHT - (high - low)) / 2)
    ax.set_ylim(low - margin, high + margin)


def comparison(regimes: Sequence[Regime]) -> Figure:
    """The regimes side by side, in the plane of the second body."""
    _, x, v, labels = BODIES[1]
    panels = [
        Panel(_title(regime), regime.arc, regime.section.x, regime.spectra[0].history[:, 0], 0.08)
        for regime in regimes
    ]
    return plot_regimes(panels, x, v, labels=labels)


def tolerances(trap: Trap) -> Figure:
    """Errors of the first exponent and of the sum over the tolerance, with and without error control."""
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots(figsize=(6.4, 4.2))
    lines = (
        ("first exponent, outside", trap.outside[:, 0] - trap.truth[0], COLOURS[1], "o-"),
        ("sum of all four, outside", trap.outside.sum(axis=1) - trap.truth.sum(), COLOURS[4], "s--"),
        ("first exponent, inside", trap.inside[:, 0] - trap.truth[0], COLOURS[0], "o-"),
    )
    for label, errors, colour, marker in lines:
        ax.loglog(trap.tolerances, np.abs(errors), marker, color=colour, label=label, markersize=4.5)
    ax.axhline(
        abs(trap.truth[0]), color=INK, linewidth=0.8, linestyle=(0, (4, 3)), label="the exponent itself"
    )
    ax.set_xlabel("tolerance, rtol = atol")
    ax.set_ylabel("error, 1/s")
    ax.set_title("Tangent vectors inside and outside the error control")
    ax.grid(True)
    ax.invert_xaxis()
    ax.legend()
    return figure


def _save(figure: Figure, path: Path) -> Path:
    import matplotlib.pyplot as plt

    figure.savefig(path)
    plt.close(figure)
    return path
