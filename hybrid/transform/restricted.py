"""A mode without its guards, or with a few of them: its flow goes on where the system would jump."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from weakref import WeakKeyDictionary

import attrs

from hybrid.system.elements import Guard, Mode, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.laws import Laws
from hybrid.system.portable import made_by

# The mode beyond the guards of another one has its name behind this.
BEYOND = "beyond "

_RESTRICTED: WeakKeyDictionary[HybridSystem, dict[Any, HybridSystem]] = WeakKeyDictionary()


def restricted(
    system: HybridSystem,
    mode: str,
    transitions: tuple[str, ...] = (),
    backwards: bool = False,
    sided: bool = False,
) -> HybridSystem:
    """The flow of one mode, with those transitions alone and the modes that they lead to.

    Backwards it is the flow against time, which then counts from zero downwards: time ``t`` of the system is
    ``-t`` here. If it is ``sided`` the flow beyond the guards at which the mode ends is a mode of its own,
    with the same field: where the field has roots of a guard it is smooth on either side, not across.
    """
    made = _RESTRICTED.setdefault(system, {})
    key = (mode, transitions, backwards, sided)
    if key not in made:
        kept = [each for each in system.transitions if each.name in transitions]
        ends = {end for each in kept for end in (each.source, each.target, each.accumulates_to)}
        modes = [each for each in system.modes if each.name == mode or each.name in ends]
        if sided:
            kept += [each for end in ends_of(system, mode) for each in _there_and_back(end, backwards)]
            modes += [attrs.evolve(each, name=BEYOND + mode) for each in modes if each.name == mode]
        found = attrs.evolve(
            system,
            modes=[_backwards(each) for each in modes] if backwards else modes,
            transitions=kept,
            start=None,
            units={},
            outputs={},
            laws=Laws(),
            growth=None,
        )
        made[key] = made_by(found, restricted, system, *key)
    return made[key]


def ends_of(system: HybridSystem, mode: str) -> list[Transition]:
    """The transitions that leave a mode whenever their guards are reached from inside."""
    leaving = [each for each in system.transitions if each.source == mode != each.target]
    return [
        each
        for each in leaving
        if isinstance(each.guard, Guard) and each.guard.direction and each.guard.when is None
    ]


def _there_and_back(end: Transition, backwards: bool) -> Iterator[Transition]:
    function, direction, mode = end.guard.function, end.guard.direction, end.source

    def against(t: Any, x: Any, p: Any) -> Any:
        return function(-t, x, p)

    for source, target, way in ((mode, BEYOND + mode, direction), (BEYOND + mode, mode, -direction)):
        yield Transition(source, target, Guard(against if backwards else function, way))


def _backwards(mode: Mode) -> Mode:
    field = mode.field

    def against(t: Any, x: Any, p: Any) -> Any:
        return tuple(-rate for rate in field(-t, x, p))

    return Mode(mode.name, against)
