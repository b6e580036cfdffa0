"""Expressions: equal ones are one object, and simplification keeps values."""

import math
import pickle
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, compile_system, simulate
from hybrid.expression.graph import nodes
from hybrid.expression.nodes import HALF, NAN, ONE, ZERO, Number, Symbol, add, multiply, number, power
from hybrid.expression.operations import Absolute, Sin, sqrt
from tests.hybrid.expression.formulas import (
    X,
    Y,
    Z,
    anything,
    at,
    expression_of,
    formulas,
    places,
    plainly,
    polynomials,
)

ROUNDS = 40


@settings(max_examples=300)
@given(anything, places)
def test_simplification_keeps_values(formula, place):
    wanted = plainly(formula, place)
    assume(abs(wanted) < 1e6)
    assert at([expression_of(formula)], place) == pytest.approx([wanted], rel=1e-9, abs=1e-9)


@given(anything, anything)
def test_equal_expressions_are_one_object(one, other):
    a, b = map(expression_of, (one, other))
    assert expression_of(one) is a
    assert a + b is b + a
    assert a * b is b * a
    assert -(a - b) is b - a
    assert a - a is a * 0 is ZERO
    assert a.is_sum or a + a is 2 * a
    assert a + ZERO is a * ONE is a / ONE is a**1 is -1 * (-a) is a


# Exact numbers, and no signs: those of sums stay within products.
GROWING = {
    1: (lambda a: a**2, lambda a: a**3, lambda a: (1 + a) ** Fraction(1, 3) if a in (X, Y) else a / 3),
    2: (lambda a, b: a + b, lambda a, b: a * b, lambda a, b: 2 * a / (1 + b) ** 2),
}
short = formulas(GROWING, numbers=(2, 3, Fraction(1, 2)), most=5)


@given(short, short, short)
def test_brackets_do_not_matter(one, other, third):
    a, b, c = map(expression_of, (one, other, third))
    assert (a + b) + c is a + (b + c) is add(a, b, c)
    assert (a * b) * c is a * (b * c) is multiply(a, b, c)


@given(polynomials, polynomials)
def test_what_is_divided_by_itself_is_one(one, other):
    a, b = map(expression_of, (one, other))
    assert a is ZERO or a / a is a**0 is ONE
    assert a is ZERO or b * a / a is b


@given(anything)
def test_a_pickled_expression_is_the_same_object(formula):
    expression = expression_of(formula)
    assert pickle.loads(pickle.dumps(expression)) is expression
    assert expression.rebuilt(expression.args) is expression if expression.args else True


def test_threads_make_one_object():
    def made(k):
        return [Sin(X + i) * Symbol(f"thread{i}") for i in range(200)]

    with ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(made, range(4))
    assert all(a is b for other in others for a, b in zip(first, other, strict=True))


def test_symbols_that_are_positive_are_others():
    assert Symbol("u", positive=True) is Symbol("u", positive=True) is not Symbol("u")
    assert (Symbol("u", positive=True) ** Y) ** HALF is Symbol("u", positive=True) ** (Y / 2)


class TestNumbers:
    @pytest.mark.parametrize(
        ("value", "exact"),
        [
            *((2.0, True), (-0.125, True), (1.5, True), (7, True), (Fraction(1, 3), True), (-0.0, True)),
            *((0.1, False), (1 / 16, False), (2.0**50, False), (3**40, False), (Fraction(1, 3**40), False)),
        ],
    )  # fmt: skip
    def test_eighths_and_short_fractions_are_exact(self, value, exact):
        made = number(value)
        assert made.is_exact is exact
        assert float(made) == float(value)
        assert number(np.float64(value)) is number(float(value))
        assert exact or number(float(value)) is made

    def test_infinities_and_nan(self):
        assert number(math.inf) is number(math.inf) is -number(-math.inf)
        assert number(math.nan) is NAN is number(math.inf) - number(math.inf)
        assert NAN.value != NAN

    def test_they_compare_as_numbers_do(self):
        assert number(0.5) == HALF == 0.5
        assert number(1) == True  # noqa: E712
        assert X != 1

    def test_arithmetic(self):
        assert number(1) / 3 + number(1) / 6 is HALF
        assert number(2) ** 10 is number(1024)
        assert (number(2) ** -2).value == Fraction(1, 4)
        assert (number(2) ** HALF).value == math.sqrt(2.0)
        assert number(-8) ** Fraction(1, 3) is NAN
        assert number(10) ** 400 is number(math.inf)


class TestPowers:
    @pytest.mark.parametrize(
        ("base", "exponent", "expected"),
        [
            (X, HALF, sqrt(X)),
            (X**2, HALF, Absolute(X)),
            (X**2, Fraction(3, 2), Absolute(X) ** 3),
            (X**4, HALF, X**2),
            (X**2, Fraction(1, 3), Absolute(X) ** Fraction(2, 3)),
            (X**2, 3, X**6),
            (X**3, HALF, sqrt(X**3)),
            (4 * X**2, HALF, 2 * Absolute(X)),
            (X**2 * Y, HALF, Absolute(X) * sqrt(Y)),
            (X**2 * Y**2, HALF, Absolute(X) * Absolute(Y)),
            (X**2 * Y, 2, X**4 * Y**2),
            (Absolute(X), 2, X**2),
        ],
    )
    def test_roots_of_even_powers_are_those_of_absolute_values(self, base, exponent, expected):
        assert power(base, number(exponent) if isinstance(exponent, int | Fraction) else exponent) is expected

    @pytest.mark.parametrize("exponent", [HALF, Fraction(1, 3), Fraction(3, 2), Fraction(-1, 2)])
    @pytest.mark.parametrize("base", [X**2 * Y, 4 * X**2 * Y, 9 * X**2, X**2 * Y**4, 5 * Y, -X * Y, -3 * X])
    def test_values_stay(self, base, exponent):
        for place in ((1.5, 2.5, 0.0), (-1.5, 2.5, 0.0)):
            [below, made] = at([base, base**exponent], place)
            assert not below > 0 or made == pytest.approx(below ** float(number(exponent)), rel=1e-14)

    def test_of_zero(self):
        assert at([ZERO**X, ZERO**Y, ZERO**Z], (2.0, 0.0, -1.0)) == [0.0, 1.0, math.inf]
        assert ZERO**2 is ZERO

    def test_of_products_that_would_leave_the_range(self):
        """``(x/50)**200`` stays a power of the quotient; a short one comes apart."""
        assert at([(X / 50) ** 200, (X / 50) ** -200], (50.0, 0.0, 0.0)) == [1.0, 1.0]
        assert (X / 50) ** 2 is X**2 / 2500
        assert at([(number(2.0**300) * X) ** 2], (2.0**-300, 0.0, 0.0)) == [1.0]


def nested(value):
    """An expression of 2^40 branches."""
    for _ in range(ROUNDS):
        value = Sin(value) + 0.6 * value
    return value


def test_forty_rounds_are_two_hundred_nodes():
    expression = nested(X)
    assert len([*nodes(expression)]) < 5 * ROUNDS
    is_the_same = nested(X) is expression and pickle.loads(pickle.dumps(expression)) is expression
    assert is_the_same
    long = add(*(Number(k) * Symbol(f"x[{k}]") for k in range(1, 5000)))
    assert long - long is ZERO


def rounds(value):
    for _ in range(ROUNDS):
        value = 0.6 * np.sin(value) + 0.4 * value
    return value


@pytest.mark.parametrize("where", ["field", "guard", "reset", "condition"])
def test_a_model_whose_function_uses_its_result_twice_forty_times(where):
    """The function is traced and computes the same as Python."""
    deep = {where: rounds}

    def of(name, value, plain):
        return deep[name](value) if name in deep else plain

    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("swing", lambda t, x, p: (x.v, of("field", 0.01 * x.q, 0.0) - x.q))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(
                    lambda t, x, p: of("guard", 0.1 * x.q, x.q),
                    -1,
                    when=lambda t, x, p: of("condition", x.q, 0.0) > -9.0,
                ),
                Reset(lambda t, x, p: (x.q, of("reset", 0.01 * x.v, 0.0) - 0.8 * x.v)),
            )
        ],
    )
    assert all(compile_system(system).emitted.traced_field)
    arc = simulate(system, (1.0, 0.3), (0.0, 4.0), tangent=True)
    assert arc.status.ok
    assert len(arc.jumps) > 0
    np.testing.assert_allclose(arc.jumps.x_minus[:, 0], 0.0, atol=1e-9)


def root_of_cubic(value):
    """``z**3 + z = value`` by Newton's method."""
    z = value
    for _ in range(12):
        z = z - (z**3 + z - value) / (3 * z * z + 1)
    return z


def test_a_model_that_solves_an_equation_in_its_field():
    """Twelve rounds of a quotient, each five times as many branches as the round before."""
    system = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -root_of_cubic(x.q)))])
    arc = simulate(system, (0.4, 0.6), (0.0, 2.0), tangent=True)
    # The energy, with the potential as an integral over z.
    z = root_of_cubic(arc.x[:, 0])
    energy = 0.5 * arc.x[:, 1] ** 2 + 0.75 * z**4 + 0.5 * z**2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    assert np.isclose(np.linalg.det(arc.fundamental), 1.0, rtol=1e-9)
