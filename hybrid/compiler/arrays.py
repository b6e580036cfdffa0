"""The graph of a system as index arrays, with what kernels know of its modes, transitions and clocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import accumulate, chain
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid.compiler.surfaces import is_paired
from hybrid.kernels.types.codes import AT, NO_MODE
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


def graph_arrays(system: HybridSystem, emitted: Emitted) -> dict[str, Any]:
    """The fields of ``hybrid.kernels.types.layout.Model`` that tell of modes and transitions."""
    transitions = system.transitions
    first_outgoing, outgoing = leaving(system, lambda each: each.is_searched)
    first_at_start, at_start = leaving(system, lambda each: each.guard.at_start)
    modes = range(len(system.modes))
    return {
        "dimension": system.dimension,
        "controlled": system.tangent_dimension,
        "first_outgoing": first_outgoing,
        "outgoing": outgoing,
        "first_at_start": first_at_start,
        "at_start": at_start,
        "target": indices(_index_or_none(system, each.target) for each in transitions),
        "accumulates_to": indices(_index_or_none(system, each.accumulates_to) for each in transitions),
        "direction": indices(each.guard.direction for each in transitions),
        "marker": indices(each.is_marker for each in transitions),
        "paired": indices(is_paired(system, emitted, i) for i in range(len(transitions))),
        "timed": indices(_is_timed(system, emitted, mode) for mode in modes),
        "timed_jump": indices(map(max, emitted.timed_guard, emitted.timed_reset)),
        "conditional": indices(
            any(each.source == name and each.guard.when is not None for each in transitions)
            for name in system.mode_names
        ),
        "propagator": indices(each.kind for each in emitted.propagators),
        "degree": indices(each.degree for each in emitted.propagators),
        "root": indices(each.root for each in emitted.propagators),
        "tangent_columns": indices(each.series.tangent_columns for each in emitted.propagators),
        "bounded": indices(map(emitted.pulses_excluded, modes)),
        "fragile": indices(map(emitted.is_fragile, modes)),
        "steep": indices(map(bool, emitted.steep)),
        "field_before": indices(before for before, _ in emitted.crossing),
        "field_behind": indices(behind for _, behind in emitted.crossing),
        **_slopes(emitted.slope_columns),
        **clock_arrays(system, emitted),
    }


def _index_or_none(system: HybridSystem, mode: str | None) -> int:
    return NO_MODE if mode is None else system.mode_index(mode)


def _is_timed(system: HybridSystem, emitted: Emitted, mode: int) -> bool:
    """Whether the field of a mode, or one of the guards in it, may depend on time."""
    name = system.mode_names[mode]
    pairs = zip(system.transitions, emitted.timed_guard, strict=True)
    return not emitted.autonomous[mode] or any(timed for each, timed in pairs if each.source == name)


def _slopes(columns: Sequence[Sequence[Sequence[int]]]) -> dict[str, np.ndarray]:
    """The entries of the Jacobians of all modes: where each row begins and ends, and their columns."""
    rows = [row for of_mode in columns for row in of_mode]
    n, ends = len(columns[0]), np.cumsum([0, *map(len, rows)])
    first = np.array([ends[n * mode : n * mode + n + 1] for mode in range(len(columns))])
    return {"first_slope": first, "slope_column": indices(column for row in rows for column in row)}


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
