"""What kernels know of the clocks of a system, as index arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import accumulate, chain
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.kernels.types.codes import AT
from hybrid.system.elements import Transition
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from hybrid.compiler.emitted import Emitted


def clock_arrays(system: HybridSystem, emitted: Emitted) -> dict[str, np.ndarray]:
    """The fields of ``hybrid.kernels.types.layout.Model`` that tell of clocks."""
    transitions = system.transitions
    first_clock, clocks = _clocks(system)

    def clock_of(index: int) -> Any:
        clock = transitions[index].clock
        if clock is None:
            return index
        return type(clock), emitted.surface[index], clock.quantities if clock.number == AT else ()

    return {
        "clock": _whole(0 if each.clock is None else each.clock.number for each in transitions),
        "first_clock": first_clock,
        "clocks": clocks,
        "first_tick": _whole(system.first_tick),
        "tick_of": _whole(_first_like(len(transitions), lambda i: _own_name(transitions[i]))),
        "clock_of": _whole(_first_like(len(transitions), clock_of)),
        "whole_mode": _whole(system.whole_modes.index(each.part_of or each.name) for each in system.modes),
        "enters": _whole(_enters(system, each) for each in transitions),
    }


def _whole(values: Iterable[int]) -> np.ndarray:
    return np.array(list(values), dtype=np.int64)


def _own_name(transition: Transition) -> str:
    """The name of a transition before its system was split."""
    return transition.part_of or transition.name


def _first_like(count: int, key: Callable[[int], Any]) -> list[int]:
    """For each of so many items the first one with the same key."""
    first: dict[Any, int] = {}
    return [first.setdefault(key(i), i) for i in range(count)]


def _enters(system: HybridSystem, transition: Transition) -> bool:
    """Whether a transition enters its target anew: not if it marks, or leads to another part of its mode."""
    if transition.target is None or transition.is_marker:
        return False
    source, target = map(system.mode_index, (transition.source, transition.target))
    whole, other = system.modes[source].part_of, system.modes[target].part_of
    return transition.part_of is not None or whole is None or whole != other


def _clocks(system: HybridSystem) -> tuple[np.ndarray, np.ndarray]:
    """The transitions with clocks that leave each mode: first places, and indices."""
    pairs = [*enumerate(system.transitions)]
    of_modes = [[i for i, each in pairs if each.source == name and each.clock] for name in system.mode_names]
    ends = accumulate(map(len, of_modes), initial=0)
    return _whole(ends), _whole(chain.from_iterable(of_modes))
