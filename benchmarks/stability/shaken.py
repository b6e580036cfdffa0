"""Panel d: a ball on a shaken table with a damped contact, which lands, rides and is released repeatedly."""

from __future__ import annotations

import math
from typing import Any

import attrs
import mpmath
import numpy as np

from benchmarks.peers.scipy_ivp import Edge, straight, with_events
from benchmarks.stability.methods import (
    EVENTS,
    IMPLICIT,
    OURS,
    SCIPY,
    SMOOTHED,
    STRAIGHT,
    WIDTH,
    Curves,
    measure,
)
from hybrid import Guard, HybridSystem, Mode, Transition, simulate

G, SHAKING, W, K = 9.81, 30.0, 20.0, 1e4
START = (0.05, 0.0)
# During a flight, half a turn of the table after the fifth release.
END = 1.725
# At the tight tolerances SciPy's implicit method takes minutes.
MEDIUM = {"rtol": 1e-7, "atol": 1e-9}
# Limits after which a run is aborted: steps of this library, evaluations of SciPy.
MOST_STEPS, MOST_EVALUATIONS = 50_000, 50_000


# x is the height above the table. The contact pushes while K x + c v < 0 and never pulls, so the ball is
# released below zero.
def shaken_table() -> HybridSystem:
    def weight(t):
        return SHAKING * np.cos(W * t) - G

    return HybridSystem(
        name="shaken table",
        state=("x", "v"),
        parameters={"c": 1e3},
        modes=[
            Mode("free", lambda t, x, p: (x.v, weight(t))),
            Mode("contact", lambda t, x, p: (x.v, weight(t) - K * x.x - p.c * x.v)),
            Mode("let go", lambda t, x, p: (x.v, weight(t))),
        ],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.x, direction=-1)),
            Transition("contact", "let go", Guard(lambda t, x, p: K * x.x + p.c * x.v, direction=+1)),
            Transition("let go", "free", Guard(lambda t, x, p: x.x, direction=+1)),
        ],
    )


def fields(c: float) -> tuple[list[Any], list[list[Edge]]]:
    def free(t, x):
        return x[1], SHAKING * math.cos(W * t) - G

    def contact(t, x):
        return x[1], SHAKING * math.cos(W * t) - G - K * x[0] - c * x[1]

    land = Edge(lambda t, x: x[0], -1, 1)
    let_go = Edge(lambda t, x: K * x[0] + c * x[1], +1, 0)
    return [free, contact], [[land], [let_go]]


def switched(c: float) -> Any:
    def field(t, x):
        push = min(K * x[0] + c * x[1], 0.0) if x[0] < 0 else 0.0
        return x[1], SHAKING * math.cos(W * t) - G - push

    return field


def smoothed(c: float) -> Any:
    def field(t, x):
        push = min(K * x[0] + c * x[1], 0.0) * 0.5 * (1 - math.tanh(x[0] / WIDTH))
        return x[1], SHAKING * math.cos(W * t) - G - push

    return field


def exact_height(c: float, events: list[tuple[str, float]] | None = None) -> float:
    """Height at the end with 40 digits, from closed forms of flight and contact joined at their roots."""
    with mpmath.workdps(40):
        piece, start, x, v = flight, mpmath.mpf(0), *map(mpmath.mpf, START)
        while True:
            motion, due = piece(mpmath.mpf(c), start, x, v)
            crossing = first_crossing(due, start)
            if crossing is None:
                return float(motion(mpmath.mpf(END))[0])
            x, v = motion(crossing)
            start, piece = crossing, contact if piece is flight else flight
            if events is not None:
                events.append((piece.__name__, float(crossing)))


def first_crossing(due: Any, start: Any, scan: float = 1e-3) -> Any:
    """Time at which ``due`` first changes from positive to negative before the end, or None."""
    before = start + scan / 1000
    while before < END:
        after = before + scan
        if due(before) > 0 >= due(after):
            root = mpmath.findroot(due, (before, after), solver="anderson", tol=1e-60)
            return root if root < END else None
        before = after
    return None


def flight(c: Any, start: Any, x: Any, v: Any) -> Any:
    a, w = mpmath.mpf(SHAKING), mpmath.mpf(W)
    g = mpmath.mpf(G)

    def motion(t: Any) -> Any:
        s = t - start
        drift = v - a / w * mpmath.sin(w * start)
        height = x + drift * s - g * s**2 / 2 - a / w**2 * (mpmath.cos(w * t) - mpmath.cos(w * start))
        return height, drift - g * s + a / w * mpmath.sin(w * t)

    return motion, lambda t: motion(t)[0]


def contact(c: Any, start: Any, x: Any, v: Any) -> Any:
    a, w = mpmath.mpf(SHAKING), mpmath.mpf(W)
    g, k = mpmath.mpf(G), mpmath.mpf(K)
    response = a / mpmath.mpc(k - w**2, c * w)
    root = mpmath.sqrt(c**2 - 4 * k)
    fast, slow = -(c + root) / 2, -2 * k / (c + root)

    def forced(t: Any) -> Any:
        turning = response * mpmath.expj(w * t)
        return turning.real - g / k, (1j * w * turning).real

    x_0, v_0 = (now - held for now, held in zip((x, v), forced(start), strict=True))
    of_fast = (v_0 - slow * x_0) / (fast - slow)
    of_slow = x_0 - of_fast

    def motion(t: Any) -> Any:
        s, held = t - start, forced(t)
        parts = of_fast * mpmath.exp(fast * s), of_slow * mpmath.exp(slow * s)
        return held[0] + sum(parts), held[1] + fast * parts[0] + slow * parts[1]

    def push(t: Any) -> Any:
        height, speed = motion(t)
        return -k * height - c * speed

    return motion, push


def damping_curves() -> Curves:
    """Error of the height at the end, during a flight."""
    curves: Curves = {}
    system = shaken_table()
    for c in 10.0 ** np.arange(2.5, 8.6, 0.5):
        exact = exact_height(c)

        def off(x: np.ndarray, exact: float = exact) -> float:
            return abs(float(x[0]) - exact)

        run = START, (0.0, END)
        for name, solver in OURS.items():
            solver = attrs.evolve(solver, max_steps=MOST_STEPS)
            ours = {"mode": "free", "parameters": {"c": c}, "solver": solver}
            measure(curves, name, c, off, simulate, system, *run, **ours)
        explicit = {**SCIPY, "most_evaluations": MOST_EVALUATIONS}
        implicit = {**explicit, "method": "Radau", **MEDIUM}
        measure(curves, EVENTS, c, off, with_events, *fields(c), *run, **explicit)
        measure(curves, IMPLICIT, c, off, with_events, *fields(c), *run, **implicit)
        measure(curves, STRAIGHT, c, off, straight, switched(c), *run, **explicit)
        measure(curves, SMOOTHED, c, off, straight, smoothed(c), *run, **explicit)
    return curves
