"""The paper's three regimes on one diagram: the orbit of one impact, its bifurcations, runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid import Branch, continue_orbit, periodic_orbit, simulate
from hybrid.plot import COLOURS, plot_branch
from hybrid.system.graph import HybridSystem
from lyapunov.chart import chart
from lyapunov.plot import style
from lyapunov.study.paper import PAPER

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SPAN = (6.5, 8.5)
# Where the orbit of one impact is stable, and how long a run takes to settle there.
STABLE, PERIODS = 7.40, 600
START = (0.0, 0.02, 0.0, 0.0)


@attrs.frozen(eq=False)
class Diagram:
    """The branch of the orbit with one impact per period, and a chart of runs over the same frequencies."""

    branch: Branch
    chart: xarray.Dataset


def diagram(
    system: HybridSystem, *, points: int = 101, intervals: int = 200, progress: bool = False
) -> Diagram:
    """The branch from 6.5 to 8.5 rad/s, and runs at so many frequencies over so many periods."""
    period = 2 * np.pi / STABLE
    settled = simulate(system, START, (0.0, PERIODS * period), mode="free", parameters={"omega": STABLE})
    orbit = periodic_orbit(system, settled.x[-1], mode=str(settled.mode[-1]), parameters={"omega": STABLE})
    runs = chart(
        system,
        {"omega": np.linspace(*SPAN, points)},
        START,
        mode="free",
        intervals=intervals,
        transient=intervals,
        section=60,
        progress=progress,
    )
    return Diagram(continue_orbit(orbit, "omega", SPAN), runs)


def diagram_text(found: Diagram) -> str:
    """The bifurcations of the branch, and where the frequencies of the paper lie."""
    lines = [f"The orbit of one impact per period, omega from {SPAN[0]} to {SPAN[1]}:"]
    lines += [f"  {each}" for each in found.branch.bifurcations]
    values = [each.value for each in found.branch.bifurcations]
    for omega in PAPER:
        i = int(np.argmin(np.abs(found.branch.parameter - omega)))
        passed = sum(value < omega for value in values)
        state = "stable" if found.branch.stable[i] else "unstable"
        lines.append(f"  omega = {omega:.2f}: after {passed} of {len(values)}, the orbit is {state}")
    return "\n".join(lines)


def draw(found: Diagram) -> Figure:
    """Over the frequency: section and branch, moduli of multipliers, exponent, impacts per period."""
    import matplotlib.pyplot as plt

    figure, rows = plt.subplots(4, 1, figsize=(7.2, 8.4), sharex=True, layout="constrained")
    plot_branch(found.branch, "x1", over=found.chart, ax=rows[0]).set_xlabel("")
    omega = found.branch.parameter
    for moduli in np.abs(found.branch.multipliers).T:
        rows[1].plot(omega, moduli, color=COLOURS[0], lw=1.2)
    rows[1].axhline(1.0, color="0.4", lw=0.8)
    rows[1].set_ylabel("moduli of the\nmultipliers")
    _dots(rows[2], found.chart.omega, found.chart.exponents[:, 0])
    rows[2].axhline(0.0, color="0.4", lw=0.8)
    rows[2].set_ylabel("largest exponent, 1/s")
    # Each impact begins and ends a contact.
    _dots(rows[3], found.chart.omega, found.chart.jumps_per_interval / 2)
    rows[3].set_ylabel("impacts per period")
    rows[3].set_xlabel("$\\omega$, rad/s")
    for row in rows:
        for value in [each.value for each in found.branch.bifurcations]:
            row.axvline(value, color=COLOURS[1], lw=0.8, ls=":")
        for regime in PAPER:
            row.axvline(regime, color="0.7", lw=0.6)
    return figure


def write_diagram(folder: Path, found: Diagram) -> Path:
    """Write the diagram as ``diagram.png``."""
    import matplotlib.pyplot as plt

    path = folder / "diagram.png"
    with style("chart"):
        figure = draw(found)
        figure.savefig(path)
    plt.close(figure)
    return path


def _dots(ax: Any, x: Any, y: Any) -> None:
    ax.plot(np.asarray(x), np.asarray(y), ".", ms=3, color=COLOURS[0])
