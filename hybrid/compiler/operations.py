"""All that emitting depends on, as text: the key under which what was found out about a system is kept.

A model function may depend on anything: constants, closures, globals, what it calls. None of that is looked
at. The function is called again, as tracing would call it, on numbers that only list what is done with them;
the list is all that tracing ever learns of the function. The same lists give the same expressions, and these
the same code.
"""

from __future__ import annotations

import json
from typing import Any

from hybrid.expression.values import TraceError, values_of
from hybrid.system.functions import ModelFunction
from hybrid.system.graph import HybridSystem, functions_of


class Operations:
    """Traced numbers as places in a list of operations; what has been done before is not listed twice."""

    def __init__(self) -> None:
        self.places: dict[tuple[Any, ...], int] = {}

    def listed(self, *operation: Any) -> int:
        """Place of an operation."""
        return self.places.setdefault(operation, len(self.places))

    def number(self, value: Any) -> int:
        """Place of a number, to the last bit."""
        return self.listed("number", float(value).hex())

    def combined(self, name: str, contents: tuple[int, ...]) -> int:
        """Place of a function's value."""
        return self.listed(name, *contents)

    def expression(self, content: int) -> Any:
        """A function that asks for expressions is to be traced each time."""
        raise TraceError("there is no expression where operations are only listed")


def operations_of(system: HybridSystem) -> str | None:
    """All that emitting depends on, as text: names, graph, and the operations of every function.

    None if they cannot be listed: a function fails, or asks for more than the results of operations.
    """
    try:
        functions = [_remembered(system, function) for _, function in functions_of(system)]
        period = _listed_period(system)
    except Exception:
        return None
    graph = [
        [
            transition.name,
            transition.source,
            transition.target,
            transition.accumulates_to,
            int(transition.guard.direction),
            transition.guard.at_start,
            transition.guard.when is None,
            transition.reset is None,
        ]
        for transition in system.transitions
    ]
    return json.dumps([system.state, [*system.parameters], [*system.mode_names], graph, functions, period])


def _remembered(system: HybridSystem, function: ModelFunction) -> list[Any]:
    """What `_listed` returns; an earlier stage of a system that grows may have listed the operations."""
    known = {} if system.growth is None else system.growth.written
    key = "operations", *function.identity
    if key not in known:
        known[key] = function, _listed(system, function)
    return [function.owner, function.kind, *known[key][1]]


def _listed(system: HybridSystem, function: ModelFunction) -> list[Any]:
    """For a function and for its derivative the operations and the results."""
    names = tuple(system.parameters)
    lists: list[Any] = []
    for called in (function.value, function.derivative):
        if called is None:
            lists.append(None)
            continue
        operations = Operations()
        t = operations.listed("t")
        x = [operations.listed("x", i) for i in range(system.dimension)]
        p = [operations.listed("p", i) for i in range(len(names))]
        values = values_of(called, system.state, names, operations, (t, x, p))
        lists.append([[*operations.places], values])
    return lists


def _listed_period(system: HybridSystem) -> Any:
    """The declared period: a number, or the operations that make one."""
    period: Any = system.period
    if not callable(period):
        return None if period is None else float(period).hex()
    operations = Operations()
    p = [operations.listed("p", i) for i in range(len(system.parameters))]
    names = tuple(system.parameters)
    try:
        values = values_of(lambda t, x, p: period(p), 1, names, operations, (-1, [-1], p))
    except Exception:
        return "cannot be traced"
    return [[*operations.places], values]
