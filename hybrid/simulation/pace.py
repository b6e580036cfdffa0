"""The time scale of a field."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.trajectory import Trajectory


def time_scale(trajectory: Trajectory) -> float:
    """How long the field takes to change a state at the start, in any units of the states.

    It is the reciprocal of the spectral radius of ``abs(D_x f)``, the smallest norm of the Jacobian in any
    units of the states. If that is zero, as in free flight, it is the longest time in which rate and
    acceleration change a component by its size. It is 1 if there is no such component.
    """
    jacobian, x, rate = trajectory.jacobian(), np.abs(trajectory.x), trajectory.field()
    if not np.all(np.isfinite(jacobian)):
        return 1.0
    radius = float(np.abs(np.linalg.eigvals(np.abs(jacobian))).max())
    if radius > 0:
        return 1.0 / radius
    speed, acceleration = np.abs(rate), np.abs(jacobian @ rate)
    per_size = speed + np.sqrt(speed * speed + 2.0 * acceleration * x)
    moves = (x > 0) & (per_size > 0)
    return float(np.max(2.0 * x[moves] / per_size[moves], initial=0.0)) or 1.0
