"""What the functions of a model read: parameters that nothing reads, numbers that stand in for one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

from hybrid.symbolic.reads import names_read
from hybrid.symbolic.values import TraceError
from hybrid.system.graph import HybridSystem, as_system, functions_of, watched_by
from hybrid.testing.errors import PropertyError, discard

READS = "Every parameter is read, and no number stands in for one"
_CLOCKS: WeakKeyDictionary[HybridSystem, dict[str, bool]] = WeakKeyDictionary()


def is_clock(system: HybridSystem, transition: str) -> bool:
    """Whether the guard of a transition is a function of time alone."""
    found = _CLOCKS.setdefault(system, {})
    if transition not in found:
        guard = system.transitions[system.transition_index(transition)].guard
        try:
            found[transition] = names_read(system, guard.function).isdisjoint(system.state_names)
        except TraceError:
            found[transition] = False
    return found[transition]


def check_reads(system: HybridSystem) -> None:
    """Each parameter is read by a function of the model or a law, and by the name of no other number.

    It finds a number that is typed where a parameter belongs, and one that is read from a module or a closure
    although there is a parameter of that name: changing the parameter then changes nothing.

    Raises
    ------
    PropertyError
        If a parameter is not read, or a number read from elsewhere has its name.
    """
    numbers = numbers_read(as_system("system", system))
    letters = {name.casefold(): name for name in system.parameters}
    for name, value in numbers.items():
        parameter = letters.get(name.casefold())
        if parameter is not None:
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
    return watched_by(system).numbers()


def _all_functions(system: HybridSystem) -> list[Callable[..., Any]]:
    laws = system.laws
    found = [function.value for _, function in functions_of(system)]
    if callable(system.period):
        period = system.period
        found.append(lambda t, x, p: period(p))
    for law in (each for some in laws.in_modes.values() for each in some):
        found += [law.function, *([law.flow] if law.flow else [])]
    for law in laws.across:
        found.append(lambda t, x, p, law=law: law.function(t, x, x, p))
    return found


def _fail(system: HybridSystem, line: str, hint: str) -> None:
    name = system.name or "the system"
    raise PropertyError(f"{READS}: this does not hold for {name}.\n  {line}\n  likely: {hint}")
