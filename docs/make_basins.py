"""Make the pictures of basins and of covariant vectors: ``python docs/make_basins.py``, three minutes."""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from make_pictures import STYLE, save

import models
from hybrid import basin_fractions, basins, periodic_orbit, simulate
from hybrid.plot import plot_basins, plot_fractions
from lyapunov import covariant_vectors


def impact_picture(folder: Path) -> None:
    """Basins of the impact oscillator with the saddle on their boundary, and shares over the amplitude."""
    system, parameters = models.impact_oscillator(), {"w": 2.6}
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.6), layout="constrained")
    over = {"x": np.linspace(-4.0, 1.2, 520), "v": np.linspace(-4.0, 4.0, 600)}
    plot_basins(basins(system, over, parameters=parameters), ax=left)
    saddle = periodic_orbit(system, (-1.40, 0.35), periods=2, parameters=parameters)
    left.plot(*saddle.x0, "wX", markeredgecolor="black", markersize=8)
    shares = basin_fractions(
        system,
        {"x": (-4.0, 1.0), "v": (-4.0, 4.0)},
        along={"A": np.linspace(0.5, 6.0, 111)},
        parameters=parameters,
        starts=1000,
    )
    plot_fractions(shares, ax=right)
    save(figure, folder / "basins_impact.png")


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
        founding_picture(folder)
        angles_picture(folder)


if __name__ == "__main__":
    main()
