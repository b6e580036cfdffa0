"""``python -m benchmarks.stability`` makes ``docs/stability.png`` and prints a summary of its curves."""

from __future__ import annotations

import time
from collections.abc import Callable

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.common import file_in, heading, options, table
from benchmarks.stability.events import grazing_curves, restitution_curves, split_curves
from benchmarks.stability.methods import Curves
from benchmarks.stability.periods import phase_curves
from benchmarks.stability.picture import PICTURE, picture
from benchmarks.stability.shaken import damping_curves
from benchmarks.stability.wall import stiffness_curves


def summary(panels: dict[str, Curves]) -> None:
    rows = []
    for panel, curves in panels.items():
        for name, points in curves.items():
            values = np.array([value for _, value in points])
            good = values[np.isfinite(values)]
            given_up = str(len(values) - len(good))
            if len(good):
                spread = [f"{number:.1e}" for number in (good.min(), np.median(good), good.max())]
            else:
                spread = ["-"] * 3
            rows.append([panel, name, *spread, given_up])
    table(["panel", "method", "least", "median", "largest", "no result"], rows)


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--periods", type=int, default=1_000_000, help="periods of panel f")
    given = parser.parse_args()
    periods, path = given.periods, file_in(given.output, PICTURE)
    heading("Where methods fail: errors against closed forms, and miscounted events.")
    jobs: dict[str, Callable[[], Curves]] = {
        "stiffness": stiffness_curves,
        "grazing": grazing_curves,
        "restitution": restitution_curves,
        "damping": damping_curves,
        "split": split_curves,
        "phase": lambda: phase_curves(periods),
    }
    panels: dict[str, Curves] = {}
    for name, job in jobs.items():
        begin = time.process_time()
        panels[name] = job()
        print(f"{name}: {time.process_time() - begin:.0f} s", flush=True)
    print()
    summary(panels)
    with plt.rc_context({"font.size": 9, "axes.linewidth": 0.7}):
        picture(panels, periods, path)
    print(f"Picture: {path}")


if __name__ == "__main__":
    main()
