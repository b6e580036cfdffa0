"""Queries on expressions have the answers of a walk through the tree, and visit each node once."""

from fractions import Fraction

import pytest
from hypothesis import given

from hybrid.expression.graph import (
    all_replaced,
    contains,
    degree_of,
    is_larger_than,
    mentions,
    nodes,
    nodes_of,
    replaced,
    symbols_of,
)
from hybrid.expression.nodes import Sum, number
from hybrid.expression.operations import Absolute, Cos, Maximum, Sin, Tanh
from tests.hybrid.expression.formulas import X, Y, Z, anything, at, expression_of, places, polynomials

KINDS = (Sin, Absolute, Maximum, Tanh)


def tree(expression):
    """Every node of the tree, as often as it occurs."""
    return [expression, *(each for part in expression.args for each in tree(part))]


@given(anything)
def test_answers_are_those_of_a_walk_through_the_tree(formula):
    expression = expression_of(formula)
    found = tree(expression)
    assert len([*nodes(expression)]) == len({*nodes(expression)})
    assert {*nodes(expression)} == {*found}
    assert symbols_of(expression) == {each for each in found if each.is_symbol}
    assert mentions(expression, (X, Y)) == (X in found or Y in found)
    assert contains(expression, KINDS) == any(isinstance(each, KINDS) for each in found)
    assert nodes_of((Sin, Sum), expression) == {each for each in found if isinstance(each, Sin | Sum)}
    assert expression.size == sum(max(1, len(each.args) - 1) for each in found if each.args)
    assert is_larger_than(expression.size - 1, expression) is not is_larger_than(expression.size, expression)


@given(anything, anything, places)
def test_what_is_replaced_has_the_value_of_the_new_part(formula, other, place):
    expression, new = expression_of(formula), expression_of(other)
    [inner] = at([new], place)
    [wanted] = at([expression], (inner, place[1], 3.0))
    [found] = at([replaced(expression, {X: new, Z: number(3)})], place)
    assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9) or not abs(wanted) < 1e6
    assert replaced(expression, {}) is expression


def test_parts_are_replaced_from_the_top():
    shared = Sin(X * Y)
    found = all_replaced([shared + X, Cos(shared) * shared], {shared: Z, X: Y, Y: X})
    assert found == [Z + Y, Cos(Z) * Z]


@pytest.mark.parametrize(
    ("expression", "degree"),
    [
        (Z**2, 0),
        (X, 1),
        (X + Y * Z, 1),
        (3 * X * Y**2 + Y, 3),
        ((X * Y + 1) ** 4, 8),
        (X * Sin(Z), 1),
        (Sin(X) + Y, None),
        (Y / X, None),
        (X ** Fraction(1, 2), None),
        (Z**X, None),
    ],
)
def test_degrees(expression, degree):
    assert degree_of(expression, frozenset((X, Y))) == degree


@given(polynomials)
def test_a_degree_bounds_the_growth_of_a_polynomial(formula):
    expression = expression_of(formula)
    degree = degree_of(expression, frozenset((X, Y)))
    low, high = (abs(each) for far in (1e3, 1e6) for each in at([expression], (far, -0.7 * far, 0.3)))
    assert high <= 2e3**degree * max(low, 1.0) * 1.1


def test_a_query_of_a_deep_graph_takes_no_longer_than_its_nodes():
    value = X
    for _ in range(3000):
        value = Sin(value) + number(0.5) * value
    assert not mentions(value, (Y,))
    assert symbols_of(value) == {X}
    assert is_larger_than(10**6, value)
    is_the_same = replaced(replaced(value, {X: Y}), {Y: X}) is value
    assert is_the_same
