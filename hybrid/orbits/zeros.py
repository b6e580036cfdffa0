"""Zeros of functions along a curve, by a bracket or by interpolation across a singular place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

# The unknowns are polynomials of a function through places at these shares of the bracket around its zero.
SHARES = (-1.0, -0.6, -0.25, 0.25, 0.6, 1.0)
# A zero is interpolated from the two ends of its bracket and so many places more, the last of which is this
# near to the one before.
MOST_PLACES = 6
SAME = 1e-13


def zero_on_the_way(
    known: dict[float, Any], step: Callable[[float], Any], function: Callable[[Any], float]
) -> Any:
    """What a ``step`` of a length gives where a function of that is zero, between two ``known`` ends.

    None if it does not change its sign, or a step fails.
    """
    from scipy.optimize import brentq

    heights = dict[float, float]()

    def value(s: float) -> float:
        if s not in heights:
            known[s] = known[s] if s in known else step(s)
            if known[s] is None:
                raise ArithmeticError
            heights[s] = function(known[s])
        return heights[s]

    try:
        low, high = sorted(known)
        root = _by_interpolation(value, low, high)
        if root is None:
            root = brentq(value, low, high, xtol=1e-14, rtol=4e-16 * 4, maxiter=60, disp=False)
    except (ArithmeticError, ValueError):
        return None
    return known[min(heights, key=lambda s: abs(s - root))]


def _by_interpolation(value: Callable[[float], float], low: float, high: float) -> float | None:
    """The zero of a function that is nearly a line: the argument as a polynomial of the value, at zero.

    None where that leaves the bracket or does not settle.
    """
    lengths, heights = [low, high], [value(low), value(high)]
    if not heights[0] * heights[1] < 0.0:
        return None
    for _ in range(MOST_PLACES):
        if len(set(heights)) < len(heights):
            return None
        s = at_zero(np.array(heights), np.array(lengths)[:, None]).item()
        if not low < s < high:
            return None
        near = min(abs(s - each) for each in lengths)
        lengths.append(s)
        heights.append(value(s))
        if heights[-1] == 0.0 or near <= SAME:
            return s
    return None


def interpolated(knots: Sequence[tuple[float, np.ndarray, np.ndarray]], s: float) -> np.ndarray:
    """Hermite's polynomial at ``s`` through knots: their place, the unknowns ``(n,)`` and their slopes."""
    places = [each for place, *_ in knots for each in (place, place)]
    table = [each for _, unknowns, _ in knots for each in (unknowns, unknowns)]
    found, product = table[0], 1.0
    for order in range(1, len(places)):
        table = [
            knots[i // 2][2]
            if places[i + order] == places[i]
            else (after - before) / (places[i + order] - places[i])
            for i, (before, after) in enumerate(pairwise(table))
        ]
        product *= s - places[order - 1]
        found = found + product * table[0]
    return found


def at_zero(heights: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
    """The polynomial of ``heights (k,)`` through ``unknowns (k, n)``, at zero (Neville's scheme)."""
    table = unknowns.copy()
    for step in range(1, len(heights)):
        left, right = heights[:-step, None], heights[step:, None]
        table = (right * table[:-1] - left * table[1:]) / (right - left)
    return np.asarray(table[0])
