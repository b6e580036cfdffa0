"""Zeros of functions along a curve, by a bracket or by interpolation across a singular place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

# The unknowns are polynomials of a function through places at these shares of the bracket around its zero.
SHARES = (-1.0, -0.6, -0.25, 0.25, 0.6, 1.0)


def zero_on_the_way(
    known: dict[float, Any], step: Callable[[float], Any], function: Callable[[Any], float]
) -> Any:
    """What a ``step`` of a length gives where a function of that is zero, between two ``known`` ends.

    None if it does not change its sign, or a step fails.
    """
    from scipy.optimize import brentq

    def value(s: float) -> float:
        if s not in known:
            known[s] = step(s)
        if known[s] is None:
            raise ArithmeticError
        return function(known[s])

    try:
        root = brentq(value, *known, xtol=1e-14, rtol=4e-16 * 4, maxiter=60, disp=False)
    except (ArithmeticError, ValueError):
        return None
    return known[min(known, key=lambda s: abs(s - root))]


def at_zero(heights: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
    """The polynomial of ``heights (k,)`` through ``unknowns (k, n)``, at zero (Neville's scheme)."""
    table = unknowns.copy()
    for step in range(1, len(heights)):
        left, right = heights[:-step, None], heights[step:, None]
        table = (right * table[:-1] - left * table[1:]) / (right - left)
    return np.asarray(table[0])
