"""Recomputes the vibro-impact study of Bazhenov, Pogorelova and Postnikova (2017): ``python -m lyapunov``."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import models
from hybrid import DOP853, HybridError, Taylor, Tsit5
from lyapunov.study import figures, report
from lyapunov.study.column import paper_columns_by_its_method
from lyapunov.study.diagram import diagram, diagram_text, write_diagram
from lyapunov.study.paper import PAPER, ROWS
from lyapunov.study.runs import STARTS, Settings, study_regime
from lyapunov.study.tangents import explanations, tolerance_study

SOLVERS = {solver.__name__: solver for solver in (Taylor, DOP853, Tsit5)}

EPILOG = f"""
For each frequency, the study prints:
the two-orbit formulas (7), (8) and (9) of the paper and Benettin's method (10) after
M = {", ".join(map(str, ROWS))} periods, beside the figures of the paper;
the renormalised two-orbit estimate and the tapered mean, which converge;
the whole spectrum with its standard error and the sum rule; and the Floquet exponents of the orbit of one
period. It then follows this orbit over the frequency to its bifurcations, shows the error of tangent
vectors outside the error control, and tests candidate explanations of the paper's figures, the paper's
own method (ode23s straight through the impacts) among them.

Starts: {"; ".join(f"{start.label}, {start.text}" for start in STARTS)}.

The folder receives exponents_*.csv, portrait_*.png and convergence_*.png for each frequency, and
regimes.png, diagram.png, tolerances.csv, tolerances.png and explanations.csv. Exponents are in 1/s.
"""


def parser() -> argparse.ArgumentParser:
    """Options of the command line."""
    options = argparse.ArgumentParser(
        prog="python -m lyapunov",
        description=__doc__,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    options.add_argument(
        "--omega",
        type=float,
        nargs="+",
        default=list(PAPER),
        help="frequencies of the drive, rad/s (default: the paper's, %(default)s)",
    )
    options.add_argument(
        "--intervals",
        type=int,
        default=10_000,
        metavar="M",
        help="forcing periods to average over (default: %(default)s)",
    )
    options.add_argument(
        "--transient",
        type=int,
        default=1_000,
        help="forcing periods to discard at the start (default: %(default)s)",
    )
    options.add_argument("--solver", choices=SOLVERS, default="Taylor", help="method (default: %(default)s)")
    options.add_argument(
        "--rtol", type=float, default=1e-9, help="relative tolerance per step (default: %(default)s)"
    )
    options.add_argument(
        "--atol", type=float, default=1e-11, help="absolute tolerance per step (default: %(default)s)"
    )
    options.add_argument(
        "--output",
        type=Path,
        default=Path("study"),
        help="folder for tables and figures (default: %(default)s)",
    )
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the study with the options of the command line; return the exit status."""
    options = parser().parse_args(arguments)
    started = time.perf_counter()
    try:
        solver = SOLVERS[options.solver](rtol=options.rtol, atol=options.atol)
        settings = Settings(options.intervals, options.transient, solver, progress=sys.stderr.isatty())
        options.output.mkdir(parents=True, exist_ok=True)
        _run(options.omega, settings, options.output)
    except (HybridError, OSError) as error:
        print(f"python -m lyapunov: {error}", file=sys.stderr)
        return 2
    print(f"\nTables and figures are in {options.output.resolve()} ({time.perf_counter() - started:.0f} s).")
    return 0


def _run(omegas: Sequence[float], settings: Settings, folder: Path) -> None:
    """Compute, print and write each table as soon as it is ready."""
    system = models.vibroimpact()
    solver = settings.solver
    print(
        f"Vibro-impact system, {settings.intervals} periods after {settings.transient}, "
        f"{type(solver).__name__} at rtol = {solver.rtol:g}, atol = {solver.atol:g}.\n"
        "First exponent, 1/s, after M periods. (7) to (10): formulas of the paper. two-orbit: tapered mean\n"
        "for a renormalised companion. tapered: tapered mean of Benettin's growth rates.\n",
        flush=True,
    )
    regimes = []
    for omega in dict.fromkeys(omegas):
        regimes.append(study_regime(system, omega, settings))
        print(report.regime_text(regimes[-1]), end="\n\n", flush=True)
        report.write_histories(folder, regimes[-1])
    figures.write_figures(folder, regimes)

    found_on = diagram(system, progress=settings.progress)
    print(diagram_text(found_on), end="\n\n", flush=True)
    write_diagram(folder, found_on)

    trap = tolerance_study(system, settings)
    print(report.tolerance_text(trap), end="\n\n", flush=True)
    report.write_tolerances(folder, trap)
    figures.write_tolerance_figure(folder, trap)

    found = explanations(system, list(dict.fromkeys(omegas)), settings)
    print(report.explanation_text(found), flush=True)
    report.write_explanations(folder, found)
    if known := [omega for omega in dict.fromkeys(omegas) if omega in PAPER]:
        columns = paper_columns_by_its_method(system, known, settings)
        print(f"\n{report.column_text(columns)}", flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
