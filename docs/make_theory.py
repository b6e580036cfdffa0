"""Make the pictures of the theory pages, each against its closed form: ``python docs/make_theory.py``."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from make_pictures import STYLE, save
from matplotlib.axes import Axes

import models
from hybrid import HybridSystem, simulate
from hybrid.plot import COLOURS, plot_arc
from lyapunov import lyapunov_spectrum
from models.one_impact import one_impact_orbits

HERE = Path(__file__).parent
INK = "#333333"


def names_of(page: str) -> dict[str, Any]:
    """Run the first Python block of a page."""
    block = re.search(r"^```python\n(.*?)^```", (HERE / page).read_text(encoding="utf-8"), re.M | re.S)
    assert block is not None
    namespace: dict[str, Any] = {}
    exec(compile(block[1], page, "exec"), namespace)
    return namespace


def benettin_picture(folder: Path) -> None:
    """Errors of the two means over the number of intervals: on a periodic orbit, and on a chaotic one."""
    figure, (regular, chaotic) = plt.subplots(1, 2, figsize=(9.0, 3.5), layout="constrained")
    oscillator, slower = models.impact_oscillator(), {"w": 0.9}
    orbit = one_impact_orbits(**{**oscillator.parameters, **slower})[0]
    exact = np.log(np.abs(orbit.multipliers[0])) / (2 * np.pi / 0.9)
    found = lyapunov_spectrum(oscillator, (0.0, 0.0), parameters=slower, intervals=3300, k=1)
    draw_errors(regular, found.benettin_history[:, 0] - exact, found.history[:, 0] - exact)
    guide(regular, 2e-2, -1, r"$\propto M^{-1}$")
    guide(regular, 0.8, -3, r"$\propto M^{-3}$")
    regular.set_title("a periodic orbit with impacts")

    exact = 4 / 3 * np.log(2.0)
    start = (0.0, 0.314, 0.686)
    found = lyapunov_spectrum(
        models.switched_arrival(), start, mode="fill1", k=1, interval=1.0, intervals=100_000, transient=20
    )
    draw_errors(chaotic, found.benettin_history[:, 0] - exact, found.history[:, 0] - exact)
    guide(chaotic, 1.0, -0.5, r"$\propto M^{-1/2}$")
    error = found.standard_error[0]
    chaotic.plot([len(found.growths)], [2 * error], "o", color=INK, markersize=5, label="two standard errors")
    chaotic.set_title("chaos: three buffers and one server")
    for ax in (regular, chaotic):
        ax.set_xlabel("intervals M")
        ax.legend(frameon=False, loc="lower left")
    regular.set_ylabel("error of the largest exponent")
    save(figure, folder / "benettin.png")


def draw_errors(ax: Axes, plain: np.ndarray, tapered: np.ndarray) -> None:
    """The largest error from each number of intervals to a tenth more, so that zeros do not show."""
    counts = np.unique(np.geomspace(10, len(plain) / 1.1, 120).astype(int))
    for errors, label, colour in ((plain, "plain mean", COLOURS[0]), (tapered, "tapered mean", COLOURS[1])):
        largest = [np.abs(errors[count - 1 : int(1.1 * count) + 1]).max() for count in counts]
        ax.loglog(counts, largest, color=colour, label=label)
    ax.spines[["top", "right"]].set_visible(False)


def guide(ax: Axes, factor: float, power: float, label: str) -> None:
    counts = np.array(ax.get_xlim()).clip(10, None)
    ax.loglog(counts, factor * counts**power, color=INK, linewidth=0.8, linestyle="--")
    ax.annotate(label, (counts[-1] / 4, factor * (counts[-1] / 4) ** power), xytext=(4, 4),
                textcoords="offset points", color=INK)  # fmt: skip


def chatter_picture(folder: Path) -> None:
    """A ball that comes to rest, and the time that is left at each impact, on a geometric series."""
    names = names_of("chatter.md")
    ball, arc = names["ball"], names["arc"]
    assert isinstance(ball, HybridSystem)
    figure, (height, left) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    plot_arc(arc, ["q"], ax=[height])
    height.set(xlabel="time t (s)", ylabel="height q (m)")
    impacts = arc.jumps.t[:-1]
    limit = names["limit"]
    left.semilogy(
        np.arange(1, len(impacts) + 1), limit - impacts, "o", color=COLOURS[0], label="impacts of the run"
    )
    k = np.arange(1, 31)
    first = limit - impacts[0]
    left.semilogy(
        k, first * ball.parameters["e"] ** (k - 1), color=INK, linewidth=0.8, label="$e^{k-1}$ series"
    )
    left.axvline(len(impacts) + 0.5, color=INK, linewidth=0.8, linestyle=":")
    left.text(len(impacts) + 0.9, first, "extrapolated from here", va="top", color=INK)
    left.set(xlabel="impact k", ylabel="time left to the limit (s)", title="the time left shrinks by e")
    left.legend(frameon=False, loc="lower left")
    left.spines[["top", "right"]].set_visible(False)
    save(figure, folder / "chatter.png")


def grazing_picture(folder: Path) -> None:
    """A thrown ball under a ceiling: its kick by the impact, and the entry of its saltation matrix."""
    names = names_of("grazing.md")
    toss, top = names["toss"], names["top"]
    figure, (kick, entry) = plt.subplots(1, 2, figsize=(9.0, 3.2), layout="constrained")
    heights = np.linspace(-0.02, 0.05, 141)
    kicks = [top(simulate(toss, (-0.5, np.sqrt(1 + 2 * H)), (0.0, 2.0)), H) for H in heights]
    kick.plot(heights, kicks, ".", color=COLOURS[0], markersize=4, label="runs")
    beyond = heights[heights >= 0]
    kick.plot(beyond, -1.8 * np.sqrt(2 * beyond), color=INK, linewidth=0.8, label=r"$-(1 + r)\sqrt{2 g H}$")
    kick.set(xlabel="height H beyond the ceiling (m)", ylabel="kick of the velocity (m/s)")
    kick.set_title("the map has a root")
    powers = 10.0 ** np.arange(-8, -0.5, 0.5)
    sizes = [
        abs(simulate(toss, (-0.5, np.sqrt(1 + 2 * H)), (0.0, 2.0)).jumps[0].saltation[1, 0]) for H in powers
    ]
    entry.loglog(powers, sizes, "o", color=COLOURS[0], markersize=4, label="saltation matrices")
    entry.loglog(
        powers, 1.8 / np.sqrt(2 * powers), color=INK, linewidth=0.8, label=r"$(1 + r)\sqrt{g / 2 H}$"
    )
    entry.set(xlabel="height H beyond the ceiling (m)", ylabel="entry of the saltation matrix (1/s)")
    entry.set_title("its derivative is unbounded")
    for ax in (kick, entry):
        ax.legend(frameon=False)
        ax.spines[["top", "right"]].set_visible(False)
    save(figure, folder / "grazing.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        benettin_picture(folder)
        chatter_picture(folder)
        grazing_picture(folder)


if __name__ == "__main__":
    main()
