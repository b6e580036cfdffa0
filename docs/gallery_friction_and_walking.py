"""Gallery pictures of models of friction and walking; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.axes import Axes

import models
from hybrid import DOP853, HybridArc, HybridSystem, periodic_orbit, simulate
from hybrid.plot import COLOURS, plot_phase
from models.dry_friction_oscillator import den_hartog_amplitude

LOOSE = DOP853(rtol=1e-8, atol=1e-10)


def stick_slip(ax: Axes) -> None:
    system = models.stick_slip()
    for start in ((1.0, -1.0), (-0.8, 0.9), (0.35, -0.05)):
        plot_phase(simulate(system, start, (0.0, 15.0)), "x", "v", ax=ax)
    fade(ax)
    plot_phase(periodic_orbit(system, (0.5, 0.2), period=12.0).arc(), "x", "v", ax=ax)
    ax.get_legend().remove()
    ax.text(-0.25, 0.27, "sticks", color=COLOURS[2])
    ax.text(0.0, -0.7, "slips", color=COLOURS[0])
    ax.set(xlabel="displacement x", ylabel="velocity v")


def coulomb_stick_slip(ax: Axes) -> None:
    system = models.coulomb_stick_slip()
    for belt, colour in zip((0.1, 0.2, 0.5), COLOURS, strict=False):
        arc = simulate(system, (0.5, belt), (0.0, 40.0), mode="stick", parameters={"belt": belt})
        t = np.linspace(0.0, 40.0, 2000)
        ax.plot(t, arc(t)[:, 0], color=colour, label=f"{belt:g}")
    ax.axhline(1.0, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
    ax.set(xlabel="time t", ylabel="displacement x", xlim=(0.0, 40.0), ylim=(-0.45, 1.65))
    ax.legend(title="speed of the belt", ncols=3, loc="upper center", frameon=False)
    plain(ax)


def dry_friction_oscillator(ax: Axes) -> None:
    system = models.dry_friction_oscillator()
    exact = np.concatenate([np.linspace(0.35, 0.99, 300), np.linspace(1.01, 2.0, 300)])
    simulated = np.concatenate([np.arange(0.42, 0.97, 0.06), np.arange(1.05, 2.0, 0.1)])
    for f, colour in zip((0.2, 0.5, 0.75), COLOURS, strict=False):
        ax.plot(exact, [den_hartog_amplitude(f, 1.0, w) for w in exact], color=colour, label=f"f = {f:g} A")
        amplitudes = [largest_displacement(system, {"f": f, "w": float(w)}) for w in simulated]
        ax.plot(simulated, amplitudes, "o", color=colour, markersize=2.5, markerfacecolor="white")
    ax.set(xlabel="forcing frequency w", ylabel="amplitude", xlim=(0.35, 2.0), ylim=(0.0, 5.0))
    ax.legend(frameon=False)
    plain(ax)


def largest_displacement(system: HybridSystem, parameters: Mapping[str, float]) -> float:
    """Largest displacement of the settled motion, at which the mass turns or stops."""
    period = system.forcing_period(parameters)
    t_end = 25 * period
    arc = simulate(
        system,
        (0.0, 1.0),
        (0.0, t_end),
        parameters=parameters,
        solver=LOOSE,
        samples=[t_end],
        keep_jumps=True,
    )
    return float(np.abs(arc.jumps.x_minus[arc.jumps.t > t_end - 2 * period, 0]).max())


def rimless_wheel(ax: Axes) -> None:
    system = models.rimless_wheel()
    gamma, alpha = system.parameters["gamma"], system.parameters["alpha"]
    for omega in (2.0, 1.02, 0.85):
        plot_phase(simulate(system, (gamma - alpha, omega), (0.0, 4.0), max_jumps=8), "theta", "omega", ax=ax)
    fade(ax)
    plot_phase(periodic_orbit(system, (0.0, 0.6), period=1.0).arc(), "theta", "omega", ax=ax)
    ax.set(xlabel="angle of the spoke θ (rad)", ylabel="angular velocity ω (rad/s)")


def simplest_walker(ax: Axes) -> None:
    system = models.simplest_walker()
    orbit = periodic_orbit(system, (0.2003, 0.4006, -0.1998, -0.0158), mode="behind", period=3.9)
    x0, mode, t_end = orbit.x0, orbit.mode, 160 * orbit.period
    for gamma in np.linspace(0.0135, 0.019, 100):
        parameters = {"gamma": float(gamma)}
        arc = simulate(
            system,
            x0,
            (0.0, t_end),
            mode=mode,
            parameters=parameters,
            solver=LOOSE,
            samples=[t_end],
            keep_jumps=True,
        )
        heelstrikes = arc.jumps.x_plus[[jump.transition == "heelstrike" for jump in arc.jumps]]
        angles = heelstrikes[-70:, 0]
        ax.plot(np.full(len(angles), gamma), angles, ",", color=COLOURS[0], rasterized=True)
        # Start the next slope at the last state, because only walks close to the attractor do not fall.
        x0, mode = arc.x[-1], str(arc.mode[-1])
    ax.set(xlabel="slope γ (rad)", ylabel="angle after heelstrike θ (rad)")
    plain(ax)


def slip_hopper(ax: Axes) -> None:
    system = models.slip_hopper()
    energy, g = 22.31, system.parameters["g"]
    for degrees, colour in zip((66, 68, 70), COLOURS, strict=False):
        parameters = {"alpha": np.radians(degrees)}
        heights = np.linspace(np.sin(parameters["alpha"]) + 1e-3, 1.5, 50)
        following = []
        for y in heights:
            start = (0.0, y, np.sqrt(2 * (energy - g * y)), 0.0)
            arc = simulate(
                system, start, (0.0, 2.0), mode="descent", parameters=parameters, max_jumps=3, solver=LOOSE
            )
            following.append(next_apex(arc))
        ax.plot(heights, following, color=colour, label=f"{degrees}°")
    ax.plot([0.9, 1.5], [0.9, 1.5], color="0.6", linewidth=0.8, zorder=0)
    ax.set(xlabel="apex height (m)", ylabel="next apex height (m)", xlim=(0.9, 1.5), ylim=(0.9, 1.5))
    ax.legend(title="angle of attack", frameon=False)
    plain(ax)


def next_apex(arc: HybridArc) -> float:
    """Height of the first apex; nan if the runner has fallen."""
    touchdown, takeoff, apex = arc.jumps[:3]
    up = takeoff.transition == "takeoff" and takeoff.x_minus[3] > 0
    return apex.x_minus[1] if up and apex.x_minus[1] > touchdown.x_minus[1] else np.nan


def fade(ax: Axes) -> None:
    """Turn all lines drawn so far into a background."""
    for line in ax.lines:
        line.set_alpha(0.4)
        line.set_linewidth(0.9)


def plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "stick_slip",
        "A block on a moving belt reaches a limit cycle of sticking and slipping from every start shown.",
        stick_slip,
        "belt, limit cycle, brake squeal",
    ),
    (
        "coulomb_stick_slip",
        "Displacement at three belt speeds: the mass sticks up to x = 1, the static friction, then slips.",
        coulomb_stick_slip,
        "static friction, stiction",
    ),
    (
        "dry_friction_oscillator",
        "Den Hartog's resonance curves (lines, motion without stops) and simulation (dots, stops included).",
        dry_friction_oscillator,
        "dry friction, Den Hartog",
    ),
    (
        "rimless_wheel",
        "Two starts roll down the slope and reach the same gait; one start is too slow and rocks to rest.",
        rimless_wheel,
        "rimless wheel, spokes",
    ),
    (
        "simplest_walker",
        "Steps of the simplest walker on steeper and steeper slopes: period doublings lead to chaos.",
        simplest_walker,
        "passive walker, bipedal",
    ),
    (
        "slip_hopper",
        "Apex return map of a runner at one energy: running is stable where the map crosses the diagonal "
        "with a slope between -1 and 1.",
        slip_hopper,
        "SLIP, spring-mass running, hopper",
    ),
]
