"""Simplification of kinks and choices that are decided within a mode, where guards keep their sign."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import sympy

from hybrid.symbolic.expressions import Absolute, Less, LessEqual, Maximum, Minimum, Select, Sign, Step
from hybrid.symbolic.nodes import MOST_EXPANDED, contains, expanded, interned, is_larger_than

# Expressions whose terms are remembered: they are compared with every guard.
MOST_REMEMBERED = 4096


def simplified(expression: sympy.Expr, known: Sequence[sympy.Expr]) -> sympy.Expr:
    """The expression, simplified by the fact that everything in ``known`` is positive or zero."""
    return interned(_simplified(expression, known, {}))


def _simplified(
    node: sympy.Expr, known: Sequence[sympy.Expr], made: dict[sympy.Expr, sympy.Expr]
) -> sympy.Expr:
    if not contains(node, (Maximum, Minimum, Absolute, Sign, Step, Select)):
        return node
    if node not in made:
        args = [_simplified(each, known, made) for each in node.args]
        made[node] = _decided(node, args, known)
    return made[node]


def _decided(node: sympy.Expr, args: list[sympy.Expr], known: Sequence[sympy.Expr]) -> sympy.Expr:
    """A node with new arguments, simplified if its sign or its choice is known."""
    if isinstance(node, Maximum | Minimum):
        a, b = args
        sign = sign_of(a - b, known) * (1 if isinstance(node, Maximum) else -1)
        if sign:
            return a if sign > 0 else b
    if isinstance(node, Absolute | Sign | Step):
        sign = sign_of(args[0], known)
        if sign:
            absolute = sign * args[0]
            unit = sympy.Integer(sign) if isinstance(node, Sign) else sympy.Integer((sign + 1) // 2)
            return absolute if isinstance(node, Absolute) else unit
    if isinstance(node, Select) and isinstance(args[0], Less | LessEqual):
        a, b = args[0].args
        sign = sign_of(b - a, known)
        if sign:
            return args[1] if sign > 0 else args[2]
    return node.func(*args)


def sign_of(expression: sympy.Expr, known: Sequence[sympy.Expr]) -> int:
    """1 if an expression is in ``known``, -1 if its negative is, else 0."""
    if is_larger_than(MOST_EXPANDED, expression):
        return 0
    terms = _terms(expression)
    for positive in known:
        others = _terms(positive)
        if terms.keys() != others.keys():
            continue
        for sign in (1, -1):
            if all(factor == sign * others[term] for term, factor in terms.items()):
                return sign
    return 0


@lru_cache(MOST_REMEMBERED)
def _terms(expression: sympy.Expr) -> dict[sympy.Expr, sympy.Expr]:
    """Factors of the terms of an expanded expression; zeros are left out."""
    return {term: factor for term, factor in expanded(expression).as_coefficients_dict().items() if factor}
