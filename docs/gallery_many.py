"""Gallery pictures of models with many of a kind; each function draws on given axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes

from hybrid import simulate
from hybrid.plot import COLOURS
from models import interleaved_converter, pulse_coupled_neurons


def currents_of_the_phases(axes: Axes) -> None:
    system = interleaved_converter(4)
    period = system.parameters["T"]
    start = {"v": 3.6, "phase.i": 1.4, "phase.w": 0.0}
    arc = simulate(system, start, (0.0, 400 * period), parameters={"d": 0.3})
    late = arc.t >= 397 * period
    t = 1e3 * (arc.t[late] - 397 * period)
    for i, colour in enumerate(COLOURS[:4]):
        axes.plot(t, arc[f"phase[{i}].i"][late], color=colour, linewidth=1.0)
    axes.plot(t, arc["current"][late], color="black", linewidth=1.2)
    axes.set(xlabel="t (ms)", ylabel="currents and their sum (A)", ylim=(0.0, None))


def firings_of_neurons(axes: Axes) -> None:
    start = {"neuron.u": np.random.default_rng(4).uniform(0.02, 0.98, 30)}
    arc = simulate(pulse_coupled_neurons(30), start, (0.0, 9.0), parameters={"eps": 0.006})
    firing = [int(name.partition("[")[2].partition("]")[0]) for name in arc.jumps.transition]
    axes.plot(arc.jumps.t, firing, "|", color=COLOURS[0], markersize=3)
    axes.set(xlabel="t (s)", ylabel="neuron that fires")


PICTURES: list[tuple[str, str, Callable[[Axes], None], str]] = [
    (
        "interleaved_converter",
        "Currents of four phases that take turns, and their sum (black): most of the ripple cancels.",
        currents_of_the_phases,
        "interleaved converter, multiphase converter",
    ),
    (
        "pulse_coupled_neurons",
        "Thirty neurons, each of which raises all others when it fires, fall into step.",
        firings_of_neurons,
        "pulse-coupled neurons, Peskin, synchronisation",
    ),
]
