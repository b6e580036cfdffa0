"""Every public plot as it is printed: the results, the calls and the pictures of the page ``plots.md``."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import hybrid
import hybrid.plot
import lyapunov
import lyapunov.plot
import models
from hybrid import DOP853, basin_fractions, basins, continue_all, continue_orbit, periodic_orbit, simulate
from hybrid.measures import maximum
from models.contact import Hertz, Rigid, hertz_stiffness

HERE = Path(__file__).parent
PAGE, FOLDER = HERE / "plots.md", "plots"
# The impact oscillator with a stop in the middle, where its motion is chaotic.
CHAOS = {"d": 0.0, "c": 0.05, "w": 2.8}
START = (-0.5, 0.0)
FAST = DOP853(rtol=1e-7, atol=1e-9)
# The text before the pictures is written by hand and ends with this line.
BEGIN = "## Each plot as it is printed"


def impacts() -> Any:
    return simulate(models.vibroimpact(), (0.0, 0.02, 0.0, 0.0), (0.0, 6.0))


def bounces() -> Any:
    floor = hybrid.Contact("floor", gap=lambda t, x, p: x.y, restitution=0.5)
    ball = hybrid.mechanics(
        coordinates=("y",),
        velocities=("v",),
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-9.81,),
        contacts=[floor],
        units={"y": "m", "v": "m/s", "t": "s"},
    )
    return simulate(ball, (1.0, 0.0), (0.0, 2.0))


def orbit() -> Any:
    return periodic_orbit(models.impact_oscillator(), (0.9, 1.0))


def branch() -> Any:
    return continue_orbit(result("orbit"), "w", (0.68, 2.0))


def branches() -> Any:
    harder = periodic_orbit(models.impact_oscillator(), (0.9, 1.0), parameters={"r": 0.6})
    return [result("branch"), continue_orbit(harder, "w", (0.68, 2.0))]


def diagram() -> Any:
    rest = hybrid.equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    return continue_all(rest, "q", (5.0, 10.0), outputs={"top": maximum("y")})


def fold() -> Any:
    last = [each for each in result("branch").bifurcations if each.kind == "fold"][-1]
    return hybrid.continue_bifurcation(last, {"w": (1.5, 1.8), "r": (0.65, 0.85)})


def section() -> Any:
    return hybrid.stroboscopic_section(
        models.impact_oscillator(), START, periods=2000, transient=100, parameters=CHAOS, solver=FAST
    )


def ends() -> Any:
    starts = np.column_stack([np.linspace(-1.0, 0.9, 60), np.zeros(60)])
    return hybrid.simulate_many(models.impact_oscillator(), starts, (0.0, 10.0))


def swept() -> Any:
    ball = models.bouncing_ball()

    def task(point: dict[str, float]) -> dict[str, float]:
        arc = simulate(ball, (1.0, 0.0), (0.0, 2.0), parameters=point)
        return {"jumps": len(arc.jumps), "height": float(arc["q"][-1])}

    return hybrid.sweep(task, {"e": np.linspace(0.3, 0.8, 11)})


def found() -> Any:
    over = {"x": np.linspace(-1.0, 0.9, 60), "v": np.linspace(-2.0, 2.0, 60)}
    return basins(models.impact_oscillator(), over, parameters={"w": 1.5})


def shares() -> Any:
    ranges = {"x": (-1.0, 0.9), "v": (-2.0, 2.0)}
    along = {"w": np.linspace(1.3, 1.8, 11)}
    return basin_fractions(models.impact_oscillator(), ranges, along=along, starts=50)


def errors() -> Any:
    return hybrid.global_error(models.impact_oscillator(), (0.0, 0.0), (0.0, 40.0))


def work() -> Any:
    given = {"tolerances": [1e-4, 1e-6, 1e-8, 1e-10], "repeats": 1, "longest": 0.2}
    return hybrid.work_precision(models.impact_oscillator(), (0.0, 0.0), (0.0, 20.0), **given)


def spectrum() -> Any:
    return lyapunov.lyapunov_spectrum(
        models.impact_oscillator(), START, k=2, intervals=500, parameters=CHAOS, solver=FAST
    )


def two() -> Any:
    return lyapunov.two_orbit_exponents(models.impact_oscillator(), START, intervals=300, parameters=CHAOS)


def line() -> Any:
    return lyapunov.chart(
        models.impact_oscillator(),
        {"w": np.linspace(2.6, 2.85, 101)},
        START,
        k=2,
        intervals=200,
        section=60,
        solver=FAST,
        parameters={"d": 0.0, "c": 0.05},
    )


def plane() -> Any:
    return lyapunov.chart(
        models.impact_oscillator(),
        {"w": np.linspace(2.6, 2.85, 24), "c": np.linspace(0.05, 0.2, 24)},
        START,
        k=2,
        intervals=150,
        solver=FAST,
        parameters={"d": 0.0},
    )


def compared() -> Any:
    laws = {"rigid": Rigid(e=1.0), "Hertz": Hertz(hertz_stiffness())}
    systems = {name: models.vibroimpact(law) for name, law in laws.items()}
    start = (-0.00765806, -0.00411675, 0.05565196, -0.35621583)
    return lyapunov.compare_models(systems, start, reference="Hertz", intervals=50)


def chaos() -> Any:
    return simulate(models.impact_oscillator(), START, (0.0, 60.0), parameters=CHAOS)


MAKE: dict[str, Callable[[], Any]] = {
    each.__name__: each
    for each in (
        *(impacts, bounces, orbit, branch, branches, diagram, fold, section, ends, swept, found, shares),
        *(errors, work, spectrum, two, line, plane, compared, chaos),
    )
}
# Every plot: what is drawn, the call, and what the picture shows. A call is run as it is written.
PLOTS = {
    "plot_arc": 'plot_arc(impacts, ["x1", "v1"], labels={"x1": "$x_1$", "v1": r"$\\dot x_1$", "t": "$t$"})',
    "plot_phase": 'plot_phase(impacts, "x1", "v1", labels={"x1": "$x_1$", "v1": r"$\\dot x_1$"})',
    "plot_contacts": "plot_contacts(bounces)",
    "plot_jumps": "plot_jumps(impacts.jumps)",
    "plot_section": 'plot_section(section, labels={"x": "$x$", "v": r"$\\dot x$"})',
    "plot_orbit": 'plot_orbit(orbit, "x", "v")',
    "plot_branch": 'plot_branch(branches, "x", label=["r = 0.8", "r = 0.6"], labels={"w": r"$\\omega$"})',
    "plot_diagram": 'plot_diagram(diagram, "top", labels={"top": "largest lift"})',
    "plot_curve": 'plot_curve(fold, labels={"w": r"$\\omega$"})',
    "plot_graph": "plot_graph(models.stick_slip())",
    "plot_ends": "plot_ends(ends)",
    "plot_sweep": 'plot_sweep(swept, labels={"height": "last height"})',
    "plot_basins": "plot_basins(found)",
    "plot_fractions": 'plot_fractions(shares, labels={"w": r"$\\omega$"})',
    "plot_global_error": "plot_global_error(errors)",
    "plot_work_precision": "plot_work_precision(work)",
    "plot_spectrum": "plot_spectrum(spectrum)",
    "plot_two_orbits": "plot_two_orbits(two)",
    "plot_convergence": 'plot_convergence({"estimate": spectrum.history[:, 0]}, truth=0.0)',
    "plot_exponents": "plot_exponents(line)",
    "plot_bifurcation": "plot_bifurcation(line)",
    "plot_chart": 'plot_chart(line, labels={"w": r"$\\omega$"})',
    "plot_map": "plot_map(plane)",
    "plot_kinds": "plot_kinds(plane)",
    "plot_comparison": "plot_comparison(compared)",
    "plot_phase_portrait": 'plot_phase_portrait(chaos, "x", "v", section=section)',
}


@cache
def result(name: str) -> Any:
    """What is drawn under a name, computed once."""
    return MAKE[name]()


class Results(dict[str, Any]):
    """The names of a call: plots, models, and results that are computed when they are first asked for."""

    def __missing__(self, name: str) -> Any:
        if name not in MAKE:
            raise KeyError(name)
        return result(name)


def draw(name: str) -> Any:
    """Run the call of a plot, and return its figure."""
    plots = {each: getattr(hybrid.plot, each) for each in hybrid.plot.__all__}
    plots |= {each: getattr(lyapunov.plot, each) for each in lyapunov.plot.__all__}
    axes = eval(PLOTS[name], {}, Results(plots, models=models))
    return np.atleast_1d(np.asarray(axes, dtype=object)).ravel()[0].get_figure(root=True)


def page() -> str:
    """The page: what is written by hand, and then each call with its picture."""
    head = PAGE.read_text(encoding="utf-8").partition(BEGIN)[0]
    parts = [
        f"### {name}\n\n`{call}`\n\n![The picture of {name} at the width of a column]({FOLDER}/{name}.png)\n"
        for name, call in PLOTS.items()
    ]
    return head + BEGIN + "\n\n" + "\n".join(parts)


def write(folder: Path, save: Callable[[Any, Path], None]) -> None:
    """Draw all pictures in the style for print."""
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    for name in PLOTS:
        with hybrid.plot.style("paper"):
            save(draw(name), folder / FOLDER / f"{name}.png")
    (folder / PAGE.name).write_text(page(), encoding="utf-8")
