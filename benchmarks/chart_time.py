"""Time of a chart and efficiency of its threads: ``python -m benchmarks.chart_time --rows 1000``."""

from __future__ import annotations

import argparse
import time
from functools import partial

import numpy as np

import models
from benchmarks.common import heading, table
from hybrid import Taylor
from lyapunov import chart

START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
PERIODS, TRANSIENT = 1000, 200
SOLVER = Taylor(rtol=1e-6, atol=1e-8)


def measured(rows: int, threads: int, **options: object) -> tuple[float, float]:
    """Wall-clock time and processor time in seconds."""
    over = {"omega": np.linspace(7.0, 8.0, rows)}
    work = partial(chart, models.vibroimpact(), over, START, solver=SOLVER, executor=threads)
    clock, processor = time.perf_counter(), time.process_time()
    work(**{"intervals": PERIODS, "transient": TRANSIENT, **options})
    return time.perf_counter() - clock, time.process_time() - processor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=64)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    arguments = parser.parse_args()
    count = arguments.rows
    heading(
        f"Founding system, {count} frequencies from 7 to 8, {PERIODS} periods after {TRANSIENT}, one tangent "
        f"vector, rtol = {SOLVER.rtol:.0e}."
    )
    measured(2, 1, intervals=1, transient=1, continue_from="previous", section=1)
    rows = []
    for name, options in (("anew", {}), ("carried", {"continue_from": "previous"})):
        alone = None
        for threads in arguments.threads:
            clock, processor = measured(count, threads, **options)
            alone = alone or clock
            # A row of one interval is almost all Python, which threads cannot run in parallel.
            _, python = measured(count, 1, intervals=1, transient=1, **options)
            rows.append(
                [
                    name,
                    str(threads),
                    f"{clock:.2f} s",
                    f"{1e3 * processor / count:.0f} ms",
                    f"{100 * python / processor:.1f} %",
                    f"{100 * alone * arguments.threads[0] / clock / threads:.0f} %",
                ]
            )
    table(["start", "threads", "time", "processor time per row", "Python's share", "efficiency"], rows)


if __name__ == "__main__":
    main()
