"""Panel f: the phase of the impacts of a stable orbit, over up to a million forcing periods."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np

import models
from benchmarks.peers.scipy_ivp import Edge, with_events
from benchmarks.stability.methods import EVENTS, LEAST, OURS, SCIPY, WITHOUT_PERIOD, Curves
from hybrid import HybridSystem
from hybrid.simulation.trajectory import start
from models.one_impact import one_impact_orbits

# A short forcing period, which needs few steps.
PARAMETERS = {"w": 2.0, "d": 0.05}
# Share of the periods after which the slower methods are stopped.
SHARES = {"Tsit5, tight": 0.02, "Tsit5, loose": 0.1, "RadauIIA, tight": 0.001, "RadauIIA, loose": 0.02}
SHARE_WITHOUT_PERIOD = 0.3
SCIPY_PERIODS = 1000


def phase_curves(periods: int) -> Curves:
    """Error of the forcing phase at the impacts of a stable orbit, over the number of periods."""
    system = models.impact_oscillator()
    p = {**system.parameters, **PARAMETERS}
    (orbit,) = one_impact_orbits(**p)
    period, phase = 2 * math.pi / p["w"], orbit.theta / p["w"]
    after = (p["d"], -p["r"] * orbit.V)
    counts = np.unique(np.geomspace(1, periods, 40).astype(int))
    curves: Curves = {}
    for name, solver in OURS.items():
        within = counts[counts <= max(1, SHARES.get(name, 1.0) * periods)]
        curves[name] = phases(system, after, phase, period, within, solver)
    plain = attrs.evolve(system, period=None)
    within = counts[counts <= max(1, SHARE_WITHOUT_PERIOD * periods)]
    curves[WITHOUT_PERIOD] = phases(plain, after, phase, period, within, OURS["DOP853, tight"])

    def flight(t, x):
        return x[1], p["A"] * math.cos(p["w"] * t) - p["c"] * x[1] - p["k"] * x[0]

    edge = Edge(lambda t, x: x[0] - p["d"], +1, 0, lambda x: (p["d"], -p["r"] * x[1]))
    span = (phase, phase + (min(periods, SCIPY_PERIODS) + 0.5) * period)
    times = with_events([flight], [[edge]], after, span, **SCIPY).events
    number = np.arange(1, len(times) + 1)
    errors = np.maximum.accumulate(np.maximum(np.abs(times - phase - number * period), LEAST))
    chosen = counts[counts <= len(times)]
    curves[EVENTS] = [(int(count), float(p["w"] * errors[count - 1])) for count in chosen]
    return curves


def phases(
    system: HybridSystem,
    after: tuple[float, float],
    phase: float,
    period: float,
    counts: Iterable[int],
    solver: Any,
) -> list[tuple[float, float]]:
    """Largest phase error of the impacts up to each count of periods, in one run without a history."""
    trajectory = start(system, after, phase, parameters=PARAMETERS, solver=solver)
    record = trajectory.no_record()
    errors, largest = [], 0.0
    for count in counts:
        trajectory.advance(phase + (count + 0.5) * period, record)
        run = trajectory.run
        cycles, found = run.jumps, run.last_jump_phase - phase
        # ``last_jump_phase`` is a phase if the model has a period, else a time.
        whole = round(found / period) if trajectory.model.period > 0 else cycles
        # Keep the largest error, since a time held as one number may be right by chance.
        largest = max(largest, abs(found - whole * period) * 2 * math.pi / period)
        errors.append((float(count), max(largest, LEAST)))
    return errors
