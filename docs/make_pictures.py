"""Make the pictures of the documentation with the model of the README: ``python docs/make_pictures.py``."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import print_plots

import models
from hybrid import (
    DOP853,
    HybridSystem,
    basin_fractions,
    continue_all,
    continue_equilibrium,
    continue_orbit,
    equilibrium,
    periodic_orbit,
    simulate,
    stroboscopic_section,
    switch_branch,
)
from hybrid.measures import amplitude, maximum
from hybrid.plot import COLOURS, plot_arc, plot_branch, plot_diagram, plot_graph, plot_phase
from lyapunov import chart
from lyapunov.plot import plot_chart, style
from lyapunov.study.diagram import diagram, draw

HERE = Path(__file__).parent
README = HERE.parent / "README.md"
PLAIN = HERE / "plain-equations.md"
OUTPUTS = HERE / "outputs.md"
CONTACTS = HERE / "contacts-from-gaps.md"
DIODES = HERE / "diodes-and-complementarity.md"
STYLE = {"font.size": 9, "axes.titlesize": 10, "axes.titlelocation": "left", "savefig.dpi": 160}


def model_of(page: Path, name: str) -> HybridSystem:
    """Run the first Python block of a page and take its model."""
    block = re.search(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    assert block is not None
    namespace: dict[str, Any] = {}
    exec(compile(block[1], str(page), "exec"), namespace)
    return namespace[name]


def rattler_picture(system: HybridSystem, folder: Path) -> None:
    """Time series, phase portrait with an unstable periodic orbit, and section of the chaotic attractor."""
    period = system.forcing_period()
    arc = simulate(system, (0.5, 0.0), (0.0, 16 * period))
    later = simulate(system, arc.x[-1], (0.0, 6 * period), mode=str(arc.mode[-1]))
    orbit = periodic_orbit(system, (1.2, 1.6))
    section = stroboscopic_section(
        system, (0.5, 0.0), periods=40_000, transient=100, solver=DOP853(rtol=1e-8, atol=1e-10)
    )

    figure = plt.figure(figsize=(10.0, 3.9), layout="constrained")
    grid = figure.add_gridspec(2, 3, width_ratios=(1.25, 1, 1))
    series = [figure.add_subplot(grid[row, 0]) for row in range(2)]
    plot_arc(later, ax=series)
    series[0].tick_params(labelbottom=False)
    for axes, label in zip(series, ("position q", "velocity v"), strict=True):
        axes.set_ylabel(label)
    series[-1].set_xlabel("time t")

    portrait = figure.add_subplot(grid[:, 1])
    plot_phase(later, "q", "v", ax=portrait)
    portrait.get_legend().remove()
    lines = list(portrait.lines)
    for line in lines:
        line.set_alpha(0.35 if line.get_linestyle() != "None" else 0.0)
    plot_phase(orbit.arc(), "q", "v", ax=portrait)
    portrait.get_legend().remove()
    for line in portrait.lines[len(lines) :]:
        line.set_linewidth(2.4 if line.get_color() in COLOURS else 0.9)
    portrait.set_ylabel("velocity v")
    portrait.set_title("an unstable orbit in the attractor")
    portrait.set_xlabel("position q")

    strobe = figure.add_subplot(grid[:, 2], sharey=portrait)
    for index, mode in enumerate(system.mode_names):
        inside = section.mode == mode
        strobe.plot(*section.x[inside].T, ",", color=COLOURS[index], alpha=0.7, rasterized=True)
    strobe.set_title("once per forcing period")
    strobe.set_xlabel("position q")
    strobe.tick_params(labelleft=False)
    strobe.spines[["top", "right"]].set_visible(False)
    save(figure, folder / "rattler.png")


def graph_picture(system: HybridSystem, folder: Path) -> None:
    figure, axes = plt.subplots(figsize=(5.6, 2.3), layout="constrained")
    plot_graph(system, ax=axes)
    save(figure, folder / "graph.png")


def split_picture(system: HybridSystem, folder: Path) -> None:
    figure, axes = plt.subplots(figsize=(6.4, 4.6), layout="constrained")
    plot_graph(system, ax=axes)
    save(figure, folder / "split_graph.png")


def outputs_picture(system: HybridSystem, folder: Path) -> None:
    """Height, force and energy of the soft contact."""
    axes = plot_arc(simulate(system, (0.2, 0.0), (0.0, 1.0)), ["q", "force", "energy"], figsize=(6.4, 4.2))
    save(axes.figure, folder / "outputs.png")


def contacts_picture(system: HybridSystem, folder: Path) -> None:
    """A block that bounces, slides and sticks, over time."""
    arc = simulate(system, {"x": 0.0, "y": 1.0, "u": 3.0, "v": 0.0}, (0.0, 4.0))
    axes = plot_arc(arc, figsize=(6.4, 5.6))
    save(axes.figure, folder / "contacts_over_time.png")


def diodes_picture(system: HybridSystem, folder: Path) -> None:
    """A boost converter whose current stops in each period."""
    arc = simulate(system, (0.0, 40.0), (0.0, 4 * system.parameters["T"]))
    axes = plot_arc(arc, ["i", "v", "diode.z"], figsize=(6.4, 4.8))
    save(axes.figure, folder / "boost_with_a_diode.png")


def chart_picture(system: HybridSystem, folder: Path) -> None:
    """Sections and exponents over the forcing frequency, with the attractor followed from row to row."""
    with style("chart"):
        swept = chart(
            system,
            {"w": np.linspace(1.3, 1.9, 600)},
            (0.5, 0.0),
            k=2,
            intervals=1000,
            section=200,
            continue_from="w",
            solver=DOP853(rtol=1e-8, atol=1e-10),
        )
        above, below = axes = plot_chart(swept)
        above.set_ylabel("position q, once per period")
        below.set_xlabel("forcing frequency w")
        save(axes.figure, folder / "chart.png")


def branch_picture(folder: Path) -> None:
    """The branch of one impact per period, with its folds and its grazings."""
    branch = continue_orbit(periodic_orbit(models.impact_oscillator(), (0.9, 1.0)), "w", (0.68, 2.0))
    axes = plot_branch(branch, "x", figsize=(6.4, 3.2))
    save(axes.figure, folder / "branch.png")
    save(draw(diagram(models.vibroimpact(), points=201, intervals=400)), folder / "regimes_diagram.png")


def equilibria_picture(folder: Path) -> None:
    """Equilibria of the relief valve, and the cycles that begin at their Hopf point."""
    rest = equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    branch = continue_equilibrium(rest, "q", (0.5, 10.0))
    axes = plot_branch(branch, "y", label="equilibrium", figsize=(6.4, 3.4))
    cycle = switch_branch(branch.of("Hopf")[0])
    cycles = continue_orbit(cycle, "q", (4.0, 10.0), outputs={"top": maximum("y")})
    plot_branch(cycles, "top", label="cycles", ax=axes)
    axes.set_xlabel("inflow q")
    axes.set_ylabel("largest lift")
    save(axes.figure, folder / "equilibria.png")


def diagram_picture(folder: Path) -> None:
    """The branches of the impact oscillator, an isola among them, with what a sweep has reached."""
    oscillator = models.impact_oscillator()
    free = periodic_orbit(oscillator, (0.1, 0.0), parameters={"w": 1.5})
    over, along = {"x": (-2.0, 0.9), "v": (-2.0, 2.0)}, {"w": np.linspace(1.3, 3.1, 37)}
    seen = basin_fractions(oscillator, over, along=along, starts=10, periods=300)
    whole = continue_all(free, "w", (1.3, 3.1), sweep=seen, outputs={"amplitude": amplitude("x")})
    axes = plot_diagram(whole, "amplitude", figsize=(6.4, 3.4))
    axes.set_xlabel("forcing frequency w")
    save(axes.figure, folder / "diagram.png")


def save(figure: Any, path: Path) -> None:
    figure.savefig(path, metadata={"Software": None})
    plt.close(figure)
    quantise(path)
    print(f"{path}: {path.stat().st_size / 1024:.0f} kB")


def quantise(path: Path) -> None:
    """Reduce a picture to 256 colours, which is a third of the size."""
    from PIL import Image

    with Image.open(path) as image:
        small = image.convert("RGB").quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    small.save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        system = model_of(README, "rattler")
        rattler_picture(system, folder)
        graph_picture(system, folder)
        split_picture(model_of(PLAIN, "oscillator"), folder)
        outputs_picture(model_of(OUTPUTS, "ball"), folder)
        contacts_picture(model_of(CONTACTS, "block"), folder)
        diodes_picture(model_of(DIODES, "boost"), folder)
        chart_picture(system, folder)
        branch_picture(folder)
        equilibria_picture(folder)
        diagram_picture(folder)
        print_plots.write(folder, save)


if __name__ == "__main__":
    main()
