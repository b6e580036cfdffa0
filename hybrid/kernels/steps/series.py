"""One step by the Taylor series of the solution; guards are isolated on the series themselves.

A series ``(order + 1, columns)`` holds normalised Taylor coefficients: the state, then the guards of the
mode, the time since the start of the step, the integral of div f, what the recurrences need, and the tangent
vectors, four at a time. Its variable is time, or the clock of a desingularised mode. Two rows below it take
the values at the end of the step, and what these are sums of.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.arithmetic.columns import evaluate, evaluate_with_sizes, gather_tangents
from hybrid.kernels.events.bounds import bound_state
from hybrid.kernels.events.guards import guard_speed, guard_value, is_forced
from hybrid.kernels.events.moments import speed_rounding
from hybrid.kernels.events.onset import BY_SPEED, crosses_towards
from hybrid.kernels.events.path import state_at, time_at, up_to, value_at
from hybrid.kernels.events.record import start_record
from hybrid.kernels.events.resolution import restore_sides
from hybrid.kernels.guards.first_event import first_event
from hybrid.kernels.guards.roots import time_of
from hybrid.kernels.guards.touch import remember_touch
from hybrid.kernels.instructions.registers import whole_registers
from hybrid.kernels.steps.field.residual import followed
from hybrid.kernels.steps.series_length import (
    EXACT_TOLERANCE,
    MOST_BITS,
    Columns,
    Tolerance,
    is_regular,
    longest_step,
    within_floats,
)
from hybrid.kernels.steps.step import FINEST, moves_nothing, rates_by_jacobian
from hybrid.kernels.types.codes import (
    DESINGULARISED,
    EXACT,
    FROM_LAST_STEP,
    FROM_STATE,
    FROM_ZERO,
    GO_ON,
    HIGH,
    HIGHEST_ORDER,
    LEAST_SLOPE,
    NARROW,
    NO_TRANSITION,
    NON_FINITE,
    READY,
    ROOTED,
    STEP_TOO_SMALL,
)
from hybrid.kernels.types.layout import EPSILON, Path
from hybrid.kernels.types.options import INLINE, KERNEL
from hybrid.kernels.types.task import task_of

# Share of a step that is tried next if the end of the series hides on which side of a guard the step ends.
BLURRED_SHORTER = 0.75
MOST_SHORTER = 100
# A root that a step of its own clock does not bring to zero is no farther from it than this share of time.
ROUNDING_OF_STAY = 64.0 * EPSILON
# Largest correction of a landing, as a share of the step.
CLOSE = 1e-8
# A flight without end is followed for this many times the time in which the state changes by its size.
LONG = 100.0
# A step may exceed the last stay in a mode by this share of the stay.
AHEAD = 0.25
# Below this share of the time the excess is too small for a step.
NEXT_TO_NOTHING = 1e-10


@njit(**INLINE)
def number_of_guards(model, mode):
    """How many guards the series of a mode may hold."""
    return model.first_outgoing[mode + 1] - model.first_outgoing[mode]


@njit(**INLINE)
def order_of(model, method, mode):
    """The order of the series of a mode."""
    if model.degree[mode] > 0:
        return model.degree[mode]
    return HIGHEST_ORDER if model.propagator[mode] == EXACT else method.order


@njit(**INLINE)
def holds_roots(model, mode):
    """Whether the series of a mode hold roots of its guards."""
    return model.propagator[mode] == DESINGULARISED or model.propagator[mode] == ROOTED


@njit(**KERNEL)
def step_until(path, remaining, work):
    """Shorten a step on the clock of a desingularised mode so that it does not pass the end of the run.

    Beyond a zero of the root, where the mode ends, that clock would run backwards: the first place counts at
    which it shows the end.
    """
    series, clock, order, h = path.powers, path.clock, path.degree, path.length
    low, high, row = 0.0, h, work.registers[0]
    while low < h:
        bound_state(path, clock, 0.5 * (low + high), 0.5 * (high - low), row)
        shown = value_at(series, clock, order, high) >= remaining
        if shown and (row[LEAST_SLOPE] >= 0.0 or high - low <= 2.0 * EPSILON * high):
            return time_of(series, clock, order, high, remaining)
        if row[HIGH] < remaining or row[LEAST_SLOPE] >= 0.0 or high - low <= 2.0 * EPSILON * high:
            low, high = high, min(high + 2.0 * (high - low), h)
        else:
            high = 0.5 * (low + high)
    return h


@njit(**INLINE)
def accept_series(model, run, tangents, path, work):
    """Move the state and the tangent vectors to the end of a path, and the divergence's integral.

    The values of the state there, and what they are sums of, have been left behind the series.
    """
    n, series, order = model.dimension, work.series, path.degree
    mode = run.mode
    first, last = model.first_outgoing[mode], model.first_outgoing[mode + 1]
    on_guard = 0
    for slot in range(first, last):
        on_guard += run.on_guard[model.outgoing[slot]]
    # Rounding is judged by the terms of which the state is the sum.
    for i in range(n):
        run.scale[i] = max(run.scale[i] if on_guard > 0 else 0.0, series[order + 2, i])
        run.y[i] = series[order + 1, i]
    if tangents > 0:
        run.divergence += series[order + 1, n + last - first + 1]
        start, stride = model.tangent_start, model.tangent_columns[mode]
        for g in range(whole_registers(tangents, NARROW) // NARROW):
            evaluate(series, order, path.length, start + g * stride, NARROW * n)
        gather_tangents(series, order + 1, n, start, stride, run.y[: n * (1 + tangents)])


@njit(**KERNEL)
def remember_series(model, run, record, path, span):
    """Write a step along the series into the record: the state and time as polynomials in a share of it."""
    slot, n = start_record(run, record, path.start, span), model.dimension
    rows, series, order, h, clock = (
        record.step_coefficients[slot],
        path.powers,
        path.degree,
        path.length,
        path.clock,
    )
    power = 1.0
    for o in range(order + 1):
        for i in range(n):
            rows[o, i] = series[o, i] * power
        rows[o, n] = series[o, clock] * power if clock >= 0 else 0.0
        power *= h
    if clock < 0:
        rows[1, n] = span
    for o in range(order + 1, rows.shape[0]):
        for i in range(n + 1):
            rows[o, i] = 0.0


@njit(**INLINE)
def set_origins(model, run, order, series):
    """Tell the series what they may take the roots of guards from.

    The state shows a guard only up to the tolerances and up to rounding, and a root of either is far larger.
    So a root that a step ended with is the start of the next one, and is zero where the guard is.
    """
    mode, n = run.mode, model.dimension
    first = model.first_outgoing[mode]
    origin = FROM_LAST_STEP if run.stage == READY else FROM_STATE
    for slot in range(first, model.first_outgoing[mode + 1]):
        leaves = run.on_guard[model.outgoing[slot]] == BY_SPEED
        series[order + 2, n + slot - first] = FROM_ZERO if leaves else origin


@njit(**KERNEL)
def reach_guard(model, run, tangents, transition, t, longest, work):
    """Bring the state onto the guard by an Euler step in time, whose length is returned.

    A contact ends where the root of its guard vanishes, and the guard differs from the square of the root by
    the error of the step. A guard that is not affine has a series with terms, and rounding, of its own. Left
    beyond its rounding it would count as not yet, or once more, crossed. Nothing is done, and 0 returned,
    where its speed is rounding, or where more than ``longest`` would be needed. With ``tangents`` 0,
    tangent vectors stay as they are: those at the zero of the root are right, and their rate may be infinite
    there.
    """
    field = work.stages[0]
    rates_by_jacobian(model, run.mode, t, run.y, tangents, work.jacobian, field)
    speed = guard_speed(model, transition, t, run.y, field, work.gradient)
    if speed == 0.0:
        return 0.0
    correction = -guard_value(model, transition, t, run.y, work.scalar) / speed
    if not abs(correction) <= longest:
        return 0.0
    if model.affine_guard[transition] == 0:
        for i in range(model.dimension):
            work.field[i] = field[i]
        if abs(speed) <= speed_rounding(model, run, transition, run.mode, t, run.y, work):
            # At a flat root value and speed are rounding, and their quotient may be large.
            return 0.0
    for i in range(model.dimension * (1 + tangents)):
        run.y[i] += correction * field[i]
    return correction


@njit(**KERNEL)
def project_on_guard(model, run, transition, t, work):
    """Bring the state onto the guard by the shortest way: its speed may be zero where its root vanishes."""
    value = guard_value(model, transition, t, run.y, work.scalar)
    model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
    square = 0.0
    for i in range(model.dimension):
        square += work.gradient[i] * work.gradient[i]
    for i in range(model.dimension if square > 0.0 else 0):
        run.y[i] -= value * work.gradient[i] / square


@njit(**INLINE)
def expanded(model, method, run, tangents, work):
    """The path of the series from the state on, without an end."""
    mode, n, kind = run.mode, model.dimension, model.propagator[run.mode]
    order = order_of(model, method, mode)
    clock = n + number_of_guards(model, mode) if kind == DESINGULARISED else -1
    if holds_roots(model, mode):
        set_origins(model, run, order, work.series)
    # A run may be taken on without its tangent vectors: the columns are those of what is passed.
    model.series(mode, run.phase, run.y[: n * (1 + tangents)], model.parameters, order, work.series)
    root = model.root[mode] if holds_roots(model, mode) else 1
    return Path(work.series, order, clock, run.phase, 1.0, math.inf, kind == EXACT, root)


@njit(**INLINE)
def trusted(task, path, remaining):
    """The part of a path on which its series are the solution; without one, its length is not positive."""
    attempts, model, method, run, _, work = task_of(task)
    mode, n, tangents, series = run.mode, model.dimension, task.tangents, path.powers
    order, clock, h, last, growth = path.degree, path.clock, math.inf, 0.0, 0.0
    rtol, atol = (EXACT_TOLERANCE, 0.0) if path.exact else (method.rtol, method.atol)
    tolerance, polynomial = Tolerance(rtol, atol, path.exact), model.degree[mode] > 0
    if not polynomial:
        groups = whole_registers(tangents, NARROW) // NARROW
        columns = Columns(n, model.controlled, model.tangent_start, model.tangent_columns[mode], groups)
        h, last, growth = longest_step(series, columns, order, tolerance, work.weights)
        if not order * abs(last) < MOST_BITS:
            order, h, last, growth = within_floats(series, columns, order, tolerance, work.weights)
    fragile = model.fragile[mode] == 1 and clock < 0
    if not h > 0.0 or (fragile and moves_nothing(model, run, series[1], h)):
        return up_to(path, 0.0)
    if clock < 0:
        h = min(h, method.max_step, remaining, as_far_as_last_time(model, run, mode))
        if not h < 1e100:
            h = min(h, unhurried(series, model.controlled, run))
    else:
        h = min(h, 1e100)
    path = Path(series, order, clock, path.start, 1.0, h, path.exact, path.root)
    if is_forced(model, mode):
        return up_to(path, attempts.explained_series(model, method, run, tangents, path, work))
    if polynomial or clock >= 0 or is_regular(series, n, order, tolerance, last, growth, work.weights):
        return path
    return up_to(path, followed(model, method, run, tangents, path, work))


@njit(**INLINE)
def evaluate_end(model, mode, path):
    """Write the values at the end of a path behind its series, and what these are sums of.

    State, guards, clock and divergence are evaluated together, in whole vectors.
    """
    front = whole_registers(model.dimension + number_of_guards(model, mode) + 2, NARROW)
    evaluate_with_sizes(path.powers, path.degree, path.length, 0, front)


@njit(**INLINE)
def is_finite(path, n):
    """Whether the state at the end of a path is finite."""
    total = 0.0
    for i in range(n):
        total += path.powers[path.degree + 2, i]
    return total < math.inf


@njit(**INLINE)
def up_to_event(task, path):
    """The path up to its first event, the transition, and whether it is cut before, where it is proved."""
    _, model, _, run, record, work = task_of(task)
    mode, finest = run.mode, FINEST * measured_time(model, run, run.mode)
    theta, fired, proved, blurred = first_event(task, path, False, NO_TRANSITION, 0.0)
    for _ in range(MOST_SHORTER):
        if blurred == NO_TRANSITION or BLURRED_SHORTER * path.length <= finest:
            break
        path = up_to(path, BLURRED_SHORTER * path.length)
        evaluate_end(model, mode, path)
        restore_sides(model, run)
        theta, fired, proved, blurred = first_event(task, path, False, NO_TRANSITION, 0.0)
    end = min(theta, proved, 1.0)
    if run.grazing_place <= end:
        s = run.grazing_place * path.length
        state_at(path, model.dimension, s, work.state)
        remember_touch(model, run, record, run.grazing_place / end, time_at(path, s), work)
    cut = proved < min(theta, 1.0)
    if cut:
        theta, fired = proved, NO_TRANSITION
    if cut or fired != NO_TRANSITION:
        path = up_to(path, path.length * theta)
        evaluate_end(model, mode, path)
        run.pending = fired
    return path, fired, cut


@njit(**INLINE)
def time_taken(path, remaining, finest, ends):
    """The time along a path, all that is ``remaining`` if less than its rounding would be left.

    An event ``ends`` the path before, or the part that is proved. ``finest`` is the rounding of the time.
    """
    if path.clock < 0:
        return path.length
    span = min(path.powers[path.degree + 1, path.clock], remaining)
    # Where the clock shows the end up to its rounding, no step leads through what would be left.
    rounding = max(finest, FINEST * path.powers[path.degree + 2, path.clock])
    return remaining if not ends and remaining - span <= rounding else span


@njit(**KERNEL)
def land_series(model, run, tangents, fired, t, stay, span, work):
    """Bring the state at the end of a step onto the guard that ends it; returns the time that this takes.

    The step ends at the time ``t`` of a ``stay`` in the mode, and has taken the time ``span``.
    """
    on_clock = model.propagator[run.mode] == DESINGULARISED
    if model.propagator[run.mode] == ROOTED:
        project_on_guard(model, run, fired, t, work)
        return 0.0
    if not on_clock and model.affine_guard[fired] == 1:
        return 0.0
    # What the error of the root makes of the time is less than the stay in the mode.
    longest = stay if on_clock else CLOSE * span
    moved = 0 if on_clock and model.guard_in_series[fired] == 1 else tangents
    return reach_guard(model, run, moved, fired, t, longest, work)


@njit(**KERNEL)
def end_at_root(model, run, path, work):
    """End a stay at a guard whose root vanishes, but never on its own clock; a code and the time it takes.

    On the clock a root that goes to zero at a steady rate in time, as that of a tank without inflow, falls
    exponentially. The guard is reached when the root at its pace needs less than the rounding of time.
    """
    mode, series, pace = run.mode, path.powers, path.powers[1, path.clock]
    first, near = model.first_outgoing[mode], ROUNDING_OF_STAY * measured_time(model, run, mode)
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition, column = model.outgoing[slot], model.dimension + slot - first
        value, slope, side = series[0, column], series[1, column], run.side[transition]
        ends = model.guard_in_series[transition] == 1 and crosses_towards(model.direction[transition], -side)
        if ends and value * slope < 0.0 and pace * abs(value) <= near * abs(slope):
            project_on_guard(model, run, transition, run.phase, work)
            run.pending = transition
            return GO_ON, 0.0
    return STEP_TOO_SMALL, 0.0


@njit(**KERNEL)
def series_step(task, remaining):
    """One step, to the first event on it or to the end of the run; returns a code and the step in time.

    The transition of an event is left in ``run.pending``.
    """
    _, model, method, run, record, work = task_of(task)
    mode, n, tangents, guards = run.mode, model.dimension, task.tangents, number_of_guards(model, run.mode)
    path = expanded(model, method, run, tangents, work)
    run.steps += 1
    path = trusted(task, path, remaining)
    if not path.length > 0.0:
        return NON_FINITE, 0.0
    evaluate_end(model, mode, path)
    if not is_finite(path, n):
        return NON_FINITE, 0.0
    series, order, clock = path.powers, path.degree, path.clock
    if clock >= 0 and not series[order + 2, clock] < remaining:
        path = up_to(path, step_until(path, remaining, work))
        evaluate_end(model, mode, path)
    fired, cut = NO_TRANSITION, False
    if guards > 0:
        path, fired, cut = up_to_event(task, path)
    finest = FINEST * measured_time(model, run, mode)
    span = time_taken(path, remaining, finest, cut or fired != NO_TRANSITION)
    stays = fired == NO_TRANSITION and not span > finest and span < remaining
    if stays and (model.timed[mode] == 1 or moves_nothing(model, run, series[1], path.length)):
        return end_at_root(model, run, path, work) if clock >= 0 else (STEP_TOO_SMALL, 0.0)
    if record.step_phase.shape[0] > 0 and span > 0.0:
        remember_series(model, run, record, path, span)
    accept_series(model, run, tangents, path, work)
    if order < method.order:
        # The next series looks for its root behind a series of the full order.
        for column in range(n, n + guards):
            series[method.order + 1, column] = series[order + 1, column]
    run.stage = READY
    if fired != NO_TRANSITION:
        stay = run.since_entry + span
        span += land_series(model, run, tangents, fired, path.start + span, stay, span, work)
    return GO_ON, span


@njit(**INLINE)
def as_far_as_last_time(model, run, mode):
    """A little more than the rest of a stay as long as the last one; infinity if the stay is longer already.

    The event that ends it is found on the way; a longer step would only make it harder to find. A stay that
    was next to nothing says nothing of this one.
    """
    left, beyond = run.stay[mode] - run.since_entry, AHEAD * run.stay[mode]
    if left > 0.0 and beyond > NEXT_TO_NOTHING * measured_time(model, run, mode):
        return left + beyond
    return math.inf


@njit(**KERNEL)
def unhurried(series, n, run):
    """A step for a solution that is a polynomial, in a run without an end."""
    size, pace = 0.0, 0.0
    for i in range(n):
        size, pace = max(size, abs(series[0, i])), max(pace, abs(series[1, i]))
    h = max(run.next_step, LONG * size / pace if pace * size > 0.0 else 1.0)
    run.next_step = min(2.0 * h, 1e50)
    return h
