"""Expressions as model functions: on numbers, on traced numbers, and in other symbols."""

import pickle

import numpy as np
from hypothesis import given

from hybrid.expression.evaluation import expressed, scalar
from hybrid.expression.operations import Less, Select, Sin
from hybrid.expression.tracing import model_symbols, trace
from tests.hybrid.expression.formulas import anything, at, expression_of, places, smooth

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t


@given(anything, smooth, places)
def test_on_numbers_they_are_the_function_and_in_tracing_the_expressions(one, other, place):
    expressions = [*map(expression_of, (one, other))]
    both, first = expressed(expressions), scalar(expressions[0])
    point = 0.0, np.array(place[:2]), np.array(place[2:])
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(both(*point), at(expressions, place))
        np.testing.assert_array_equal(first(*point), both(*point)[0])
    assert trace(both, 2, ("k",)) == expressions
    assert trace(lambda t, x, p: (first(t, x, p),), 2, ("k",)) == expressions[:1]


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
