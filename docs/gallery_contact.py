"""Gallery pictures of models with impacts; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

import models
from hybrid import DOP853, simulate, stroboscopic_section
from hybrid.plot import COLOURS
from models.contact import Hertz, HuntCrossley, KelvinVoigt, hertz_stiffness

COARSE = DOP853(rtol=1e-8, atol=1e-10)


def vibroimpact(ax: Axes) -> None:
    """Force over penetration in a single impact at 0.4 m/s; the damped laws have a restitution of 0.6."""
    K, mass, speed, e = hertz_stiffness(), 1000 * 100 / 1100, 0.4, 0.6
    laws = {
        "Hertz": Hertz(K),
        "Hunt-Crossley": HuntCrossley.from_restitution(e, K, speed),
        "Kelvin-Voigt": KelvinVoigt.from_restitution(e, mass, Hertz(K).duration(mass, speed)),
    }
    alone = {"omega1": 0.0, "omega2": 0.0, "P": 0.0}
    for colour, (name, law) in zip(COLOURS, laws.items(), strict=False):
        start = (-1e-4, 0.0, speed / 2, -speed / 2)
        arc = simulate(models.vibroimpact(law), start, (0.0, 0.01), mode="free", parameters=alone)
        # At its end the arc is free, and has no force.
        t = np.linspace(arc.jumps[0].t, arc.jumps[1].t, 400)[:-1]
        depth = (arc(t, "x1") - arc(t, "x2")) * 1e6
        ax.plot(np.append(0, depth), np.append(0, arc(t, "force")) / 1e3, color=colour, label=name)
    ax.axvline(0, color="0.3", linewidth=0.9, linestyle=":", label="rigid")
    ax.set_xlabel("penetration (µm)")
    ax.set_ylabel("force (kN)")
    ax.legend(frameon=False, fontsize=8)


def impact_oscillator(ax: Axes) -> None:
    parameters = {"c": 0.1, "w": 2.8, "d": 0.0, "r": 0.8}
    section = stroboscopic_section(
        models.impact_oscillator(),
        (-0.1, 0.0),
        parameters=parameters,
        periods=30_000,
        transient=200,
        solver=COARSE,
    )
    ax.plot(*section.x.T, ",", color=COLOURS[0], alpha=0.6, rasterized=True)
    ax.set_xlabel("displacement $x$")
    ax.set_ylabel("velocity $v$")


def bouncing_ball(ax: Axes) -> None:
    for index, e in enumerate((0.9, 0.8, 0.6)):
        system = models.bouncing_ball()
        arc = simulate(system, (1.0, 0.0), (0.0, 10.0), parameters={"e": e})
        t = np.linspace(0.0, arc.t[-1], 2500)
        ax.plot(t, arc(t)[:, 0], color=COLOURS[index], linewidth=1.0, label=f"e = {e}")
        ax.plot(arc.t[-1], 0.0, "o", color=COLOURS[index], markersize=4, clip_on=False, zorder=5)
    ax.set_ylim(0, 1.02)
    ax.set_xlabel("time (s)")
    ax.set_ylabel("height (m)")
    ax.legend(frameon=False, fontsize=8)


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "vibroimpact",
        "Force over penetration in one impact, for each contact law of the model.",
        vibroimpact,
        "vibro-impact, vibroimpact",
    ),
    (
        "impact_oscillator",
        "The chaotic attractor of an oscillator at a rigid stop, with one point per forcing period.",
        impact_oscillator,
        "impact oscillator, rigid stop",
    ),
    (
        "bouncing_ball",
        "A ball comes to rest after infinitely many bounces, where the run ends; dots mark the limits.",
        bouncing_ball,
        "bouncing ball, ball",
    ),
]
