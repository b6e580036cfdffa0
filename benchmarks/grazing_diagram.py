"""The impact oscillator through a grazing: its section and largest exponent, compared with closed forms.

``python -m benchmarks.grazing_diagram`` makes ``docs/grazing_diagram.png`` and prints the errors.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

import models
from benchmarks.common import file_in, heading, options, table
from hybrid import DOP853, simulate, stroboscopic_section
from hybrid.plot import COLOURS
from lyapunov import lyapunov_spectrum, two_orbit_exponents
from models.one_impact import one_impact_orbits

PICTURE = "grazing_diagram.png"
# Overdamped: without impacts small displacements decay like exp(-0.1 t) and exp(-t).
PARAMETERS = {"k": 0.1, "c": 1.1, "w": 1.0, "d": 1.0, "r": 0.8}
SLOW, PERIOD = -0.1, 2 * math.pi
# The amplitude at which the orbit without impacts touches the stop.
GRAZING = PARAMETERS["d"] * math.hypot(PARAMETERS["k"] - PARAMETERS["w"] ** 2, PARAMETERS["c"])
SYSTEM = models.impact_oscillator()
START = (0.0, 0.0)


class Point(NamedTuple):
    """One amplitude: points of the attractor, its largest exponent, and the exact value."""

    beyond: float
    # Displacements once per period, and speeds before the impacts.
    strobe: np.ndarray
    speeds: np.ndarray
    # Whether each of these impacts grazed within the tolerances.
    grazed: np.ndarray
    exponent: float
    error: float
    # Closed form for at most one impact every n periods, else an estimate from two orbits; the other is nan.
    exact: float
    two_orbits: float
    # Whether the status of the spectrum counts grazed jumps.
    warned: bool


def parameters(beyond: float) -> dict[str, float]:
    """Parameters at the amplitude ``(1 + beyond)`` times that of the grazing."""
    return {**PARAMETERS, "A": (1 + beyond) * GRAZING}


def exact_exponent(beyond: float, impacts: np.ndarray) -> float:
    """Largest exponent of the orbit with these impact times, or nan if it has no stable closed form."""
    if beyond < 0:
        return SLOW
    flights = np.diff(impacts) / PERIOD
    n = round(flights.mean())
    if np.abs(flights - n).max() > 1e-3:
        return math.nan
    largest = [max(abs(orbit.multipliers)) for orbit in one_impact_orbits(**parameters(beyond), n=n)]
    return next((math.log(value) / (n * PERIOD) for value in largest if value < 1), math.nan)


def point(beyond: float, transient: int = 20_000, intervals: int = 1000, shown: int = 150) -> Point:
    run: dict[str, Any] = {"parameters": parameters(beyond)}
    # The transient is run without tangent vectors.
    settled = stroboscopic_section(SYSTEM, START, periods=shown, transient=transient, **run)
    x0 = settled.x[-1]
    jumps = simulate(
        SYSTEM, x0, (0.0, shown * PERIOD), samples=[shown * PERIOD], keep_jumps=True, **run
    ).jumps
    spectrum = lyapunov_spectrum(SYSTEM, x0, k=1, intervals=intervals, transient=50, **run)
    exact, pair = exact_exponent(beyond, jumps.t), math.nan
    if math.isnan(exact):
        # The separation must be far below the depth of the impacts, where the map has a square root.
        run |= {"solver": DOP853(rtol=1e-12, atol=1e-14), "separation": 1e-11}
        pair = two_orbit_exponents(SYSTEM, x0, intervals=intervals, transient=50, **run).renormalised_exponent
    return Point(
        beyond,
        settled.x[:, 0],
        jumps.x_minus[:, 1],
        jumps.kind == "grazing",
        float(spectrum.exponents[0]),
        float(spectrum.standard_error[0]),
        exact,
        pair,
        "grazed" in spectrum.status.message,
    )


def draw_exponents(axes: Any, points: list[Point], x: np.ndarray) -> None:
    measured = np.array([p.exponent for p in points])
    exact, pair = np.array([p.exact for p in points]), np.array([p.two_orbits for p in points])
    closed = np.isfinite(exact)
    axes.axhline(0, color="0.6", linewidth=0.7)
    axes.plot(
        x[closed],
        measured[closed],
        ".",
        color=COLOURS[0],
        markersize=3.5,
        label="no impacts, or one every $n$ periods",
    )
    axes.plot(x[~closed], measured[~closed], ".", color=COLOURS[1], markersize=3.5, label="other orbits")
    axes.plot(x, exact, "o", color="0.3", markersize=5.5, markerfacecolor="none", markeredgewidth=0.5,
              label="closed form")  # fmt: skip
    axes.plot(x, pair, "+", color="0.3", markersize=5.5, markeredgewidth=0.5, label="two orbits")
    warned = np.array([p.warned for p in points])
    axes.plot(x[warned], measured[warned], "s", color=COLOURS[3], markersize=8, markerfacecolor="none",
              label="status counts grazed jumps")  # fmt: skip
    axes.set_ylim(-0.115, 0.065)


def picture(path: Path, sweep: list[Point], before: list[Point], after: list[Point]) -> None:
    figure, grid = plt.subplots(
        2, 3, figsize=(11.4, 5.8), layout="constrained", sharex="col", width_ratios=(1.1, 0.45, 1.25)
    )
    (strobe, key, speeds), (whole, left, right) = grid
    for p in sweep:
        strobe.plot(np.full(len(p.strobe), p.beyond), p.strobe, ".", color=COLOURS[0], markersize=1.2)
    strobe.axvline(0, color="0.6", linewidth=0.7)
    strobe.set_ylabel("$x$ once per period")
    strobe.set_title("a  Through the grazing", loc="left", fontsize=9.5, fontweight="bold")
    draw_exponents(whole, sweep, np.array([p.beyond for p in sweep]))
    whole.set(ylabel="largest exponent", xlabel="$A / A_g - 1$")

    draw_exponents(left, before, np.array([-p.beyond for p in before]))
    left.set(xscale="log", xlabel="$1 - A / A_g$")
    left.invert_xaxis()
    left.set_title("b  Before the grazing", loc="left", fontsize=9.5, fontweight="bold")

    for p in after:
        scaled = p.speeds / math.sqrt(p.beyond)
        x = np.full(len(scaled), p.beyond)
        speeds.plot(x[~p.grazed], scaled[~p.grazed], ".", color=COLOURS[0], markersize=1.2)
        speeds.plot(
            x[p.grazed], scaled[p.grazed], "s", color=COLOURS[3], markersize=5, markerfacecolor="none"
        )
    speeds.set(ylabel=r"speed of impacts $/\,\sqrt{A / A_g - 1}$", ylim=(0, None))
    speeds.set_title("c  After the grazing", loc="left", fontsize=9.5, fontweight="bold")
    draw_exponents(right, after, np.array([p.beyond for p in after]))
    right.set(xscale="log", xlabel="$A / A_g - 1$")

    key.axis("off")
    key.legend(*right.get_legend_handles_labels(), loc="center", frameon=False, fontsize=8.5)
    for axes in (strobe, speeds, whole, left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(which="minor", length=0)
    figure.savefig(path, dpi=150, metadata={"Software": None})


def summary(name: str, points: list[Point]) -> list[str]:
    off = np.array([abs(p.exponent - p.exact) for p in points])
    apart = np.array([abs(p.exponent - p.two_orbits) / p.error for p in points])
    closed, other = off[np.isfinite(off)], apart[np.isfinite(apart)]
    return [
        name,
        f"{max(p.exponent for p in points):+.4f}",
        f"{len(closed)}",
        f"{np.median(closed):.0e}, {closed.max():.0e}",
        f"{len(other)}",
        f"{np.median(other):.1f}, {other.max():.1f}" if len(other) else "-",
        f"{sum(p.warned for p in points)}",
    ]


def main() -> None:
    path = file_in(options(__doc__).parse_args().output, PICTURE)
    heading("The largest exponent near a grazing.")
    begin = time.process_time()
    sweep = [point(beyond) for beyond in np.linspace(-0.05, 0.25, 120)]
    before = [point(-beyond) for beyond in 10.0 ** np.arange(-9, -0.9, 0.5)]
    after = [point(beyond) for beyond in 10.0 ** np.arange(-9, -0.95, 1 / 16)]
    parts = {"-0.05 to 0.25": sweep, "-0.1 to -1e-9": before, "1e-9 to 0.1": after}
    table(
        ["A / A_g - 1", "largest", "closed form", "error: median, largest",
         "other orbits", "standard errors from two orbits: median, largest", "with a warning"],
        [summary(name, points) for name, points in parts.items()],
    )  # fmt: skip
    with plt.rc_context({"font.size": 9, "axes.linewidth": 0.7}):
        picture(path, sweep, before, after)
    print(f"Picture: {path}; {time.process_time() - begin:.0f} s")


if __name__ == "__main__":
    main()
