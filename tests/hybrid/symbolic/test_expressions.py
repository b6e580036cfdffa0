"""The library's own functions of SymPy's expressions."""

import pytest
import sympy

from hybrid.symbolic.expressions import ONE, ZERO, Maximum, Minimum, product

x, y = sympy.symbols("x y", real=True)


def test_numbers_are_computed():
    two, three = sympy.Float(2), sympy.Float(3)
    assert Minimum(two, three) == 2
    assert Maximum(two, three) == 3


@pytest.mark.parametrize("kind", [Minimum, Maximum])
def test_slopes_at_a_tie_are_halves(kind):
    slopes = [kind(x, y).diff(each).subs({x: 1.0, y: 1.0}) for each in (x, y)]
    assert [float(slope) for slope in slopes] == [0.5, 0.5]
    low, high = (kind(x, y).diff(x).subs({x: value, y: 1.0}) for value in (0.0, 2.0))
    assert [float(low), float(high)] == ([1.0, 0.0] if kind is Minimum else [0.0, 1.0])


def test_a_product_is_sympys():
    for factors in ((sympy.Float(2), x), (x, sympy.Float(2)), (x, y), (ZERO, x), (ONE, x), (2 * x, 3 * y)):
        assert product(*factors) == sympy.Mul(*factors)
