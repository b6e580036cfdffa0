"""The functions of a system as expressions, and all that emitting depends on as text.

That text is the key under which what was found out about a system is kept. A model function may depend on
anything: constants, closures, globals, what it calls. None of that is looked at. The function is called
again, and its expressions are all that tracing ever learns of it. The same expressions give the same code.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from hybrid.errors import ModelError
from hybrid.expression.graph import listing
from hybrid.expression.nodes import Expression, Number, Symbol
from hybrid.expression.tracing import trace
from hybrid.system.functions import ModelFunction
from hybrid.system.graph import HybridSystem, functions_of

# Traces of functions: their expressions, or the reason why there are none.
Traces = dict[Any, Any]


def expressions_of(
    system: HybridSystem, function: ModelFunction, traces: Traces, *, derivative: bool = False
) -> list[Expression]:
    """The expressions of a model function, or of its derivative; ``traces`` remembers them.

    Raises
    ------
    ModelError
        If it cannot be traced.
    """
    called = function.slopes if derivative else function.value
    assert called is not None
    return _remembered(("trace", derivative, *function.identity), called, system, traces)


def _remembered(
    key: Any, called: Callable[..., Any], system: HybridSystem, traces: Traces
) -> list[Expression]:
    if key not in traces:
        try:
            # The function is kept: the key holds its identity.
            traces[key] = trace(called, system.variables.components, tuple(system.parameters)), called
        except ModelError as reason:
            traces[key] = reason, called
    found, _ = traces[key]
    if isinstance(found, ModelError):
        raise found
    expressions: list[Expression] = found
    return expressions


def period_of(system: HybridSystem, traces: Traces) -> Expression | None:
    """The declared period as an expression of the parameters; None if it cannot be traced."""
    period: Any = system.period
    if not callable(period):
        return Number(float(period))
    try:
        [expression] = _remembered("period", lambda t, x, p: period(p), system, traces)
    except ModelError:
        return None
    return expression


def key_of(system: HybridSystem, traces: Traces) -> str | None:
    """All that emitting depends on, as text: names, graph, and the expressions of every function.

    None if a function cannot be traced.
    """
    functions, expressions = [], list[Expression]()
    try:
        for _, function in functions_of(system):
            value = expressions_of(system, function, traces)
            given = function.derivative is not None
            slopes = expressions_of(system, function, traces, derivative=True) if given else []
            functions.append((function.owner, function.kind, len(value), given, len(slopes)))
            expressions += [*value, *slopes]
    except ModelError:
        return None
    period = None if system.period is None else period_of(system, traces)
    graph = [
        [
            transition.name,
            transition.source,
            transition.target,
            transition.accumulates_to,
            int(transition.guard.direction),
            transition.guard.at_start,
            transition.clock is None,
            transition.guard.when is None,
            transition.reset is None,
        ]
        for transition in system.transitions
    ]
    # The series of a system that grows have room for further modes, and texts may be left out.
    grows = system.growth is not None
    names = [grows, system.state, system.held, system.counters, [*system.parameters], [*system.mode_names]]
    timed = system.period is not None, period is not None
    listed = _listed([*expressions, *([] if period is None else [period])])
    return json.dumps([names, graph, functions, timed, listed])


def _listed(expressions: Sequence[Expression]) -> Any:
    """Expressions as plain data."""
    rows, places = listing(expressions)
    return [_plain(row) for row in rows], places


def _plain(row: Any) -> Any:
    if isinstance(row, Number):
        return str(row.value) if row.is_exact else float(row.value).hex()
    if isinstance(row, Symbol):
        return row.label
    kind, places, attached = row
    return [kind.__name__, *places, *map(str, attached)]
