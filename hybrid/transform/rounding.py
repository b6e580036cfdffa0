"""Sums of fields whose terms cancel up to the rounding of their numbers."""

from __future__ import annotations

from collections import defaultdict

import sympy

# A number smaller than this fraction of the numbers it is the sum of is their rounding.
ROUNDING = 1e-13


def combined(*terms: tuple[int, sympy.Expr]) -> sympy.Expr:
    """The sum of expressions, each with its sign, without the products of which only rounding is left.

    The numbers of the corners of a field are sums themselves: ``0.1 + 0.2 - 0.3`` is not zero.
    """
    totals: dict[sympy.Expr, sympy.Expr] = defaultdict(lambda: sympy.Integer(0))
    sizes: dict[sympy.Expr, float] = defaultdict(float)
    for sign, expression in terms:
        for term in sympy.Add.make_args(expression.expand()):
            number, rest = term.as_coeff_Mul()
            totals[rest] += sign * number
            sizes[rest] += abs(float(number))
    # What is no number, as infinity less infinity, stays.
    left = (total * rest for rest, total in totals.items() if not abs(float(total)) <= ROUNDING * sizes[rest])
    return sympy.Add(*left)
