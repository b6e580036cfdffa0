"""Rates and guards whose terms in time and parameters alone may cancel, so that only rounding errors remain.

An example is the speed of a guard on which the state may rest, such as the force on a block that sticks and
is about to slip. The size of the rounding error cannot be found from the rate, the states or the Jacobian.
Interval arithmetic on the rate gives it. The same holds for the guard at which the block slips.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import attrs

from hybrid.expression.graph import mentions, nodes
from hybrid.expression.nodes import Expression, Function, add
from hybrid.expression.tracing import Symbols


@attrs.frozen
class Residue:
    """A rate, and the component of the state that has this rate."""

    expression: Expression
    component: int


def residues(
    field: Sequence[Expression] | None,
    gradients: Iterable[Sequence[Expression] | None],
    symbols: Symbols,
) -> tuple[Residue, ...]:
    """The rates with terms that may cancel and on which the speed of a guard of the mode depends.

    A field or a gradient that was not traced is None. Such a field has no residues; such a guard depends on
    every rate.
    """
    if field is None:
        return ()
    rows = list(gradients)
    return tuple(
        Residue(rate, i)
        for i, rate in enumerate(field)
        if any(row is None or row[i] != 0 for row in rows) and _may_cancel(rate, symbols)
    )


def residue_of_guard(guard: Expression | None, symbols: Symbols) -> Expression | None:
    """The terms of a guard in time and parameters alone, if they may cancel and the guard has other terms."""
    if guard is None or not guard.is_sum or not _may_cancel(guard, symbols):
        return None
    free = [term for term in guard.args if not mentions(term, symbols.x)]
    return add(*free) if 0 < len(free) < len(guard.args) else None


def _may_cancel(rate: Expression, symbols: Symbols) -> bool:
    """Whether a rate has a sum with two terms without the state, or a function without the state."""
    for node in nodes(rate):
        if node.is_sum and sum(not mentions(term, symbols.x) for term in node.args) > 1:
            return True
        if isinstance(node, Function) and not mentions(node, symbols.x):
            return True
    return False
