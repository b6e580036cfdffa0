"""A system in words: its state, parameters and modes, and a table of its transitions."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from textwrap import fill
from typing import Any

from hybrid.display.tables import html_table, table, with_unit
from hybrid.system.clocks import Clock
from hybrid.system.elements import END, Guard

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
    state = _listed(system, variables.state_names[: variables.moving])
    if isinstance(system.state, int) and not any(name in units for name in system.state_names):
        state = f"{system.state} components"
    parameters = ", ".join(
        f"{name} = {value:.6g} {units.get(name, '')}".rstrip() for name, value in system.parameters.items()
    )
    lines = [
        f"HybridSystem {system.name}".rstrip(),
        f"state: {state}",
        f"parameters: {parameters or 'none'}",
        f"modes: {', '.join(map(repr, system.mode_names))}",
    ]
    if system.under_way:
        waits = [repr(each.name) for each in system.transitions if each.clock and each.clock.kind == "Delay"]
        lines.insert(2, f"under way: {len(system.under_way)} components, for {', '.join(waits)}")
    for kind in ("counters", "held"):
        listed = _listed(system, getattr(system, kind))
        lines[2:2] = [f"{kind}: {listed}"] if listed else []
    if "t" in units:
        lines.insert(2, f"time: {with_unit('t', units['t'])}")
    if system.outputs:
        lines.append(f"outputs: {', '.join(with_unit(name, units.get(name)) for name in system.outputs)}")
    if system.start is not None:
        lines.append(f"start: {system.start!r}")
    if system.listed_order:
        lines.append("listed order: decides where guards are reached together")
    if system.angles:
        turns = ", ".join(f"{name} turns in {turn:.6g}" for name, turn in system.angles.items())
        lines.append(f"angles: {turns}")
    if system.period is not None:
        lines.append(f"period: {_period_told(system)}")
    if system.switching:
        inside = "; ".join(f"{', '.join(names)} in mode {mode}" for mode, names in system.switching.items())
        lines.append(f"kinks or jumps inside of modes: {inside} (hybrid.split makes modes of them)")
    lines += system.notes
    if not system.is_whole:
        lines.append("A run adds the modes that it needs.")
    return lines


def _listed(system: Any, names: Iterable[str]) -> str:
    """Those of the names that an author gave, with their units."""
    own = (name for name in names if name not in system.under_way)
    return ", ".join(with_unit(name, system.units.get(name)) for name in own)


def _period_told(system: Any) -> str:
    """The period at the default parameters, if it has one there."""
    try:
        period = f"{system.forcing_period():.6g}"
    except (ArithmeticError, ValueError):
        return "a function of the parameters"
    return f"{period}, a function of the parameters" if callable(system.period) else period


def _transition_rows(system: Any) -> list[list[str]]:
    return [
        [
            transition.name,
            transition.source,
            END if transition.target is None else transition.target,
            _guard_told(transition.guard),
            "" if transition.guard.when is None else "yes",
            "" if transition.reset is None else "yes",
            transition.accumulates_to or "",
        ]
        for transition in system.transitions
    ]


def _guard_told(guard: Guard | Clock) -> str:
    """When a transition fires, in few words."""
    if isinstance(guard, Clock):
        return guard.told
    return GUARD_SIDES[guard.direction] + (", at the start" if guard.at_start else "")
