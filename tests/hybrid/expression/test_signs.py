"""Kinks and choices that are decided where an expression keeps its sign."""

import numpy as np
import pytest

from hybrid.expression.evaluation import Program
from hybrid.expression.graph import MOST_EXPANDED, nodes_of
from hybrid.expression.nodes import Function, add, number
from hybrid.expression.operations import Less, LessEqual, Select, Step
from hybrid.expression.signs import sign_of, simplified
from hybrid.expression.tracing import model_symbols, trace

SYMBOLS = model_symbols(2, 0)
Q, V = SYMBOLS.x


def traced(function):
    [expression] = trace(lambda t, x, p: (function(x.q, x.v),), ("q", "v"), ())
    return expression


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    "function",
    [
        lambda h: np.abs(h),
        lambda h: np.sign(h),
        lambda h: np.heaviside(h, 0.5),
        lambda h: np.maximum(h, 0.0),
        lambda h: np.minimum(h, 0.0),
        lambda h: np.where(h > 0.0, 2.0 * h, h + 1.0),
        lambda h: np.where(h >= 0.0, 2.0 * h, h + 1.0),
        lambda h: np.where(h < 0.0, 2.0 * h, h + 1.0),
        lambda h: 3.0 * np.abs(h) * np.sign(h) + np.maximum(h, 0.0),
    ],
)
def test_a_known_sign_decides(function, sign):
    """The height ``v - q`` is positive, or its negative is."""
    before = traced(lambda q, v: function(v - q))
    after = simplified(before, [sign * (V - Q)])
    assert not nodes_of(Function, after)
    for q, v in ((0.5, 0.75), (-1.0, 2.0)):
        place = {Q: q, V: v} if sign > 0 else {Q: v, V: q}
        height = float(place[V] - place[Q])
        assert Program([after]).run(place) == [float(function(np.float64(height)))]


@pytest.mark.parametrize("known", [[], [V], [Q + V, V]])
def test_what_no_known_sign_decides_stays(known):
    for function in (np.abs, np.sign, lambda h: np.maximum(h, 0.0), lambda h: np.where(h > 0, h, 2 * h)):
        before = traced(lambda q, v, function=function: function(q - v))
        assert simplified(before, known) is before


def test_conditions_of_both_kinds():
    for kind in (Less, LessEqual):
        choice = Select(kind(Q, V), number(2), number(3))
        assert simplified(choice, [V - Q]) == 2
        assert simplified(choice, [Q - V]) == 3


def test_signs_are_those_of_equal_expressions():
    assert sign_of((Q + 1) * V, [Q, Q * V + V]) == 1
    assert sign_of(-(Q + 1) * V, [Q, Q * V + V]) == -1
    assert sign_of(Q, [Q * V + V]) == 0
    assert sign_of(2 * Q, [Q]) == 0


def test_steps():
    assert simplified(Step(V - Q), [V - Q]) == 1
    assert simplified(Step(V - Q), [Q - V]) == 0
    assert simplified(3 * Step(V - Q) * Q, [V - Q]) == 3 * Q
    assert simplified(Step(V - Q), [Q]) == Step(V - Q)


def test_long_expressions_are_not_expanded():
    long = add(*(V**k for k in range(2, MOST_EXPANDED)))
    assert sign_of(long, [long]) == 0
