"""The first event on the path of a step: cheap proofs about each guard, and its isolation where they fail.

All methods ask here. A path is a series, or the interpolant of an attempted Runge-Kutta step. A guard that is
a column of the path is a polynomial, up to the error of the method; for any other guard its own expression is
bounded on the path of the state.

Error control keeps the error of a step below the tolerances, not below the state: a state that decays below
its absolute tolerance may have either sign at the end of a step, and anything between. A change of side found
there is one of the error. So a step on which a guard changes sides, or grazes, must tell the sides at its
ends, unless the guard moves on through zero; else the step is repeated with a shorter length, on which the
error is smaller.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from hybrid.kernels.arithmetic.bernstein import NO_ROOT, crosses_towards, halve, stays
from hybrid.kernels.arithmetic.lanes import four_times, load, store
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    error_band,
    guard_speed,
    guard_value,
    rounding_band,
)
from hybrid.kernels.events.onset import BY_SPEED, LATER
from hybrid.kernels.events.path import end_of, time_along, time_at
from hybrid.kernels.events.resolution import (
    UNDERFLOW,
    keep_outcome,
    keep_side,
    set_sides_before,
    underflows,
)
from hybrid.kernels.guards.isolate import guard_at_start
from hybrid.kernels.guards.pieces import NO_COLUMN, in_column
from hybrid.kernels.guards.roots import Bracket, root_between
from hybrid.kernels.guards.touch import forget_touches, note_touch, share_with_one_touch
from hybrid.kernels.types.codes import LEADING, NARROW, NO_TRANSITION
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL
from hybrid.kernels.types.task import task_of

# The signs at the ends of a step must bear so many times its estimated error.
MARGIN = 100.0
# Number of terms at the end of a series by which its error is judged: some may be zero.
TAIL_OF_GUARD = 5
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
# What a crossing counts that is not certain: a guard that is clear of zero on both sides of it is.
UNCERTAIN = 2


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
def judge_leading(degree, rest, slope_of_rest, side, band, last, shortest, stack):
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
        if end - start < shortest:
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
def underflows_in_column(powers, column, order):
    """``underflows`` for a guard that is a column of the path."""
    return max(abs(powers[0, column]), abs(powers[order + 1, column])) < UNDERFLOW


@njit(**INLINE)
def keep_error(i, error, size, work):
    """Keep how far a step may be off in component ``i``, where it is more than the rounding of its size."""
    work.path_error[i] = error if error > ROUNDING_OF_STATE * EPSILON * size else 0.0


@njit(**INLINE)
def keep_error_of_series(model, path, work):
    """Keep how far the terms that a series leaves out may move the state at the end of its path."""
    series, order, h = path.powers, path.degree, path.length
    for i in range(model.dimension):
        size = max(abs(series[0, i]), abs(series[1, i] * h), abs(series[order + 1, i]))
        keep_error(i, last_terms(series, i, order, h), size, work)


@njit(**INLINE)
def moved_by_error(model, work):
    """How far the error of a step may move a guard with the gradient ``work.gradient``."""
    moved = 0.0
    for i in range(model.dimension):
        moved += abs(work.gradient[i]) * work.path_error[i]
    return moved


@njit(**KERNEL)
def is_clear(model, transition, t, x, work):
    """Whether a guard is farther from zero at ``x (n,)`` than the error of the step may move it."""
    value = abs(guard_value(model, transition, t, x, work.scalar))
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return not value < MARGIN * moved_by_error(model, work)


@njit(**KERNEL)
def moves_on(model, run, transition, path, work):
    """Whether a guard moves through zero much farther than the error of a step: some step finds that."""
    mode, t, later = run.mode, path.start, time_at(path, path.length)
    model.field(mode, t, run.y, model.parameters, work.field)
    before = guard_speed(model, transition, t, run.y, work.field, work.gradient)
    model.field(mode, later, work.trial, model.parameters, work.field)
    after = guard_speed(model, transition, later, work.trial, work.field, work.gradient)
    way = min(abs(before), abs(after)) * time_along(path, path.length)
    return before * after > 0.0 and way > MARGIN * moved_by_error(model, work)


@njit(**INLINE)
def is_clear_in_column(path, column):
    """Whether a guard that is a column of a series is farther from zero at both ends than its last terms.

    What is less than the rounding of all its terms is no error.
    """
    powers, order = path.powers, path.degree
    error = last_terms(powers, column, order, path.length)
    if error <= ROUNDING_OF_STATE * EPSILON * powers[order + 2, column]:
        return True
    return min(abs(powers[0, column]), abs(powers[order + 1, column])) >= MARGIN * error


@njit(**KERNEL)
def is_resolved(model, run, transition, column, path, attempted, on_guard, work):
    """Whether the error of a step leaves the sign of a guard at both of its ends alone.

    It is not asked of a guard that is zero at the start, but for a step that leaves it after a jump: the
    derivatives tell its side. An ``attempted`` step has its error in ``work.path_error``.
    """
    asked = on_guard == 0 or (attempted and on_guard == BY_SPEED and run.since_entry == 0.0)
    if not asked or (not attempted and model.degree[run.mode] > 0):
        return True
    if not attempted and column != NO_COLUMN:
        return is_clear_in_column(path, column)
    if not attempted:
        keep_error_of_series(model, path, work)
    end_of(path, model.dimension, work.trial)
    later = time_at(path, path.length)
    begins = on_guard > 0 or is_clear(model, transition, path.start, run.y, work)
    clear = begins and is_clear(model, transition, later, work.trial, work)
    return clear or moves_on(model, run, transition, path, work)


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
        band = in_column(path, column, rounding_band(model, run, transition, t, run.y, work))
        rests = guard.on_guard > 0 and size <= band
    if not path.exact:
        band = in_column(path, column, error_band(method, run, work.gradient, model.controlled))
    return Leading(transition, column, guard.side, guard.on_guard, known, size, power, band), rests


@njit(**KERNEL)
def crossing_by_leading(model, run, guard, path, attempted, work):
    """``crossing_on_path`` by the leading powers of a guard, with a verdict, which may be ``UNKNOWN``."""
    powers, order, h, side = path.powers, path.degree, path.length, guard.side
    column, transition = guard.column, guard.transition
    degree, rest = leading_powers(
        powers, column, order, guard.power, guard.known, guard.size, work.polynomial, h
    )
    if degree >= LEADING:
        return UNKNOWN, NO_ROOT, True
    leading_to_bernstein(work.polynomial, degree, work.stack)
    # What only parts of an attempted step show, its error may hide.
    shortest = 2.0 if attempted else SHORTEST_PART
    verdict, start, end, row = judge_leading(
        degree, rest, order * rest, side, guard.band, powers[order + 1, column], shortest, work.stack
    )
    if verdict != CROSSES:
        return verdict, NO_ROOT, True
    if not crosses_towards(model.direction[transition], -side):
        return UNKNOWN, NO_ROOT, True
    if underflows_in_column(powers, column, order):
        return CROSSES, NO_ROOT, True
    bracket = Bracket(start * h, end * h, work.stack[row, 2], work.stack[row, 2 + degree])
    last = powers[order + 1, column] if end == 1.0 else work.stack[row, 2 + degree]
    certain = min(work.stack[row, 2] * side, -last * side) > guard.band + rest
    resolved = is_resolved(model, run, transition, column, path, attempted, guard.on_guard, work)
    run.event_side[transition] = side
    run.crossings += 1 if certain and resolved else UNCERTAIN
    return CROSSES, root_between(path, column, guard.known, bracket, side) / h, resolved


@njit(**KERNEL)
def crossing_by_pieces(task, transition, column, path, attempted):
    """Where a guard crosses by its isolation on pieces of the path, as ``crossing_of``."""
    attempts, model, method, run, _, work = task_of(task)
    on_guard, later, order, end = run.on_guard[transition], time_at(path, path.length), path.degree, 0.0
    end_of(path, model.dimension, work.trial)
    if on_guard >= LATER:
        if column == NO_COLUMN:
            end = guard_value(model, transition, later, work.trial, work.scalar)
        else:
            end = path.powers[order + 1, column]
    theta, share = attempts.crossing_on_path(model, method, run, transition, column, path, end, work)
    side = run.event_side[transition]
    run.event_side[transition] = 0
    if column == NO_COLUMN:
        small = underflows(model, transition, path.start, run.y, later, work.trial, work.scalar)
    else:
        small = underflows_in_column(path.powers, column, order)
    if small:
        return NO_ROOT, share, True
    resolved = is_resolved(model, run, transition, column, path, attempted, on_guard, work)
    keep_outcome(run, transition, theta, side)
    return theta, share, resolved


@njit(**KERNEL)
def crossing_of(task, transition, column, path, attempted):
    """Where a guard crosses, the share of the step that is proved, and whether the crossing is resolved."""
    _, model, method, run, _, work = task_of(task)
    if column != NO_COLUMN:
        guard = guard_at_start(run, transition, column, path)
        leading, rests = leading_of(model, method, run, guard, path, work)
        if rests:
            run.crossings += UNCERTAIN
            return NO_ROOT, 1.0, True
        if guard.on_guard < LATER:
            # The second cheap proof: the leading powers keep to their side, whatever the others do.
            verdict, theta, resolved = crossing_by_leading(model, run, leading, path, attempted, work)
            if verdict != UNKNOWN:
                run.on_guard[transition] = 0
                return theta, 1.0, resolved
    run.crossings += UNCERTAIN
    return crossing_by_pieces(task, transition, column, path, attempted)


@njit(**KERNEL)
def leave_guard(model, run, transition, path, work):
    """Set the side of a guard to its side at the end of the path, if rounding does not hide that."""
    t = time_at(path, path.length)
    end_of(path, model.dimension, work.trial)
    value = guard_value(model, transition, t, work.trial, work.scalar)
    model.guard_gradient(transition, t, work.trial, model.parameters, work.gradient)
    if abs(value) > rounding_band(model, run, transition, t, work.trial, work):
        run.side[transition] = 1 if value > 0.0 else -1
        run.on_guard[transition] = 0


@njit(**INLINE)
def column_of(model, transition, place, attempted):
    """The column of the path that is a guard, the one at a ``place`` in its mode; or ``NO_COLUMN``."""
    held = model.affine_guard[transition] if attempted else model.guard_in_series[transition]
    return model.dimension + place if held == 1 else NO_COLUMN


@njit(**KERNEL)
def first_event(task, path, attempted, ignored, touched):
    """Earliest crossing on a path over the guards of the mode but ``ignored``, and its transition.

    The guard of ``ignored`` touches zero at the share ``touched`` of the step. Behind its powers a path has
    the values at its end, and below them what the guards among its columns are sums of there; an
    ``attempted`` Runge-Kutta step has its error in ``work.path_error``.

    Returns ``(theta, transition, proved, blurred)``, with ``(NO_ROOT, NO_TRANSITION)`` if nothing crosses
    before the share ``proved`` of the step, to which the step is to be cut. ``blurred`` is a transition whose
    guard changes sides, or grazes, on the step, although ``is_resolved`` is false for it, or none. The sides
    of guards without a crossing are brought up to date, to the end of the step, and guards that were left are
    no longer held to be zero at its start; ``resolution.restore_sides`` takes that back. For a guard with a
    crossing, ``run.event_side`` holds its side before that.
    """
    _, model, _, run, _, work = task_of(task)
    mode, powers, order = run.mode, path.powers, path.degree
    earliest, fired, proved, blurred = NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION
    forget_touches(run)
    run.crossings = UNCERTAIN if attempted else 0
    first = model.first_outgoing[mode]
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        keep_side(run, transition)
        if transition == ignored:
            leave_guard(model, run, transition, path, work)
            note_touch(run, transition, touched, 0.0)
            continue
        column = column_of(model, transition, slot - first, attempted)
        if column != NO_COLUMN and run.on_guard[transition] == 0 and not attempted:
            # Steps of a series are long: on none of them does a guard stay as close to zero as its error.
            side = run.side[transition]
            value, size = powers[order + 1, column] * side, powers[order + 2, column]
            if keeps_half(powers[0, column] * side, value, size):
                continue
        theta, share, resolved = crossing_of(task, transition, column, path, attempted)
        proved = min(proved, share)
        if not resolved:
            blurred = transition
        if theta < earliest:
            earliest, fired = theta, transition
    set_sides_before(model, run, earliest)
    return earliest, fired, min(proved, share_with_one_touch(run)), blurred
