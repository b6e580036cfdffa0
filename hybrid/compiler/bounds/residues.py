"""Rates and guards whose terms in time and parameters alone may cancel: then only their rounding is left.

The speed of a guard that the state may rest on is such a rate: the force on a block, say, that sticks and is
about to let go. How large its rounding is shows neither in the rate, nor in the states, nor in the Jacobian.
Interval arithmetic on the rate shows it. The same goes for the guard at which the block lets go.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import attrs
import sympy

from hybrid.symbolic.nodes import mentions, nodes
from hybrid.symbolic.tracing import Symbols


@attrs.frozen
class Residue:
    """A rate, and the component of the state that it is the rate of."""

    expression: sympy.Expr
    component: int


def residues(
    field: Sequence[sympy.Expr] | None,
    gradients: Iterable[Sequence[sympy.Expr] | None],
    symbols: Symbols,
) -> tuple[Residue, ...]:
    """The rates of that kind that the guards of a mode feel, by their gradients.

    A field or a guard that was not traced comes as None; nothing is known of such a field, and such a guard
    feels every rate.
    """
    if field is None:
        return ()
    rows = list(gradients)
    return tuple(
        Residue(rate, i)
        for i, rate in enumerate(field)
        if any(row is None or row[i] != 0 for row in rows) and _may_cancel(rate, symbols)
    )


def residue_of_guard(guard: sympy.Expr | None, symbols: Symbols) -> sympy.Expr | None:
    """The terms of a guard in time and parameters alone, if they may cancel and there are others."""
    if guard is None or not guard.is_Add or not _may_cancel(guard, symbols):
        return None
    free = [term for term in guard.args if not mentions(term, symbols.x)]
    return sympy.Add(*free) if 0 < len(free) < len(guard.args) else None


def _may_cancel(rate: sympy.Expr, symbols: Symbols) -> bool:
    """Whether a rate has a sum with two terms, or a function, in which the state does not occur."""
    for node in nodes(rate):
        if node.is_Add and sum(not mentions(term, symbols.x) for term in node.args) > 1:
            return True
        if node.is_Function and not mentions(node, symbols.x):
            return True
    return False
