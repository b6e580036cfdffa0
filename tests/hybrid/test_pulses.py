"""Forcing pulses far narrower than a step: none is stepped over, at any place, of any shape, by any solver."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    StatusCode,
    Taylor,
    Transition,
    Tsit5,
    compile_system,
    simulate,
    stroboscopic_section,
)

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
# Errors per step add up over the steps that a pulse takes; those of a window include the error of its edges.
ALLOWED = dict(zip(SOLVERS, (1e-9, 1e-9, 1e-6, 1e-6), strict=True))
# Pulses as functions of time, with a height ``A``, a place ``a`` and a width ``w``.
SHAPES = {
    "gauss": lambda t, p: p.A * np.exp(-(((t - p.a) / p.w) ** 2)),
    "sech": lambda t, p: p.A / np.cosh((t - p.a) / p.w),
    "lorentz": lambda t, p: p.A / (1 + ((t - p.a) / p.w) ** 2),
    "window": lambda t, p: np.where(np.abs(t - p.a) < p.w, p.A, 0.0),
    "tanh": lambda t, p: p.A / 2 * (np.tanh((t - p.a + p.w) / (p.w / 8)) - np.tanh((t - p.a - p.w) / (p.w / 8))),
    "kinked": lambda t, p: p.A * np.maximum(1 - np.abs(t - p.a) / p.w, 0),
}
DAMPING = 0.1
END = 1000.0


class P:
    """Parameters for a pulse outside of a model."""

    def __init__(self, **values):
        vars(self).update(values)


@cache
def oscillator(shape):
    pulse = SHAPES[shape]
    return HybridSystem(
        state=("x", "v"),
        parameters={"A": 1.0, "a": 500.0, "w": 0.01},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.x - DAMPING * x.v + pulse(t, p)))],
    )


@cache
def lag(shape):
    pulse = SHAPES[shape]
    return HybridSystem(
        state=("x",),
        parameters={"A": 1.0, "a": 500.0, "w": 0.01},
        modes=[Mode("lag", lambda t, x, p: (-x.x + pulse(t, p),))],
    )


def integral(function, start, stop, place, width):
    """Gauss's rule on pieces that double from the pulse outwards; kinks and jumps lie on their ends."""
    reach = width * 2.0 ** np.arange(-6, 60)
    edges = np.concatenate([place - reach, [place, start, stop], place + reach])
    edges = np.unique(np.clip(np.concatenate([edges, np.arange(start, stop, 0.5)]), start, stop))
    nodes, weights = np.polynomial.legendre.leggauss(20)
    half, middle = np.diff(edges) / 2, (edges[1:] + edges[:-1]) / 2
    with np.errstate(over="ignore"):
        values = function(middle[:, None] + half[:, None] * nodes)
    return np.sum(values * weights * half[:, None])


def exact_oscillator(shape, end, parameters):
    """The oscillator from rest: its response to an impulse, folded with the pulse."""
    p, rate = P(**parameters), DAMPING / 2
    frequency = np.sqrt(1 - rate**2)

    def position(s):
        return np.exp(-rate * (end - s)) * np.sin(frequency * (end - s)) / frequency

    def velocity(s):
        return np.exp(-rate * (end - s)) * np.cos(frequency * (end - s)) - rate * position(s)

    return np.array(
        [integral(lambda s, r=r: r(s) * SHAPES[shape](s, p), 0.0, end, p.a, p.w) for r in (position, velocity)]
    )


def exact_lag(shape, end, parameters):
    p = P(**parameters)
    return integral(lambda s: np.exp(s - end) * SHAPES[shape](s, p), 0.0, end, p.a, p.w)
