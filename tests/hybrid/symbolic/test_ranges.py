"""Ranges of random expressions hold their values, and prove signs that are plain to see."""

import math
import random

import numpy as np
import pytest

from hybrid.symbolic.ranges import End, Range, has_one_sign, range_of
from hybrid.symbolic.tracing import trace

STATES, PARAMETERS = ("q", "v"), ("k",)
OF_ONE = (
    np.sin, np.cos, np.exp, np.tanh, np.arctan, np.cosh, np.abs, np.sqrt, np.square, np.sign, np.exp2,
    np.negative, lambda a: a**-1.0, lambda a: a**-2.0, lambda a: a**3, lambda a: a**1.5, lambda a: 2.0**a,
    lambda a: np.heaviside(a, 0.5),
)  # fmt: skip
OF_TWO = (
    np.add, np.add, np.add, np.subtract, np.multiply, np.multiply, np.divide, np.maximum, np.minimum,
    np.hypot, np.arctan2, lambda a, b: np.where(a > 0, a, b), lambda a, b: np.abs(a) ** b,
)  # fmt: skip
NUMBERS = (0.0, 1.0, -1.0, 0.5, 2.0, -3.0, 0.1, 1.1, 100.0)


class Point:
    def __init__(self, **values):
        self.__dict__.update(values)


def drawn(draw, depth):
    """A random function of the model."""
    if depth == 0 or draw.random() < 0.15:
        number, name = draw.choice(NUMBERS), draw.choice("qvqk#")
        return lambda t, x, p: number if name == "#" else getattr(p if name == "k" else x, name)
    first, second = drawn(draw, depth - 1), drawn(draw, depth - 1)
    if draw.random() < 0.5:
        one = draw.choice(OF_ONE)
        return lambda t, x, p: one(first(t, x, p))
    two = draw.choice(OF_TWO)
    return lambda t, x, p: two(first(t, x, p), second(t, x, p))


@pytest.mark.parametrize("seed", range(100))
def test_every_value_lies_in_the_range(seed):
    draw, rng = random.Random(seed), np.random.default_rng(seed)
    function = drawn(draw, draw.choice((2, 3, 4)))
    try:
        [expression] = trace(function, STATES, PARAMETERS)
    except (ArithmeticError, ValueError):  # a function of numbers only, which is no number
        return
    found = range_of(expression)
    for _ in range(60):
        q, v, k = 10.0 ** rng.uniform(-3, 2) * rng.normal(size=3) * (rng.random(3) > 0.1)
        with np.errstate(all="ignore"):
            value = float(function(0.0, Point(q=q, v=v), Point(k=k)))
        if math.isnan(value):
            continue
        allowed = 1e-9 * (1.0 + abs(value))
        assert found.low.value - allowed <= value <= found.high.value + allowed
        assert not (found.positive and value < 0.0)
        assert not (found.negative and value > 0.0)


@pytest.mark.parametrize(
    "function",
    [
        lambda t, x, p: 0.9,
        lambda t, x, p: 1 + x.q**2,
        lambda t, x, p: np.exp(x.v) * np.cosh(x.q),
        lambda t, x, p: -2 - np.sin(x.q) - np.abs(p.k),
        lambda t, x, p: np.maximum(x.q, 0.1) + np.sqrt(x.v),
        lambda t, x, p: 1 / (1 + x.q**4) + np.hypot(x.q, x.v),
        lambda t, x, p: 1.5 + np.tanh(t) * np.cos(x.q),
    ],
)
def test_what_has_one_sign(function):
    assert has_one_sign(trace(function, STATES, PARAMETERS)[0])


@pytest.mark.parametrize(
    "function",
    [
        lambda t, x, p: x.q**2,
        lambda t, x, p: 1 + x.q,
        lambda t, x, p: p.k,
        lambda t, x, p: 1 + np.sin(x.q),
        lambda t, x, p: p.k + np.exp(x.q),
        lambda t, x, p: np.sqrt(x.q),
        lambda t, x, p: np.exp(x.q) - np.exp(x.v),
    ],
)
def test_what_may_be_zero(function):
    assert not has_one_sign(trace(function, STATES, PARAMETERS)[0])


@pytest.mark.parametrize(
    "function",
    [
        lambda t, x, p: (1 + np.minimum(np.abs(x.q), 1e200)) ** 2,
        lambda t, x, p: (1 + np.abs(x.q)) ** 2,
        lambda t, x, p: np.exp(np.abs(x.q)),
    ],
)
def test_an_end_beyond_all_numbers_is_only_approached(function):
    assert range_of(trace(function, STATES, PARAMETERS)[0]) == Range(End(1.0, True), End(math.inf, False))
