"""Gallery pictures of bodies with several contacts; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

import models
from hybrid import simulate
from hybrid.plot import COLOURS, plot_contacts, plot_phase


def newtons_cradle(ax: Axes) -> None:
    """Displacements in cm, each ball drawn at its own height."""
    cradle = models.newtons_cradle()
    t = np.linspace(0.0, 2.0, 1001)
    for gap, style, label in ((1e-10, "-", "touching"), (1e-5, ":", "10 µm apart")):
        arc = simulate(cradle, (-0.1, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 2.0), parameters={"d": gap})
        for i in range(3):
            named = label if i == 0 else None
            ax.plot(t, 12.0 * i + 100.0 * arc(t)[:, i], style, color=COLOURS[i], linewidth=1.2, label=named)
    ax.set_yticks([0.0, 12.0, 24.0], ["ball 1", "ball 2", "ball 3"])
    ax.set(xlabel="time (s)", xlim=(0.0, 2.0), ylim=(-12.0, 42.0))
    ax.legend(frameon=False, fontsize=8, ncols=2, loc="upper center")


def rocking_block(ax: Axes) -> None:
    block = models.rocking_block()
    R, alpha, g = (block.parameters[name] for name in ("R", "alpha", "g"))
    tilt = 0.22
    start = (0.0, R * np.cos(alpha - tilt), tilt, 0.0, 0.0, 0.0)
    plot_phase(simulate(block, start, (0.0, 9.0)), "theta", "omega", ax=ax)
    ax.get_legend().remove()
    theta = np.linspace(-alpha, alpha, 401)
    separatrix = 2 * np.sqrt(3 * g / (4 * R)) * np.sin((alpha - np.abs(theta)) / 2)
    for sign in (1, -1):
        ax.plot(theta, sign * separatrix, color="0.6", linewidth=0.9, zorder=0)
    ax.set_xlabel(r"tilt $\theta$ (rad)")
    ax.set_ylabel(r"angular velocity $\omega$ (rad/s)")


def shaken_stack(ax: Axes) -> None:
    """Speeds seen from the ground: where two curves lie on each other, a box sticks."""
    stack = models.shaken_stack()
    A, g, w = (stack.parameters[name] for name in ("A", "g", "w"))
    arc = simulate(stack, np.zeros(8), (0.0, 2.0), parameters={"A": 1.5 * A})
    t = np.linspace(0.0, 2.0, 1001)
    # The table is at rest at first, and accelerates by -A g sin(w t).
    table = 1.5 * A * g / w * (np.cos(w * t) - 1.0)
    ax.plot(t, table, color="0.6", linewidth=1.0, label="table")
    for i, name in enumerate(("lower box", "upper box")):
        ax.plot(t, table + arc(t)[:, 4 + i], color=COLOURS[i], linewidth=1.2, label=name)
    ax.set(xlabel="time (s)", ylabel="speed (m/s)", xlim=(0.0, 2.0), ylim=(-2.0, 0.6))
    ax.legend(frameon=False, fontsize=8, ncols=3, loc="upper center")


def woodpecker(ax: Axes) -> None:
    start = (0.0, -0.1034, -0.2788, -0.3411, 0.0, -7.4583)
    settled = simulate(models.woodpecker(), start, (0.0, 8.0))
    plot_contacts(simulate(settled.system, settled.x[-1], (0.0, 0.3), mode=settled.end.mode), ax=ax)
    legend = ax.get_legend()
    texts = [each.get_text() for each in legend.get_texts()]
    legend.remove()
    small = {"fontsize": 7, "handlelength": 1.2, "columnspacing": 0.9, "frameon": False}
    ax.legend(legend.legend_handles, texts, ncols=5, loc="lower center", bbox_to_anchor=(0.42, 1.0), **small)
    ax.set_xlabel("time (s)")


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "newtons_cradle",
        "Newton's cradle: of touching balls all three leave the impact, with small gaps only the last one.",
        newtons_cradle,
        "Newton's cradle, cradle",
    ),
    (
        "rocking_block",
        "A rocking block released close to the boundary of overturning, the grey curve.",
        rocking_block,
        "rocking block, rocking, earthquake, Housner",
    ),
    (
        "shaken_stack",
        "Two boxes on a table that shakes: speeds of the three, which are the same where a box sticks.",
        shaken_stack,
        "stack, blocks",
    ),
    (
        "woodpecker",
        "What holds at the beak and at the two edges of the sleeve while the woodpecker toy pecks twice.",
        woodpecker,
        "woodpecker, toy",
    ),
]
