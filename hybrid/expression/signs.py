"""Simplification of kinks and choices that are decided within a mode, where guards keep their sign."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid.expression.graph import (
    MOST_EXPANDED,
    contains,
    is_larger_than,
    rewritten,
    with_arguments,
)
from hybrid.expression.nodes import ONE, ZERO, Expression, number
from hybrid.expression.operations import Absolute, Less, LessEqual, Maximum, Minimum, Select, Sign, Step
from hybrid.expression.polynomials import coefficients_of

SWITCHES = (Maximum, Minimum, Absolute, Sign, Step, Select)


def simplified(expression: Expression, known: Sequence[Expression]) -> Expression:
    """The expression, simplified by the fact that everything in ``known`` is positive or zero."""
    if not contains(expression, SWITCHES):
        return expression
    return rewritten(expression, lambda node, args: _decided(node, args, known))


def _decided(node: Expression, args: list[Expression], known: Sequence[Expression]) -> Expression:
    """A node with new arguments, simplified if its sign or its choice is known."""
    if isinstance(node, Maximum | Minimum):
        a, b = args
        sign = sign_of(a - b, known) * (1 if isinstance(node, Maximum) else -1)
        if sign:
            return a if sign > 0 else b
    if isinstance(node, Absolute | Sign | Step):
        sign = sign_of(args[0], known)
        if sign:
            if isinstance(node, Absolute):
                return sign * args[0]
            return number(sign) if isinstance(node, Sign) else ONE if sign > 0 else ZERO
    if isinstance(node, Select) and isinstance(args[0], Less | LessEqual):
        a, b = args[0].args
        sign = sign_of(b - a, known)
        if sign:
            return args[1] if sign > 0 else args[2]
    return with_arguments(node, args)


def sign_of(expression: Expression, known: Sequence[Expression]) -> int:
    """1 if an expression is in ``known``, -1 if its negative is, else 0."""
    if is_larger_than(MOST_EXPANDED, expression):
        return 0
    terms = coefficients_of(expression) if known else {}
    for positive in known:
        others = coefficients_of(positive)
        if terms.keys() != others.keys():
            continue
        for sign in (1, -1):
            if all(factor == sign * others[term] for term, factor in terms.items()):
                return sign
    return 0
