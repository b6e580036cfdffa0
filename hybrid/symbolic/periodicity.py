"""Proof that expressions have a given period in time."""

from __future__ import annotations

from collections.abc import Iterable

import sympy

from hybrid.symbolic.expressions import Remainder
from hybrid.symbolic.nodes import mentions

# A number of periods this close to an integer (relative) counts as an integer: it has been rounded.
WHOLE = 1e-13


def is_periodic(expressions: Iterable[sympy.Expr], t: sympy.Symbol, period: sympy.Expr) -> bool:
    """Whether expressions are proved to have a period in ``t``, an expression of the parameters.

    The proof covers expressions in which time enters only through harmonics or remainders that have the
    period. Other expressions may have the period, too: only the numerical check can tell.
    """
    return all(_proved(expression, t, period) for expression in expressions)


def _proved(expression: sympy.Expr, t: sympy.Symbol, period: sympy.Expr) -> bool:
    if not mentions(expression, (t,)):
        return True
    if expression.is_Symbol:
        return False
    turn = None
    if isinstance(expression, sympy.sin | sympy.cos):
        turn = 2 * sympy.pi
    elif isinstance(expression, sympy.tan):
        turn = sympy.pi
    elif isinstance(expression, Remainder) and not mentions(expression.args[1], (t,)):
        turn = expression.args[1]
    if turn is not None:
        slope = expression.args[0].diff(t)
        if not mentions(slope, (t,)) and _is_whole(sympy.cancel(slope * period / turn)):
            return True
    return all(_proved(argument, t, period) for argument in expression.args)


def _is_whole(turns: sympy.Expr) -> bool:
    if not turns.is_number:
        return False
    number = float(turns)
    return abs(number - round(number)) <= WHOLE * abs(number)
