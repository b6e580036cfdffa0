"""Guards along a series: their polynomials, proofs that they have no zero, the earliest crossing."""

import math

import numpy as np
from numba import njit

from hybrid.kernels.arithmetic.bernstein import (
    NO_ROOT,
    bracket_crossing,
    crosses_towards,
    halve,
    stays,
)
from hybrid.kernels.arithmetic.lanes import four_times, load, store
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    error_band,
    rounding_band,
    size_of_time,
)
from hybrid.kernels.events.hidden import hidden_share
from hybrid.kernels.events.onset import BY_STEP, has_just_fired
from hybrid.kernels.events.path import time_at
from hybrid.kernels.events.resolution import (
    MARGIN,
    UNDERFLOW,
    keep_change,
    keep_crossing,
    keep_passage,
    keep_side,
    keeps_sign,
    set_sides_before,
    underflows,
)
from hybrid.kernels.events.touches import forget_touches, note_touches, share_with_one_touch
from hybrid.kernels.steps.series_roots import root_between
from hybrid.kernels.types.codes import (
    DESINGULARISED,
    EXACT,
    HIGHEST_ORDER,
    NARROW,
    NO_TRANSITION,
    ROOTED,
)
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Number of terms at the end of a series by which its error is judged: some may be zero.
TAIL_OF_GUARD = 5
# Rounding of a series, as a share of the sum of the magnitudes of its terms.
ROUNDING_OF_TERMS = 64.0 * EPSILON
# High powers of a series are left out of a proof if their sum is below this share of the size of the guard.
NEGLIGIBLE = 0.003


# What a power of the variable is divided by in Bernstein form: ``C(degree, k)``.
SHARES = np.array(
    [[1.0 / max(math.comb(n, k), 1) for k in range(HIGHEST_ORDER + 1)] for n in range(HIGHEST_ORDER + 1)]
)
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


@njit(**INLINE)
def to_bernstein(coefficients, degree):
    """Turn power coefficients on ``[0, 1]`` into Bernstein coefficients, in place."""
    for k in range(1, degree + 1):
        coefficients[k] *= SHARES[degree, k]
    for level in range(degree):
        # A view whose indices are never negative needs no check in the inner loop.
        row = coefficients[level : degree + 1]
        before = row[0]
        for j in range(1, degree + 1 - level):
            entry = row[j]
            row[j] = entry + before
            before = entry


@njit(**KERNEL)
def leading_to_bernstein(coefficients, degree, stack):
    """As ``to_bernstein``, from ``coefficients`` into the first row of a stack, a column a register."""
    if degree >= DEGREES:
        for k in range(degree + 1):
            stack[0, 2 + k] = coefficients[k]
        to_bernstein(stack[0, 2:], degree)
        return
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
def powers_on_step(series, column, order, h, known_roots, coefficients):
    """Power coefficients on ``[0, 1]`` of a series, divided by its variable for each known root at 0.

    Returns the degree.
    """
    degree = order
    while degree > known_roots and series[degree, column] == 0.0:
        degree -= 1
    power = h**known_roots
    for k in range(known_roots, degree + 1):
        coefficients[k - known_roots] = series[k, column] * power
        power *= h
    return degree - known_roots


@njit(**INLINE)
def leading_power(series, column, order, h, known_roots, size):
    """The lowest power of a series, not below ``known_roots``, that is more than rounding on the step ``h``.

    ``size`` is the sum of the magnitudes of all terms.
    """
    power = h**known_roots
    while known_roots < order and abs(series[known_roots, column]) * power <= ROUNDING_OF_TERMS * size:
        known_roots, power = known_roots + 1, power * h
    return known_roots


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
def as_root(model, mode, size):
    """How large a guard of a size is in its series, which may be that of its root."""
    if model.propagator[mode] not in (DESINGULARISED, ROOTED):
        return size
    return math.sqrt(size) if model.root[mode] == 2 else size ** (1.0 / model.root[mode])


@njit(**INLINE)
def last_terms(series, column, order, h):
    """The sum of the magnitudes of the last terms of a series: more than all that are left out."""
    power, total = h**order, 0.0
    for o in range(order, max(order - TAIL_OF_GUARD, 0), -1):
        total += abs(series[o, column]) * power
        power /= h
    return total


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

    As ``runge_kutta_guards.is_resolved``. ``column`` is that of the guard, or -1 if the guard is no series.
    """
    n, series, order, t, h = model.dimension, path.powers, path.degree, path.start, path.length
    if model.degree[run.mode] > 0 or on_guard > 0:
        # A polynomial has no other terms; the derivatives of a guard that is zero tell its side.
        return True
    if column >= 0:
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
        return error <= as_root(model, run.mode, rounding)
    for i in range(n):
        work.trial[i] = series[order + 1, i]
        size = max(abs(series[0, i]), abs(series[1, i] * h), abs(work.trial[i]))
        error = last_terms(series, i, order, h)
        work.field_after[i] = error if error > ROUNDING_OF_STATE * EPSILON * size else 0.0
    later = time_at(path, h)
    return keeps_sign(model, transition, t, run.y, work) and keeps_sign(
        model, transition, later, work.trial, work
    )


@njit(**KERNEL)
def earliest_on_series(attempts, model, method, run, path, work):
    """Earliest crossing on a step over the guards of the mode, and its transition.

    Returns ``(theta, transition, proved, blurred)``, and brings sides up to date, as
    ``runge_kutta_guards.earliest_crossing`` does, with the sides before crossings kept. A guard that is a
    series itself is a polynomial, up to the remainder of the series; what it is a sum of stands behind the
    series. For any other guard its own expression is bounded on the series of the state.
    """
    mode, series, order, t, h = run.mode, path.powers, path.degree, path.start, path.length
    kind = model.propagator[mode]
    earliest, fired, proved, blurred = NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION
    forget_touches(run)
    first = model.first_outgoing[mode]
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        keep_side(run, transition)
        on_guard, side = run.on_guard[transition], run.side[transition]
        if model.guard_in_series[transition] == 0:
            later = time_at(path, h)
            for i in range(model.dimension):
                work.trial[i] = series[order + 1, i]
            theta, share = attempts.crossing_beside_series(model, method, run, transition, path, work)
            side = run.rehearsal[3, transition]
            run.rehearsal[3, transition] = 0
            proved = min(proved, share)
            if underflows(model, transition, t, run.y, later, work.trial, work.scalar):
                continue
            if not is_resolved_by_series(model, run, transition, -1, path, on_guard, work):
                blurred = transition
            if theta == NO_ROOT:
                keep_change(run, transition, side)
                continue
            keep_crossing(run, transition, theta, side)
            if theta < earliest:
                earliest, fired = theta, transition
            continue
        column = model.dimension + slot - first
        value, size = series[order + 1, column] * side, series[order + 2, column]
        if on_guard == 0 and keeps_half(series[0, column] * side, value, size):
            continue
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        rounding = rounding_band(model, run, transition, t, run.y, work)
        band = rounding
        if kind != EXACT:
            band = error_band(method, run, work.gradient, model.dimension)
        # A value that is small for a guard is less small for the root of the guard.
        rounding, band = as_root(model, mode, rounding), as_root(model, mode, band)
        # The root of a guard that is zero without speed begins to grow like its variable, too.
        known = min(on_guard, 1) if kind in (DESINGULARISED, ROOTED) else on_guard
        noisy = on_guard == BY_STEP and kind != EXACT
        if noisy:
            # Where terms of the field cancel, the first powers are rounding.
            known = 0
        elif on_guard == BY_STEP:
            known = leading_power(series, column, order, h, known, size)
        size, power = beyond_known_roots(series, column, h, known, size)
        if on_guard > 0:
            if size <= rounding:
                continue
            run.on_guard[transition] = 0
            if on_guard == BY_STEP and has_just_fired(run, transition, on_guard):
                side = 0
        verdict, start, end, row, degree, rest, hidden = UNKNOWN, 0.0, 1.0, 0, 0, 0.0, 0.0
        if not noisy:
            # The second cheap proof: the leading powers keep to their side, whatever the others do.
            degree, rest = leading_powers(series, column, order, power, known, size, work.polynomial, h)
            leading_to_bernstein(work.polynomial, degree, work.stack)
            verdict, start, end, row = judge_leading(
                degree, rest, order * rest, side, band, series[order + 1, column], work.stack
            )
        if verdict == CLEAR:
            continue
        if verdict == CROSSES and crosses_towards(model.direction[transition], -side):
            if underflows_on_series(series, column, order):
                continue
            # What is far from a bound for the last terms is resolved.
            seen = degree <= order - TAIL_OF_GUARD and not is_close(
                series, column, order, MARGIN * rest + UNDERFLOW
            )
            if not seen and not is_resolved_by_series(model, run, transition, column, path, on_guard, work):
                blurred = transition
            ends = work.stack[row, 2], work.stack[row, 2 + degree]
            theta = root_between(series, column, order, known, h, start * h, end * h, *ends, side) / h
            run.rehearsal[3, transition] = side
            if theta < earliest:
                earliest, fired = theta, transition
            continue
        degree = powers_on_step(series, column, order, h, known, work.polynomial)
        to_bernstein(work.polynomial, degree)
        if noisy:
            value = series[order + 1, column]
            hidden = hidden_share(work.polynomial, degree, rounding, band, value, work.stack)
        if stays(work.polynomial, degree, side, band):
            continue
        direction, before = model.direction[transition], side
        theta, end, row, side = bracket_crossing(work.polynomial, degree, side, direction, work.stack)
        if theta < end:
            ends = work.stack[row, 2], work.stack[row, 2 + degree]
            start, end = hidden + theta * (1.0 - hidden), hidden + end * (1.0 - hidden)
            theta = root_between(series, column, order, known, h, start * h, end * h, *ends, -side) / h
        if theta != NO_ROOT or side != before:
            keep_passage(run, transition, direction, work.polynomial, degree, before, hidden, work.stack)
        if noisy:
            degree = powers_on_step(series, column, order, h, known, work.polynomial)
            to_bernstein(work.polynomial, degree)
        note_touches(run, transition, degree, known, hidden, theta, band, work)
        if underflows_on_series(series, column, order):
            continue
        if not is_resolved_by_series(model, run, transition, column, path, on_guard, work):
            blurred = transition
        if theta == NO_ROOT:
            keep_change(run, transition, side)
            continue
        keep_crossing(run, transition, theta, side)
        if theta < earliest:
            earliest, fired = theta, transition
    set_sides_before(model, run, earliest)
    return earliest, fired, min(proved, share_with_one_touch(run)), blurred
