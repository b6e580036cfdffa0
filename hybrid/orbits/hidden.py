"""How far a solution moves over a period where rounding of its states hides that."""

from __future__ import annotations

import numpy as np

from hybrid.compiler.cache.loader import load_kernels
from hybrid.orbits.newton import EPSILON
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.periods import split_time
from hybrid.simulation.trajectory import Trajectory

# Points, besides the solver's own, that show how far an orbit moves.
SAMPLES = 65
# The smallest gap that Newton's method can reach, in units in the last place of the largest states.
FINEST_GAP = 4


def hidden_gap(trajectory: Trajectory, arc: HybridArc, magnitude: np.ndarray) -> np.ndarray:
    """The part ``(n,)`` of the gap of an arc without jumps that rounding of the states may hide.

    It is the mean rate times the time, as far as rounding can hide it: a component may move so slowly that no
    step changes it.
    """
    step, model = load_kernels("hybrid.kernels.steps.step"), trajectory.model
    times = np.linspace(arc.t[0], arc.t[-1], SAMPLES)
    rates = np.empty((SAMPLES, len(magnitude)))
    for t, x, rate in zip(times, arc(times), rates, strict=True):
        step.field_at(model, trajectory.run.mode, split_time(t, model.period)[1], x, rate)
    moved = np.trapezoid(rates, times, axis=0)
    most = FINEST_GAP * EPSILON * magnitude
    return np.asarray(np.clip(np.where(np.isfinite(moved), moved, 0.0), -most, most))
