"""Expressions as model functions: on numbers, on traced numbers, and in other symbols."""

import pickle

import numpy as np
import pytest

from hybrid.expression.evaluation import expressed, scalar
from hybrid.expression.operations import Less, Select, Sin
from hybrid.expression.tracing import model_symbols, trace

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t
FUNCTIONS = {
    "smooth": lambda t, x, p: x[0] * x[1] - t / p[0] + x[0] ** 1.5 + np.exp(np.sin(x[1])) - np.pi,
    "kinks": lambda t, x, p: np.abs(x[1]) + 2 * np.maximum(x[0], x[1]) + np.hypot(x[0], x[1]) + np.cbrt(x[1]),
    "jumps": lambda t, x, p: np.sign(x[1]) + np.heaviside(x[0], 0.5) + 10 * np.ceil(x[1]) + np.mod(x[1], 0.4),
    "choices": lambda t, x, p: np.where((x[0] < x[1]) | (x[0] == t), 1.0, np.where(x[1] <= t, 2.0, 3.0)),
    "connectives": lambda t, x, p: np.where((x[0] > 0) & ~(x[1] > 0), x[0], x[1]),
}
PLACES = [(0.3, (0.45, -1.3), (1.7,)), (1.1, (0.8, 0.6), (2.5,))]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_on_numbers_they_are_the_function(name):
    function = FUNCTIONS[name]
    expressions = trace(lambda t, x, p: (function(t, x, [p.k]), x[0]), 2, ("k",))
    both, first = expressed(expressions), scalar(expressions[0])
    for t, x, p in PLACES:
        expected = float(function(np.float64(t), np.array(x), np.array(p)))
        found = both(np.float64(t), np.array(x), np.array(p))
        assert float(found[0]) == pytest.approx(expected, rel=1e-14)
        assert found[1] == x[0]
        assert float(first(np.float64(t), np.array(x), np.array(p))) == float(found[0])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_tracing_gets_the_expressions_themselves(name):
    expressions = trace(lambda t, x, p: (FUNCTIONS[name](t, x, [p.k]), x[0]), 2, ("k",))
    assert trace(expressed(expressions), 2, ("k",)) == expressions
    assert trace(lambda t, x, p: (scalar(expressions[0])(t, x, p),), 2, ("k",)) == expressions[:1]


def test_in_other_symbols_products_stay_products():
    """``3*(a - b)`` is exact where ``a - b`` is; ``3*a - 3*b`` is not."""
    [swapped] = trace(lambda t, x, p: expressed([3.0 * (Q - V)])(t, [x[1], x[0]], p), 2, ("k",))
    assert swapped is 3.0 * (V - Q)


def test_values_that_are_used_twice_are_computed_once():
    calls = []

    class Counted(np.ndarray):
        def __array_ufunc__(self, ufunc, method, *inputs, **options):
            calls.append(ufunc.__name__)
            plain = [np.asarray(each) if isinstance(each, Counted) else each for each in inputs]
            return np.asarray(getattr(ufunc, method)(*plain, **options)).view(Counted)

    shared = Sin(Q)
    function = expressed([shared + 1, shared * 2, Select(Less(Q, V), shared, Q)])
    place = np.array(0.5).view(Counted)
    function(0.0, [place, 0.25], [1.0])
    assert calls.count("sin") == 1


def test_a_pickled_function_has_the_same_expressions():
    function = expressed([Sin(Q) * K, Less(Q, V)])
    again = pickle.loads(pickle.dumps(function))
    assert again.expressions == function.expressions
    assert again(0.0, [0.5, 0.25], [2.0]) == function(0.0, [0.5, 0.25], [2.0])
