"""Checks of the modes and transitions of a graph: their names, and that they belong together."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid import arguments
from hybrid.errors import ModelError, unknown_name
from hybrid.system.elements import END, Mode, Transition


def check_elements(modes: Sequence[Mode], transitions: Sequence[Transition]) -> None:
    """ModelError unless there are modes, all names differ, and transitions name modes that there are."""
    if not modes:
        raise ModelError("HybridSystem: at least one mode is needed; got none.")
    for what, items, kind in (("mode", modes, Mode), ("transition", transitions, Transition)):
        for item in items:
            if not isinstance(item, kind):
                raise ModelError(
                    f"HybridSystem: each {what} must be a {kind.__name__}; got {arguments.shown(item)}."
                )
        names = [item.name for item in items]
        if END in names:
            raise ModelError(
                f"HybridSystem: {what} name {END!r} is reserved for the end of a run. Use another name."
            )
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ModelError(
                f"HybridSystem: {what} names must differ; given twice: {', '.join(twice)}. "
                f"Give each {what} its own name."
            )
    known = dict.fromkeys(each.name for each in modes)
    for transition in transitions:
        for end in ("source", "target", "accumulates_to"):
            name = getattr(transition, end)
            if name is not None and name not in known:
                raise ModelError(
                    unknown_name(f"Transition {transition.name!r}: {end} mode", name, known, "Modes")
                )


def check_joined(mode_names: Sequence[str], transitions: Sequence[Transition]) -> None:
    """Among several modes, one that no transition enters or leaves is assumed to be a mistake."""
    linked = set()
    for transition in transitions:
        ends = {transition.source, transition.target, transition.accumulates_to} - {None}
        linked |= ends if len(ends) > 1 else set()
    lonely = [name for name in mode_names if name not in linked]
    if len(mode_names) > 1 and lonely:
        raise ModelError(
            f"HybridSystem: no transition joins mode {lonely[0]!r} to the others. Modes: "
            f"{', '.join(mode_names)}. Add a transition, or make it a separate system."
        )
