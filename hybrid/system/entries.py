"""Entries of modes: which transitions make one, and where the time since an entry counts."""

from __future__ import annotations

import numpy as np

from hybrid.system.elements import Transition
from hybrid.system.graph import HybridSystem


def enters_anew(system: HybridSystem, transition: Transition) -> bool:
    """Whether a transition enters its target anew: not if it marks, or leads to another part of its mode."""
    if transition.target is None or transition.is_marker:
        return False
    source, target = map(system.mode_index, (transition.source, transition.target))
    whole, other = system.modes[source].part_of, system.modes[target].part_of
    return transition.part_of is not None or whole is None or whole != other


def has_age(system: HybridSystem, mode: str) -> bool:
    """Whether the age counts in a mode: elsewhere it is zero, and no perturbation moves it."""
    index = system.mode_index(mode)
    return (system.modes[index].part_of or mode) in system.aging


def are_ageless(system: HybridSystem, modes: np.ndarray) -> np.ndarray:
    """In which of these modes the state has no age, ``(N,)``; all count if it has one everywhere."""
    ageless = [mode for mode in system.mode_names if system.age is None or not has_age(system, mode)]
    found = np.isin(modes, ageless)
    return found | ~found.any()
