"""Make the pictures of basins and of covariant vectors: ``python docs/make_basins.py``, four minutes."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from make_pictures import STYLE, save
from matplotlib.legend import Legend

import models
from hybrid import HybridSystem, Mode, basin_fractions, basins, edge_state, simulate
from hybrid.measures import mean
from hybrid.plot import plot_basins, plot_fractions
from lyapunov import covariant_vectors


def impact_picture(folder: Path) -> None:
    """Basins of the impact oscillator with the saddle on their boundary, and shares over the amplitude."""
    system, parameters = models.impact_oscillator(), {"w": 2.6}
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained")
    over = {"x": np.linspace(-4.0, 1.2, 520), "v": np.linspace(-4.0, 4.0, 600)}
    plot_basins(basins(system, over, parameters=parameters), ax=left)
    saddle = edge_state(system, (0.0, 0.0), (-1.6, -0.4), parameters=parameters).orbit
    left.plot(*saddle.arc()(saddle.period / 2), "wX", markeredgecolor="black", markersize=8)
    shares = basin_fractions(
        system,
        {"x": (-4.0, 1.0), "v": (-4.0, 4.0)},
        along={"A": np.linspace(0.5, 6.0, 111)},
        parameters=parameters,
        starts=1000,
    )
    plot_fractions(shares, ax=right)
    save(figure, folder / "basins_impact.png")


def edge_picture(folder: Path) -> None:
    """The way from two starts of the impact oscillator to the saddle between their basins."""
    system, parameters = models.impact_oscillator(), {"w": 2.6}
    over = {"x": np.linspace(-2.0, 1.1, 310), "v": np.linspace(-2.0, 2.0, 320)}
    ax = plot_basins(basins(system, over, parameters=parameters), figsize=(6.4, 4.6))
    starts = (0.5, -1.2), (0.95, -1.0)
    edge = edge_state(system, *starts, parameters=parameters)
    ax.plot(*np.transpose(starts), "w--", linewidth=1.0, label="between the starts")
    x, v = edge.points.T
    ax.plot(x, v, "wo", markersize=4, markeredgecolor="black", label="the edge trajectory")
    saddle = np.array([edge.x, edge.orbit.arc()(edge.orbit.period / 2)])
    ax.plot(*saddle.T, "wX", markersize=9, markeredgecolor="black", label="the saddle")
    lines = [each for each in ax.lines if not str(each.get_label()).startswith("_")]
    told = [str(each.get_label()) for each in lines]
    ax.add_artist(Legend(ax, lines, told, loc="lower left", fontsize=8, facecolor="0.7"))
    save(ax.figure, folder / "edge_state.png")


def features_picture(folder: Path) -> None:
    """Basins of a pendulum under a constant torque, by the mean speed."""
    pendulum = HybridSystem(
        state=("angle", "speed"),
        parameters={"torque": 0.5, "c": 0.2},
        modes=[Mode("swing", lambda t, x, p: (x.speed, p.torque - p.c * x.speed - np.sin(x.angle)))],
    )
    over = {"angle": np.linspace(-6.0, 6.0, 150), "speed": np.linspace(-4.0, 6.0, 120)}
    asked = {"mean speed": mean("speed")}
    found = basins(pendulum, over, features=asked, periods=100, interval=1.0, recurrences=20)
    save(plot_basins(found, figsize=(6.4, 4.6)).figure, folder / "features_pendulum.png")


def founding_picture(folder: Path) -> None:
    """The torus of the founding system at 7.46 and the orbit of 396 periods, with their basins."""
    over = {"x1": 0.0, "x2": np.linspace(0.0, 0.16, 64), "v1": 0.0, "v2": np.linspace(-1.2, 1.2, 64)}
    found = basins(models.vibroimpact(), over, parameters={"omega": 7.46})
    ax = plot_basins(found, figsize=(6.4, 4.6))
    save(ax.figure, folder / "basins_founding.png")


def angles_picture(folder: Path) -> None:
    """Angles between stable and unstable directions of the impact oscillator, beside impact speeds."""
    system, parameters = models.impact_oscillator(), {"w": 2.8, "d": 0.0}
    found = covariant_vectors(system, (-0.5, 0.0), parameters=parameters, intervals=3000)
    angles, speeds = np.degrees(found.angles), np.full(len(found), np.nan)
    for i, (x, t) in enumerate(zip(found.x, found.t, strict=True)):
        impacts = simulate(system, x, (t, t + found.interval), parameters=parameters).jumps
        if len(impacts):
            speeds[i] = min(impact.x_minus[1] for impact in impacts)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    left.loglog(speeds, angles, ".", markersize=2, rasterized=True)
    left.set_xlabel("speed of the slowest impact in the next period")
    left.set_ylabel("angle (degrees)")
    dots = right.scatter(*found.x.T, c=np.log10(angles), s=2, cmap="viridis", rasterized=True)
    figure.colorbar(dots, ax=right, label="log10 of the angle in degrees")
    right.set_xlabel("x")
    right.set_ylabel("v")
    save(figure, folder / "covariant_angles.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the pictures")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        impact_picture(folder)
        edge_picture(folder)
        features_picture(folder)
        founding_picture(folder)
        angles_picture(folder)


if __name__ == "__main__":
    main()
