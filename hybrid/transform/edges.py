"""Transitions of a system while it is split."""

from __future__ import annotations

import attrs

from hybrid.expression.nodes import Expression
from hybrid.system.elements import Transition
from hybrid.transform.cells import Cell


@attrs.frozen
class Edge:
    """A transition, the cell that it leads to, and the cell for the limit of its chatter; None for none."""

    transition: Transition
    target: Cell | None
    limit: Cell | None = None


@attrs.frozen
class Outgoing:
    """A user's transition in the expressions of its functions; None for what could not be traced."""

    index: int
    transition: Transition
    guard: Expression | None
    reset: list[Expression] | None
