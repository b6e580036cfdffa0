"""Proof that expressions have a given period in time."""

from __future__ import annotations

from collections.abc import Iterable

import sympy

from hybrid.symbolic.derivatives import partial_derivatives
from hybrid.symbolic.expressions import Remainder
from hybrid.symbolic.nodes import mentions, once

# A number of periods this close to an integer (relative) counts as an integer: it has been rounded.
WHOLE = 1e-13


def is_periodic(expressions: Iterable[sympy.Expr], t: sympy.Symbol, period: sympy.Expr) -> bool:
    """Whether expressions are proved to have a period in ``t``, an expression of the parameters.

    The proof covers expressions in which time enters only through harmonics or remainders that have the
    period. Other expressions may have the period, too: only the numerical check can tell.
    """
    return all(_proved(expression, t, period) for expression in expressions)


@once
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
    if turn is not None and _is_whole_in(expression.args[0], t, period, turn):
        return True
    return all(_proved(argument, t, period) for argument in expression.args)


@once
def _is_whole_in(angle: sympy.Expr, t: sympy.Symbol, period: sympy.Expr, turn: sympy.Expr) -> bool:
    """Whether an angle advances by a whole number of turns in a period."""
    [[slope]] = partial_derivatives([angle], [t])
    if mentions(slope, (t,)):
        return False
    turns = slope * period / turn
    # Mostly the parameters cancel at once, and polynomials need not be asked.
    return _is_whole(turns if turns.is_number else sympy.cancel(turns))


def _is_whole(turns: sympy.Expr) -> bool:
    if not turns.is_number:
        return False
    number = float(turns)
    return abs(number - round(number)) <= WHOLE * abs(number)
