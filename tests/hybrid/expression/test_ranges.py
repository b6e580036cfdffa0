"""Ranges of random expressions hold their values, and prove signs that are plain to see."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid.expression import operations as ops
from hybrid.expression.ranges import End, Range, has_one_sign, range_of
from hybrid.expression.tracing import trace
from tests.hybrid.expression.formulas import KINKED, POLYNOMIAL, SMOOTH, expression_of, formulas, of, plainly

STATES, PARAMETERS = ("q", "v"), ("k",)
OTHERS = {
    1: (
        *(of(kind) for kind in (ops.Exp, ops.Exp2, ops.Cosh, ops.Sign)),
        *(lambda a: a**-1, lambda a: a**-2, lambda a: a ** Fraction(3, 2), lambda a: 2.0**a),
    ),
    2: (
        *(of(kind) for kind in (ops.Hypot, ops.Atan2)),
        lambda a, b: a / b,
        lambda a, b: of(ops.Absolute)(a) ** b,
    ),
}
numbers = st.one_of(st.just(0.0), st.floats(-1e3, 1e3), st.floats(-1.0, 1.0))


@settings(max_examples=400)
@given(
    formulas(POLYNOMIAL, SMOOTH, KINKED, OTHERS, numbers=(0, 1, -3, 0.5, 0.1, 100)),
    st.lists(st.tuples(numbers, numbers, numbers), min_size=20, max_size=20),
)
def test_every_value_lies_in_the_range(formula, places):
    found = range_of(expression_of(formula))
    for value in (plainly(formula, place) for place in places):
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
