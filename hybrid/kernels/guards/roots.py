"""Roots of a guard that is a series, and the place on a step where its clock shows a time."""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.events.path import value_at
from hybrid.kernels.types.kinds import REAL
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Safety factor for the estimated error of the last step towards a root, which leaves out higher derivatives.
UNSEEN = 64.0
# Below this share of a root a step of Newton's method is so short that the next one would be rounding.
SETTLED_STEP = 1e-8
# Most steps of Newton's method from a root without to one with what is zero at the start up to rounding.
MOST_CORRECTIONS = 60


class Bracket(NamedTuple):
    """Two places of a step with one root between them, and the values there, up to a positive factor."""

    low: REAL
    high: REAL
    left: REAL
    right: REAL


@njit(**INLINE)
def expanded_at(series, column, first, order, s):
    """Value, derivative and half the second one of a series divided by its variable to the power ``first``.

    Horner's scheme in ``s**2`` for even and for odd terms, which do not wait for each other.
    """
    square = s * s
    even, even_slope, even_bend = 0.0, 0.0, 0.0
    odd, odd_slope, odd_bend = 0.0, 0.0, 0.0
    top = order
    if (order - first) % 2 == 0:
        even = series[order, column]
        top = order - 1
    for o in range(top, first, -2):
        odd_bend = odd_bend * square + odd_slope
        odd_slope = odd_slope * square + odd
        odd = odd * square + series[o, column]
        even_bend = even_bend * square + even_slope
        even_slope = even_slope * square + even
        even = even * square + series[o - 1, column]
    value = even + s * odd
    slope = odd + 2.0 * (s * even_slope + square * odd_slope)
    bend = even_slope + s * (3.0 * odd_slope + 4.0 * (s * even_bend + square * odd_bend))
    return value, slope, bend


@njit(**KERNEL)
def time_of(series, clock, order, h, span):
    """Place on ``[0, h]`` where the clock shows ``span``: Newton's method in a bracket; time only grows."""
    low, high = 0.0, h
    # The clock may start at speed zero; the place then grows like the root of the time.
    s = h * math.sqrt(min(max(span / value_at(series, clock, order, h), 0.0), 1.0))
    if s == 0.0:
        return s
    for _ in range(100):
        value, slope, _ = expanded_at(series, clock, 0, order, s)
        misfit = value - span
        if misfit > 0.0:
            high = s
        else:
            low = s
        newton = s - misfit / slope
        # Where the step is rounding, the place itself is an end of the bracket.
        if abs(newton - s) <= 2.0 * EPSILON * s:
            return min(newton, h)
        if not low < newton < high:
            newton = 0.5 * (low + high)
        if high - low <= 2.0 * EPSILON * high:
            return newton
        s = newton
    return s


@njit(**KERNEL)
def root_between(path, column, known_roots, bracket, side):
    """The one root of a series in an interval where it is monotone; the sign before it is ``side``.

    The series is divided by its variable for each known root at 0; in the end it is taken as it is, which at
    0 is zero up to rounding only; but not to a root at 0, where the step begins.
    """
    s, h = simple_root_of(path, column, known_roots, bracket, side), path.length
    for _ in range(MOST_CORRECTIONS if known_roots > 0 else 0):
        value, slope, _ = expanded_at(path.powers, column, 0, path.degree, s)
        shift = -value / slope if slope != 0.0 else 0.0
        if not abs(shift) <= 1e-6 * h or not 0.5 * s <= s + shift <= h:
            break
        s += shift
        if abs(shift) <= EPSILON * s:
            break
    return s


@njit(**INLINE)
def simple_root_of(path, column, known_roots, bracket, side):
    """``root_between`` of the series divided by what is known, by Halley's method and Newton's in a bracket.

    The error after a step of Halley's is about the cube of the step, over the square of the length on which
    the guard bends: where that is rounding, it need not be looked at.
    """
    low, high, left, right = bracket
    s, last = low + (high - low) * (left / (left - right)), high - low
    if not low < s < high:
        s = 0.5 * (low + high)
    for _ in range(100):
        value, slope, bend = expanded_at(path.powers, column, known_roots, path.degree, s)
        if value == 0.0:
            return s
        if (value > 0.0) == (side > 0):
            low = s
        else:
            high = s
        shift = -value / slope if slope != 0.0 else math.inf
        curve = bend / slope if slope != 0.0 else math.inf
        # Far from the root, next to a turning point, Halley's steps would be as short as the slope is small.
        if abs(shift * curve) < 0.5:
            shift /= 1.0 + shift * curve
        closer, change = s + shift, abs(shift)
        # The steps of the method shrink here; a step that does not shrink is rounding.
        if change <= EPSILON * s or (last < SETTLED_STEP * s and change > 0.25 * last):
            return s
        if low < closer < high:
            if UNSEEN * ((abs(curve) + 1.0 / path.length) * change) ** 2 * change <= EPSILON * s:
                return closer
        else:
            # A bisection says nothing of how the steps of the method shrink.
            closer, change = 0.5 * (low + high), math.inf
        if high - low <= EPSILON * high:
            return closer
        s, last = closer, change
    return s
