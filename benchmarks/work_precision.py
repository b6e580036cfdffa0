"""Error against time on four systems, compared with other installed packages: tables and charts.

Run ``pip install '.[benchmarks]'``, then ``OMP_NUM_THREADS=1 python -m benchmarks.work_precision``. GNU
Octave is included if it is installed.
"""

from __future__ import annotations

import argparse
import importlib
import os
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.common import heading
from benchmarks.peers.problem import ATOL_OVER_RTOL, Problem
from benchmarks.problems import problems
from hybrid import DOP853, RadauIIA, Taylor, Tsit5, WorkPrecision, work_precision
from hybrid.plot import plot_work_precision

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
TANGENT_TOLERANCES = (1e-6, 1e-9, 1e-12)
PEERS = {
    "scipy_ivp": "scipy",
    "cvode": "scikit-sundae",
    "heyoka_taylor": "heyoka",
    "diffrax_jax": "diffrax",
    "octave": "GNU Octave",
}
OURS = {
    method.__name__: method(rtol=1.0, atol=ATOL_OVER_RTOL) for method in (Taylor, DOP853, Tsit5, RadauIIA)
}
# Errors at which times are compared.
TARGETS = (1e-4, 1e-6, 1e-8, 1e-10)


def peers(wanted: list[str]) -> Iterator[Any]:
    """The installed peers; prints a line for each peer that is missing."""
    for module, package in PEERS.items():
        if module not in wanted:
            continue
        try:
            yield importlib.import_module(f"benchmarks.peers.{module}")
            print(f"{package} {_version(module, package)}")
        except ImportError as missing:
            print(f"{package}: left out, {missing}")


def _version(module: str, package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return str(importlib.import_module(f"benchmarks.peers.{module}").version())


def measure(problem: Problem, found: list[Any], repeats: int) -> WorkPrecision:
    methods: dict[str, Any] = {f"hybrid {name}": solver for name, solver in OURS.items()}
    if not problem.tangent:
        for peer in found:
            methods |= peer.methods(problem)
    return work_precision(
        problem.system,
        problem.x0,
        problem.t_span,
        methods=methods,
        tolerances=TANGENT_TOLERANCES if problem.tangent else TOLERANCES,
        reference=problem.reference,
        mode=problem.mode,
        tangent=problem.tangent,
        repeats=repeats,
        longest=0.5,
        clock=time.process_time,
    )


def compare(result: WorkPrecision) -> None:
    """Print each method's milliseconds for each error of ``TARGETS``, between its measured points."""
    print("ms to an error of".ljust(34) + "".join(f"{target:10.0e}" for target in TARGETS) + "   compile ms")
    for method in result.methods:
        rows = result.rows_of(method)
        reached = (1e3 * result.seconds_at(method, target) for target in TARGETS)
        cells = "".join(f"{ms:10.3g}" if np.isfinite(ms) else f"{'-':>10}" for ms in reached)
        print(f"{method:34}{cells}{1e3 * np.nan_to_num(result.compile_seconds[rows]).max():13.0f}")
    failed = {m: set(result.status[result.rows_of(m)].tolist()) - {"SUCCESS"} for m in result.methods}
    for method, statuses in failed.items():
        for status in statuses:
            print(f"{method}: {status[:100]}")
    print()


def draw(results: dict[str, WorkPrecision], path: Path) -> None:
    columns = min(len(results), 2)
    rows = -(-len(results) // columns)
    figure, grid = plt.subplots(
        rows, columns, figsize=(7.5 * columns, 5.4 * rows), layout="constrained", squeeze=False
    )
    for ax in grid.ravel()[len(results) :]:
        ax.set_axis_off()
    for ax, (title, result) in zip(grid.ravel(), results.items(), strict=False):
        plot_work_precision(result, "fundamental" if "fundamental" in result.error else "state", ax=ax)
        ax.set_title(title, loc="left", fontsize=10)
    figure.savefig(path, dpi=90, metadata={"Software": None})
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=7, help="least number of runs for the median")
    parser.add_argument("--peers", nargs="*", choices=PEERS, default=list(PEERS), help="all by default")
    parser.add_argument("--only", nargs="*", default=None, help="beginnings of the short names of problems")
    parser.add_argument("--full", action="store_true", help="also print every run")
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    arguments = parser.parse_args()
    heading("Error against processor time: this library and its peers, one thread each.")
    arguments.output.mkdir(parents=True, exist_ok=True)
    found = list(peers(arguments.peers))
    print(f"Load at the start: {os.getloadavg()[0]:.1f}\n")
    results: dict[str, dict[str, WorkPrecision]] = {}
    for name, problem in problems().items():
        if arguments.only and not name.startswith(tuple(arguments.only)):
            continue
        result = measure(problem, found, arguments.repeats)
        group = name.split("-", maxsplit=1)[0]
        results.setdefault(group, {})[problem.title] = result
        floor = ", ".join(f"{quantity} {error:.0e}" for quantity, error in result.reference_error.items())
        print(f"{problem.title} (error of the reference: {floor})", flush=True)
        if arguments.full:
            print(result)
        compare(result)
        # Draw after every problem, so that an interrupted run leaves a picture.
        draw(results[group], arguments.output / f"work_precision_{group}.png")
    print(f"Load at the end: {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
