"""Entries of modes: which transitions make one, and where the time since an entry counts."""

from __future__ import annotations

import numpy as np

from hybrid.errors import ModelError
from hybrid.system.clocks import Clock
from hybrid.system.delayed import marks_alone
from hybrid.system.elements import Transition
from hybrid.system.graph import HybridSystem


def enters_anew(system: HybridSystem, transition: Transition) -> bool:
    """Whether a transition enters its target anew: not if it marks, or leads to another part of its mode."""
    if transition.target is None or transition.is_marker or marks_alone(transition):
        return False
    source, target = map(system.mode_index, (transition.source, transition.target))
    whole, other = system.modes[source].part_of, system.modes[target].part_of
    return transition.part_of is not None or whole is None or whole != other


def whole_mode(system: HybridSystem, mode: str) -> str:
    """The mode that one is a part of, or itself."""
    return system.modes[system.mode_index(mode)].part_of or mode


def enters_itself(system: HybridSystem, transition: Transition) -> bool:
    """Whether a transition leads from a mode, or a part of it, to itself and enters it anew."""
    if transition.target is None or not enters_anew(system, transition):
        return False
    return whole_mode(system, transition.source) == whole_mode(system, transition.target)


def begins_age(system: HybridSystem, transition: Transition) -> bool:
    """Whether the age of the target begins anew at a transition.

    It does at each entry. Where all clocks count from the entry from another mode, it does at those alone.
    """
    if not enters_anew(system, transition):
        return False
    clocks = _counting(system, whole_mode(system, transition.source))
    return not (enters_itself(system, transition) and clocks) or any(each.restarts for each in clocks)


def check_ages(system: HybridSystem) -> None:
    """ModelError if the clocks of a mode count from two times, which one age does not tell."""
    for transition in system.transitions:
        mode = whole_mode(system, transition.source)
        if enters_itself(system, transition) and len({each.restarts for each in _counting(system, mode)}) > 1:
            raise ModelError(
                f"Mode {mode!r} has clocks After with restarts=True and with restarts=False, and transition "
                f"{transition.name!r} enters it anew: tangent vectors would need two times of entry. Replace "
                "one of the clocks by a guard on a component of rate 1, which the transitions into the mode "
                "set to 0. Runs without tangent vectors need no change."
            )


def _counting(system: HybridSystem, mode: str) -> list[Clock]:
    """The clocks of a whole mode that count from an entry."""
    return [
        each.clock
        for each in system.transitions
        if each.clock and each.clock.counts_from_entry and whole_mode(system, each.source) == mode
    ]


def has_age(system: HybridSystem, mode: str) -> bool:
    """Whether the age counts in a mode: elsewhere it is zero, and no perturbation moves it."""
    index = system.mode_index(mode)
    return (system.modes[index].part_of or mode) in system.aging


def are_ageless(system: HybridSystem, modes: np.ndarray) -> np.ndarray:
    """In which of these modes the state has no age, ``(N,)``; all count if it has one everywhere."""
    ageless = [mode for mode in system.mode_names if system.age is None or not has_age(system, mode)]
    found = np.isin(modes, ageless)
    return found | ~found.any()
