"""A system in words: its state, parameters and modes, and a table of its transitions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from textwrap import fill
from typing import Any

from hybrid.display.tables import html_table, table, with_unit
from hybrid.system.clocks import Clock
from hybrid.system.elements import END, Guard
from hybrid.system.members import about_all, condensed, shared_name, shared_names

TRANSITION_COLUMNS = ("transition", "from", "to", "guard", "condition", "reset", "limit of chatter")
# Width of a terminal, in characters.
WIDTH = 100
GUARD_SIDES = {-1: "falls", 0: "either way", 1: "rises"}


def described(system: Any) -> str:
    """A :class:`hybrid.HybridSystem` in one table."""
    rows = _transition_rows(system)
    heading = [fill(line, WIDTH, subsequent_indent="    ") for line in _heading(system)]
    return "\n".join([*heading, "", table(TRANSITION_COLUMNS, rows) if rows else "no transitions"])


def described_in_html(system: Any) -> str:
    """The same for a notebook."""
    heading = "<br>".join(map(escape, _heading(system)))
    return f"<p>{heading}</p>\n{html_table(TRANSITION_COLUMNS, _transition_rows(system))}"


def _heading(system: Any) -> list[str]:
    units = system.units
    variables = system.variables
    state = _names_told(_own(system, variables.state_names[: variables.moving]), units)
    if isinstance(system.state, int) and not any(name in units for name in system.state_names):
        state = f"{system.state} components"
    lines = [
        f"HybridSystem {system.name}".rstrip(),
        f"state: {state}",
        f"parameters: {_parameters_told(system) or 'none'}",
        f"modes: {', '.join(map(repr, system.mode_names))}",
    ]
    if system.under_way:
        waits = [repr(each.name) for each in system.transitions if each.clock and each.clock.kind == "Delay"]
        lines.insert(2, f"under way: {len(system.under_way)} components, for {', '.join(waits)}")
    for kind in ("counters", "held"):
        listed = _names_told(_own(system, getattr(system, kind)), units)
        lines[2:2] = [f"{kind}: {listed}"] if listed else []
    if "t" in units:
        lines.insert(2, f"time: {with_unit('t', units['t'])}")
    if system.outputs:
        lines.append(f"outputs: {_names_told(tuple(system.outputs), units)}")
    if system.start is not None:
        lines.append(f"start: {system.start!r}")
    if system.listed_order:
        lines.append("listed order: decides where guards are reached together")
    if system.angles:
        turns = {shared_name(name): f"turns in {turn:.6g}" for name, turn in system.angles.items()}
        lines.append(f"angles: {', '.join(f'{name} {turn}' for name, turn in turns.items())}")
    if system.cyclic:
        lines.append(f"cyclic: {', '.join(condensed(system.cyclic))}")
    if system.period is not None:
        lines.append(f"period: {_period_told(system)}")
    if system.switching:
        inside = "; ".join(f"{', '.join(names)} in mode {mode}" for mode, names in system.switching.items())
        lines.append(f"kinks or jumps inside of modes: {inside} (hybrid.split makes modes of them)")
    lines += system.notes
    if not system.is_whole:
        lines.append("A run adds the modes that it needs.")
    return lines


def _own(system: Any, names: Iterable[str]) -> tuple[str, ...]:
    """Those of the names that an author gave."""
    return tuple(name for name in names if name not in system.under_way)


def _names_told(names: tuple[str, ...], units: Mapping[str, str]) -> str:
    """Names with their units; those of all members of a repeat are one, with their number."""
    shared = {each: one for each, (one, *_) in shared_names(names).items()}
    told = [
        _counted(with_unit(name, units.get(shared.get(name, name))), name, names) for name in condensed(names)
    ]
    return ", ".join(told)


def _counted(text: str, name: str, names: tuple[str, ...]) -> str:
    """A text about a name, with the number of members that it stands for."""
    members = shared_names(names).get(name)
    return text if members is None else f"{text} ×{len(members)}"


def _parameters_told(system: Any) -> str:
    """The default values; of those of all members the least and the largest."""
    names, shared, found = tuple(system.parameters), shared_names(tuple(system.parameters)), []
    for name in condensed(names):
        members = shared.get(name, (name,))
        values = [system.parameters[each] for each in members]
        least, largest = (f"{each:.6g}" for each in (min(values), max(values)))
        value = least if least == largest else f"{least} to {largest}"
        text = f"{name} = {value} {system.units.get(members[0], '')}".rstrip()
        found.append(_counted(text, name, names))
    return ", ".join(found)


def _period_told(system: Any) -> str:
    """The period at the default parameters, if it has one there."""
    try:
        period = f"{system.forcing_period():.6g}"
    except (ArithmeticError, ValueError):
        return "a function of the parameters"
    return f"{period}, a function of the parameters" if callable(system.period) else period


def _transition_rows(system: Any) -> list[list[str]]:
    """A row per transition; those of all members of a repeat share one."""
    first = {shared_name(each.name): each for each in reversed(system.transitions)}
    names = system.transition_names
    return [
        [
            _counted(name, name, names),
            transition.source,
            END if transition.target is None else transition.target,
            about_all(_guard_told(transition.guard), transition.name),
            "" if transition.guard.when is None else "yes",
            "" if transition.reset is None else "yes",
            transition.accumulates_to or "",
        ]
        for name, transition in ((name, first[name]) for name in condensed(names))
    ]


def _guard_told(guard: Guard | Clock) -> str:
    """When a transition fires, in few words."""
    if isinstance(guard, Clock):
        return guard.told
    return GUARD_SIDES[guard.direction] + (", at the start" if guard.at_start else "")
