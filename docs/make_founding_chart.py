"""The chart of the founding system over frequency and gap: ``python docs/make_founding_chart.py --help``.

The rows are computed on a coarse grid first, then on finer ones that contain it: each grid reuses the rows of
the grids before, which are in the store. The command may be killed and started again at any time. The picture
is drawn at the end, or with ``--draw`` from what is there.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

import hybrid
import models
from lyapunov import chart
from lyapunov.plot import plot_kinds, plot_map, style
from lyapunov.study.runs import STARTS

HERE = Path(__file__).parent
# The paper's three regimes.
REGIMES = {7.40: "periodic", 7.46: "torus", 7.92: "chaotic"}
GAP = 0.05

FREQUENCIES = np.round(7.1 + 0.002 * np.arange(500), 3)
GAPS = np.round(0.03 + 0.0001 * np.arange(500), 4)
SETTINGS: dict[str, Any] = {
    "k": 2,
    "transient": 200,
    "intervals": 300,
    "solver": hybrid.Taylor(rtol=1e-6, atol=1e-8),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--store", type=Path, default=Path("founding.zarr"))
    parser.add_argument("--every", type=int, nargs="+", default=[4, 2, 1], help="strides of the grids")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--draw", action="store_true", help="draw what the store holds, compute nothing")
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the picture")
    arguments = parser.parse_args()
    for every in () if arguments.draw else arguments.every:
        begin, processor = time.perf_counter(), time.process_time()
        over = {"D": GAPS[::every], "omega": FREQUENCIES[::every]}
        swept = chart(
            models.vibroimpact(),
            over,
            STARTS[0].x0,
            store=arguments.store,
            executor=arguments.threads,
            **SETTINGS,
        )
        done = int((swept.status == hybrid.StatusCode.SUCCESS).sum())
        print(
            f"{swept.status.size} rows, {done} of them complete, {time.perf_counter() - begin:.0f} s, "
            f"{time.process_time() - processor:.0f} s of processor time",
            flush=True,
        )
    arguments.output.mkdir(parents=True, exist_ok=True)
    draw(arguments.store, arguments.output)


def draw(store: Path, folder: Path) -> None:
    """The largest exponent and the kinds of motion, with the paper's regimes as points."""
    swept = hybrid.open_store(store)
    # Lines that are not complete yet are left out.
    swept = swept.isel(D=(swept.status != hybrid.StatusCode.NOT_RUN).all("omega").values)
    with style("chart"):
        figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6), sharey=True)
        plot_map(swept, ax=left)
        plot_kinds(swept, ax=right)
        right.set_ylabel("")
        for ax in (left, right):
            for omega, kind in REGIMES.items():
                ax.plot(omega, GAP, "o", color="black", markerfacecolor="none", markersize=7)
                above = omega != 7.46
                ax.annotate(
                    f"{omega:.2f} {kind}",
                    (omega, GAP),
                    xytext=(4, 9 if above else -16),
                    textcoords="offset points",
                    fontsize=8,
                    bbox={"facecolor": "white", "alpha": 0.75, "linewidth": 0, "pad": 1},
                )
        figure.savefig(folder / "founding_chart.png", dpi=130)


if __name__ == "__main__":
    main()
