"""The graph of a system as index arrays, with what kernels know of its clocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import accumulate, chain
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.kernels.types.codes import AT
from hybrid.system.elements import Transition
from hybrid.system.entries import enters_anew
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from hybrid.compiler.emitted import Emitted


def indices(values: Iterable[Any]) -> np.ndarray:
    """Whole numbers, or truths, as kernels get them."""
    return np.array([int(value) for value in values], dtype=np.int64)


def leaving(system: HybridSystem, chosen: Callable[[Transition], bool]) -> tuple[np.ndarray, np.ndarray]:
    """The chosen transitions that leave each mode, as listed: first places, and indices."""
    pairs = [*enumerate(system.transitions)]
    of_modes = [
        [i for i, each in pairs if each.source == name and chosen(each)] for name in system.mode_names
    ]
    return indices(accumulate(map(len, of_modes), initial=0)), indices(chain.from_iterable(of_modes))


def clock_arrays(system: HybridSystem, emitted: Emitted) -> dict[str, Any]:
    """The fields of ``hybrid.kernels.types.layout.Model`` that tell of clocks."""
    transitions = system.transitions
    first_clock, clocks = leaving(system, lambda each: each.clock is not None)

    def clock_of(index: int) -> Any:
        clock = transitions[index].clock
        if clock is None:
            return index
        return type(clock), emitted.surface[index], clock.quantities if clock.number == AT else ()

    return {
        "clock": indices(0 if each.clock is None else each.clock.number for each in transitions),
        "first_clock": first_clock,
        "clocks": clocks,
        "first_tick": indices(system.first_tick),
        "tick_of": indices(_first_like(len(transitions), lambda i: _own_name(transitions[i]))),
        "clock_of": indices(_first_like(len(transitions), clock_of)),
        "whole_mode": indices(system.whole_modes.index(each.part_of or each.name) for each in system.modes),
        "enters": indices(enters_anew(system, each) for each in transitions),
        "age": -1 if system.age is None else system.age,
    }


def _own_name(transition: Transition) -> str:
    """The name of a transition before its system was split."""
    return transition.part_of or transition.name


def _first_like(count: int, key: Callable[[int], Any]) -> list[int]:
    """For each of so many items the first one with the same key."""
    first: dict[Any, int] = {}
    return [first.setdefault(key(i), i) for i in range(count)]
