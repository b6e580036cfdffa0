"""Gallery pictures of machines with contacts; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

import models
from hybrid import periodic_orbit, simulate
from hybrid.plot import COLOURS
from models.cam_follower import critical_speed


def cam_follower(ax: Axes) -> None:
    """Speeds of impacts in 40 turns of the cam, after 60 more, each from where the last run has ended."""
    system = models.cam_follower()
    a, least = system.parameters["a"], critical_speed()
    speeds, found = [], []
    q, v = 0.03, 0.0
    for w in least * np.linspace(0.9, 3.6, 400):
        turn = 2 * np.pi / w
        # The follower starts a little above the cam, which is at its top.
        start = (max(q, a + 1e-3), v)
        arc = simulate(system, start, (0.0, 100 * turn), parameters={"w": w})
        q, v = arc.x[-1]
        hits = [jump for jump in arc.jumps["cam"] if jump.t > 60 * turn]
        speeds += [w / least] * len(hits)
        found += [-(jump.x_minus[1] + a * w * np.sin(w * jump.t)) for jump in hits]
    ax.plot(speeds, found, ".", color=COLOURS[0], markersize=1.0, markeredgewidth=0.0, rasterized=True)
    ax.axvline(1.0, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
    ax.set(xlabel="speed of the cam / critical speed", ylabel="speed of impacts (m/s)", ylim=(0.0, None))


def slider_crank(ax: Axes) -> None:
    """Heights of the two ends of the slider in its guide, over one turn of the crank."""
    system = models.slider_crank()
    arc = simulate(system, (0.0, 0.0, 0.01, 150.0, -75.0, 0.0), (0.0, 0.07))
    a, c = system.parameters["a"], system.parameters["c"]
    t = np.linspace(0.0, arc.t[-1], 2000)
    turns = arc(t, "theta1") / (2 * np.pi)
    for side, colour, name in ((-1, COLOURS[0], "rear end"), (+1, COLOURS[1], "front end")):
        end = arc(t, "height") + side * a * np.sin(arc(t, "theta3"))
        ax.plot(turns, end * 1e3, color=colour, linewidth=1.0, label=name)
    for wall in (-c, c):
        ax.axhline(wall * 1e3, color="0.6", linewidth=0.8, zorder=0)
    ax.set(xlabel="turns of the crank", ylabel="height in the guide (mm)", ylim=(-1.1, 1.6), xlim=(0.0, 1.0))
    ax.legend(frameon=False, loc="upper right", ncols=2)


def verge_escapement(ax: Axes) -> None:
    """The limit cycle between the two walls that teeth and pallets make."""
    system = models.verge_escapement()
    run = simulate(system, (0.0, 0.0, 0.0, 0.0), (0.0, 6.0))
    orbit = periodic_orbit(system, run.x[-1], mode=run.end.mode, period=1.24)
    arc = simulate(system, orbit.x0, (0.0, 2.0 * orbit.period), mode=orbit.mode)
    tooth, p = system.angles["theta"], system.parameters
    first = np.floor(arc["theta"].min() / tooth) * tooth
    teeth = np.linspace(0.0, 2.5, 400)
    track = p["A"] * np.sin(2 * np.pi * teeth)
    for wall in (track - p["c"], track + p["c"]):
        ax.plot(teeth, wall, color="0.6", linewidth=0.8)
    t = np.linspace(0.0, arc.t[-1], 4000)
    ax.plot((arc(t, "theta") - first) / tooth, arc(t, "phi"), color=COLOURS[0])
    ax.set(xlabel="angle of the wheel (teeth)", ylabel="angle of the foliot (rad)", xlim=(0.0, 2.5))


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "cam_follower",
        "A follower leaves the cam at the critical speed (dashed): it bounces to rest in each turn, hits the "
        "cam once per turn, and chaotically.",
        cam_follower,
        "cam, cam follower, valve train",
    ),
    (
        "slider_crank",
        "Both ends of a slider with clearance, which starts tilted, over a turn of the crank: impacts, and "
        "sliding along the walls.",
        slider_crank,
        "slider-crank, clearance, joint clearance",
    ),
    (
        "verge_escapement",
        "The limit cycle of the oldest clock: teeth (grey) push the foliot to and fro, and recoil while it "
        "turns on.",
        verge_escapement,
        "escapement, clockwork",
    ),
]
