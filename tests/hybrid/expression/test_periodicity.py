"""Periods that expressions are proved to have, and those that they are not."""

import math

import numpy as np
import pytest

from hybrid.expression.nodes import number
from hybrid.expression.periodicity import is_periodic
from hybrid.expression.tracing import model_symbols, trace

SYMBOLS = model_symbols(2, 1)
W = SYMBOLS.p[0]


def proved(function, turns=1):
    expressions = trace(lambda t, x, p: (x.v, function(t, x, p)), ("q", "v"), ("w",))
    return is_periodic(expressions, SYMBOLS.t, 2 * turns * number(math.pi) / W)


@pytest.mark.parametrize(
    "function",
    [
        lambda t, x, p: x.q * p.w,
        lambda t, x, p: np.cos(p.w * t) * x.q,
        lambda t, x, p: np.sin(3 * p.w * t - 0.2) ** 2 + np.exp(np.cos(p.w * t)),
        lambda t, x, p: np.tan(p.w * t / 2),
        lambda t, x, p: np.tan(p.w * t),
        lambda t, x, p: np.mod(t, 2 * np.pi / p.w),
        lambda t, x, p: np.mod(p.w * t, 2 * np.pi) * x.v,
        lambda t, x, p: np.mod(p.w * t / np.pi, 1.0),
        lambda t, x, p: np.sign(np.sin(p.w * t)) * np.abs(x.q),
        lambda t, x, p: np.cos(p.w * t + x.q),
    ],
)
def test_what_is_proved(function):
    assert proved(function)
    assert proved(function, turns=3)


@pytest.mark.parametrize(
    "function",
    [
        lambda t, x, p: t,
        lambda t, x, p: np.cos(t),
        lambda t, x, p: np.cos(p.w * t / 2),
        lambda t, x, p: np.sin(1.000001 * p.w * t),
        lambda t, x, p: np.tan(p.w * t / 4),
        lambda t, x, p: np.cos(p.w * t**2),
        lambda t, x, p: np.cos(p.w * t * x.q),
        lambda t, x, p: np.mod(t, 3 * np.pi / p.w),
        lambda t, x, p: np.mod(np.cos(p.w * t), t),
        lambda t, x, p: np.mod(x.q, t),
        lambda t, x, p: np.cos(p.w * t) + 1e-9 * t,
        lambda t, x, p: x.q * np.exp(-t),
    ],
)
def test_what_is_not(function):
    assert not proved(function)


def test_half_a_turn_needs_two_periods():
    assert not proved(lambda t, x, p: np.cos(p.w * t / 2))
    assert proved(lambda t, x, p: np.cos(p.w * t / 2), turns=2)


@pytest.mark.parametrize("share", [1e-7, 1e-9, 1e-11])
def test_a_period_that_is_nearly_one_is_none(share):
    assert not proved(lambda t, x, p: np.cos((1 + share) * p.w * t))
