"""The library's own functions of SymPy's expressions."""

import math
from itertools import product as product_of

import numpy as np
import pytest
import sympy

from hybrid.symbolic import expressions
from hybrid.symbolic.expressions import (
    ONE,
    ZERO,
    Absolute,
    And,
    Atan2,
    Ceiling,
    CubeRoot,
    Equal,
    Floor,
    Gate,
    Less,
    LessEqual,
    Maximum,
    Minimum,
    Not,
    Or,
    Remainder,
    Select,
    Sign,
    Step,
    Together,
    Truncate,
    TruncatedRemainder,
    close_gates,
    defined_at_origin,
    hypot,
    product,
)

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


FUNCTIONS = {
    Floor: (np.floor, 1),
    Ceiling: (np.ceil, 1),
    Truncate: (np.trunc, 1),
    Sign: (np.sign, 1),
    Step: (lambda u: np.heaviside(u, 0.5), 1),
    Absolute: (np.abs, 1),
    CubeRoot: (np.cbrt, 1),
    Not: (lambda a: float(not a), 1),
    Less: (lambda a, b: float(a < b), 2),
    LessEqual: (lambda a, b: float(a <= b), 2),
    Equal: (lambda a, b: float(a == b), 2),
    And: (lambda a, b: float(np.logical_and(a, b)), 2),
    Or: (lambda a, b: float(np.logical_or(a, b)), 2),
    Maximum: (np.maximum, 2),
    Minimum: (np.minimum, 2),
    Remainder: (np.mod, 2),
    TruncatedRemainder: (np.fmod, 2),
    Atan2: (np.arctan2, 2),
    Select: (lambda c, a, b: float(np.where(c, a, b)), 3),
}
PLACES = (-1.7, -0.6, 0.0, 0.45, 1.3)


@pytest.mark.parametrize("kind", FUNCTIONS)
def test_values_are_those_of_numpy(kind):
    function, arity = FUNCTIONS[kind]
    for place in product_of(PLACES, repeat=arity):
        if kind in (Remainder, TruncatedRemainder) and place[1] == 0.0:
            assert math.isnan(float(kind(*map(sympy.Float, place))))
            continue
        assert float(kind(*map(sympy.Float, place))) == pytest.approx(float(function(*place)), abs=1e-15)


@pytest.mark.parametrize("kind", FUNCTIONS)
def test_slopes_are_those_of_the_function(kind):
    """Central differences at places that are no kinks."""
    function, arity = FUNCTIONS[kind]
    symbols = sympy.symbols(f"x:{arity}", real=True)
    steps = 1e-5 * np.eye(arity)
    for place in product_of((-1.7, -0.6, 0.45, 1.3), repeat=arity):
        if len(set(place)) < arity:
            continue
        for symbol, step in zip(symbols, steps, strict=True):
            slope = kind(*symbols).diff(symbol).subs(dict(zip(symbols, place, strict=True))).doit()
            ahead, behind = function(*(place + step)), function(*(place - step))
            assert float(slope) == pytest.approx(float(ahead - behind) / 2e-5, abs=1e-8)


def test_slope_of_an_absolute_value_at_its_kink():
    assert Absolute(x).diff(x).subs(x, 0.0) == 0


def test_connectives_decide_as_far_as_numbers_do():
    truth, number_two = Less(x, y), sympy.Float(2)
    assert And(ZERO, x) == And(x, ZERO) == 0
    assert And(number_two, truth) == And(truth, ONE) == truth
    assert Or(number_two, x) == Or(x, ONE) == 1
    assert Or(ZERO, truth) == Or(truth, ZERO) == truth
    # What is not 0 or 1 is made so.
    assert isinstance(And(ONE, x), And)
    assert isinstance(Or(ZERO, x), Or)
    assert isinstance(And(truth, x), And)
    assert Select(truth, x, x) == x
    assert Select(number_two, x, y) == x
    assert Select(ZERO, x, y) == y


@pytest.mark.parametrize(
    ("slope", "at_origin"),
    [
        (x / hypot(x, y), 0.0),
        (x * y / hypot(x, y), 0.0),
        (x / sympy.sqrt(x**2 + y**2), 0.0),
        (x / sympy.sqrt(x**2 + 3 * y**4), 0.0),
    ],
)
def test_slopes_of_lengths_are_zero_at_the_origin(slope, at_origin):
    made = defined_at_origin(slope)
    for a, b in ((0.3, -0.4), (-2.0, 1.0)):
        there = {x: a, y: b}
        assert float(made.subs(there).doit()) == pytest.approx(float(slope.subs(there).doit()), rel=1e-14)
    assert float(made.subs({x: 0.0, y: 0.0}).doit()) == at_origin


@pytest.mark.parametrize(
    "other",
    [
        x / sympy.sqrt(x**2 - y**2),
        x / sympy.sqrt(x**2 + y),
        x / sympy.sqrt(x**2 + y**3),
        x / (x**2 + y**2),
        x / hypot(x, y) ** 2,
        x * sympy.sqrt(x**2 + y**2),
    ],
)
def test_other_powers_stay_as_they_are(other):
    assert defined_at_origin(other) == other


def test_products_are_zero_where_a_factor_switches_them_off():
    steep = x ** sympy.Rational(-3, 4)
    assert close_gates(Step(x) * steep) == Gate(x, steep)
    assert close_gates(2 * Step(y) * x) == Gate(y, 2 * x)
    assert close_gates(Step(x)) == Step(x)
    assert close_gates(Step(x) * Step(y)) in (Gate(x, Step(y)), Gate(y, Step(x)))
    choice = Select(Less(x, y), ZERO, y)
    assert close_gates(choice * steep) == Select(Less(x, y), ZERO, y * steep)
    other = Select(Less(x, y), x, ZERO)
    assert close_gates(other * steep) == Select(Less(x, y), x * steep, ZERO)
    open_choice = Select(Less(x, y), x, y)
    assert close_gates(open_choice * steep) == open_choice * steep
    assert close_gates(1 + Step(x) * steep) == 1 + Gate(x, steep)
    plain = x * y
    assert close_gates(plain) is plain


def test_all_functions_are_real():
    """Roots of their squares, say, are their absolute values, not complex numbers."""
    found = [each for each in vars(expressions).values() if isinstance(each, type)]
    classes = [each for each in found if issubclass(each, expressions.RealFunction)]
    assert len(classes) > 15
    for each in classes:
        assert each.is_real, each
    for each in (Absolute(x), Maximum(x, y), Floor(x), Select(x, y, x), Less(x, y)):
        assert each.is_real
        assert not each.is_zero


def test_products_of_products_with_numbers_beyond_the_range_stay_apart():
    """2^600 times 2^-600 is computed factor by factor: neither number leaves the range."""
    large, small = sympy.Mul(sympy.Integer(2) ** 400, x), sympy.Mul(sympy.Integer(2) ** 300, y)
    made = product(large, small)
    assert set(made.args) == {Together(large), Together(small)}
    assert product(large, y) == sympy.Mul(large, y)
    # A factor that is no product needs nothing that holds it together.
    assert set(product(large, sympy.Integer(2) ** 300).args) == {Together(large), sympy.Integer(2) ** 300}
    # So do powers that would be collected.
    one, other = x**9 * y, x**10 * y
    assert set(product(one, other).args) == {Together(one), Together(other)}


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
