"""Panel a: a ball on an elastic wall of any stiffness."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks.peers.scipy_ivp import Edge, straight, with_events
from benchmarks.stability.methods import (
    EVENTS,
    LOOSE,
    OURS,
    SCIPY,
    SMOOTHED,
    STRAIGHT,
    STRAIGHT_LOOSE,
    WIDTH,
    Curves,
    measure,
)
from hybrid import Guard, HybridSystem, Mode, Transition, simulate

G = 9.81


# Piecewise linear with a closed form: x'' = -g above zero and x'' = -g - K x below.
def elastic_wall() -> HybridSystem:
    return HybridSystem(
        name="elastic wall",
        state=("x", "v"),
        parameters={"K": 1e4},
        modes=[
            Mode("free", lambda t, x, p: (x.v, -G)),
            Mode("contact", lambda t, x, p: (x.v, -G - p.K * x.x)),
        ],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.x, direction=-1)),
            Transition("contact", "free", Guard(lambda t, x, p: x.x, direction=+1)),
        ],
    )


def fields(K: float) -> tuple[list[Any], list[list[Edge]]]:
    def free(t, x):
        return x[1], -G

    def contact(t, x):
        return x[1], -G - K * x[0]

    def height(t, x):
        return x[0]

    return [free, contact], [[Edge(height, -1, 1)], [Edge(height, +1, 0)]]


def switched(K: float) -> Any:
    return lambda t, x: (x[1], -G - K * min(x[0], 0.0))


def smoothed(K: float) -> Any:
    return lambda t, x: (x[1], -G - K * x[0] * 0.5 * (1 - math.tanh(x[0] / WIDTH)))


def bounced(K: float, bounces: int) -> float:
    """Time at which the ball, after ``bounces`` elastic bounces from height 1, has fallen half-way."""
    speed, w = math.sqrt(2 * G), math.sqrt(K)
    # x = (-1 + cos s) g / K - (speed / w) sin s returns to zero at tan(s / 2) = -speed w / g.
    contact = 2 * (math.pi - math.atan2(speed * w, G)) / w
    return bounces * (2 * speed / G + contact) + math.sqrt(1 / G)


def off_the_middle(x: np.ndarray) -> float:
    return abs(float(x[0]) - 0.5)


def stiffness_curves(bounces: int = 5) -> Curves:
    """Error of the height half-way down a flight, where errors of energy and of phase both show."""
    curves: Curves = {}
    system = elastic_wall()
    loosely = {**SCIPY, **LOOSE}
    for K in 10.0 ** np.arange(2, 8.1, 0.5):
        run = (1.0, 0.0), (0.0, bounced(K, bounces))
        at = K, off_the_middle
        ours = {"mode": "free", "parameters": {"K": K}}
        for name, solver in OURS.items():
            measure(curves, name, *at, simulate, system, *run, **ours, solver=solver)
        measure(curves, EVENTS, *at, with_events, *fields(K), *run, **SCIPY)
        measure(curves, STRAIGHT, *at, straight, switched(K), *run, **SCIPY)
        measure(curves, STRAIGHT_LOOSE, *at, straight, switched(K), *run, **loosely)
        measure(curves, SMOOTHED, *at, straight, smoothed(K), *run, **SCIPY)
    return curves
