"""Exponents and cost of the founding system with each contact law, from simple to detailed."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")

from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import models
from benchmarks.common import file_in, heading, least_time, options, table
from hybrid import Taylor
from hybrid.plot import COLOURS
from lyapunov import ModelComparison, compare_models, lyapunov_spectrum
from models.contact import ContactLaw, hertz_stiffness, matched_laws

PICTURE = "contact_laws.png"
START = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
MASS = 1000 * 100 / 1100
# Impact speed on the orbit at 7.40, m/s.
SPEED = 0.40
OMEGAS = np.round(np.arange(7.0, 8.0001, 0.025), 3)
# Up to here every law has a stable orbit of one period; above are tori, chaos and coexisting attractors.
LAST_PERIODIC = 7.40
SOLVER = Taylor(rtol=1e-9, atol=1e-11)
TOLERANCES = (3e-1, 3e-2, 1e-3, 1e-6)
STYLES = {
    "rigid": {"color": COLOURS[1], "marker": "s"},
    "Kelvin-Voigt": {"color": COLOURS[2], "marker": "^"},
    "Hertz": {"color": COLOURS[0], "marker": "o"},
    "Hunt-Crossley": {"color": COLOURS[0], "marker": "o"},
}
# Differences below this come from the solver's tolerances.
LEAST = 1e-8


def comparison(laws: dict[str, ContactLaw], omegas: np.ndarray, intervals: int) -> ModelComparison:
    """Every law over the frequencies, with the last law as the reference."""
    return compare_models(
        {name: models.vibroimpact(law) for name, law in laws.items()},
        START,
        mode="free",
        reference=list(laws)[-1],
        points=[{"omega": float(omega)} for omega in omegas],
        intervals=intervals,
        transient=400,
        solver=SOLVER,
    )


def microseconds(law: ContactLaw, periods: int = 1000) -> float:
    """Processor time per period at the default frequency with four tangent vectors."""
    system = models.vibroimpact(law)

    def run(count: int) -> Any:
        return lyapunov_spectrum(system, START, mode="free", intervals=count, transient=0, solver=SOLVER)

    run(1)
    return least_time(lambda: run(periods)) / periods * 1e6


def rows(laws: dict[str, ContactLaw], found: ModelComparison) -> list[list[str]]:
    periodic = np.array([point["omega"] <= LAST_PERIODIC for point in found.points])
    return [
        [
            name,
            f"{microseconds(laws[name]):.0f} us",
            f"{found.cost(name):.0f}",
            f"{found.distance(name)[periodic].max():.0e}",
            f"{np.nanmedian(found.distance(name)[~periodic]):.0e}",
            ", ".join(equation(item) for item in laws[name].parameters.items()),
        ]
        for name in laws
    ]


def equation(item: tuple[str, float]) -> str:
    name, value = item
    return f"{name} = {value:.3g}"


def draw(axes: Any, found: ModelComparison, what: str) -> None:
    omegas = [point["omega"] for point in found.points]
    for name in reversed(found.names):
        style = {"label": name, "linewidth": 1.0, "markersize": 3.0, **STYLES[name]}
        if what == "first exponent":
            axes.plot(omegas, [spectrum.exponents[0] for spectrum in found.spectra[name]], **style)
        elif name != found.reference:
            axes.plot(omegas, np.maximum(found.distance(name), LEAST), **style)
    if what == "distance":
        axes.set_yscale("log")
        axes.set_ylim(LEAST, 1)
    axes.set_xlabel(r"frequency $\omega$ (rad/s)")
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)


def picture(path: Path, elastic: ModelComparison, damped: ModelComparison) -> None:
    with plt.rc_context({"font.size": 9, "axes.titlesize": 10, "axes.titlelocation": "left"}):
        figure, grid = plt.subplots(1, 3, figsize=(11.4, 3.5), layout="constrained")
        draw(grid[0], elastic, "first exponent")
        grid[0].axhline(0, color="0.6", linewidth=0.7, zorder=0)
        grid[0].set_title("elastic: the first exponent (1/s)")
        draw(grid[1], elastic, "distance")
        grid[1].set_title("elastic: distance from Hertz (1/s)")
        draw(grid[2], damped, "first exponent")
        grid[2].axhline(0, color="0.6", linewidth=0.7, zorder=0)
        grid[2].set_title("restitution 0.8: the first exponent (1/s)")
        for axes in grid:
            axes.legend(frameon=False, fontsize=8)
        figure.savefig(path, dpi=150, metadata={"Software": None})
        plt.close(figure)


def main() -> None:
    path = file_in(options(__doc__).parse_args().output, PICTURE)
    heading(
        "The founding system with every contact law, omega from 7 to 8 rad/s, four tangent vectors,\n"
        f"rtol = {SOLVER.rtol:.0e}. Distance: largest difference of an exponent from the last law's, in 1/s."
    )
    columns = [
        "law",
        "time per period",
        "steps",
        f"largest distance to {LAST_PERIODIC}",
        "median distance above",
        "parameters",
    ]
    found = {}
    for e in (1.0, 0.8):
        laws = matched_laws(hertz_stiffness(), MASS, SPEED, e)
        found[e] = comparison(laws, OMEGAS, intervals=800)
        print(f"Restitution {e}; {found[e].status}\n")
        table(columns, rows(laws, found[e]))
        periodic = comparison(laws, OMEGAS[OMEGAS <= LAST_PERIODIC], intervals=800)
        for tolerance in TOLERANCES:
            print(
                f"The cheapest within {tolerance:.0e} up to {LAST_PERIODIC}: {periodic.cheapest(tolerance)}"
            )
        print()
    picture(path, found[1.0], found[0.8])
    print(f"Picture: {path}")


if __name__ == "__main__":
    main()
