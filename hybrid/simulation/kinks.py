"""Whether the modes on the sides of a kink move a state alike."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from hybrid.system.derivatives import evaluate, sample_points
from hybrid.system.elements import Transition
from hybrid.system.functions import ModelFunction, field_function, guard_function
from hybrid.system.graph import HybridSystem
from hybrid.system.periodicity import EPSILON, rounding

# What a run knows of a guard whose speed and acceleration vanish with it: no side is told.
NO_SIDE = 3
# Fields are compared on the guard at this distance from the state, in sizes of its components.
DISTANCE = 1e-2
MOST_STEPS = 8


def move_alike(system: HybridSystem, model: Any, run: Any, modes: list[str]) -> bool:
    """Whether continuous kinks join the modes that allow a start, and tell no side of it.

    A state in the wrong one of two such modes passes to the other without a change as soon as it moves. Where
    fields agree at the start alone (a two-fold), each mode may lead elsewhere.
    """
    own = np.array(model.parameters[: len(system.parameters)])
    start = _Start(system, own, float(run.phase), np.array(run.y[: system.dimension]))
    met: set[str | None] = {*modes[:1]}
    for _ in modes:
        for transition, on_guard in zip(system.transitions, run.on_guard, strict=True):
            pair = {transition.source, transition.target}
            if on_guard != NO_SIDE or not pair.issubset(modes) or len(pair & met) != len(pair) - 1:
                continue
            # The kink may be passed in one direction alone; no transition of the other may change the state.
            if all(start.is_kink(each) for each in system.transitions if {each.source, each.target} == pair):
                met |= pair
    return bool(modes) and met.issuperset(modes)


@attrs.frozen(eq=False)
class _Start:
    system: HybridSystem
    parameters: np.ndarray
    t: float
    x: np.ndarray

    def is_kink(self, transition: Transition) -> bool:
        """Whether state and field are continuous across the guard of a transition, here and near."""
        if transition.reset is not None or transition.target is None:
            return False
        n, modes = self.system.dimension, self.system.modes
        before, after = (
            field_function(modes[self.system.mode_index(name)], self.system.variables)
            for name in (transition.source, transition.target)
        )
        guard = guard_function(transition)
        size = DISTANCE * np.where(self.x == 0.0, 1.0, np.abs(self.x))
        around = (self._onto(guard, self.x + size * offset) for _, offset in sample_points(n))
        return all(self._agree(before, after, x) for x in (self.x, *around) if x is not None)

    def _value(self, function: ModelFunction, x: np.ndarray) -> np.ndarray | None:
        found = evaluate(self.system.variables, function.value, self.t, x, self.parameters)
        return None if found is None else np.asarray(found)

    def _agree(self, one: ModelFunction, other: ModelFunction, x: np.ndarray) -> bool:
        """Whether two fields are the same at a state, up to rounding."""
        here, there = self._value(one, x), self._value(other, x)
        if here is None or there is None:
            return False
        shaken = rounding(self.system.variables, one, self.t, x, self.parameters, here)
        return bool(np.all(np.abs(there - here) <= 64 * EPSILON * np.abs(here) + shaken))

    def _onto(self, guard: ModelFunction, x: np.ndarray) -> np.ndarray | None:
        """The state moved onto the guard along its gradient; None if the guard is not met near it."""
        step = np.cbrt(EPSILON)
        for _ in range(MOST_STEPS):
            places = np.vstack([x, x + step * np.eye(len(x)), x - step * np.eye(len(x))])
            values = [
                found[0] for found in (self._value(guard, each) for each in places) if found is not None
            ]
            if len(values) < len(places):
                return None
            height, ahead, behind = np.split(np.array(values), [1, 1 + len(x)])
            slopes = (ahead - behind) / (2.0 * step)
            if abs(height[0]) <= 4 * EPSILON * float(np.abs(slopes) @ np.abs(x)):
                return x
            if not slopes @ slopes > 0.0:
                return None
            x = x - height * slopes / (slopes @ slopes)
        return None
