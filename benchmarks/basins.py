"""How long the basins of a million starts take: ``python -m benchmarks.basins``."""

from __future__ import annotations

import argparse
import time

import numpy as np

import hybrid
import models

# Parameters at which one attractor, or two, wait for the starts.
CASES = {"one orbit": {}, "two orbits": {"w": 2.6}, "two orbits, little damping": {"w": 0.75, "c": 0.02}}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--side", type=int, default=1000, help="starts along each axis")
    parser.add_argument("--threads", type=int, help="by default all cores")
    arguments = parser.parse_args()
    over = {"x": np.linspace(-4.0, 1.0, arguments.side), "v": np.linspace(-4.0, 4.0, arguments.side)}
    for name, parameters in CASES.items():
        begin, processor = time.perf_counter(), time.process_time()
        found = hybrid.basins(
            models.impact_oscillator(), over, parameters=parameters, executor=arguments.threads
        )
        wall, busy = time.perf_counter() - begin, time.process_time() - processor
        points, shares = float(found.steps.mean()), found.fraction.values.round(4)
        print(
            f"{name}: {wall:.1f} s, {busy:.1f} s of processor time, {points:.1f} points, {shares}", flush=True
        )


if __name__ == "__main__":
    main()
