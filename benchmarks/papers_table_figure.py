"""Errors of four methods on the founding system: two that a careful person looks at, two that tell."""

from __future__ import annotations

import matplotlib as mpl

mpl.use("Agg")

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np

import models
from benchmarks.common import table
from hybrid import DOP853, HybridSystem, Taylor
from hybrid.measures.averages import running_tapered_mean
from hybrid.plot import COLOURS
from lyapunov import lyapunov_spectrum
from lyapunov.study.impact import (
    Carry,
    Impact,
    by_library,
    by_ode23s,
    by_straight_dop853,
    by_uncontrolled_dop853,
    impacts,
    measure,
    straight_through,
)
from lyapunov.study.ode23s import Ode23s
from lyapunov.study.paper import PAPER
from lyapunov.study.runs import STARTS
from lyapunov.study.tangents import uncontrolled_exponents, with_tangent

PICTURE = "papers_table.png"
SYSTEM = models.vibroimpact()
STRAIGHT, EXTENDED = straight_through(SYSTEM), with_tangent(SYSTEM)
TOLERANCES = tuple(10.0**-digits for digits in range(3, 9))
PERIODS, TRANSIENT = 200, 100
LEAST = 1e-12


class Method(NamedTuple):
    """Name and style, the map across a window, and all four exponents, at a tolerance."""

    name: str
    colour: str
    marker: str
    carry: Callable[[float], Carry]
    exponents: Callable[[float, float], np.ndarray]


def spectrum(system: HybridSystem, solver: DOP853 | Taylor, omega: float) -> np.ndarray:
    return lyapunov_spectrum(
        system,
        STARTS[0].x0,
        parameters={"omega": omega},
        intervals=PERIODS,
        transient=TRANSIENT,
        solver=solver,
    ).exponents


def by_paper(tolerance: float, omega: float) -> np.ndarray:
    growths = Ode23s(tolerance, tolerance / 100).growths(
        SYSTEM, STARTS[0].x0, omega=omega, k=4, periods=PERIODS, transient=TRANSIENT
    )
    return running_tapered_mean(growths)[-1]


METHODS = (
    Method(
        "ode23s straight through",
        COLOURS[1],
        "o",
        lambda tolerance: by_ode23s(Ode23s(tolerance, tolerance / 100)),
        by_paper,
    ),
    Method(
        "DOP853 straight through",
        COLOURS[2],
        "^",
        by_straight_dop853,
        lambda tolerance, omega: spectrum(STRAIGHT, DOP853(rtol=tolerance, atol=tolerance / 100), omega),
    ),
    Method(
        "DOP853 with events, only the state controlled",
        COLOURS[3],
        "s",
        by_uncontrolled_dop853,
        lambda tolerance, omega: uncontrolled_exponents(
            EXTENDED, omega, DOP853(rtol=tolerance, atol=tolerance / 100), PERIODS
        ),
    ),
    Method(
        "this library",
        COLOURS[0],
        "D",
        by_library,
        lambda tolerance, omega: spectrum(SYSTEM, Taylor(rtol=tolerance, atol=tolerance / 100), omega),
    ),
)
QUANTITIES = (
    "first exponent, 1/s",
    "sum of the exponents, 1/s",
    "restitution of one impact",
    "tangent map of one impact",
)


def truth(omega: float) -> float:
    """First exponent by the library at 1e-12, from the same start and directions over as many periods.

    A mean over 200 periods differs from its limit, on chaotic motion by 0.02, so runs of one length are
    compared. Chaotic orbits part, but only by a factor of a thousand in that time.
    """
    return float(spectrum(SYSTEM, Taylor(rtol=1e-12, atol=1e-14), omega)[0])


def errors(method: Method, tolerance: float, omega: float, windows: list[Impact], exact: float) -> np.ndarray:
    """The four quantities of the figure."""
    exponents = method.exponents(tolerance, omega)
    found = [measure(window, method.carry(tolerance)) for window in windows]
    p = SYSTEM.parameters
    trace = -2 * (p["xi1"] * p["omega1"] + p["xi2"] * p["omega2"] * (1 + p["m2"] / p["m1"]))
    return np.array(
        [
            abs(exponents[0] - exact),
            abs(exponents.sum() - trace),
            np.sqrt(np.mean([each.restitution_error**2 for each in found])),
            np.sqrt(np.mean([each.map_error**2 for each in found])),
        ]
    )


def figure(path: Path) -> None:
    """Compute, print and draw the errors."""
    figure, grid = plt.subplots(4, 3, figsize=(9.6, 10.2), sharex=True, sharey="row", layout="constrained")
    rows = []
    for omega, column in zip(PAPER, grid.T, strict=True):
        exact = truth(omega)
        windows = impacts(SYSTEM, omega)
        tasks = [(method, tolerance) for method in METHODS for tolerance in TOLERANCES]

        def work(
            task: tuple[Method, float],
            omega: float = omega,
            windows: list[Impact] = windows,
            exact: float = exact,
        ) -> np.ndarray:
            return errors(*task, omega, windows, exact)

        with ThreadPoolExecutor(2) as pool:
            found = np.array(list(pool.map(work, tasks))).reshape(len(METHODS), len(TOLERANCES), 4)
        for method, values in zip(METHODS, found, strict=True):
            for ax, each in zip(column, values.T, strict=True):
                ax.loglog(
                    TOLERANCES,
                    np.maximum(each, LEAST),
                    marker=method.marker,
                    color=method.colour,
                    label=method.name,
                    markersize=4,
                    linewidth=1.0,
                )
            for tolerance, each in zip(TOLERANCES, values, strict=True):
                rows.append(
                    [f"{omega:.2f}", method.name, f"{tolerance:.0e}", *(f"{value:.0e}" for value in each)]
                )
        column[0].set_title(f"ω = {omega:.2f}, {PAPER[omega].regime}", fontsize=10)
        column[-1].set_xlabel("RelTol = 100 AbsTol")
    for row, name in zip(grid, QUANTITIES, strict=True):
        row[0].set_ylabel(f"error: {name}", fontsize=9)
        for ax in row:
            ax.grid(color="0.92", linewidth=0.6)
            ax.set_axisbelow(True)
            ax.spines[["top", "right"]].set_visible(False)
    grid[0, 0].invert_xaxis()
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    figure.savefig(path, dpi=130, metadata={"Software": None})
    plt.close(figure)
    table(["omega", "method", "tolerance", *QUANTITIES], rows)
    print(f"Picture: {path}")
