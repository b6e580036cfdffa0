"""Expressions written out as polynomials, and what these prove: equality, constant ratios.

Powers of sums, and functions, count as variables of their own, with their arguments written out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hybrid.expression.graph import in_order, is_positive, is_whole, mentions, once
from hybrid.expression.nodes import ONE, Expression, Number, Symbol, add, multiply, split

Coefficients = dict[Expression, Any]
# A sum of floats that is this small a share of its terms is their rounding.
ROUNDING = 1e-14


@once
def coefficients_of(expression: Expression) -> Mapping[Expression, Any]:
    """The numbers in front of the products in an expression that is written out; ``ONE`` has the constant.

    The time grows with the number of terms: callers ask for the size of the expression first.
    """
    known: dict[Expression, Coefficients] = {}
    for each in in_order([expression]):
        known[each] = _written_out(each, known)
    return {product: factor for product, factor in known[expression].items() if factor != 0}


def _written_out(node: Expression, known: Mapping[Expression, Coefficients]) -> Coefficients:
    if not node.args:
        return {ONE: node.value} if isinstance(node, Number) else {node: 1}
    if node.is_sum:
        total: Coefficients = {}
        for each in node.args:
            for product, factor in known[each].items():
                _count(total, product, factor)
        return total
    if node.is_product:
        made: Coefficients = {ONE: 1}
        for each in node.args:
            made = _multiplied(made, known[each])
        return made
    if node.is_power and is_whole(node.exponent) and is_positive(node.exponent) and len(known[node.base]) > 1:
        made = {ONE: 1}
        for _ in range(node.exponent.value):
            made = _multiplied(made, known[node.base])
        return made
    factor, rest = split(node.rebuilt([_summed(known[each]) for each in node.args]))
    if rest.is_sum:
        return dict(coefficients_of(multiply(Number(factor), rest)))
    return {rest: factor}


def _multiplied(one: Coefficients, other: Coefficients) -> Coefficients:
    total: Coefficients = {}
    for a, by in one.items():
        for b, factor in other.items():
            number, product = split(multiply(a, b))
            _count(total, product, number * by * factor)
    return total


def _count(total: Coefficients, product: Expression, factor: Any) -> None:
    before = total.get(product, 0)
    after = before + factor
    total[product] = 0 if abs(after) <= ROUNDING * abs(before) else after


def _summed(coefficients: Mapping[Expression, Any]) -> Expression:
    return add(*(multiply(Number(factor), product) for product, factor in coefficients.items()))


def expanded(expression: Expression) -> Expression:
    """The expression with its products written out."""
    return _summed(coefficients_of(expression))


def is_zero(expression: Expression) -> bool:
    """Whether an expression vanishes once it is written out."""
    return not coefficients_of(expression)


def ratio(one: Expression, other: Expression, variables: Iterable[Symbol] | None = None) -> Expression | None:
    """The factor, free of the variables, by which one expression is a multiple of another; None for none.

    Without ``variables`` it must be a number.
    """
    if one is other:
        return ONE
    above, below = (_by_products(each, variables) for each in (one, other))
    if above.keys() != below.keys() or not below:
        return None
    leading = next(iter(below))
    for product, factor in below.items():
        if not is_zero(above[product] * below[leading] - above[leading] * factor):
            return None
    return above[leading] / below[leading]


def _by_products(expression: Expression, variables: Iterable[Symbol] | None) -> dict[Expression, Expression]:
    """The factors in front of the products of variables; all symbols are variables if none are given."""
    found: dict[Expression, list[Expression]] = {}
    own = None if variables is None else [*variables]
    for product, factor in coefficients_of(expression).items():
        parts = product.args if product.is_product else (product,)
        moving = [each for each in parts if each is not ONE and (own is None or mentions(each, own))]
        free = [each for each in parts if each not in moving]
        found.setdefault(multiply(*moving), []).append(multiply(Number(factor), *free))
    return {product: add(*factors) for product, factors in found.items()}
