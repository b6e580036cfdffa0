"""Gallery pictures of models that switch or collide; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from hybrid import DOP853, HybridArc, simulate
from hybrid.plot import COLOURS, plot_phase
from models import (
    ball_chain,
    buck_converter,
    chua_circuit,
    solvable_oscillator,
    switched_arrival,
    three_disk_billiard,
)

FAST = DOP853(rtol=1e-8, atol=1e-10)


def double_scroll(axes: Axes) -> None:
    system = chua_circuit()
    settled = simulate(system, (0.7, 0.0, 0.0), (0.0, 50.0), samples=[50.0], solver=FAST)
    arc = simulate(system, settled.x[-1], (0.0, 150.0), mode=str(settled.mode[-1]), solver=FAST)
    plot_phase(arc, "x", "z", ax=axes)
    for line in axes.lines:
        line.set_linewidth(0.6)
    axes.lines[-1].remove()
    axes.plot([-1.5, 0, 1.5], [1.5, 0, -1.5], "k+", markersize=5)


def bifurcations_of_the_converter(axes: Axes) -> None:
    system = buck_converter()
    period = system.parameters["T"]
    start, mode = np.array([12.0, 0.6, 0.0]), "off"
    for E in np.linspace(24.0, 34.0, 201):
        arc = simulate(system, start, (0.0, 80 * period), mode=mode, parameters={"E": E}, solver=FAST)
        start, mode = arc.x[-1], str(arc.mode[-1])
        begins = arc.jumps.x_plus[arc.jumps.x_plus[:, 2] == 0.0, 0][-60:]
        axes.plot(np.full(len(begins), E), begins, ".", color=COLOURS[0], markersize=1.2, markeredgewidth=0.0)
    axes.set_xlabel("input voltage E (V)")
    axes.set_ylabel("v where the ramp begins (V)")


def solvable_chaos(axes: Axes) -> None:
    t_end = 20.0
    arc = simulate(solvable_oscillator(), (0.3, 0.0), (0.0, t_end), mode="plus")
    t = np.linspace(0.0, t_end, 3000)
    flips = [0.0, *(jump.t for jump in arc.jumps), t_end]
    signs = [1.0 if mode == "plus" else -1.0 for mode in ("plus", *(jump.target for jump in arc.jumps))]
    axes.stairs(signs, flips, baseline=None, color=COLOURS[1], linewidth=1.4, label="s")
    axes.plot(t, arc(t)[:, 0], color=COLOURS[0], linewidth=0.9, label="u")
    whole = np.arange(int(t_end) + 1)
    axes.plot(whole, arc(whole)[:, 0], "k.", markersize=4)
    axes.set_xlabel("t")
    axes.set_ylabel("u, s")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)


def orbit_in_the_triangle(axes: Axes) -> None:
    arc = simulate(switched_arrival(), (0.0, 0.314, 0.686), (0.0, 40.0), mode="fill1")
    plot_phase(arc, "x1", "x2", ax=axes)
    for line in axes.lines:
        line.set_linewidth(0.8)
    axes.plot([0, 1, 0, 0], [0, 0, 1, 0], color="0.5", linewidth=0.8, zorder=0)
    axes.set_aspect("equal")


def rattling_ball(axes: Axes) -> None:
    masses = {"m1": 1.0, "m2": 0.1, "m3": 1.0}
    arc = simulate(ball_chain(), (-1.0, -0.3, 1.0, 0.5, 0.0, -0.5), (0.0, 4.0), parameters=masses)
    for k, name in enumerate(("heavy", "light", "heavy")):
        axes.plot(arc.t, arc.x[:, k], color=COLOURS[k % 2], linewidth=1.2, label=name if k < 2 else None)
    axes.set_xlabel("t")
    axes.set_ylabel("q1, q2, q3")
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)


def scattering_by_three_disks(axes: Axes) -> None:
    """Seven particles that start at one point in directions 1e-4 rad apart."""
    system = three_disk_billiard()
    a, R = system.parameters["a"], system.parameters["R"]
    for k in range(3):
        angle = np.pi / 2 + 2 * np.pi * k / 3
        centre = R / np.sqrt(3) * np.array([np.cos(angle), np.sin(angle)])
        axes.add_patch(Circle(tuple(centre), a, facecolor="0.85", edgecolor="0.3"))
    for k in range(7):
        angle = 1e-4 * (k - 3) + 2e-3
        start = (0.0, -R / np.sqrt(12), np.cos(angle), np.sin(angle))
        arc: HybridArc = simulate(system, start, (0.0, 60.0))
        axes.plot(arc.x[:, 0], arc.x[:, 1], color=COLOURS[k], linewidth=0.9)
    axes.set(aspect="equal", xlim=(-6, 6), ylim=(-4, 5.5), xlabel="x", ylabel="y")


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "chua_circuit",
        "The double scroll, with one colour per affine region; crosses mark the three equilibria.",
        double_scroll,
        "Chua, double scroll",
    ),
    (
        "buck_converter",
        "Period doublings of the output voltage at the start of each ramp, and the sudden growth at 32.3 V.",
        bifurcations_of_the_converter,
        "buck converter, voltage mode",
    ),
    (
        "solvable_oscillator",
        "The oscillation grows about the set point s, which flips at integer times; there the states (dots) "
        "follow an exact map.",
        solvable_chaos,
        "exactly solvable chaos",
    ),
    (
        "switched_arrival",
        "Work in the buffers: straight lines across a triangle; distances double at each switch.",
        orbit_in_the_triangle,
        "queue, switched arrival, buffers",
    ),
    (
        "ball_chain",
        "A light ball reverses two heavy balls in 7 collisions; the bound is ceil(pi / phi) = 8.",
        rattling_ball,
        "ball chain, inelastic collapse",
    ),
    (
        "three_disk_billiard",
        "Seven particles start within a milliradian and leave three disks in very different directions.",
        scattering_by_three_disks,
        "billiard, billiards, scattering",
    ),
]
