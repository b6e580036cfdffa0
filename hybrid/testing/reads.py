"""What the functions of a model read: parameters that nothing reads, numbers that stand in for one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from hybrid.expression.evaluation import expressed
from hybrid.expression.reads import TIME, names_read
from hybrid.expression.values import TraceError
from hybrid.system.derivatives import evaluate, sample_points
from hybrid.system.elements import Reset, Transition
from hybrid.system.functions import WholeReset, field_function
from hybrid.system.graph import HybridSystem, as_system, functions_of, laws_of, watched_below, watched_by
from hybrid.testing.errors import PropertyError, discard
from hybrid.transform.deciding import decided_by

READS = "Every parameter is read, and no number stands in for one"
_PASSED: WeakKeyDictionary[HybridSystem, dict[str, bool]] = WeakKeyDictionary()


def is_passed(system: HybridSystem, transition: str) -> bool:
    """Whether the state passes the guard of a transition, so that it is no wall.

    It passes a guard of time alone, as that of `Every`; and one whose reset leads back to the mode and
    changes something, but nothing of what the guard and its speed are made of, as a counter does.
    """
    found = _PASSED.setdefault(system, {})
    if transition not in found:
        try:
            found[transition] = _is_passed(system, system.transitions[system.transition_index(transition)])
        except TraceError:
            found[transition] = False
    return found[transition]


def _is_passed(system: HybridSystem, transition: Transition) -> bool:
    if transition.clock is not None and not transition.clock.counts_from_entry:
        return True
    felt = names_read(system, transition.guard.function) - {TIME}
    if felt.isdisjoint(system.state_names):
        return True
    if transition.source != transition.target or transition.reset is None:
        return False
    mode = system.modes[system.mode_index(transition.source)]
    rates = field_function(mode, system.variables).value
    for i, name in enumerate(system.state_names):
        if name in felt:
            felt |= names_read(system, lambda t, x, p, i=i: rates(t, x, p)[i])
    changed = _changed(system, transition.reset)
    return bool(changed) and felt.isdisjoint(changed)


def _changed(system: HybridSystem, reset: Reset) -> set[str]:
    """The components that a reset changes, at some points."""
    variables, whole = system.variables, WholeReset(reset.function, system.variables.components)
    changed = np.zeros(system.dimension, dtype=bool)
    for t, x in sample_points(system.dimension):
        values = evaluate(variables, whole, t, x, variables.defaults)
        changed |= True if values is None else values != x
    return {name for name, moves in zip(system.state_names, changed, strict=True) if moves}


def check_reads(system: HybridSystem) -> None:
    """Each parameter is read by a function of the model, an output or a law, and by the name of no number.

    It finds a number that is typed where a parameter belongs, and one that is read from a module or a closure
    although there is a parameter of that name: changing the parameter then changes nothing.

    Raises
    ------
    PropertyError
        If a parameter is not read, or a number read from elsewhere has its name.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import check_reads
    >>> check_reads(models.bouncing_ball())
    """
    numbers = numbers_read(as_system("system", system))
    letters = {name.casefold(): name for name in system.parameters}
    for name, value in numbers.items():
        # The radius r is not the gas constant R, but MU = 0.3 is the friction mu = 0.3.
        parameter = name if name in system.parameters else letters.get(name.casefold())
        if parameter is not None and (name == parameter or system.parameters[parameter] == value):
            _fail(
                system,
                f"{name} = {value:.6g} is read from outside the model, and parameter {parameter!r} is "
                f"{system.parameters[parameter]:.6g}",
                f"{name} where p.{parameter} is meant.",
            )
    read: set[str] = set()
    for function in _all_functions(system):
        try:
            read |= names_read(system, function)
        except TraceError:
            discard("a function cannot be traced, so that what it reads is not known")
    unread = [name for name in system.parameters if name not in read]
    if unread:
        outside = ", ".join(f"{name} = {value:.6g}" for name, value in numbers.items())
        _fail(
            system,
            f"no function reads parameter {', '.join(map(repr, unread))}",
            f"a number typed where p.{unread[0]} belongs, a missing term, or a parameter to be removed."
            + (f" Read from outside the model: {outside}." if outside else ""),
        )


def numbers_read(system: HybridSystem) -> dict[str, float]:
    """The plain numbers that the functions read from modules and closures, by name."""
    watched = watched_by if decided_by(system) is None else watched_below
    return watched(system).numbers()


def _all_functions(system: HybridSystem) -> list[Callable[..., Any]]:
    laws = laws_of(system)
    found = [function.value for _, function in functions_of(system)]
    if callable(system.period):
        period = system.period
        found.append(lambda t, x, p: period(p))
    for law in (each for some in laws.in_modes.values() for each in some):
        found += law.formulas
    for output in system.outputs.values():
        found += output.functions
    growth = decided_by(system)
    if growth is not None:
        # Modes are made when runs need them, and each reads some of this.
        found.append(expressed(growth.given))
    for law in laws.across:
        found.append(lambda t, x, p, law=law: law.quantity(t, x, x, p))
    return found


def _fail(system: HybridSystem, line: str, hint: str) -> None:
    name = system.name or "the system"
    raise PropertyError(f"{READS}: this does not hold for {name}.\n  {line}\n  likely: {hint}")
