"""Guards along a series: their polynomials, proofs that they have no zero, the earliest crossing."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hybrid.kernels.arithmetic.bernstein import NO_ROOT, crosses_towards, halve, stays
from hybrid.kernels.arithmetic.lanes import four_times, load, store
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    error_band,
    guard_value,
    rounding_band,
    size_of_time,
)
from hybrid.kernels.events.onset import BY_SPEED, LATER
from hybrid.kernels.events.path import time_at
from hybrid.kernels.events.resolution import (
    MARGIN,
    UNDERFLOW,
    keep_outcome,
    keep_side,
    keeps_sign,
    set_sides_before,
    underflows,
)
from hybrid.kernels.guards.isolate import guard_at_start
from hybrid.kernels.guards.pieces import NO_COLUMN, Guard, as_column
from hybrid.kernels.guards.touch import forget_touches, share_with_one_touch
from hybrid.kernels.steps.series_roots import Bracket, root_between
from hybrid.kernels.types.codes import NARROW, NO_TRANSITION
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Number of terms at the end of a series by which its error is judged: some may be zero.
TAIL_OF_GUARD = 5
# Rounding of a series, as a share of the sum of the magnitudes of its terms.
ROUNDING_OF_TERMS = 64.0 * EPSILON
# High powers of a series are left out of a proof if their sum is below this share of the size of the guard.
NEGLIGIBLE = 0.003

# What a power of the variable adds to each Bernstein coefficient: ``C(i, k) / C(degree, k)`` in the row
# ``DEGREES * degree + k``.
DEGREES = 4 * NARROW
POWERS = np.array(
    [
        [math.comb(i, k) / max(math.comb(n, k), 1) for i in range(DEGREES)]
        for n in range(DEGREES)
        for k in range(DEGREES)
    ]
)
# Verdicts on a guard.
CLEAR, CROSSES, UNKNOWN = range(3)
# If a part this short is not decided, the whole polynomial is used.
SHORTEST_PART = 0.2
# What a crossing counts that is not certain: a guard that is clear of zero on both sides of it is.
UNCERTAIN = 2


@njit(**KERNEL)
def leading_to_bernstein(coefficients, degree, stack):
    """Bernstein coefficients from those of powers on ``[0, 1]`` into the first row of a stack.

    One column a register; the degree is below ``DEGREES``.
    """
    a, b, c, d = four_times(0.0), four_times(0.0), four_times(0.0), four_times(0.0)
    row = DEGREES * degree
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
def beyond_known_roots(series, column, h, known_roots, size):
    """The sum of the magnitudes of all terms without the known ones, and the power of ``h`` in the next."""
    power = 1.0
    for k in range(known_roots):
        size -= abs(series[k, column]) * power
        power *= h
    return size, power


@njit(**INLINE)
def keeps_half(first, value, size):
    """A cheap proof that a polynomial on ``[0, 1]`` keeps half of its ``first`` value, from its value at 1.

    With ``size`` the sum of the magnitudes of its terms, those that take it down on the way come to
    ``(size - value) / 2``.
    """
    return first > size - value + ROUNDING_OF_TERMS * size


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


@njit(**INLINE)
def last_terms(series, column, order, h):
    """The sum of the magnitudes of the last terms of a series: more than all that are left out."""
    least, total, power = max(order - TAIL_OF_GUARD, 0) + 1, 0.0, 1.0
    for o in range(order, least - 1, -1):
        total = total * h + abs(series[o, column])
    for _ in range(least):
        power *= h
    return total * power


@njit(**INLINE)
def is_close(series, column, order, error):
    """Whether a guard with a series is closer to zero than an error, at the start or the end of the step."""
    return abs(series[order + 1, column]) < error or abs(series[0, column]) < error


@njit(**INLINE)
def underflows_on_series(series, column, order):
    """``underflows`` for a guard with a series."""
    return max(abs(series[0, column]), abs(series[order + 1, column])) < UNDERFLOW


@njit(**KERNEL)
def is_resolved_by_series(model, run, transition, column, path, on_guard, work):
    """Whether the end of the series leaves the sign of a guard at both ends of the step alone.

    As ``runge_kutta_guards.is_resolved``. ``column`` is that of the guard, or ``NO_COLUMN`` if the guard is
    no series.
    """
    n, series, order, t, h = model.dimension, path.powers, path.degree, path.start, path.length
    if model.degree[run.mode] > 0 or on_guard > 0:
        # A polynomial has no other terms; the derivatives of a guard that is zero tell its side.
        return True
    if column != NO_COLUMN:
        if 0.0 < abs(series[0, column]) < UNDERFLOW:
            # The last terms have no digits.
            return False
        # Rounding of a sum of terms that cancel is less on a shorter step, rounding of the state is not.
        error = MARGIN * last_terms(series, column, order, h) + EPSILON * series[order + 2, column]
        if not is_close(series, column, order, error):
            return True
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        size = abs(work.gradient[n]) * size_of_time(model, t)
        for i in range(n):
            size += abs(work.gradient[i]) * max(abs(run.y[i]), abs(series[order + 1, i]))
        rounding = ROUNDING_OF_STATE * EPSILON * size
        guard = Guard(transition, column, 0, on_guard, 0.0, 0.0, 0.0)
        return error <= as_column(model, run, guard, rounding)
    for i in range(n):
        work.trial[i] = series[order + 1, i]
        size = max(abs(series[0, i]), abs(series[1, i] * h), abs(work.trial[i]))
        error = last_terms(series, i, order, h)
        work.field_after[i] = error if error > ROUNDING_OF_STATE * EPSILON * size else 0.0
    later = time_at(path, h)
    return keeps_sign(model, transition, t, run.y, work) and keeps_sign(
        model, transition, later, work.trial, work
    )


class Leading(NamedTuple):
    """A guard that is a column of a series, as its leading powers are judged.

    ``side`` is its sign before, and ``on_guard`` its order at the start: so many powers are ``known`` to be
    zero. All the others come to ``size``; ``power`` is that of the step's length in the first of them. Within
    ``band`` the guard may touch zero.
    """

    transition: INTEGER
    column: INTEGER
    side: INTEGER
    on_guard: INTEGER
    known: INTEGER
    size: REAL
    power: REAL
    band: REAL


@njit(**INLINE)
def leading_of(model, method, run, guard, path, work):
    """The ``Leading`` of a guard, and whether the guard rests at zero."""
    transition, column, t = guard.transition, guard.column, path.start
    model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
    known = 1 if guard.on_guard == BY_SPEED else 0
    size, power = beyond_known_roots(
        path.powers, column, path.length, known, path.powers[path.degree + 2, column]
    )
    rests, band = False, 0.0
    if path.exact or guard.on_guard > 0:
        band = as_column(model, run, guard, rounding_band(model, run, transition, t, run.y, work))
        rests = guard.on_guard > 0 and size <= band
    if not path.exact:
        band = as_column(model, run, guard, error_band(method, run, work.gradient, model.controlled))
    return Leading(transition, column, guard.side, guard.on_guard, known, size, power, band), rests


@njit(**KERNEL)
def crossing_by_leading(model, run, guard, path, work):
    """``crossing_on_series`` by the leading powers of a guard, with a verdict, which may be ``UNKNOWN``."""
    series, order, h, side = path.powers, path.degree, path.length, guard.side
    column, transition = guard.column, guard.transition
    degree, rest = leading_powers(
        series, column, order, guard.power, guard.known, guard.size, work.polynomial, h
    )
    if degree >= DEGREES:
        return UNKNOWN, NO_ROOT, True
    leading_to_bernstein(work.polynomial, degree, work.stack)
    verdict, start, end, row = judge_leading(
        degree, rest, order * rest, side, guard.band, series[order + 1, column], work.stack
    )
    if verdict != CROSSES:
        return verdict, NO_ROOT, True
    if not crosses_towards(model.direction[transition], -side):
        return UNKNOWN, NO_ROOT, True
    if underflows_on_series(series, column, order):
        return CROSSES, NO_ROOT, True
    # What is far from a bound for the last terms is resolved.
    seen = degree <= order - TAIL_OF_GUARD and not is_close(series, column, order, MARGIN * rest + UNDERFLOW)
    resolved = seen or is_resolved_by_series(model, run, transition, column, path, guard.on_guard, work)
    bracket = Bracket(start * h, end * h, work.stack[row, 2], work.stack[row, 2 + degree])
    run.rehearsal[3, transition] = side
    last = series[order + 1, column] if end == 1.0 else work.stack[row, 2 + degree]
    certain = min(work.stack[row, 2] * side, -last * side) > guard.band + rest
    run.crossings += 1 if certain and resolved else UNCERTAIN
    return CROSSES, root_between(path, column, guard.known, bracket, side) / h, resolved


@njit(**KERNEL)
def crossing_by_pieces(attempts, model, method, run, transition, column, path, work):
    """``crossing_on_series`` by the isolation of the guard on pieces of the path.

    ``column`` is that of the guard, or ``NO_COLUMN`` if the guard is no series.
    """
    on_guard, later, order, end = run.on_guard[transition], time_at(path, path.length), path.degree, 0.0
    for i in range(model.dimension):
        work.trial[i] = path.powers[order + 1, i]
    if on_guard >= LATER:
        if column == NO_COLUMN:
            end = guard_value(model, transition, later, work.trial, work.scalar)
        else:
            end = path.powers[order + 1, column]
    theta, share = attempts.crossing_on_path(model, method, run, transition, column, path, end, work)
    side = run.rehearsal[3, transition]
    run.rehearsal[3, transition] = 0
    if column == NO_COLUMN:
        small = underflows(model, transition, path.start, run.y, later, work.trial, work.scalar)
    else:
        small = underflows_on_series(path.powers, column, order)
    if small:
        return NO_ROOT, share, True
    resolved = is_resolved_by_series(model, run, transition, column, path, on_guard, work)
    keep_outcome(run, transition, theta, side)
    return theta, share, resolved


@njit(**KERNEL)
def crossing_on_series(attempts, model, method, run, transition, column, path, work):
    """Where a guard crosses, the share of the step that is proved, and whether the crossing is resolved."""
    if column != NO_COLUMN:
        guard = guard_at_start(model, run, transition, column)
        leading, rests = leading_of(model, method, run, guard, path, work)
        if rests:
            run.crossings += UNCERTAIN
            return NO_ROOT, 1.0, True
        if guard.on_guard < LATER:
            # The second cheap proof: the leading powers keep to their side, whatever the others do.
            verdict, theta, resolved = crossing_by_leading(model, run, leading, path, work)
            if verdict != UNKNOWN:
                run.on_guard[transition] = 0
                return theta, 1.0, resolved
    run.crossings += UNCERTAIN
    return crossing_by_pieces(attempts, model, method, run, transition, column, path, work)


@njit(**KERNEL)
def earliest_on_series(attempts, model, method, run, path, work):
    """Earliest crossing on a step over the guards of the mode, and its transition.

    Returns ``(theta, transition, proved, blurred)``, and brings sides up to date, as
    ``runge_kutta_guards.earliest_crossing`` does, with the sides before crossings kept. A guard that is a
    series itself is a polynomial, up to the remainder of the series; what it is a sum of stands behind the
    series. For any other guard its own expression is bounded on the series of the state.
    """
    mode, series, order = run.mode, path.powers, path.degree
    earliest, fired, proved, blurred = NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION
    forget_touches(run)
    run.crossings = 0
    first = model.first_outgoing[mode]
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition, column = model.outgoing[slot], NO_COLUMN
        keep_side(run, transition)
        if model.guard_in_series[transition] == 1:
            column, side = model.dimension + slot - first, run.side[transition]
            value, size = series[order + 1, column] * side, series[order + 2, column]
            if run.on_guard[transition] == 0 and keeps_half(series[0, column] * side, value, size):
                continue
        theta, share, resolved = crossing_on_series(
            attempts, model, method, run, transition, column, path, work
        )
        proved = min(proved, share)
        if not resolved:
            blurred = transition
        if theta < earliest:
            earliest, fired = theta, transition
    set_sides_before(model, run, earliest)
    return earliest, fired, min(proved, share_with_one_touch(run)), blurred
