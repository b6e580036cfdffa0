"""Sizes of the components along a run, each in its own unit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybrid.simulation.arc import HybridArc
from hybrid.system.derivatives import evaluate
from hybrid.system.functions import ModelFunction, field_function, reset_function
from hybrid.system.graph import HybridSystem

# Derivative ``(n, n + 1)`` of the function of a mode or transition of that index.
Derivative = Callable[[ModelFunction, int, float, np.ndarray], np.ndarray]

# A component that stays small is given this share of what the others make of it.
SHARE = 1e-3
# The sizes of terms are told by changes of the state by this share of the sizes of its components.
NUDGE = 1e-3


def sizes_along(
    system: HybridSystem, values: np.ndarray, arc: HybridArc, derivative: Derivative
) -> np.ndarray:
    """The largest absolute value ``(n,)`` of each component, or a share of what the others make of it.

    Rounding of the others reaches a component that stays near zero: by a reset, or by the field in the time
    in which the state changes by its size, at most that of the run. A share of the largest component would
    depend on the units.
    """
    size = np.abs(arc.x).max(axis=0)
    made = np.zeros_like(size)
    duration = float(arc.t[-1] - arc.t[0])
    places = [(str(arc.mode[0]), float(arc.t[0]), arc.x[0])]
    for jump in arc.jumps:
        places.append((jump.source, jump.t, jump.x_minus))
        index = system.transition_index(jump.transition)
        reset = reset_function(system.transitions[index], system.variables)
        if reset is not None:
            made = np.maximum(made, _absolute(derivative(reset, index, jump.t, jump.x_minus)) @ size)
    for mode, t, x in places:
        index = system.mode_index(mode)
        function = field_function(system.modes[index], system.variables)
        slopes = _absolute(derivative(function, index, t, x))
        rates = evaluate(system.variables, function.value, t, x, values)
        speeds = np.zeros_like(size) if rates is None else np.abs(rates)
        # The spectral radius, unlike a norm, does not depend on the units of the components.
        rate = float(np.abs(np.linalg.eigvals(slopes)).max())
        time = min(duration, 1.0 / rate) if rate > 0.0 else duration
        made = np.maximum(made, time * (slopes @ size + speeds))
    found = np.maximum(size, SHARE * made)
    # A component that is zero, and stays so, has no size.
    return np.where(found > 0.0, found, 1.0)


def _absolute(derivative: np.ndarray) -> np.ndarray:
    """Absolute values ``(n, n)`` of a derivative in the state, zero where it is not finite."""
    slopes = np.abs(derivative[:, :-1])
    return np.where(np.isfinite(slopes), slopes, 0.0)


def sizes_of_terms(
    function: Callable[[np.ndarray], Any], x: np.ndarray, values: np.ndarray, scale: np.ndarray
) -> np.ndarray:
    """Sizes of the terms of a function, to which each component contributes what its size makes."""
    sizes = np.abs(values)
    for i in np.flatnonzero(scale):
        aside = x.copy()
        aside[i] += NUDGE * scale[i]
        sizes = np.maximum(sizes, np.abs(function(aside) - values) / NUDGE)
    return np.asarray(sizes)
