"""One step by the Taylor series of the solution, whose guards are isolated on the series themselves.

A series ``(order + 1, columns)`` holds normalised Taylor coefficients: the state and the tangent vectors in
the columns of ``y``, then the guards of the mode, the time since the start of the step, the integral of div
f, and what the recurrences need. Its variable is time, or the clock of a desingularised mode.
"""

import math

from numba import njit

from hybrid.kernels.bernstein import NO_ROOT, first_crossing, stays
from hybrid.kernels.codes import (
    DESINGULARISED,
    DIVERGENCE,
    EXACT,
    GO_ON,
    GRAZING_PLACE,
    HIGHEST_ORDER,
    MODE,
    NEXT_STEP,
    NO_TRANSITION,
    NON_FINITE,
    PENDING,
    PHASE,
    STEP_TOO_SMALL,
    STEPS,
)
from hybrid.kernels.guards import error_band, guard_speed, guard_value, note_grazing, rounding_band
from hybrid.kernels.layout import EPSILON, INLINE, KERNEL
from hybrid.kernels.record import remember_grazing, start_record
from hybrid.kernels.step import rates

# Series that can be trusted to the last digit are cut off below rounding.
EXACT_TOLERANCE = 1e-17
# Share of the largest component that is an absolute tolerance for the others.
SHARE = 1e-3
SAFETY = 0.9
# Terms at the end of a series that have to be small.
TAIL = 8
# Share of a guard's value that the high powers of its series may reach together to be left out of a proof.
NEGLIGIBLE = 0.1
# A flight without end is followed for this many times the time in which the state changes by its size.
LONG = 100.0


@njit(**INLINE)
def value_at(series, column, order, s):
    """Value of one series."""
    total = series[order, column]
    for o in range(order - 1, -1, -1):
        total = total * s + series[o, column]
    return total


@njit(**INLINE)
def slope_at(series, column, order, s):
    """Derivative of one series."""
    total = order * series[order, column]
    for o in range(order - 1, 0, -1):
        total = total * s + o * series[o, column]
    return total


@njit(**INLINE)
def values_at(series, order, s, length, out):
    """Values of the first ``length`` series, into ``out``."""
    for i in range(length):
        out[i] = value_at(series, i, order, s)


@njit(**INLINE)
def weigh_guards(model, mode, series, n, length, first, rtol, worst):
    """Add to ``worst`` the last terms of guards that are not affine, whose series ends before the state's.

    They are measured against what the guard changes while the state changes by its size.
    """
    size, pace = 0.0, 0.0
    for i in range(n):
        size, pace = max(size, abs(series[0, i])), max(pace, abs(series[1, i]))
    scale = size / pace if size * pace > 0.0 else 1.0
    start = model.first_outgoing[mode]
    for slot in range(start, model.first_outgoing[mode + 1]):
        if model.affine_guard[model.outgoing[slot]] == 1:
            continue
        column = length + slot - start
        largest = abs(series[0, column]) + scale * (
            abs(series[1, column]) + scale * (abs(series[2, column]) + scale * abs(series[3, column]))
        )
        for k in range(TAIL if largest > 0.0 else 0):
            worst[k] = max(worst[k], abs(series[first + k, column]) / (rtol * largest))


@njit(**KERNEL)
def longest_step(model, mode, series, n, length, order, rtol, atol, exact, worst):
    """Longest step at which the last term of every block is below its tolerance, as after Jorba and Zou 2005.

    The tolerances are those of the Runge-Kutta methods: each tangent vector is a block by itself. One term is
    not enough, on the clock of a contact only every fifth may be there: the ones before must be on their
    way, below the powers of ``rtol`` that lead to it.
    ``worst (>= TAIL,)`` is scratch. Nan if a coefficient is.
    """
    first = order + 1 - TAIL
    for k in range(TAIL):
        worst[k] = 1e-300
    for start in range(0, length, n):
        square, largest = 0.0, 0.0
        for i in range(start, start + n):
            square += series[0, i] * series[0, i]
            largest = max(largest, abs(series[0, i]))
        if largest == 0.0:
            # From rest at the origin, the first terms tell the size.
            for i in range(start, start + n):
                largest = max(largest, abs(series[1, i]), abs(series[2, i]), abs(series[3, i]))
        if exact:
            floor = SHARE * rtol * largest + 1e-300
        elif start > 0:
            floor = rtol * math.sqrt(square / n) + 1e-300
        else:
            floor = atol
        for i in range(start, start + n):
            weight = 1.0 / (floor + rtol * abs(series[0, i]))
            for k in range(TAIL):
                worst[k] = max(worst[k], weight * abs(series[first + k, i]))
            if not weight * (abs(series[order, i]) + abs(series[order - 1, i])) < math.inf:
                return math.nan
    weigh_guards(model, mode, series, n, length, first, rtol, worst)
    h = worst[TAIL - 1] ** (-1.0 / order)
    decay = rtol ** (1.0 / order)
    share = 1.0
    for k in range(TAIL - 2, -1, -1):
        share /= decay
        if worst[k] * h ** (first + k) > share:
            h = (share / worst[k]) ** (1.0 / (first + k))
    return SAFETY * h


@njit(**KERNEL)
def time_of(series, clock, order, h, span):
    """Place on ``[0, h]`` where the clock shows ``span``: Newton's method in a bracket; time only grows."""
    low, high = 0.0, h
    s = h * math.sqrt(span / value_at(series, clock, order, h))
    for _ in range(100):
        misfit = value_at(series, clock, order, s) - span
        if misfit > 0.0:
            high = s
        else:
            low = s
        newton = s - misfit / slope_at(series, clock, order, s)
        if not low < newton < high:
            newton = 0.5 * (low + high)
        if abs(newton - s) <= 2.0 * EPSILON * s or high - low <= 2.0 * EPSILON * high:
            return newton
        s = newton
    return s


@njit(**KERNEL)
def step_until(series, clock, order, h, remaining, work):
    """Shorten a step on the clock of a desingularised mode so that it does not pass the end of the run.

    Beyond a zero of the root, where the mode ends, that clock would run backwards.
    """
    power, latest = 1.0, 0.0
    for o in range(order + 1):
        latest += abs(series[o, clock]) * power
        power *= h
    if latest < remaining:
        return h
    degree, _ = powers_on_step(series, clock + 2, order, h, 0, work.polynomial)
    to_bernstein(work.polynomial, degree)
    theta, _ = first_crossing(work.polynomial, degree, 1, -1, work.stack)
    longest = min(theta, 1.0) * h
    if value_at(series, clock, order, longest) < remaining:
        return h
    return time_of(series, clock, order, longest, remaining)


@njit(**INLINE)
def to_bernstein(coefficients, degree):
    """Turn power coefficients on ``[0, 1]`` into Bernstein coefficients, in place."""
    share = 1.0
    for k in range(1, degree + 1):
        share *= k / (degree - k + 1.0)
        coefficients[k] *= share
    for level in range(degree):
        # A view of what changes: its indices are plainly not negative, and need no check in the inner loop.
        row = coefficients[level : degree + 1]
        before = row[0]
        for j in range(1, degree + 1 - level):
            entry = row[j]
            row[j] = entry + before
            before = entry


@njit(**INLINE)
def powers_on_step(series, column, order, h, known_roots, coefficients):
    """Power coefficients on ``[0, 1]`` of a series, divided by its variable for each known root at 0.

    Returns the degree, and the sum of the magnitudes of all but the first coefficient.
    """
    degree = order
    while degree > known_roots and series[degree, column] == 0.0:
        degree -= 1
    power, reach = h**known_roots, 0.0
    for k in range(known_roots, degree + 1):
        coefficients[k - known_roots] = series[k, column] * power
        power *= h
    for k in range(1, degree + 1 - known_roots):
        reach += abs(coefficients[k])
    return degree - known_roots, reach


@njit(**INLINE)
def stays_clear(powers, degree, side, band, scratch):
    """The second cheap proof that a guard keeps beyond ``band`` on its side of zero over a whole step.

    Its leading powers must, by their Bernstein coefficients, even if all the others are against them.
    """
    leading, rest = degree, 0.0
    while leading > 1 and rest + abs(powers[leading]) <= NEGLIGIBLE * abs(powers[0]):
        rest += abs(powers[leading])
        leading -= 1
    for k in range(leading + 1):
        scratch[k] = powers[k]
    to_bernstein(scratch, leading)
    return stays(scratch, leading, side, band + rest)


@njit(**KERNEL)
def earliest_on_series(model, method, run, order, t, h, length, kind, work):
    """Earliest crossing on a step over the guards of the mode, and its transition.

    Returns ``(theta, slot of the guard, transition)``, with ``NO_ROOT`` and ``NO_TRANSITION`` if there is
    none. Sides, and what is held to be zero, are brought up to date as by ``guards.earliest_crossing``. The
    polynomials are the guards themselves, up to the remainder of the series.
    """
    mode, series = run.count[MODE], work.series
    earliest, place, fired = NO_ROOT, 0, NO_TRANSITION
    run.clock[GRAZING_PLACE] = NO_ROOT
    first = model.first_outgoing[mode]
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        on_guard, side = run.on_guard[transition], run.side[transition]
        column = length + slot - first
        degree, reach = powers_on_step(series, column, order, h, on_guard, work.polynomial)
        nearest = work.polynomial[0] * side
        # The cheap proof: the guard cannot come back to zero within this step.
        if on_guard == 0 and nearest > 2.0 * reach:
            continue
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        rounding = rounding_band(model, run, t, work.gradient)
        band = rounding
        if kind != EXACT:
            band = error_band(method, run, work.gradient, model.dimension)
        # Along the root of a guard, what is small for the guard is not as small.
        if kind == DESINGULARISED:
            rounding, band = math.sqrt(rounding), math.sqrt(band)
        if on_guard > 0:
            if reach + abs(work.polynomial[0]) <= rounding:
                continue
            run.on_guard[transition] = 0
        if stays_clear(work.polynomial, degree, side, band, work.stack[0]):
            continue
        to_bernstein(work.polynomial, degree)
        if stays(work.polynomial, degree, side, band):
            continue
        theta, side = first_crossing(work.polynomial, degree, side, model.direction[transition], work.stack)
        if theta > 1.0 and side == run.side[transition] and on_guard == 0:
            note_grazing(run, transition, degree, side, band, 0.0, 1.0, work)
        if theta == NO_ROOT:
            run.side[transition] = side
        elif theta < earliest:
            earliest, place, fired = theta, slot - first, transition
    return earliest, place, fired


@njit(**INLINE)
def refined(series, column, order, s, h):
    """A root of a series near ``s``, refined to rounding; not to one at 0, where the step begins."""
    for _ in range(3):
        slope = slope_at(series, column, order, s)
        if slope == 0.0:
            break
        shift = -value_at(series, column, order, s) / slope
        if not abs(shift) <= 1e-6 * h or not 0.5 * s <= s + shift <= h:
            break
        s += shift
        if abs(shift) <= EPSILON * s:
            break
    return s


@njit(**INLINE)
def accept_series(model, run, tangents, order, h, work):
    """Move the state and the tangent vectors to ``h`` on the series, and the divergence's integral."""
    n, series = model.dimension, work.series
    mode = run.count[MODE]
    first, last = model.first_outgoing[mode], model.first_outgoing[mode + 1]
    on_guard = 0
    for slot in range(first, last):
        on_guard += run.on_guard[model.outgoing[slot]]
    for i in range(n):
        # What the state is a sum of is what its rounding is judged by.
        size = abs(series[order, i])
        for o in range(order - 1, -1, -1):
            size = size * h + abs(series[o, i])
        run.scale[i] = max(run.scale[i] if on_guard > 0 else 0.0, size)
    length = n * (1 + tangents)
    values_at(series, order, h, length, run.y)
    if tangents > 0:
        run.clock[DIVERGENCE] += value_at(series, length + last - first + 1, order, h)


@njit(**KERNEL)
def remember_series(model, run, record, order, t, h, span, clock, work):
    """Write a step along the series into the record: Bernstein coefficients of the state and of time."""
    slot = start_record(run, record, t, span)
    degree = record.step_coefficients.shape[1] - 1
    n = model.dimension
    column = work.polynomial
    for i in range(n + 1):
        power = 1.0
        for k in range(degree + 1):
            column[k] = 0.0
            if k <= order:
                column[k] = work.series[k, i if i < n else clock] * power
            power *= h
        if i == n and clock < 0:
            column[0], column[1] = 0.0, span
            for k in range(2, degree + 1):
                column[k] = 0.0
        to_bernstein(column, degree)
        for k in range(degree + 1):
            record.step_coefficients[slot, k, i] = column[k]


@njit(**KERNEL)
def reach_guard(model, run, tangents, transition, t, work):
    """Bring the state onto the guard by an Euler step in time, whose length is returned.

    A contact ends where the root of its guard vanishes. The guard differs from the square of the root by the
    error of the step, and beyond its rounding it would count as not yet, or once more, crossed.
    """
    field = work.stages[0]
    rates(model, run.count[MODE], t, run.y, tangents, field)
    speed = guard_speed(model, transition, t, run.y, field, work.gradient)
    if speed == 0.0:
        return 0.0
    correction = -guard_value(model, transition, t, run.y, work.scalar) / speed
    for i in range(model.dimension * (1 + tangents)):
        run.y[i] += correction * field[i]
    return correction


@njit(**KERNEL)
def series_step(model, method, run, record, tangents, remaining, work):
    """One step, to the first event on it or to the end of the run; returns a code and the step in time.

    An event is left in ``PENDING``.
    """
    n = model.dimension
    length = n * (1 + tangents)
    mode, t, series = run.count[MODE], run.clock[PHASE], work.series
    kind, degree = model.propagator[mode], model.degree[mode]
    exact = kind == EXACT
    order = HIGHEST_ORDER if exact else method.order
    if degree > 0:
        order = degree
    guards = model.first_outgoing[mode + 1] - model.first_outgoing[mode]
    clock = length + guards if kind == DESINGULARISED else -1
    model.series(mode, t, run.y, model.parameters, order, series)
    run.count[STEPS] += 1
    if degree > 0:
        h = math.inf
    elif exact:
        h = longest_step(model, mode, series, n, length, order, EXACT_TOLERANCE, 0.0, True, work.polynomial)
    else:
        h = longest_step(
            model, mode, series, n, length, order, method.rtol, method.atol, False, work.polynomial
        )
    if not h > 0.0:
        return NON_FINITE, 0.0
    if clock >= 0:
        h = step_until(series, clock, order, min(h, 1e100), remaining, work)
        span = math.inf
    else:
        h = min(h, method.max_step, remaining)
        if not h < 1e100:
            h = unhurried(series, n, run)
        span = h
    fired = NO_TRANSITION
    if guards > 0:
        theta, place, fired = earliest_on_series(model, method, run, order, t, h, length, kind, work)
        if run.clock[GRAZING_PLACE] < theta:
            s = run.clock[GRAZING_PLACE] * h
            values_at(series, order, s, n, work.state)
            since = s if clock < 0 else value_at(series, clock, order, s)
            remember_grazing(model, run, record, t + since, work)
        if fired != NO_TRANSITION:
            h = refined(series, length + place, order, theta * h, h)
            span = h
            run.count[PENDING] = fired
    if clock >= 0:
        span = min(value_at(series, clock, order, h), remaining)
    if fired == NO_TRANSITION and not span > 4.0 * EPSILON * abs(t) and span < remaining:
        return STEP_TOO_SMALL, 0.0
    if record.step_time.shape[0] > 0 and span > 0.0:
        remember_series(model, run, record, order, t, h, span, clock, work)
    accept_series(model, run, tangents, order, h, work)
    if fired != NO_TRANSITION and clock >= 0:
        span += reach_guard(model, run, tangents, fired, t + span, work)
    return GO_ON, span


@njit(**KERNEL)
def unhurried(series, n, run):
    """A step for a solution that is a polynomial, in a run without an end."""
    size, pace = 0.0, 0.0
    for i in range(n):
        size, pace = max(size, abs(series[0, i])), max(pace, abs(series[1, i]))
    h = max(run.clock[NEXT_STEP], LONG * size / pace if pace * size > 0.0 else 1.0)
    run.clock[NEXT_STEP] = min(2.0 * h, 1e50)
    return h
