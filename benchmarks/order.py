"""Order of the global error across impacts, measured against exact answers for DOP853 and Tsit5."""

from __future__ import annotations

import json
from collections.abc import Callable

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

import models
from benchmarks.common import ROOT, file_in, heading, options, table
from hybrid import DOP853, HybridArc, Tsit5, simulate
from hybrid.plot import COLOURS
from hybrid.solvers import Solver

# Tolerance without effect, so that all steps have the given size.
LOOSE = {"rtol": 1.0, "atol": 1e6}
STEPS = {DOP853: 2.0 ** -np.arange(-1, 4.5, 0.5), Tsit5: 2.0 ** -np.arange(1, 8.5, 0.5)}
FLOOR = 2e-12


def oscillator_error() -> Callable[[Solver], float]:
    """Error at the end of twenty impacts from rest, against the closed form with 50 digits."""
    text = (ROOT / "tests" / "reference" / "impact_oscillator.json").read_text(encoding="utf-8")
    flight = json.loads(text)["flight"]
    system = models.impact_oscillator()

    def error(solver: Solver) -> float:
        arc = simulate(system, flight["x0"], (0.0, flight["t_end"]), solver=solver)
        return distance(arc, np.array(flight["t"]), np.array(flight["x_end"]))

    return error


def distance(arc: HybridArc, times: np.ndarray, end: np.ndarray) -> float:
    """Largest error over the times of the impacts and the state at the end; nan if impacts are missing."""
    if len(arc.jumps) != len(times):
        return np.nan
    return float(max(np.abs(arc.jumps.t - times).max(), np.abs(arc.x[-1] - end).max()))


def slope(steps: np.ndarray, errors: np.ndarray) -> float:
    """Fitted order, from errors above rounding and small enough for the asymptotic order."""
    inside = (errors > FLOOR) & (errors < 1e-3)
    return float(np.polyfit(np.log(steps[inside]), np.log(errors[inside]), 1)[0])


def main() -> None:
    given = options(__doc__).parse_args()
    heading("Global error over 20 impacts of the impact oscillator at a fixed step, against the closed form.")
    error = oscillator_error()
    figure, axes = plt.subplots(figsize=(5.2, 3.8), layout="constrained")
    rows = []
    for index, (method, steps) in enumerate(STEPS.items()):
        errors = np.array([error(method(**LOOSE, max_step=h)) for h in steps])
        order = method.tableau.order
        measured = slope(steps, errors)
        rows.append([method.__name__, str(order), f"{measured:.2f}", f"{np.nanmin(errors):.1e}"])
        axes.loglog(steps, errors, "os"[index], color=COLOURS[index], markersize=4)
        axes.loglog(steps, errors, color=COLOURS[index], label=f"{method.__name__}, order {order}")
        guide = np.array([steps[-1], steps[0]])
        anchor = np.nanargmax(np.where((errors > FLOOR) & (errors < 1e-3), errors, np.nan))
        line = errors[anchor] * (guide / steps[anchor]) ** order
        axes.loglog(guide, line, ":", color=COLOURS[index], linewidth=1)
    table(["solver", "order", "slope measured", "least error"], rows)
    axes.set_ylim(1e-15, 1e1)
    axes.set_xlabel("step")
    axes.set_ylabel("error after 20 impacts")
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    path = file_in(given.output, "order.png")
    figure.savefig(path, dpi=150, metadata={"Software": None})
    print(f"Picture: {path}; the slope of a dotted line is the order of the method.")


if __name__ == "__main__":
    main()
