"""Sums of fields whose terms cancel up to the rounding of their numbers."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from hybrid.expression.nodes import Expression, Number, add, multiply
from hybrid.expression.polynomials import coefficients_of

# A number smaller than this fraction of the numbers it is the sum of is their rounding.
ROUNDING = 1e-13


def combined(*terms: tuple[int, Expression]) -> Expression:
    """The sum of expressions, each with its sign, without the products of which only rounding is left.

    The numbers of the corners of a field are sums themselves: ``0.1 + 0.2 - 0.3`` is not zero.
    """
    totals: dict[Expression, Any] = defaultdict(int)
    sizes: dict[Expression, float] = defaultdict(float)
    for sign, expression in terms:
        for product, factor in coefficients_of(expression).items():
            totals[product] += sign * factor
            sizes[product] += abs(float(factor))
    # What is no number, as infinity less infinity, stays.
    left = (
        (total, each) for each, total in totals.items() if not abs(float(total)) <= ROUNDING * sizes[each]
    )
    return add(*(multiply(Number(total), each) for total, each in left))
