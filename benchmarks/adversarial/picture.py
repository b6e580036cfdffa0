"""Picture: shares of events missed, invented and doubled over the sharpness of the guards, per method."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.adversarial.tally import EDGES, Tally, by_sharpness
from hybrid.plot import COLOURS

STYLES: dict[str, dict[str, Any]] = {
    "Taylor": {"color": "0.1", "marker": "*"},
    "DOP853": {"color": COLOURS[0], "marker": "o"},
    "RadauIIA": {"color": COLOURS[5], "marker": "D"},
    "SciPy DOP853": {"color": COLOURS[1], "marker": "^", "linestyle": "--"},
}
PANELS = ("missed", "invented", "doubled")


def picture(tally: Tally, path: Path) -> None:
    """Draw three panels with one point per bin of sharpness and method, on an axis that includes zero."""
    middles = np.sqrt(EDGES[1:] * EDGES[:-1])
    with plt.rc_context({"font.size": 9, "axes.linewidth": 0.7}):
        figure, panels = plt.subplots(1, 3, figsize=(11.4, 3.4), sharey=True)
        for place, (axes, name) in enumerate(zip(panels, PANELS, strict=True)):
            for method, style in STYLES.items():
                if method in tally.outcomes:
                    shares = by_sharpness(tally, method)[:, place]
                    axes.plot(middles, shares, label=method, linewidth=1.1, markersize=4, **style)
            axes.set_title(name, loc="left", fontweight="bold", fontsize=9.5)
            axes.set(xscale="log", xlabel="sharpness $k$ of the guard")
            axes.set_yscale("symlog", linthresh=1e-5)
            axes.set_ylim(-1e-6, 1.5)
            axes.spines[["top", "right"]].set_visible(False)
            axes.grid(color="0.92", linewidth=0.6)
            axes.set_axisbelow(True)
            axes.tick_params(which="minor", length=0)
        panels[0].set_ylabel("share of the changes of sign")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.tight_layout(rect=(0, 0.07, 1, 1))
        figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False)
        figure.savefig(path, dpi=150, metadata={"Software": None})
        plt.close(figure)
