"""A mode without its guards, or with a few of them: its flow goes on where the system would jump."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import attrs

from hybrid.system.elements import Mode
from hybrid.system.graph import HybridSystem
from hybrid.system.laws import Laws
from hybrid.system.portable import made_by

_RESTRICTED: WeakKeyDictionary[HybridSystem, dict[Any, HybridSystem]] = WeakKeyDictionary()


def restricted(
    system: HybridSystem, mode: str, transitions: tuple[str, ...] = (), backwards: bool = False
) -> HybridSystem:
    """The flow of one mode, with those transitions alone and the modes that they lead to.

    Backwards it is the flow against time, which then counts from zero downwards: time ``t`` of the system is
    ``-t`` here.
    """
    made = _RESTRICTED.setdefault(system, {})
    key = (mode, transitions, backwards)
    if key not in made:
        kept = [each for each in system.transitions if each.name in transitions]
        ends = {end for each in kept for end in (each.source, each.target, each.accumulates_to)}
        modes = [each for each in system.modes if each.name == mode or each.name in ends]
        found = attrs.evolve(
            system,
            modes=[_backwards(each) for each in modes] if backwards else modes,
            transitions=kept,
            start=None,
            laws=Laws(),
        )
        made[key] = made_by(found, restricted, system, *key)
    return made[key]


def _backwards(mode: Mode) -> Mode:
    field = mode.field

    def against(t: Any, x: Any, p: Any) -> Any:
        return tuple(-rate for rate in field(-t, x, p))

    return Mode(mode.name, against)
