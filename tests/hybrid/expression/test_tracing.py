import math

import numpy as np
import pytest

from hybrid.errors import ModelError
from hybrid.expression.nodes import number
from hybrid.expression.tracing import model_symbols, trace
from hybrid.expression.values import TraceError
from tests.hybrid.code import values_of

NAMES = ("a", "b")


def traced_scalar(function):
    return trace(lambda t, x, p: (function(x.a, x.b),), NAMES, ())


@pytest.mark.parametrize("x", [(2.5, 0.75), (-2.5, 0.75)])
@pytest.mark.parametrize(
    "function",
    [
        lambda a, b: abs(a) ** b,
        lambda a, b: -(a**3) + 2 / b - a // b + a % b,
        lambda a, b: (a > 0) * b + (a <= b) * a,
        lambda a, b: np.where((a > 0) & ~(b > 1), a, 3 * b),
        lambda a, b: np.where((a > 1) | (b == 0), a**-2, a**7),
        lambda a, b: np.clip(a, -1, b) + np.clip(a, 0, None),
        lambda a, b: np.float64(2.0) * a + np.float64(1.0) / b,
        lambda a, b: abs(b) ** 2.5 + (b * b) ** -1.5,
        lambda a, b: a / 3 - (a + b) / 7 + 0.1 * b,
        lambda a, b: np.sum(np.array([[1.0, 2.0], [3.0, 4.0]]) @ np.array([a, b])),
        lambda a, b: np.sum(np.cos(np.array([a, b]))),
    ],
)
def test_operators_and_choices(function, x):
    result = values_of(traced_scalar(function), x)
    np.testing.assert_allclose(result, [function(*map(np.float64, x))], rtol=1e-15)


ARRAY = np.array([0.5, -1.5, 2.0, 0.25])


@pytest.mark.parametrize(
    "function",
    [
        lambda t, x, p: np.diff(x),
        lambda t, x, p: np.concatenate([x[2:], np.cos(x[:2]), [t, 1.0]]),
        lambda t, x, p: np.maximum(np.diff(np.concatenate([[0.0], x])), 0) ** 1.5,
        lambda t, x, p: x @ x + np.dot(x[:2], x[2:]) + np.sum(x) + x.sum() + np.prod(x),
        lambda t, x, p: np.arange(16.0).reshape(4, 4) @ x,
        lambda t, x, p: np.where(x > 0, x, t * x**2),
        lambda t, x, p: np.clip(x, -1, 1) + np.cumsum(x),
        lambda t, x, p: np.max(x) - np.min(x) * p.k,
        lambda t, x, p: np.outer(x, x),
        lambda t, x, p: np.array([1.0, 2.0, 3.0, 4.0]) * x[1] + np.roll(x, 1),
        lambda t, x, p: np.array([x[0], x[1] * p.k]),
        lambda t, x, p: np.stack([x, p.k * x]),
        lambda t, x, p: _filled(x),
        lambda t, x, p: _summed(x),
    ],
)
def test_arrays(function):
    p = type("P", (), {"k": 3.0})
    result = values_of(trace(function, 4, ("k",)), ARRAY, [3.0], t=2.0)
    np.testing.assert_allclose(result, np.ravel(function(2.0, ARRAY, p)), rtol=1e-15)


def _filled(x):
    rate = np.zeros_like(x)
    rate[:2] = x[2:]
    rate[2:] += 2 * x[:2]
    return rate


def _summed(x):
    total, product = 0.0, x[0]
    for each in x:
        total += each
        product *= each
        product -= 1.0
    kept = total
    total /= 2.0
    return kept, total, product, x[0]


def test_symbols_are_named_as_code_reads_them():
    symbols = model_symbols(2, 1)
    assert [s.label for s in (*symbols.variables, *symbols.p)] == ["x[0]", "x[1]", "t", "p[0]"]
    assert trace(lambda t, x, p: (p.k * x.a + t, 1), NAMES, ("k",)) == [
        symbols.p[0] * symbols.x[0] + symbols.t,
        number(1),
    ]


def fails(function, text, state=NAMES):
    with pytest.raises(TraceError, match=text) as caught:
        trace(function, state, ())
    assert isinstance(caught.value, ModelError)


def test_what_cannot_be_traced_is_told():
    fails(
        lambda t, x, p: (x.a if x.a > 0 else x.b,),
        r"branch cannot be traced: in place of ``x.a if x.a > 0 else x.b``",
    )
    fails(lambda t, x, p: (max(x.a, 0),), r"np.maximum")
    fails(lambda t, x, p: (math.sin(x.a),), r"use np.sin in place of math.sin")
    fails(lambda t, x, p: (range(x.a),), "a number is needed")
    fails(lambda t, x, p: (np.spacing(x.a),), "np.spacing cannot be traced")
    fails(lambda t, x, p: ("a",), "'a' is not a number")
    fails(lambda t, x, p: (np.where(x.a > 0),), "np.where needs both values")
    fails(lambda t, x, p: np.linalg.inv(np.outer(x, x)), "Error", state=2)
    fails(lambda t, x, p: (x.a / 0,), "not a real number")


@pytest.mark.parametrize("x", [-2.0, 0.25, 3.0])
def test_piecewise_with_and_without_a_default(x):
    def with_default(a, b):
        return np.piecewise(a, [a < 0, a > 1], [lambda z: -z, lambda z: z * z, 7.0])

    def without(a, b):
        return np.piecewise(a, [a < 0, a > 1], [lambda z: -z, lambda z: z * z])

    for function in (with_default, without):
        found = values_of(traced_scalar(function), [x, 0.0])
        assert found[0] == function(np.array([x]), None)[0]


def test_a_traced_number_is_real():
    expressions = trace(
        lambda t, x, p: (x.a.real, x.b * x.a.imag, x.a.conjugate(), np.imag(x.a) + np.real(x.b)), NAMES, ()
    )
    a, b = model_symbols(2, 0).x
    assert expressions == [a, 0, a, b]
