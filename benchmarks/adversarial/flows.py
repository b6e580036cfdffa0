"""Flows with a closed-form motion, as text that runs on numbers, on enclosures and in models."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# A parameter is drawn between two numbers, uniformly or uniformly in the logarithm.
EVENLY, LOGARITHMICALLY = "evenly", "logarithmically"
Range = tuple[str, float, float]


class Flow(NamedTuple):
    """A field, its motion from time zero, and the signals that guards are made of.

    ``field`` and ``motion`` have one text per state; ``signals`` are expressions with values of order one.
    """

    name: str
    state: tuple[str, ...]
    field: tuple[str, ...]
    motion: tuple[str, ...]
    parameters: dict[str, Range]
    signals: tuple[str, ...]
    end: float


def evenly(low: float, high: float) -> Range:
    return EVENLY, low, high


def logarithmically(low: float, high: float) -> Range:
    return LOGARITHMICALLY, low, high


def draw(rng: np.random.Generator, how: Range, count: int) -> np.ndarray:
    kind, low, high = how
    if kind == EVENLY:
        return rng.uniform(low, high, count)
    return np.exp(rng.uniform(np.log(low), np.log(high), count))


TURN = evenly(0.0, 2 * np.pi)

FLOWS = (
    Flow(
        "oscillator",
        ("q", "v"),
        ("x.v", "-p.w*p.w*x.q"),
        ("p.A*np.cos(p.w*t + p.f)", "-p.A*p.w*np.sin(p.w*t + p.f)"),
        {"A": evenly(0.5, 2.0), "w": evenly(0.5, 3.0), "f": TURN},
        ("x.q", "x.v", "x.q + 0.3*x.v", "x.q*x.v", "(x.q - 0.5*np.cos(0.7*t))"),
        10.0,
    ),
    Flow(
        "damped oscillator",
        ("q", "v"),
        ("x.v", "-2*p.d*x.v - (p.d*p.d + p.w*p.w)*x.q"),
        (
            "p.A*np.exp(-p.d*t)*np.cos(p.w*t + p.f)",
            "-p.A*np.exp(-p.d*t)*(p.d*np.cos(p.w*t + p.f) + p.w*np.sin(p.w*t + p.f))",
        ),
        {"A": evenly(1.0, 3.0), "w": evenly(0.5, 3.0), "f": TURN, "d": evenly(0.01, 0.3)},
        ("x.q", "x.v", "x.q - 0.5*x.v", "(x.q + 0.4*np.sin(1.3*t))"),
        10.0,
    ),
    Flow(
        "ramp",
        ("q",),
        ("p.s",),
        ("p.b + p.s*t",),
        {"s": evenly(0.1, 0.4), "b": evenly(-2.0, -1.2)},
        ("x.q", "x.q", "np.sin(2*x.q)", "(x.q*np.cos(t))"),
        10.0,
    ),
    Flow(
        "cubic in time",
        ("q", "v"),
        ("x.v", "p.s + p.m*t"),
        ("p.b - 0.5*t + p.s*t*t/2 + p.m*t*t*t/6", "-0.5 + p.s*t + p.m*t*t/2"),
        {"b": evenly(-1.0, 1.0), "s": evenly(-0.3, 0.3), "m": evenly(-0.2, 0.2)},
        ("x.q", "x.v", "x.q - 0.5*x.v"),
        6.0,
    ),
    Flow(
        "decay",
        ("q", "v"),
        ("-p.d*x.q", "-0.5*x.v"),
        ("p.A*np.exp(-p.d*t)", "p.B*np.exp(-0.5*t)"),
        {"A": evenly(1.0, 3.0), "d": evenly(0.05, 1.0), "B": evenly(-3.0, 3.0)},
        ("x.q", "x.v", "x.q + x.v", "(x.q*np.sin(3*t))"),
        10.0,
    ),
    Flow(
        "logistic",
        ("q",),
        ("p.d*x.q*(1 - x.q)",),
        ("1/(1 + p.B*np.exp(-p.d*t))",),
        {"d": evenly(0.5, 3.0), "B": logarithmically(3.0, 300.0)},
        ("(3*x.q - 1.5)", "(x.q - 0.5*np.cos(0.9*t))", "(2*x.q - 1)"),
        10.0,
    ),
    Flow(
        "double well",
        ("q",),
        ("x.q - x.q**3",),
        ("p.s/np.sqrt(1 + p.B*np.exp(-2*t))",),
        {"s": evenly(1.0, 1.0), "B": logarithmically(3.0, 3000.0)},
        ("(2*x.q - 1)", "(x.q - np.sin(0.8*t))", "(x.q - 0.5)"),
        8.0,
    ),
    Flow(
        "driven rate",
        ("q",),
        ("p.m*np.cos(p.w*t)*x.q",),
        ("p.A*np.exp(p.m*np.sin(p.w*t)/p.w)",),
        {"A": evenly(0.3, 1.0), "m": evenly(0.5, 1.5), "w": evenly(0.7, 2.0)},
        ("(x.q - 0.7)", "(x.q - 0.5 - 0.5*np.sin(t))", "(2*x.q - 1.5)"),
        10.0,
    ),
    Flow(
        "separatrix of a pendulum",
        ("q", "v"),
        ("x.v", "-np.sin(x.q)"),
        ("4*np.arctan(np.exp(t - p.b)) - np.pi", "4*np.exp(t - p.b)/(1 + np.exp(2*t - 2*p.b))"),
        {"b": evenly(2.0, 5.0)},
        ("x.q", "(x.v - 1)", "(x.q - 0.8*np.cos(2*t))"),
        7.0,
    ),
    Flow(
        "circle that attracts",
        ("q", "v"),
        ("x.q - p.w*x.v - x.q*(x.q*x.q + x.v*x.v)", "p.w*x.q + x.v - x.v*(x.q*x.q + x.v*x.v)"),
        (
            "np.cos(p.w*t + p.f)/np.sqrt(1 + p.B*np.exp(-2*t))",
            "np.sin(p.w*t + p.f)/np.sqrt(1 + p.B*np.exp(-2*t))",
        ),
        {"w": evenly(0.7, 3.0), "f": TURN, "B": evenly(-0.8, 3.0)},
        ("x.q", "x.v", "(x.q + x.v)", "(2*x.q*x.v)", "(x.q - 0.4*np.cos(1.7*t))"),
        8.0,
    ),
    Flow(
        "turns with a rate that swings",
        ("q", "v"),
        ("-(1 + p.m*np.cos(p.w*t))*x.v", "(1 + p.m*np.cos(p.w*t))*x.q"),
        (
            "p.A*np.cos(t + p.m/p.w*np.sin(p.w*t) + p.f)",
            "p.A*np.sin(t + p.m/p.w*np.sin(p.w*t) + p.f)",
        ),
        {"A": evenly(0.7, 2.0), "m": evenly(0.2, 0.9), "w": evenly(0.5, 2.0), "f": TURN},
        ("x.q", "x.v", "(x.q*x.v)", "(x.q - x.v)"),
        10.0,
    ),
)
