"""Runs that take their steps together beside single runs: ``python -m benchmarks.abreast``.

Processor time, the least of turns that alternate in one process. A row is a run among 480.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import models
from benchmarks.common import heading, least_in_turns, table
from hybrid import Taylor, simulate, simulate_many
from hybrid.simulation.trajectory import start as begin
from lyapunov import lyapunov_spectrum
from lyapunov.directions import first_vectors
from lyapunov.estimates import Estimates, Flight
from lyapunov.together import means_together

ROWS = 480
# Starts, the mode of the start, and the time of a run.
CASES: dict[str, tuple[Callable[[], Any], tuple[float, ...], str | None, float]] = {
    "vibro-impact, Hertz contact": (
        models.vibroimpact,
        (-0.00765806, -0.00411675, 0.05565196, -0.35621583),
        "free",
        100.0,
    ),
    "impact oscillator": (models.impact_oscillator, (0.0, 0.3), None, 400.0),
    "bilinear oscillator": (models.bilinear_oscillator, (0.3, 0.0), None, 300.0),
    "buck converter": (models.buck_converter, (12.0, 0.5, 0.0), None, 0.04),
    "stick-slip": (models.stick_slip, (1.0, 0.0), None, 200.0),
    "impact pair": (models.impact_pair, (0.2, 0.1), None, 200.0),
}
TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12)


def many(system: Any, starts: np.ndarray, mode: str | None, span: float, solver: Any) -> Any:
    """Runs from all starts."""
    return simulate_many(system, starts, (0.0, span), mode=mode, executor=1, progress=False, solver=solver)


def rows(system: Any, start: tuple[float, ...], k: int, intervals: int) -> Any:
    """The exponents of as many runs."""
    vectors, length, runs = first_vectors(system, k, None), system.forcing_period(), []
    for _ in range(ROWS):
        runs.append(begin(system, start, 0.0, mode="free", tangent=vectors))
    estimates = Estimates([Flight(run, length) for run in runs], k)
    found = means_together(estimates, 0, intervals)
    estimates.release()
    return found


def beside_single_runs(turns: int) -> None:
    """Time of a run alone and among others, and the share of steps that are taken together."""
    lines = []
    for name, (make, start, mode, span) in CASES.items():
        system = make()
        starts = np.tile(start, (ROWS, 1)) * (1.0 + 1e-6 * np.arange(ROWS)[:, None])
        end = [span]
        alone = partial(simulate, system, start, (0.0, span), mode=mode, samples=end)
        among = partial(many, system, starts, mode, span, Taylor())
        one, other = least_in_turns([alone, among], turns)
        facts = among().attrs
        share = facts["steps_together"] / max(1, facts["steps_together"] + facts["steps_alone"])
        lines.append(
            [
                name,
                f"{one * 1e3:.3f}",
                f"{other / ROWS * 1e3:.3f}",
                f"{one * ROWS / other:.1f}",
                f"{share:.3f}",
            ]
        )
    table(["model", "alone, ms", "among others, ms", "ratio", "steps together"], lines)


def exponents(turns: int) -> None:
    """Time of an interval of the founding system with tangent vectors."""
    system, start = models.vibroimpact(), CASES["vibro-impact, Hertz contact"][1]
    lines = []
    for k in (1, 2, 4):
        alone = partial(lyapunov_spectrum, system, start, k=k, intervals=300, transient=0, mode="free")
        one, other = least_in_turns([alone, partial(rows, system, start, k, 300)], turns)
        lines.append(
            [str(k), f"{one / 300 * 1e6:.2f}", f"{other / 300 / ROWS * 1e6:.2f}", f"{one * ROWS / other:.1f}"]
        )
    table(["tangent vectors", "alone, us an interval", "among others", "ratio"], lines)


def accuracy(turns: int) -> dict[str, list[tuple[float, float]]]:
    """Microseconds a period and error of both over the tolerance, against a run at the finest one."""
    system = models.vibroimpact()
    _, start, mode, _ = CASES["vibro-impact, Hertz contact"]
    span = 20.0 * system.forcing_period()
    starts = np.tile(start, (ROWS, 1))
    exact = simulate(system, start, (0.0, span), mode=mode, solver=Taylor(rtol=1e-14, atol=1e-16)).x[-1]
    found: dict[str, list[tuple[float, float]]] = {"alone": [], "among others": []}
    lines = []
    for rtol in TOLERANCES:
        solver = Taylor(rtol=rtol)
        alone = partial(simulate, system, start, (0.0, span), mode=mode, samples=[span], solver=solver)
        among = partial(many, system, starts, mode, span, solver)
        seconds = least_in_turns([alone, among], turns)
        times = [seconds[0] / 20 * 1e6, seconds[1] / 20 / ROWS * 1e6]
        errors = [np.abs(alone().x[-1] - exact).max(), float(np.abs(among().x_end.values - exact).max())]
        for name, time_, error in zip(found, times, errors, strict=True):
            found[name].append((time_, error))
        lines.append([f"{rtol:.0e}", *(f"{t:.2f} us, {e:.0e}" for t, e in zip(times, errors, strict=True))])
    table(["rtol", "alone: a period, error", "among others"], lines)
    return found


def picture(found: dict[str, list[tuple[float, float]]], path: Path) -> None:
    """Error against time, of both."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for (name, points), mark in zip(found.items(), "os", strict=True):
        ax.loglog(*zip(*points, strict=True), f"{mark}-", label=name)
    ax.set_xlabel("microseconds of processor time a forcing period")
    ax.set_ylabel("error after 20 periods")
    ax.legend()
    figure.savefig(path, dpi=150)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--turns", type=int, default=5, help="turns of each run")
    parser.add_argument("--picture", type=Path, help="file for the picture of error against time")
    given = parser.parse_args()
    turns = given.turns
    heading("Runs that take their steps together.")
    beside_single_runs(turns)
    exponents(turns)
    found = accuracy(turns)
    if given.picture is not None:
        picture(found, given.picture)


if __name__ == "__main__":
    main()
