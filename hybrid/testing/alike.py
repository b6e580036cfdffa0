"""Members of a repeat that are alike: to exchange them exchanges what functions give, and no more."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import attrs
import numpy as np

from hybrid.system.clocks import function_of_number
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function, Guard, Transition
from hybrid.system.functions import condition_function, field_function, reset_function
from hybrid.system.graph import HybridSystem
from hybrid.system.members import full_name, groups_in, member_name
from hybrid.testing.case import Case
from hybrid.testing.run import lasting
from hybrid.testing.sizes import sizes_of_terms

# Values may differ by this share of the sizes of their terms: sums of members are added in another order.
TOLERANCE = 1e-8
# Points of a run at which functions are compared.
MOST_POINTS = 4


@attrs.frozen(eq=False)
class Exchange:
    """Members of a repeat in another order.

    Attributes
    ----------
    group, order
        Name of the repeat, and the member that comes to each place.
    state, parameters
        Places: ``x[state]`` and ``p[parameters]`` are the exchanged ones.
    """

    group: str
    order: tuple[int, ...]
    state: np.ndarray
    parameters: np.ndarray

    @classmethod
    def of(cls, system: HybridSystem, group: str, order: tuple[int, ...]) -> Exchange:
        """The exchange for the names of a system."""

        def places(names: tuple[str, ...]) -> np.ndarray:
            return np.array([names.index(before(name, group, order)) for name in names], dtype=int)

        return cls(group, order, places(system.state_names), places(system.variables.parameter_names))


def before(name: str, group: str, order: tuple[int, ...]) -> str:
    """The name, before an exchange, of what has this name after it."""
    parts = member_name(name)
    if parts is None or parts.group != group:
        return name
    return full_name(group, order[parts.number], parts.name)


def check_alike(case: Case, name: str, told: str) -> None:
    """Fail if a field, a guard, a clock or a reset of exchanged members is not the exchanged one."""
    system = case.system
    count = groups_in((*system.state_names, *system.variables.parameter_names))[name]
    # The exchange of two and the turn of all make every order.
    orders = dict.fromkeys([(1, 0, *range(2, count)), (*range(1, count), 0)] if count > 1 else [])
    for order in orders:
        exchange = Exchange.of(system, name, order)
        for point in _points(case):
            _compare(case, exchange, told, *point)


def _points(case: Case) -> Iterator[tuple[float, np.ndarray, str]]:
    """Times, states and modes of a run."""
    arc = case.whole
    rows = np.flatnonzero(lasting(arc))
    for i in rows[np.unique(np.linspace(0, len(rows) - 1, MOST_POINTS).astype(int))] if len(rows) else ():
        yield float(arc.t[i]), arc.x[i], str(arc.mode[i])


def _compare(case: Case, exchange: Exchange, told: str, t: float, x: np.ndarray, mode: str) -> None:
    """Fail if a function of the mode gives something else for exchanged members."""
    variables, p = case.system.variables, case.values
    moved, changed, scale = x[exchange.state], p[exchange.parameters], np.abs(case.whole.x).max(axis=0)
    for what, function, other in _functions(case.system, mode, exchange):
        value = partial(_value, case, t=t, parameters=p, function=function)
        own = value(x)
        found = evaluate(variables, other, t, moved, changed, finite=False)
        if own is None or found is None or not np.all(np.isfinite(own)):
            continue
        size = sizes_of_terms(value, x, own, scale)
        if len(own) == len(x):
            own, size = own[exchange.state], size[exchange.state]
        if np.any(np.abs(own - found) > TOLERANCE * size):
            exchanged = ", ".join(map(str, exchange.order))
            case.fail(
                told,
                f"{what}: got {_few(found)} with the members of {exchange.group!r} in the order {exchanged}, "
                f"for {_few(own)}",
                f"at t = {t:.8g}, {case.state_told(x)}, in mode {mode!r}",
                hint="an index that is one off, a neighbour that is forgotten, or a number of one member "
                "that should be a parameter of each; or the members are not alike.",
            )


def _value(case: Case, x: np.ndarray, *, t: float, parameters: np.ndarray, function: Function) -> Any:
    return evaluate(case.system.variables, function, t, x, parameters, finite=False)


def _functions(
    system: HybridSystem, mode: str, exchange: Exchange
) -> Iterator[tuple[str, Function, Function]]:
    """The functions of a mode in words: that of the members in their order, and that of exchanged ones."""
    field = field_function(system.modes[system.mode_index(mode)], system.variables).value
    yield f"the field of mode {mode!r}", field, field
    for each in system.transitions:
        if each.source == mode:
            own = system.transitions[
                system.transition_index(before(each.name, exchange.group, exchange.order))
            ]
            for what, function, other in _of_transition(system, own, each):
                yield f"the {what} of transition {each.name!r}", function, other


def _of_transition(
    system: HybridSystem, own: Transition, other: Transition
) -> Iterator[tuple[str, Function, Function]]:
    """Guard or clock, condition and reset of two transitions."""
    if isinstance(own.guard, Guard):
        yield "guard", own.guard.function, other.guard.function
    elif own.clock is not None and other.clock is not None:
        for place in range(len(own.clock.quantities)):
            yield "clock", function_of_number(own.clock, place), function_of_number(other.clock, place)
    conditions = condition_function(own), condition_function(other)
    resets = reset_function(own, system.variables), reset_function(other, system.variables)
    for what, (first, second) in (("condition", conditions), ("reset", resets)):
        if first is not None and second is not None:
            yield what, first.value, second.value


def _few(values: np.ndarray) -> str:
    return np.array2string(values, precision=6, threshold=8)
