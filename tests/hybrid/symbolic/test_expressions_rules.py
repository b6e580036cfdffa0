"""Numbers, products and powers of expressions, one by one."""

import math

import pytest
import sympy

from hybrid.symbolic import expressions
from hybrid.symbolic.expressions import ZERO, Absolute, Together

x, y = sympy.symbols("x y", real=True)


class TestNumbers:
    @pytest.mark.parametrize(
        ("value", "exact"),
        [
            (2.0, True),
            (-0.125, True),
            (1.5, True),
            (7, True),
            (0.1, False),
            (1 / 16, False),
            (2.0**50, False),
        ],
    )
    def test_multiples_of_an_eighth_are_exact(self, value, exact):
        made = expressions.number(value)
        assert made.is_Rational == exact
        assert float(made) == value
        assert expressions.number(float(value)) is made

    def test_infinities_and_nan(self):
        assert expressions.number(math.inf) == sympy.oo
        assert expressions.number(-math.inf) == -sympy.oo
        assert expressions.number(math.nan) is sympy.nan

    @pytest.mark.parametrize(
        ("expression", "digits"),
        [
            (sympy.Integer(8), 3.0),
            (sympy.Rational(-1, 8), 3.0),
            (sympy.Rational(3, 1024), 10.0),
            (8 * x, 3.0),
            (x, 0.0),
            (x * y, 0.0),
            (ZERO, 0.0),
            (sympy.Float(0.0), 0.0),
            (sympy.Float(2.0**-40), 40.0),
            (sympy.Float(2.0**40) * x, 40.0),
            (sympy.Float("1e400"), math.inf),
        ],
    )
    def test_binary_digits(self, expression, digits):
        assert expressions._digits(expression) == digits

    def test_high_powers(self):
        high = expressions.HIGHEST_SPLIT
        for factor, is_high in (
            (x, False),
            (x**high, False),
            (x ** (high + 1), True),
            (x ** -(high + 1), True),
            (x ** sympy.Rational(2 * high + 1, 2), True),
            (x ** sympy.Rational(2 * high - 1, 2), False),
            (x**y, False),
        ):
            assert expressions._is_high(factor) is is_high
        collects = expressions._collects_high_powers
        assert collects(x ** (high + 1) * y, (x**high, x * y))
        assert not collects(x ** (high + 1) * y, (x ** (high + 1), y))
        assert not collects(x**high * y, (x, x ** (high - 1) * y))
        # A sign is no factor.
        assert not collects(-(x ** (high + 1)), (x, -(x**high)))
        assert collects(2 * x ** (high + 1), (x, 2 * x**high))
        assert not collects(x ** (high + 1), (x, x**high))


class TestPowers:
    half, third = sympy.Rational(1, 2), sympy.Rational(1, 3)

    @pytest.mark.parametrize(
        ("base", "exponent", "expected"),
        [
            (x, sympy.Integer(3), x**3),
            (x, half, sympy.sqrt(x)),
            (x, y, x**y),
            # Roots of even powers are those of absolute values; whole powers of them need none.
            (x**2, half, Absolute(x)),
            (x**2, sympy.Rational(3, 2), Absolute(x) ** 3),
            (x**4, half, Absolute(x) ** 2),
            (x**2, third, Absolute(x) ** sympy.Rational(2, 3)),
            (x**2, sympy.Integer(3), x**6),
            (x**3, half, sympy.sqrt(x**3)),
            (4 * x**2, half, 2 * Absolute(x)),
            (x**2 * y, half, Absolute(x) * sympy.sqrt(y)),
            (x**2 * y**2, half, Absolute(x) * Absolute(y)),
            (x**2 * y, sympy.Integer(2), x**4 * y**2),
        ],
    )
    def test_of_even_powers(self, base, exponent, expected):
        assert expressions.power(base, exponent) == expected

    @pytest.mark.parametrize("exponent", [half, third, sympy.Rational(3, 2), sympy.Rational(-1, 2)])
    @pytest.mark.parametrize("base", [x**2 * y, 4 * x**2 * y, 9 * x**2, x**2 * y**4, 5 * y, x * y])
    def test_values_stay(self, base, exponent):
        made = expressions.power(base, exponent)
        for place in ({x: 1.5, y: 2.5}, {x: -1.5, y: 2.5}):
            below = base.subs(place)
            if below > 0:
                assert float(made.subs(place).doit()) == pytest.approx(float(below**exponent), rel=1e-14)

    def test_of_zero(self):
        made = expressions.power(ZERO, y)
        found = [made.subs(y, value).doit() for value in (2.0, 0.0, -1.0)]
        assert found == [0, 1, sympy.oo]
        assert expressions.power(ZERO, sympy.Integer(2)) == 0

    def test_of_products_that_would_leave_the_range(self):
        """``(t/50)**200`` stays a power of the quotient."""
        most = expressions.HIGHEST_SPLIT
        base = x / 50
        assert expressions.power(base, sympy.Integer(200)) == Together(base) ** 200
        assert expressions.power(base, sympy.Integer(-200)) == Together(base) ** -200
        assert expressions.power(base, sympy.Integer(most)) == base**most
        assert expressions.power(base, sympy.Integer(most + 1)) == Together(base) ** (most + 1)
        assert expressions.power(x, sympy.Integer(200)) == x**200
        large = 2**300 * x
        assert expressions.power(large, sympy.Integer(2)) == Together(large) ** 2
        assert expressions.power(2**200 * x, sympy.Integer(2)) == 2**400 * x**2

    def test_a_length(self):
        assert expressions.length(x, y) == sympy.sqrt(x**2 + y**2)
        assert expressions.quotient(x, y) == x / y
        for other, even in ((x**2, True), (x**-4, True), (x**3, False), (x, False), (x**half_of_y, False)):
            assert expressions._is_even_power(other) is even


half_of_y = y / 2


def test_the_text_of_what_stays_together():
    assert str(Together(x * y) ** 2) == "(x*y)**2"
    assert Together(sympy.Integer(3)) == 3
    assert Together(x * y).diff(x) == y
