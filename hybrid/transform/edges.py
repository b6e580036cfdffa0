"""Transitions of a system while it is split."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import attrs

from hybrid.expression.evaluation import scalar
from hybrid.expression.graph import contains
from hybrid.expression.nodes import Expression
from hybrid.expression.operations import And
from hybrid.expression.switches import SWITCHING
from hybrid.expression.tracing import TraceError, model_symbols, trace
from hybrid.system.elements import Function, Transition
from hybrid.system.functions import WholeReset
from hybrid.system.variables import Variables
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

    @classmethod
    def of(cls, index: int, transition: Transition, variables: Variables) -> Outgoing:
        """A transition of a system with these variables."""
        guard, reset = _guard(transition, variables), _reset(transition, variables)
        return cls(index, transition, guard, reset)


def switches(transition: Transition, variables: Variables) -> bool:
    """Whether a reset has a kink or a jump inside, which :func:`split` makes a condition."""
    entries = _reset(transition, variables)
    return entries is not None and any(contains(entry, SWITCHING) for entry in entries)


def _guard(transition: Transition, variables: Variables) -> Expression | None:
    try:
        found = trace(transition.guard.function, variables.components, variables.parameter_names)
    except TraceError:
        return None
    return None if transition.clock else found[0]


def _reset(transition: Transition, variables: Variables) -> list[Expression] | None:
    if transition.reset is None:
        return [*model_symbols(variables.dimension, len(variables.parameter_names)).x]
    try:
        reset = WholeReset(transition.reset.function, variables.components)
        return trace(reset, variables.components, variables.parameter_names)
    except TraceError:
        return None


def all_of(conditions: Sequence[Expression]) -> Function | None:
    """The condition that all of several hold; None for none."""
    return scalar(reduce(And, conditions)) if conditions else None
