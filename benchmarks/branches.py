"""How long branches of orbits and curves of bifurcations take, and how far they are from closed forms.

Seconds are processor time of one core, the least of three, with the model compiled before. The runs of
resonance curves with two measures are counted, and one of the short runs of a branch is timed by itself.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import models
from benchmarks.common import heading, table
from hybrid import PeriodicOrbit, continue_bifurcation, continue_orbit, periodic_orbit, simulate
from hybrid.measures import amplitude, maximum
from hybrid.simulation.repeated import Repeated
from hybrid.simulation.trajectory import Common
from hybrid.solvers import Taylor
from hybrid.transform.extended import extended
from hybrid.transform.restricted import restricted


def settled(system: Any, x0: tuple[float, ...], periods: int, mode: str | None = None) -> PeriodicOrbit:
    arc = simulate(system, x0, (0.0, periods * system.forcing_period()), mode=mode)
    return periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]))


def converter() -> PeriodicOrbit:
    system = models.buck_converter()
    given = {"E": 20.0}
    arc = simulate(system, (12.0, 0.5, 0.0), (0.0, 0.08), mode="on", parameters=given)
    return periodic_orbit(system, arc.x[-1], mode=str(arc.mode[-1]), parameters=given)


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    found, times = run(), []
    for _ in range(3):
        start = time.process_time()
        found = run()
        times.append(time.process_time() - start)
    return found, min(times)


def runs_in(call: Callable[[], Any]) -> int:
    """How many runs a call begins."""
    begin, count = Common.begin, 0

    def counted(*arguments: Any) -> Any:
        nonlocal count
        count += 1
        return begin(*arguments)

    Common.begin = counted  # type: ignore[method-assign]
    try:
        call()
    finally:
        Common.begin = begin  # type: ignore[method-assign]
    return count


def resonance_curves(bilinear: PeriodicOrbit, impacts: PeriodicOrbit) -> None:
    gears = periodic_orbit(models.gear_pair(), (1.1, 0.0), parameters={"w": 1.6})
    outputs = {"amplitude": amplitude("x"), "peak": maximum("x")}
    rows = []
    for what, orbit, span in (
        ("gear pair", gears, (0.4, 1.6)),
        ("bilinear oscillator", bilinear, (0.3, 4.0)),
        ("impact oscillator", impacts, (0.75, 2.0)),
    ):

        def followed(orbit: PeriodicOrbit = orbit, span: tuple[float, float] = span) -> Any:
            return continue_orbit(orbit, "w", span, outputs=outputs)

        branch, seconds = timed(followed)
        count = len(branch)
        each = (f"{200 * seconds / count:.2f} s", f"{runs_in(followed) / count:.1f}")
        rows.append((what, f"w {span[0]} to {span[1]}", str(count), str(len(branch.bifurcations)), *each))
    table(("resonance curve", "over", "orbits", "bifurcations", "per 200 orbits", "runs per orbit"), rows)


def short_runs() -> None:
    system = extended(models.bilinear_oscillator(), ("w",))
    flow, solver = restricted(system, "stiff"), Taylor(rtol=1e-12, atol=1e-14)
    runs, start, times = Repeated(flow, {}, solver), np.array([0.0, 1.0, 1.0]), (0.0, 1.0)

    def several(run: Callable[[], Any], number: int = 1000) -> float:
        return 1e6 / number * timed(lambda: [run() for _ in range(number)])[1]

    rows = [
        ("simulate(tangent=True)", lambda: simulate(flow, start, times, solver=solver, tangent=True).status),
        ("as a branch makes it", lambda: runs.run("stiff", start, times, 1000, 1000)),
    ]
    table(("one short run", "time"), [(what, f"{several(run):.0f} us") for what, run in rows])


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    heading(__doc__.splitlines()[0])
    impacts = periodic_orbit(models.impact_oscillator(), (0.9, 1.0))
    swing = settled(models.dry_friction_oscillator(), (1.0, 0.0), 200, "above")
    bilinear = settled(models.bilinear_oscillator(), (0.0, 0.0), 300)
    founding = settled(models.vibroimpact(), (0.0, 0.02, 0.0, 0.0), 600)
    branches = [
        ("one impact per period", impacts, "w", (0.75, 1.9), {"grazing": np.sqrt(1.99)}),
        ("founding system", founding, "omega", (6.5, 8.5), {}),
        ("buck converter", converter(), "E", (10.0, 33.0), {"border": 11.3 + 3.8 / 8.4}),
        ("dry friction", swing, "w", (0.5, 0.95), {}),
        ("bilinear oscillator", bilinear, "w", (0.45, 3.0), {}),
    ]
    rows = []
    for what, orbit, name, span, exact in branches:
        branch, seconds = timed(lambda orbit=orbit, name=name, span=span: continue_orbit(orbit, name, span))
        kinds = [each.kind for each in branch.bifurcations]
        counted = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        errors = [abs(each.value - exact[each.kind]) for each in branch.bifurcations if each.kind in exact]
        error = f"{max(errors):.1e}" if errors else ""
        rows.append(
            (what, f"{name} {span[0]} to {span[1]}", str(len(branch)), f"{seconds:.2f} s", counted, error)
        )
    table(("branch", "over", "orbits", "time", "found", "error of the exact one"), rows)

    resonance_curves(bilinear, impacts)
    short_runs()

    found = continue_orbit(impacts, "w", (0.9, 2.0)).bifurcations
    curves = []
    for each in found:
        over = {"w": (1.2, 2.0), "A": (0.5, 2.0)}
        curve, seconds = timed(lambda each=each, over=over: continue_bifurcation(each, over))
        curves.append((each.kind, "w, A", str(len(curve)), f"{seconds:.2f} s"))
    table(("curve", "over", "points", "time"), curves)


if __name__ == "__main__":
    main()
