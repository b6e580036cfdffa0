"""Expressions written out, and what that proves of them."""

import math
from fractions import Fraction

import pytest
from hypothesis import assume, given

from hybrid.expression.graph import mentions, terms_of
from hybrid.expression.nodes import ONE, ZERO, number
from hybrid.expression.operations import Exp, Sin
from hybrid.expression.polynomials import coefficients_of, expanded, is_zero, ratio
from tests.hybrid.expression.formulas import X, Y, Z, anything, at, expression_of, places, polynomials

# No polynomial with short coefficients vanishes here.
PLACE = (math.sqrt(2.0), -math.pi / 3, math.e / 5)


@given(anything, places)
def test_an_expression_that_is_written_out_keeps_its_value(formula, place):
    expression = expression_of(formula)
    wanted, found = at([expression, expanded(expression)], place)
    assert not abs(wanted) < 1e3 or found == pytest.approx(wanted, rel=1e-9, abs=1e-7)


@given(polynomials)
def test_a_polynomial_that_is_written_out_has_no_sums_within_products(formula):
    found = expanded(expression_of(formula))
    assert expanded(found) is found
    assert not any(part.is_sum for term in terms_of(found) for part in term.args)


@given(polynomials, polynomials)
def test_what_is_zero_has_the_value_zero_and_the_other_way_round(one, other):
    a, b = map(expression_of, (one, other))
    assert is_zero((a + b) ** 2 - a**2 - 2 * a * b - b**2)
    assert is_zero(a * (b - 1) - b * a + a)
    difference = a - b
    assert is_zero(difference) == (abs(at([difference], PLACE)[0]) < 1e-9 * (1 + abs(at([a], PLACE)[0])))


@given(polynomials, polynomials)
def test_ratios(one, other):
    a, b = map(expression_of, (one, other))
    assume(not is_zero(a))
    assert ratio(-3 * a, a) == -3
    assert ratio(a, Fraction(2, 3) * expanded(a)) is number(Fraction(3, 2))
    found = ratio(a, b)
    assert found is None or (found.is_number and is_zero(a - found * b))
    if mentions(a, (X,)) and not mentions(b, (X, Y)) and not is_zero(b):
        assert is_zero(ratio(a * b, a, (X, Y)) - b)


@pytest.mark.parametrize(
    ("one", "other", "variables", "found"),
    [
        (X, X, None, ONE),
        (Sin(X * (Y + 1)), Sin(X * Y + X), None, ONE),
        (2 * Exp(X) * Y, Exp(X) * Y, None, number(2)),
        (0.1 * X + 0.2 * X, X, None, number(0.1 + 0.2)),
        (X * Y, X, None, None),
        (X * Y, X, (X,), Y),
        (X * Y + Y, 2 * X + 2, (X,), Y / 2),
        (X * Y + Z, X + 1, (X,), None),
        (X + 1, X + 2, None, None),
        (X, ZERO, None, None),
        (ZERO, X, None, None),
    ],
)
def test_known_ratios(one, other, variables, found):
    assert ratio(one, other, variables) is found


def test_rounding_of_sums_counts_as_nothing():
    assert is_zero((X + 0.1) * (Y + 0.2) - X * Y - 0.2 * X - 0.1 * Y - 0.02)
    assert not is_zero(1e-20 * X)


def test_coefficients():
    found = coefficients_of((X + 2) * (X - 2) * Sin(Y) + 1)
    assert found == {X**2 * Sin(Y): 1, Sin(Y): -4, ONE: 1}
