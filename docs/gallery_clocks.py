"""Gallery pictures of models with clocks, held values and tables; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

from hybrid import periodic_orbit, simulate
from hybrid.plot import COLOURS
from models import (
    battery_cell,
    boost_converter,
    delayed_neurons,
    digital_pwm,
    dosing_schedule,
    infusion_schedule,
    refractory_neuron,
    sampled_loop,
)
from models.battery_cell import CYCLE


def bifurcations_of_the_boost_converter(axes: Axes) -> None:
    system = boost_converter()
    period = system.parameters["T"]
    start, mode = np.array([0.5, 13.0, 0.0]), "on"
    for I_ref in np.linspace(0.8, 4.0, 321):
        given = {"I_ref": I_ref}
        arc = simulate(system, start, (0.0, 160 * period), mode=mode, parameters=given)
        start, mode = arc.x[-1], str(arc.mode[-1])
        ticks = arc.jumps.x_plus[[jump.transition != "peak" for jump in arc.jumps], 0][-60:]
        peaks = np.full(len(ticks), I_ref)
        axes.plot(peaks, ticks, ".", color=COLOURS[0], markersize=1.2, markeredgewidth=0.0)
    axes.set_xlabel("peak current I_ref (A)")
    axes.set_ylabel("i at the ticks (A)")


def bifurcations_of_the_sampled_duty(axes: Axes) -> None:
    system = digital_pwm()
    period = system.parameters["T"]
    start, mode = np.array([4.0, 0.5]), "on"
    for k in np.linspace(0.05, 0.4, 351):
        arc = simulate(system, start, (0.0, 120 * period), mode=mode, parameters={"k": k})
        start, mode = arc.x[-1], str(arc.mode[-1])
        samples = [jump.x_minus[0] for jump in arc.jumps["sample"]][-50:]
        axes.plot(
            np.full(len(samples), k), samples, ".", color=COLOURS[0], markersize=1.2, markeredgewidth=0.0
        )
    axes.set_xlabel("k (1/A)")
    axes.set_ylabel("i at the samples (A)")


def step_of_the_sampled_loop(axes: Axes) -> None:
    t = np.linspace(0.0, 3.0, 601)
    arc = simulate(sampled_loop(), {"y": 0.0}, (0.0, 3.0))
    axes.plot(t, arc(t)[:, 0], color=COLOURS[0], label="y")
    held = np.r_[0.0, arc.jumps.x_plus[:, 1]]
    axes.stairs(held, [0.0, *arc.jumps.t, 3.1], baseline=None, color=COLOURS[1], linewidth=1.4, label="u")
    axes.axhline(1.5, color="0.6", linewidth=0.8, linestyle=":")
    axes.set(xlabel="t (s)", ylabel="y, u", xlim=(0.0, 3.0))
    axes.legend(frameon=False)


def doses(axes: Axes) -> None:
    t = np.linspace(0.0, 96.0, 961)
    for times, label in (((8, 20, 32, 44, 56, 68), "every 12 h"), ((8, 20, 44, 56, 68), "one missed")):
        arc = simulate(dosing_schedule(map(float, times)), (0.0, 0.0), (0.0, 96.0), samples=t)
        axes.plot(t, arc["c"], color=COLOURS[len(axes.lines)], label=label)
    axes.set(xlabel="t (h)", ylabel="c (mg/L)")
    axes.legend(frameon=False)


def infusions(axes: Axes) -> None:
    t = np.linspace(-1.0, 36.0, 741)
    arc = simulate(infusion_schedule(), {"c": 0.0}, (-1.0, 36.0), samples=t)
    axes.fill_between(t, arc["r"] / 10.0, step="post", color=COLOURS[1], alpha=0.3, label="rate (10 mg/h)")
    axes.plot(t, arc["c"], color=COLOURS[0], label="c (mg/L)")
    axes.set(xlabel="t (h)", xlim=(-1.0, 36.0), ylim=(0.0, None))
    axes.legend(frameon=False)


def rates_of_the_neuron(axes: Axes) -> None:
    system, currents = refractory_neuron(), np.linspace(1.2, 8.0, 35)
    for t_ref in (0.5, 4.0, 8.0):
        given = [{"I": current, "t_ref": t_ref} for current in currents]
        counts = [simulate(system, (-65.0, 0.0), (0.0, 2e3), parameters=each)["n"][-1] for each in given]
        colour = COLOURS[len(axes.lines) // 2]
        axes.plot(currents, np.array(counts) / 2.0, "o", color=colour, markersize=2.5)
        drive = 10.0 * np.maximum(currents, 1.5 + 1e-12)
        rate = np.where(currents > 1.5, 1e3 / (t_ref + 10.0 * np.log(drive / (drive - 15.0))), 0.0)
        axes.plot(currents, rate, color=colour, linewidth=0.9, label=f"t_ref = {t_ref:g} ms")
    axes.set(xlabel="I (nA)", ylabel="spikes per second")
    axes.legend(frameon=False)


def multipliers_of_the_neurons(axes: Axes) -> None:
    system = delayed_neurons()
    drive, weight = system.parameters["I"], system.parameters["eps"]
    for label, share in (("in phase", 0.0), ("in antiphase", 0.5)):
        # A pulse comes at the age s of its receiver, whose period is T(s) = (s - tau) / share.
        s = np.linspace(0.02, 1.1, 200)
        period = s + np.log((drive * np.exp(-s) - weight) / (drive - 1.0))
        slope, tau = -weight / (drive * np.exp(-s) - weight), s - share * period
        exact = (1.0 - slope) ** 2 if share else 1.0 - 2.0 * slope
        colour = COLOURS[len(axes.lines) // 2]
        axes.plot(tau[tau > 0.0], exact[tau > 0.0], color=colour, linewidth=0.9, label=label)
        delays = np.linspace(0.02, 0.26, 7)
        found = []
        for delay, length in zip(delays, np.interp(delays, tau, period), strict=True):
            start = (0.95, drive * (1.0 - np.exp(-share * length)) if share else 0.95)
            orbit = periodic_orbit(system, start, period=length, parameters={"tau": delay})
            found.append(orbit.multipliers[1].real)
        axes.plot(delays, found, "o", color=colour, markersize=3.0)
    axes.set(xlabel="tau", ylabel="multiplier of a difference", xlim=(0.0, 0.28))
    axes.legend(frameon=False)


def drive_to_the_cut_off(axes: Axes) -> None:
    system = battery_cell()
    p = system.parameters
    arc = simulate(system, (0.45, 0.0), (0.0, 1500.0))
    t = np.unique(np.r_[np.linspace(0.0, 1500.0, 3001), arc.jumps.t])
    s, v1 = arc(t).T
    shares = np.interp(t % CYCLE[-1][0], *zip(*CYCLE, strict=True))
    current = np.where(t <= arc.jumps[0].t, p["I"] * shares, 0.0)
    voltage = p["E_0"] + (p["E_1"] - p["E_0"]) * s - v1 - p["R_0"] * current
    axes.plot(t, voltage, color=COLOURS[0], linewidth=0.7)
    axes.axhline(p["u_min"], color="0.6", linewidth=0.8, linestyle=":")
    axes.set(xlabel="t (s)", ylabel="u (V)")


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "boost_converter",
        "Current at the ticks over the peak current: a period doubling, borders where ticks find the switch "
        "closed, and chaos.",
        bifurcations_of_the_boost_converter,
        "boost converter, slope compensation",
    ),
    (
        "delayed_neurons",
        "Multipliers of two neurons that inhibit each other, computed (dots) and in closed form, over the "
        "delay of a spike.",
        multipliers_of_the_neurons,
        "spiking neurons",
    ),
    (
        "digital_pwm",
        "Current at the samples over the gain: a period doubling, and orbits at the limits of the duty.",
        bifurcations_of_the_sampled_duty,
        "digital PWM, quantisation",
    ),
    (
        "sampled_loop",
        "A step of the set point: the held control saturates, and leaves the limit without having wound up.",
        step_of_the_sampled_loop,
        "anti-windup, windup",
    ),
    (
        "dosing_schedule",
        "Concentration under doses at listed times, and with the third one missed.",
        doses,
        "tablets",
    ),
    (
        "infusion_schedule",
        "Concentration under three infusions from a table, which overlap, and the sum of their rates.",
        infusions,
        "infusions",
    ),
    (
        "refractory_neuron",
        "Spikes counted in two seconds (dots), and the closed form of the rate, for three refractory times.",
        rates_of_the_neuron,
        "neuron, integrate and fire",
    ),
    (
        "battery_cell",
        "Terminal voltage under a drive cycle that repeats, down to the cut-off at a peak of the current.",
        drive_to_the_cut_off,
        "battery, state of charge",
    ),
]
