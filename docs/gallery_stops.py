"""Gallery pictures of models of impacts and stops; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

import models
from hybrid import (
    DOP853,
    continue_equilibrium,
    continue_orbit,
    equilibrium,
    periodic_orbit,
    simulate,
    stroboscopic_section,
)
from hybrid.measures import amplitude
from hybrid.plot import COLOURS, plot_branch

COARSE = DOP853(rtol=1e-7, atol=1e-9)
DOTS = {"marker": ".", "markersize": 1.5, "mew": 0, "linestyle": "None", "color": COLOURS[0]}


def bouncing_table(ax: Axes) -> None:
    system = models.bouncing_table()
    period, g, w = system.forcing_period(), 9.81, 36.0
    accelerations = np.linspace(1.06, 1.76, 240)
    # Start on the orbit with one bounce per period; the ball lands when the table reaches ``phase``.
    phase = np.arccos(np.pi / (3 * accelerations[0]))
    V, left, A = np.pi * g / w, phase / w, accelerations[0] * g / w**2
    x, mode = np.array([A * np.sin(phase) + V * left - g * left**2 / 2, g * left - V - A * w]), "flight"
    for acceleration in accelerations:
        parameters = {"A": acceleration * g / w**2}
        for periods in (60, 60):  # the first run is a transient
            end = periods * period
            arc = simulate(
                system,
                x,
                (0.0, end),
                mode=mode,
                parameters=parameters,
                samples=[end],
                keep_jumps=True,
                solver=COARSE,
            )
            x, mode = arc.x[-1], str(arc.mode[-1])
        speeds = -arc.jumps.x_minus[:, 1]
        ax.plot(np.full(len(speeds), acceleration), speeds, **DOTS)
    ax.set_xlabel("acceleration of the table $A w^2 / g$")
    ax.set_ylabel("impact speed (m/s)")


def relief_valve(ax: Axes) -> None:
    system = models.relief_valve()
    branch = continue_equilibrium(equilibrium(system, (2.5, 0.0, 12.5)), "q", (0.5, 10.0))
    for stable, style in ((True, "-"), (False, "--")):
        ax.plot(
            branch.parameter, np.where(branch.stable == stable, branch["y"], np.nan), style, color=COLOURS[1]
        )
    [hopf] = branch.of("Hopf")
    ax.plot(hopf.value, hopf.equilibrium["y"], "o", color=COLOURS[1])
    for q in np.linspace(0.5, 10.0, 200):
        arc = simulate(
            system, (2.5, 0.3, 12.5), (0.0, 200.0), mode="open", parameters={"q": q}, solver=COARSE
        )
        late = arc(np.linspace(150.0, 200.0, 5001), "y")
        tops = late[1:-1][(late[1:-1] > late[:-2]) & (late[1:-1] >= late[2:])]
        ax.plot(np.full(len(tops), q), tops, **DOTS)
    ax.set_xlabel("inflow $q$")
    ax.set_ylabel("lift $y$ at its maxima")


def impact_pair(ax: Axes) -> None:
    system = models.impact_pair()
    parameters = {"d": 1.0}
    end = 5000 * system.forcing_period()
    arc = simulate(
        system, (0.1, 1.0), (0.0, end), parameters=parameters, samples=[end], keep_jumps=True, solver=COARSE
    )
    right = arc.jumps.x_minus[:, 1] > 0
    ax.plot(arc.jumps.t[right] / (2 * np.pi) % 1, arc.jumps.x_minus[right, 1], **DOTS)
    ax.set_xlabel("phase of the impact on the right wall")
    ax.set_ylabel("relative velocity $v$")


def bilinear_oscillator(ax: Axes) -> None:
    system = models.bilinear_oscillator()
    x, mode = (0.1, 0.0), "stiff"
    for w in np.linspace(2.2, 5.2, 240):
        section = stroboscopic_section(
            system, x, mode=mode, parameters={"w": w, "k2": 50.0}, transient=60, periods=50, solver=COARSE
        )
        x, mode = section.x[-1], str(section.mode[-1])
        ax.plot(np.full(len(section), w), section.x[:, 0], **DOTS)
    ax.set_xlabel("forcing frequency $w$")
    ax.set_ylabel("$x$ once per period")


def stop_oscillator(ax: Axes) -> None:
    system = models.stop_oscillator()
    frequencies = np.linspace(0.7, 3.0, 80)
    for colour, F0 in zip(COLOURS, (0.0, 2.0), strict=False):
        for order, line in ((1, "-"), (-1, ":")):
            x, mode, amplitudes = (0.1, 0.0), "free", []
            for w in frequencies[::order]:
                parameters = {"w": w, "F0": F0}
                end = 30 * system.forcing_period(parameters)
                last = np.linspace(29 / 30 * end, end, 100)
                arc = simulate(
                    system, x, (0.0, end), mode=mode, parameters=parameters, samples=last, solver=COARSE
                )
                x, mode = arc.x[-1], str(arc.mode[-1])
                amplitudes.append(np.abs(arc.x[:, 0]).max())
            label = f"$F_0 = {F0:g}$" if order == 1 else None
            ax.plot(frequencies[::order], amplitudes, line, color=colour, label=label)
    ax.set_xlabel("forcing frequency $w$, up (solid) and down (dotted)")
    ax.set_ylabel("amplitude")
    ax.legend(frameon=False)


def gear_pair(ax: Axes) -> None:
    system = models.gear_pair()
    orbit = periodic_orbit(system, (1.1, 0.0), parameters={"w": 1.4})
    branch = continue_orbit(orbit, "w", (0.5, 1.4), outputs={"amplitude": amplitude("x")})
    frequencies = np.linspace(0.5, 1.4, 46)
    for order, marker, label in ((1, "^", "up"), (-1, "v", "down")):
        x, mode, found = (1.1, 0.0), "drive", []
        for w in frequencies[::order]:
            period = system.forcing_period({"w": w})
            settled = simulate(
                system, x, (0.0, 100 * period), mode=mode, parameters={"w": w}, samples=[100 * period]
            )
            x, mode = settled.x[-1], str(settled.mode[-1])
            found.append(amplitude("x")(simulate(system, x, (0.0, period), mode=mode, parameters={"w": w})))
        ax.plot(frequencies[::order], found, marker, color="0.55", markersize=3.5, label=label)
    plot_branch(branch, "amplitude", ax=ax)
    ax.get_legend().remove()
    ax.legend(frameon=False, fontsize=7)
    ax.set_xlabel("mesh frequency $w$")
    ax.set_ylabel("amplitude of $x$")


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "bouncing_table",
        "A ball on a vibrating table: impact speeds over the acceleration, from one bounce per period "
        "through period doublings to chaos.",
        bouncing_table,
        "bouncing table, vibrating table",
    ),
    (
        "impact_pair",
        "A mass rattling in a shaken box: phase and velocity of its chaotic impacts on the right wall.",
        impact_pair,
        "impact pair, impact damper",
    ),
    (
        "bilinear_oscillator",
        "Bilinear oscillator with stiffnesses 1 and 50: subharmonic orbits and chaos between them.",
        bilinear_oscillator,
        "bilinear oscillator, breathing crack",
    ),
    (
        "stop_oscillator",
        "Response of the oscillator between stops, with and without preload: the resonance bends and jumps.",
        stop_oscillator,
        "elastic stop, preload",
    ),
    (
        "gear_pair",
        "Resonance of gears with backlash: orbits, and runs up and down in the frequency.",
        gear_pair,
        "gear, gears, backlash, rattle",
    ),
    (
        "relief_valve",
        "Lift of a relief valve over the inflow: the equilibrium, stable to the Hopf point, and the tops of "
        "simulated motions, which flutter and hit the seat.",
        relief_valve,
        "relief valve, valve",
    ),
]
