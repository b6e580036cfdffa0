"""Proof that expressions have a given period in time."""

from __future__ import annotations

import math
from collections.abc import Iterable

from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import mentions, once
from hybrid.expression.nodes import Expression, Symbol, number
from hybrid.expression.operations import Cos, Remainder, Sin, Tan
from hybrid.expression.polynomials import ratio

# A number of periods this close to an integer (relative) counts as an integer: it has been rounded.
WHOLE = 1e-13


def is_periodic(expressions: Iterable[Expression], t: Symbol, period: Expression) -> bool:
    """Whether expressions are proved to have a period in ``t``, an expression of the parameters.

    The proof covers expressions in which time enters only through harmonics or remainders that have the
    period. Other expressions may have the period, too: only the numerical check can tell.
    """
    return all(_proved(expression, t, period) for expression in expressions)


@once
def _proved(expression: Expression, t: Symbol, period: Expression) -> bool:
    if not mentions(expression, (t,)):
        return True
    if expression.is_symbol:
        return False
    turn: Expression | None = None
    if isinstance(expression, Sin | Cos):
        turn = number(2.0 * math.pi)
    elif isinstance(expression, Tan):
        turn = number(math.pi)
    elif isinstance(expression, Remainder) and not mentions(expression.args[1], (t,)):
        turn = expression.args[1]
    if turn is not None and _is_whole_in(expression.args[0], t, period, turn):
        return True
    return all(_proved(argument, t, period) for argument in expression.args)


@once
def _is_whole_in(angle: Expression, t: Symbol, period: Expression, turn: Expression) -> bool:
    """Whether an angle advances by a whole number of turns in a period."""
    slope = derivative(angle, t)
    turns = None if mentions(slope, (t,)) else ratio(slope * period, turn)
    if turns is None:
        return False
    count = float(turns)
    return abs(count - round(count)) <= WHOLE * abs(count)
