"""Draws the six panels as one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.stability.events import MOST_EVENTS, NEVER
from benchmarks.stability.methods import STYLES, Curves
from hybrid.plot import COLOURS

PICTURE = "stability.png"
PLAIN = {"linewidth": 1.1, "markersize": 3.4, "markeredgewidth": 0.9}


def draw(axes: Any, curves: Curves) -> None:
    for name, points in curves.items():
        if name not in STYLES:
            continue
        x, y = np.array(points).T
        axes.plot(x, y, label=name, **{**PLAIN, **STYLES[name]})


def finish(axes: Any, letter: str, title: str, xlabel: str, ylabel: str) -> None:
    axes.set_title(f"{letter}  {title}", loc="left", fontsize=9.5, fontweight="bold")
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(which="minor", length=0)


def picture(panels: dict[str, Curves], periods: int, path: Path) -> None:
    figure, grid = plt.subplots(2, 3, figsize=(11.4, 7.4))
    stiff, grazing, restitution, damping, split, phase = grid.ravel()

    draw(stiff, panels["stiffness"])
    stiff.set(xscale="log", yscale="log", ylim=(1e-17, 1e0))
    finish(
        stiff, "a", "Stiff contact, elastic", "wall stiffness $K$ (1/s²)", "height error after 5 bounces (m)"
    )

    draw(grazing, panels["grazing"])
    reported = np.array(panels["grazing"]["DOP853, tight: reported"]).T
    grazing.fill_between(
        *reported, color=COLOURS[0], alpha=0.13, linewidth=0, label="reported as grazing by DOP853, tight"
    )
    grazing.set(xscale="log", ylim=(-0.04, 1.08))
    grazing.invert_xaxis()
    finish(grazing, "b", "Near grazing", "depth of the dips", "crossings miscounted silently (share)")

    draw(restitution, panels["restitution"])
    restitution.annotate(
        f"never: given up after {MOST_EVENTS} bounces", (0.5, NEVER * 4), ha="center", fontsize=8
    )
    restitution.set(xscale="logit", yscale="log", ylim=(1e-17, 1e3))
    restitution.set_xticks([1e-4, 1e-2, 0.5, 0.99, 0.9999], ["$10^{-4}$", "0.01", "0.5", "0.99", "0.9999"])
    finish(
        restitution, "c", "Through the limit of the bounces", "restitution $e$", "error of the time of rest"
    )

    draw(damping, panels["damping"])
    damping.set(xscale="log", yscale="log", ylim=(1e-18, 1e0))
    finish(
        damping, "d", "Damped contact, stiff", "damping of the contact $c$ (1/s)",
        "height error after 5 landings (m)",
    )  # fmt: skip

    draw(split, panels["split"])
    split.set_xscale("symlog", linthresh=1, linscale=0.4)
    split.set_xticks([-1000, -30, -1, 1, 30, 1000], ["−1000", "−30", "−1", "1", "30", "1000"])
    split.set_ylim(-0.04, 1.08)
    finish(split, "e", "Run split at an event", "split minus event (ulp)", "runs with a wrong count (share)")

    draw(phase, panels["phase"])
    phase.set(xscale="log", yscale="log", ylim=(1e-16, 1e-3))
    finish(
        phase,
        "f",
        f"{periods:,} periods".replace(",", " "),
        "forcing periods",
        "largest phase error of impacts (rad)",
    )

    shown: dict[str, Any] = {}
    for axes in grid.ravel():
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            shown.setdefault(label, handle)
    figure.tight_layout(rect=(0, 0.095, 1, 1), w_pad=2.0, h_pad=2.0)
    figure.legend(shown.values(), shown.keys(), loc="lower center", ncols=5, frameon=False, fontsize=8.5)
    figure.savefig(path, dpi=150, metadata={"Software": None})
