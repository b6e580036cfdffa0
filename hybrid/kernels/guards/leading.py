"""A cheap proof about a guard that is a series: by its leading powers, with a bound for all the others.

In Bernstein form a polynomial lies between its coefficients. If they all keep to the guard's side, the guard
has no zero; if they fall from one side to the other, it has one. The rest of a guard's questions, and those
that parts of the step leave open, are left to its isolation (``isolate``).
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hybrid.kernels.arithmetic.lanes import four_times, load, store
from hybrid.kernels.events.guards import error_band, rounding_band
from hybrid.kernels.events.onset import BY_SPEED, NO_ROOT, crosses_towards
from hybrid.kernels.guards.form import in_column
from hybrid.kernels.guards.roots import MOST_ROOT_STEPS, UNSEEN, expanded_at
from hybrid.kernels.types.codes import LEADING, NARROW
from hybrid.kernels.types.kinds import REAL
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Rounding of a series, as a share of the sum of the magnitudes of its terms.
ROUNDING_OF_TERMS = 64.0 * EPSILON
# High powers of a series are left out of a proof if their sum is below this share of the size of the guard.
NEGLIGIBLE = 0.003
# What a power of the variable adds to each Bernstein coefficient: ``C(i, k) / C(degree, k)`` in the row
# ``LEADING * degree + k``.
POWERS = np.array(
    [
        [math.comb(i, k) / max(math.comb(n, k), 1) for i in range(LEADING)]
        for n in range(LEADING)
        for k in range(LEADING)
    ]
)
# Verdicts on a guard.
CLEAR, CROSSES, UNKNOWN = range(3)
# If a part this short is not decided, the whole polynomial is used.
SHORTEST_PART = 0.2
# Below this share of a root a step of Newton's method is so short that the next one would be rounding.
SETTLED_STEP = 1e-8


@njit(**INLINE)
def halve(stack, top, degree):
    """Halve the interval in row ``top`` of the stack; the left half, searched first, goes on top."""
    row, left = stack[top], stack[top + 1]
    middle = 0.5 * (row[0] + row[1])
    left[0], left[1] = row[0], middle
    row[0] = middle
    for level in range(degree, -1, -1):
        left[2 + degree - level] = row[2]
        for i in range(2, level + 2):
            row[i] = 0.5 * (row[i] + row[i + 1])


@njit(**INLINE)
def stays(coefficients, degree, side, band):
    """Whether all coefficients lie beyond ``band`` on ``side``: enough to prove nearly every step."""
    for i in range(degree + 1):  # noqa: SIM110 (no generators in kernels)
        if not coefficients[i] * side > band:
            return False
    return True


@njit(**KERNEL)
def leading_to_bernstein(coefficients, degree, stack):
    """Bernstein coefficients from those of powers on ``[0, 1]`` into the first row of a stack.

    One column a register; the degree is below ``LEADING``.
    """
    a, b, c, d = four_times(0.0), four_times(0.0), four_times(0.0), four_times(0.0)
    row = LEADING * degree
    for k in range(degree + 1):
        power = coefficients[k]
        a = load(POWERS, row + k, 0) * power + a
        b = load(POWERS, row + k, NARROW) * power + b
        c = load(POWERS, row + k, 2 * NARROW) * power + c
        d = load(POWERS, row + k, 3 * NARROW) * power + d
    store(stack, 0, 2, a)
    store(stack, 0, 2 + NARROW, b)
    store(stack, 0, 2 + 2 * NARROW, c)
    store(stack, 0, 2 + 3 * NARROW, d)


@njit(**INLINE)
def leading_powers(series, column, order, power, known_roots, size, coefficients, h):
    """The first power coefficients on ``[0, 1]`` of a series, divided by its variable for each root at 0.

    ``size`` is the sum of the magnitudes of its terms from there on, ``power`` the power of ``h`` in the
    first. Returns the degree from which on the others are a small part of the sum, and a bound for them.
    """
    rest, degree = size, 0
    for k in range(known_roots, order + 1):
        term = series[k, column] * power
        degree = k - known_roots
        coefficients[degree] = term
        rest -= abs(term)
        if rest <= NEGLIGIBLE * size:
            break
        power *= h
    # Including the rounding of this sum.
    return degree, max(rest, 0.0) + ROUNDING_OF_TERMS * size


@njit(**INLINE)
def falls_throughout(coefficients, degree, slope_of_rest, side):
    """Whether ``side`` times a polynomial in Bernstein form falls everywhere, with what has been left out."""
    least = slope_of_rest / max(degree, 1)
    for i in range(degree):
        if not (coefficients[i] - coefficients[i + 1]) * side > least:
            return False
    return degree > 0


@njit(**KERNEL)
def judge_leading(degree, rest, slope_of_rest, side, band, last, stack):
    """Proofs about a guard by its leading powers, part by part from the start of the step.

    ``stack[0, 2:]`` are their Bernstein coefficients; all the others add no more than ``rest``, and no more
    than ``slope_of_rest`` to the slope; ``last`` is the value at the end of the step, with them. Returns
    ``CLEAR`` if the guard keeps beyond ``band`` on its side; ``CROSSES`` and a part with signs that differ at
    its ends if it falls throughout that part, and is clear before; else ``UNKNOWN``. The row of ``stack``
    that holds the part comes last.
    """
    top = 0
    stack[0, 0], stack[0, 1] = 0.0, 1.0
    while top >= 0:
        row = stack[top]
        start, end = row[0], row[1]
        if stays(row[2:], degree, side, band + rest):
            top -= 1
            continue
        # At the ends of the step the exact values are known.
        left = row[2] * side - (rest + band if start > 0.0 else 0.0)
        right = last * side if end == 1.0 else row[2 + degree] * side + rest
        if (
            left > 0.0
            and right < 0.0
            and falls_throughout(row[2:], degree, slope_of_rest * (end - start), side)
        ):
            return CROSSES, start, end, top
        if end - start < SHORTEST_PART:
            return UNKNOWN, start, end, top
        halve(stack, top, degree)
        top += 1
    return CLEAR, 0.0, 1.0, 0


class Bracket(NamedTuple):
    """Two places of a step with one root between them, and the values there, up to a positive factor."""

    low: REAL
    high: REAL
    left: REAL
    right: REAL


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


@njit(**KERNEL)
def root_between(path, column, known_roots, bracket, side):
    """The one root of a series in an interval where it is monotone; the sign before it is ``side``.

    The series is divided by its variable for each known root at 0; in the end it is taken as it is, which at
    0 is zero up to rounding only; but not to a root at 0, where the step begins.
    """
    s, h = simple_root_of(path, column, known_roots, bracket, side), path.length
    for _ in range(MOST_ROOT_STEPS if known_roots > 0 else 0):
        value, slope, _ = expanded_at(path.powers, column, 0, path.degree, s)
        shift = -value / slope if slope != 0.0 else 0.0
        if not abs(shift) <= 1e-6 * h or not 0.5 * s <= s + shift <= h:
            break
        s += shift
        if abs(shift) <= EPSILON * s:
            break
    return s


@njit(**KERNEL)
def crossing_by_leading(model, method, run, transition, column, path, work):
    """A verdict on a guard, a column of a series, and the share of the step at which it crosses.

    The last result says whether the guard is beyond all errors at both ends of the part that it crosses on.
    A guard that leaves zero by its speed is divided by the step's variable.
    """
    powers, order, h, side = path.powers, path.degree, path.length, run.side[transition]
    known = 1 if run.on_guard[transition] == BY_SPEED else 0
    model.guard_gradient(transition, path.start, run.y, model.parameters, work.gradient)
    if path.exact:
        band = rounding_band(model, run, transition, path.start, run.y, work)
    else:
        band = error_band(method, run, work.gradient, model.controlled)
    band, size = in_column(path, column, band), powers[order + 2, column] - known * abs(powers[0, column])
    degree, rest = leading_powers(
        powers, column, order, h if known == 1 else 1.0, known, size, work.polynomial, h
    )
    if degree >= LEADING:
        return UNKNOWN, NO_ROOT, False
    leading_to_bernstein(work.polynomial, degree, work.stack)
    verdict, start, end, row = judge_leading(
        degree, rest, order * rest, side, band, powers[order + 1, column], work.stack
    )
    if verdict != CROSSES:
        return verdict, NO_ROOT, False
    if not crosses_towards(model.direction[transition], -side):
        return UNKNOWN, NO_ROOT, False
    left, right = work.stack[row, 2], work.stack[row, 2 + degree]
    last = powers[order + 1, column] if end == 1.0 else right
    certain = min(left * side, -last * side) > band + rest
    bracket = Bracket(start * h, end * h, left, right)
    return CROSSES, root_between(path, column, known, bracket, side) / h, certain
