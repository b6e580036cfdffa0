"""Error of an exponent by number of intervals, tolerance and method.

``python -m benchmarks.exponents`` makes ``docs/exponents_work.png``; ``pip install '.[benchmarks]'``
installs the packages that are compared.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

import models
from benchmarks import exponents_beside
from benchmarks.common import file_in, heading, options, table
from benchmarks.exponents_beside import Beside
from hybrid import Guard, HybridSystem, Mode, Reset, Taylor, Transition
from hybrid.plot.styles import COLOURS, INK, style
from lyapunov import lyapunov_spectrum, two_orbit_exponents

PICTURE = "exponents_work.png"
# The founding system at omega = 7.40, from an independent computation with 60 digits.
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
REGULAR = -0.05489356622830292
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
INTERVALS = (10, 30, 100, 300, 1000, 3000)
# The companion's distance is 1e-8; with looser tolerances it would show only the solver error.
TWO_ORBITS = Taylor(rtol=1e-12, atol=1e-14)
SKEW = 0.3
CHAOTIC = -SKEW * math.log(SKEW) - (1 - SKEW) * math.log(1 - SKEW)
STARTS = np.random.default_rng(4).uniform(0.05, 0.95, 12)
# Number of intervals M, seconds, and relative error.
Points = list[tuple[int, float, float]]
Curves = dict[str, Points]
LABELS = {
    "single_piece": "two orbits, formulas (7) and (8)",
    "undivided": "two orbits, formula (9)",
    "renormalised": "two orbits, renormalised, plain mean",
    "renormalised_exponent": "two orbits, renormalised, tapered mean",
}
LINES = {
    **{f"tolerance {tolerance:.0e}": (COLOURS[i], "o-") for i, tolerance in enumerate(TOLERANCES)},
    "plain mean (Benettin)": (INK, "x:"),
    "single_piece": (COLOURS[4], "v--"),
    "undivided": (COLOURS[5], "^--"),
    "renormalised": (COLOURS[6], "s:"),
    "renormalised_exponent": (COLOURS[6], "s--"),
}


def skew_tent() -> HybridSystem:
    """Skew tent map, once per unit of time; its exponent is known, and its growth rates are independent."""
    return HybridSystem(
        name="skew tent",
        state=("x", "clock"),
        parameters={"a": SKEW},
        modes=[Mode("wait", lambda t, x, p: (0.0, 1.0))],
        transitions=[
            Transition(
                "wait",
                "wait",
                Guard(lambda t, x, p: x.clock - 1, direction=+1),
                Reset(lambda t, x, p: (np.minimum(x.x / p.a, (1 - x.x) / (1 - p.a)), 0.0)),
            )
        ],
    )


def timed(work: Callable[[], object]) -> tuple[float, object]:
    begin = time.process_time()
    result = work()
    return time.process_time() - begin, result


def estimates(
    system: HybridSystem, x0: tuple[float, ...], M: int, solvers: dict[str, Taylor], **options: float
) -> dict[str, tuple[float, float]]:
    """Time in seconds and estimate of every method after M intervals."""
    found = {}
    for name, solver in solvers.items():
        seconds, spectrum = timed(
            lambda solver=solver: lyapunov_spectrum(
                system, x0, k=1, intervals=M, transient=M // 10, solver=solver, **options
            )
        )
        found[name] = seconds, spectrum.exponents[0]
        found["plain mean (Benettin)"] = seconds, spectrum.benettin_history[-1, 0]
    seconds, pair = timed(
        lambda: two_orbit_exponents(system, x0, intervals=M, transient=M // 10, solver=TWO_ORBITS, **options)
    )
    for name in LABELS:
        found[name] = seconds, np.atleast_1d(getattr(pair, name))[-1]
    return found


def warm(system: HybridSystem, x0: tuple[float, ...]) -> None:
    """Compile first, so that the time of compilation is not measured."""
    lyapunov_spectrum(system, x0, k=1, intervals=1, transient=0)
    two_orbit_exponents(system, x0, intervals=1)


def regular_curves() -> Curves:
    """Errors on the stable orbit of the founding system, from a point on the orbit."""
    solvers = {
        f"tolerance {tolerance:.0e}": Taylor(rtol=tolerance, atol=tolerance / 100) for tolerance in TOLERANCES
    }
    system = models.vibroimpact()
    warm(system, START)
    curves: Curves = {}
    for M in INTERVALS:
        for name, (seconds, value) in estimates(system, START, M, solvers).items():
            curves.setdefault(name, []).append((M, seconds, abs(value / REGULAR - 1)))
    return curves


def chaotic_curves() -> Curves:
    """Root mean square errors on the skew tent map, over several starts."""
    solvers = {"tolerance 1e-06": Taylor(rtol=1e-6, atol=1e-8)}
    system = skew_tent()
    warm(system, (0.3, 0.5))
    curves: Curves = {}
    for M in INTERVALS:
        runs = [estimates(system, (u, 0.5), M, solvers, interval=1.0) for u in STARTS]
        for name in runs[0]:
            seconds, values = np.array([run[name] for run in runs]).T
            error = math.sqrt(np.mean((values / CHAOTIC - 1) ** 2))
            curves.setdefault(name, []).append((M, float(seconds.mean()), error))
    return curves


def draw(axes: plt.Axes, curves: Curves, title: str) -> None:
    for name, points in curves.items():
        M, _, error = np.array(points).T
        colour, marker = LINES[name]
        axes.loglog(
            M,
            np.maximum(error, 1e-12),
            marker,
            color=colour,
            markersize=4,
            markerfacecolor="white" if ":" in marker else colour,
            label=LABELS.get(name, name),
        )
    axes.axhline(5e-4, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.annotate("three digits", (INTERVALS[0], 5e-4), xytext=(0, 3), textcoords="offset points", fontsize=8)
    axes.set_title(title)
    axes.set_xlabel("intervals $M$")
    axes.set_ylabel("relative error of the first exponent")
    axes.grid(True)


def draw_work(axes: plt.Axes, curves: Curves) -> None:
    for name, points in curves.items():
        _, seconds, error = np.array(points).T
        colour, marker = LINES[name]
        axes.loglog(
            seconds,
            np.maximum(error, 1e-12),
            marker,
            color=colour,
            markersize=4,
            markerfacecolor="white" if ":" in marker else colour,
        )
    axes.axhline(5e-4, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.set_title("The same errors over time")
    axes.set_xlabel("seconds")
    axes.grid(True)


def picture(path: Path, regular: Curves, chaotic: Curves, beside: Beside) -> None:
    with style("chart"):
        figure, (axes, below) = plt.subplots(2, 3, figsize=(12.0, 8.4), sharey="row")
        draw(axes[0], regular, "Regular: founding system at 7.40")
        draw_work(axes[1], regular)
        draw(axes[2], chaotic, "Chaotic: skew tent map")
        axes[2].set_ylabel("")
        exponents_beside.draw(below, beside)
        for side, ax in (("upper", axes[0]), ("lower", below[0])):
            figure.legend(*ax.get_legend_handles_labels(), loc=f"outside {side} center", ncols=5)
        figure.savefig(path, metadata={"Software": None})


def summary(curves: Curves) -> None:
    rows = [
        [LABELS.get(name, name), *(f"{error:.0e}" for _, _, error in points), f"{points[-1][1]:.2f} s"]
        for name, points in curves.items()
    ]
    table(["method", *(f"M = {M}" for M in INTERVALS), f"time of {INTERVALS[-1]}"], rows)


def main() -> None:
    path = file_in(options(__doc__).parse_args().output, PICTURE)
    heading("Relative error of the first exponent by number of intervals; three digits are 5e-4.")
    regular, chaotic = regular_curves(), chaotic_curves()
    print("Founding system at omega = 7.40, one tangent vector; tapered means unless noted:\n")
    summary(regular)
    print(f"Skew tent map, exponent {CHAOTIC:.6f}, root mean square over {len(STARTS)} starts:\n")
    summary(chaotic)
    beside = exponents_beside.beside()
    exponents_beside.summary(beside)
    picture(path, regular, chaotic, beside)
    print(f"Picture: {path}")


if __name__ == "__main__":
    main()
