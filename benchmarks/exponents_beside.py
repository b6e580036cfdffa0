"""The first exponent from 500 periods, compared with packages that integrate across the contact.

Part of ``python -m benchmarks.exponents``. The printed value differs from the exponent for two reasons: it is
a mean over a finite number of periods, and the integration has an error. The fundamental matrix of the orbit
gives the exact mean for the same tangent vector and periods, and thus the error of the integration alone.
"""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from typing import Any, NamedTuple

import attrs
import matplotlib.pyplot as plt
import numpy as np

import models
from benchmarks.common import least_time, table
from benchmarks.peers.growth import Growth, Method
from benchmarks.peers.problem import ATOL_OVER_RTOL
from benchmarks.problems import always_touching, stored
from hybrid import DOP853, HybridSystem, PeriodicOrbit, Taylor, periodic_orbit
from hybrid.plot import COLOURS
from lyapunov import lyapunov_spectrum
from lyapunov.directions import first_vectors

PERIODS = 500
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
PEERS = {"pynamicalsys_straight": "pynamicalsys", "jitcode_straight": "jitcode"}
# Widths in metres over which the force is smoothed, and the method and tolerance of these runs.
WIDTHS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
SMOOTH = ("jitcode_lyap dop853", 1e-10)


class Case(NamedTuple):
    """The founding system on a stable orbit, and its first exponent from a computation with 60 digits."""

    system: HybridSystem
    x0: Sequence[float]
    exact: float
    orbit: PeriodicOrbit

    @property
    def t_end(self) -> float:
        return PERIODS * self.system.forcing_period()

    def mean_of(self, vector: np.ndarray, left_out: int) -> float:
        """Mean growth rate of a tangent vector over the run without its first ``left_out`` periods."""
        logs = []
        for _ in range(round(self.t_end / self.orbit.period)):
            vector = self.orbit.fundamental @ (vector / np.linalg.norm(vector))
            logs.append(math.log(np.linalg.norm(vector)))
        turns = self.orbit.period / self.system.forcing_period()
        return float(np.mean(logs[round(left_out / turns) :]) / self.orbit.period)


class Point(NamedTuple):
    """The printed exponent, the error of the integration, and the seconds of a run and of its compilation."""

    tolerance: float
    exponent: float
    integration: float
    seconds: float
    compilation: float


Points = dict[str, list[Point]]


def cases() -> dict[str, Case]:
    made = {}
    for D in ("0.05", "0"):
        facts, system = stored("founding_system")[f"D={D}"], models.vibroimpact()
        system = attrs.evolve(system, parameters={**system.parameters, "D": float(D)})
        orbit = periodic_orbit(system, facts["x0"], periods=facts["periods"])
        made[D] = Case(system, orbit.x0, facts["exponents"][0], orbit)
    return made


def peers() -> list[Any]:
    """The installed packages; prints a line for each package that is missing."""
    found = []
    for module, package in PEERS.items():
        try:
            found.append(importlib.import_module(f"benchmarks.peers.{module}"))
            print(f"{package} {version(package)}")
        except ImportError as missing:
            print(f"{package}: left out, {missing}")
    print()
    return found


def ours(case: Case) -> dict[str, Method]:
    (vector,) = first_vectors(case.system, 1, None).T

    def with_solver(kind: Callable[..., Any]) -> Method:
        def at(rtol: float) -> Callable[[], Growth]:
            solver = kind(rtol=rtol, atol=rtol * ATOL_OVER_RTOL)

            def run(periods: int = PERIODS) -> Growth:
                left_out = periods // 10
                found = lyapunov_spectrum(
                    case.system, case.x0, k=1, intervals=periods - left_out, transient=left_out, solver=solver
                )
                return Growth(vector, left_out, found.growths.mean(), found.exponents[0])

            run(1)
            return run

        return at

    return {f"hybrid {kind.__name__}": with_solver(kind) for kind in (Taylor, DOP853)}


def by_peer(peer: Any, case: Case, **options: float) -> dict[str, Method]:
    return peer.methods(always_touching(case.system), case.x0, case.t_end, PERIODS, **options)


def measure(case: Case, found: Sequence[Any]) -> Points:
    methods = ours(case)
    for peer in found:
        methods |= by_peer(peer, case)
    return {
        name: [point(case, method, tolerance) for tolerance in TOLERANCES] for name, method in methods.items()
    }


def point(case: Case, method: Method, tolerance: float, repeats: int = 3) -> Point:
    begin = time.perf_counter()
    run = method(tolerance)
    compilation = time.perf_counter() - begin
    growth = run()
    integration = abs(growth.mean / case.mean_of(growth.vector, growth.left_out) - 1)
    return Point(tolerance, growth.exponent, integration, least_time(run, repeats), compilation)


def rounded_off(case: Case, found: Sequence[Any]) -> list[Point]:
    """Points over the widths, if jitcode_lyap is installed."""
    name, tolerance = SMOOTH
    return [
        point(case, by_peer(peer, case, width=width)[name], tolerance, repeats=1)
        for peer in found
        if peer.__name__.endswith("jitcode_straight")
        for width in WIDTHS
    ]


class Beside(NamedTuple):
    """All measurements, by the gap."""

    cases: dict[str, Case]
    points: dict[str, Points]
    rounded: dict[str, list[Point]]


def beside() -> Beside:
    found, made = peers(), cases()
    measured = {D: measure(case, found) for D, case in made.items()}
    rounded = {D: rounded_off(case, found) for D, case in made.items()}
    return Beside(made, measured, rounded)


def summary(result: Beside) -> None:
    for D, case in result.cases.items():
        print(f"{PERIODS} periods at D = {D} m, first exponent {case.exact:.8f}:\n")
        rows = [
            [
                name,
                f"{p.tolerance:.0e}",
                f"{p.exponent:.5f}",
                f"{abs(p.exponent / case.exact - 1):.0e}",
                f"{p.integration:.0e}",
                f"{p.seconds:.3f} s",
                f"{points[0].compilation:.1f} s",
            ]
            for name, points in result.points[D].items()
            for p in points
        ]
        table(
            ["method", "rtol = 100 atol", "printed", "error", "of the integration", "time", "compiled in"],
            rows,
        )
    if any(result.rounded.values()):
        print(f"The force smoothed over a width, {SMOOTH[0]} at {SMOOTH[1]:.0e}:\n")
        rows = [
            [f"D = {D} m, {what}", *(form(p) for p in points)]
            for D, points in result.rounded.items()
            for what, form in (
                ("printed", lambda p: f"{p.exponent:.4f}"),
                ("error of the integration", lambda p: f"{p.integration:.0e}"),
            )
        ]
        table(["", *(f"{width:.0e} m" for width in WIDTHS)], rows)


def draw(axes: Sequence[plt.Axes], result: Beside) -> None:
    """Error over time for each gap, and error over the width of a smoothed force."""
    for ax, (D, points) in zip(axes, result.points.items(), strict=False):
        exact = result.cases[D].exact
        for colour, (name, row) in zip(COLOURS, points.items(), strict=False):
            seconds = [p.seconds for p in row]
            printed = [abs(p.exponent / exact - 1) for p in row]
            ax.loglog(seconds, printed, "o:", color=colour, markersize=4, markerfacecolor="white")
            ax.loglog(seconds, [p.integration for p in row], "o-", color=colour, markersize=4, label=name)
        ax.set_title(f"{PERIODS} periods, all packages, D = {D} m")
        ax.set_xlabel("seconds; dotted: as printed, lines: integration")
    axes[0].set_ylabel("relative error of the first exponent")
    for colour, (D, row) in zip(COLOURS, result.rounded.items(), strict=False):
        axes[2].loglog(
            WIDTHS[: len(row)],
            [p.integration for p in row],
            "o-",
            color=colour,
            markersize=4,
            label=f"D = {D} m",
        )
    axes[2].set_title("Integration with a smoothed force")
    axes[2].set_xlabel("width, m")
    if any(result.rounded.values()):
        axes[2].legend()
    for ax in axes:
        ax.grid(True)
