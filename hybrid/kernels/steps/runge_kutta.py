"""One step of a Runge-Kutta method: attempt, error control, first event, and landing on the event."""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.arithmetic.tangent import independence
from hybrid.kernels.events.guards import ROUNDING_OF_STATE, guard_value, is_forced
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.events.path import state_at
from hybrid.kernels.events.record import start_record
from hybrid.kernels.events.resolution import restore_sides
from hybrid.kernels.guards.first_event import first_event, keep_error
from hybrid.kernels.guards.touch import note_touch, remember_touch, share_with_one_touch
from hybrid.kernels.steps.runge_kutta_landing import NOT_THERE, land_on_first, reach_any, sign_at_end
from hybrid.kernels.steps.step import (
    FINEST,
    attempt,
    attempt_again,
    interpolant_path,
    interpolation_stages,
    moves_nothing,
    path_of_step,
    rates,
    starting_step,
)
from hybrid.kernels.types.codes import (
    GO_ON,
    NO_TRANSITION,
    NON_FINITE,
    READY,
    STALE,
    STEP_TOO_SMALL,
)
from hybrid.kernels.types.kinds import REAL, Pair
from hybrid.kernels.types.layout import EPSILON, Task
from hybrid.kernels.types.options import INLINE, KERNEL, exported
from hybrid.kernels.types.task import task_of

SAFETY_FACTOR = 0.9
SHRINK = 0.2
GROW = 6.0
# Share of a step that is tried next if its error hides on which side of a guard it ends.
TRY_SHORTER = 0.5
# Steps start short after an event. A flight that is a polynomial has no error that limits its steps, and one
# step across many short bounces would lose them in its rounding error.
LONGEST_AFTER_EVENT = 100.0
# Logarithm of the smallest product of sines of the tangent vectors at the end of a step. An implicit step may
# be long where they shrink fast, and its result is then far from an exponential.
CLOSEST = math.log(1e3)


@njit(**INLINE)
def all_affine(model, mode):
    """Whether all guards of the mode are affine and can be followed without an interpolant of the state."""
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        if model.affine_guard[model.outgoing[slot]] == 0:
            return False
    return True


@njit(**KERNEL)
def remember_step(model, method, run, record, t, h, work):
    """Write the step just taken from ``run.y`` into the record; its stages are those of ``work``."""
    n, count = model.dimension, method.a.shape[0]
    interpolation_stages(model, method, run.mode, t, h, run.y, work)
    slot = start_record(run, record, t, h)
    rows = record.step_coefficients[slot]
    # Element by element: an array assignment would add its error message, seconds of compilation.
    for i in range(n):
        rows[0, i] = run.y[i]
    rows[0, n] = 0.0
    for k in range(1, rows.shape[0]):
        for i in range(n + 1):
            rows[k, i] = 0.0
        for j in range(count if k < method.powers.shape[0] else 0):
            weight = h * method.powers[k, j]
            for i in range(n):
                rows[k, i] += weight * work.stages[j, i]
    rows[1, n] = h


@njit(**KERNEL)
def remember_touch_on_step(model, method, run, record, t, h, whole, work):
    """Record the touch at ``run.grazing_place`` of the attempted step, of which the length ``h`` is taken."""
    place = run.grazing_place * whole
    interpolation_stages(model, method, run.mode, t, h, run.y, work)
    interpolant_path(method, h, run.y, model.dimension, work)
    state_at(path_of_step(method, t, h, work), model.dimension, place / h, work.state)
    remember_touch(model, run, record, place / h, t + place, work)


@njit(**INLINE)
def accept(model, method, run, tangents, h, correction, work):
    """Move the run to the end of the attempted step in ``work.new``."""
    n = model.dimension
    mode = run.mode
    on_guard = 0
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        on_guard += run.on_guard[model.outgoing[slot]]
    for i in range(n):
        before = run.scale[i] if on_guard > 0 else 0.0
        run.scale[i] = max(before, abs(run.y[i]), abs(work.new[i]), abs(h * work.stages[0, i]))
    for i in range(n * (1 + tangents)):
        run.y[i] = work.new[i]
    if tangents > 0:
        s, place = method.b.shape[0], n * (1 + tangents)
        total = 0.0
        for j in range(s + 1):
            total += method.quadrature[j] * work.stages[j, place]
        run.divergence += h * total + correction * work.stages[s, place]


@njit(**KERNEL)
def affine_column(model, method, run, transition, column, h, path, work):
    """An affine guard on the interpolant into a column of a path, and the sum of its magnitudes behind it.

    It is zero at the start if the run knows that: its value there is rounding. So is a power whose terms
    cancel, unless the run knows that the guard has a speed.
    """
    n, rows, speeds, sizes = model.dimension, path.powers, work.speeds[0], work.speeds[1]
    start, share = guard_value(model, transition, path.start, run.y, work.scalar), ROUNDING_OF_STATE * EPSILON
    start = 0.0 if run.on_guard[transition] > 0 else start
    model.guard_gradient(transition, path.start, run.y, model.parameters, work.gradient)
    for j in range(method.a.shape[0]):
        speeds[j], sizes[j] = 0.0, 0.0
        for i in range(n):
            # The step first: a column may be far smaller than its speed.
            moved = h * work.stages[j, i] * work.gradient[i]
            speeds[j] += moved
            sizes[j] += share * abs(moved)
    rows[0, column], rows[path.degree + 2, column] = start, abs(start)
    for k in range(1, path.degree + 1):
        known = k == 1 and run.on_guard[transition] == BY_SPEED
        total = h * work.gradient[n] if k == 1 else 0.0
        noise = share * abs(total)
        for j in range(method.a.shape[0]):
            total += method.powers[k, j] * speeds[j]
            noise += abs(method.powers[k, j]) * sizes[j]
        rows[k, column] = 0.0 if abs(total) <= noise and not known else total
        rows[path.degree + 2, column] += abs(rows[k, column])


@njit(**KERNEL)
def path_of_attempt(model, method, run, h, work):
    """The path of an attempted step: its interpolant, with affine guards behind the state, and its error."""
    n, mode, t, path = model.dimension, run.mode, run.phase, path_of_step(method, run.phase, h, work)
    rows, first, alone = path.powers, model.first_outgoing[mode], all_affine(model, mode)
    if not alone:
        interpolant_path(method, h, run.y, n, work)
    for i in range(n):
        # Where a step is too long, either estimate may be close to zero.
        error = h * (abs(work.error[i]) + abs(work.second_error[i]))
        keep_error(i, error, max(abs(run.y[i]), abs(work.new[i]), abs(h * work.stages[0, i])), work)
        rows[path.degree + 1, i] = work.new[i]
        if alone:
            # The powers of the state are not asked for, but for the first two.
            rows[0, i], rows[1, i] = run.y[i], h * work.stages[0, i]
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition, column = model.outgoing[slot], n + slot - first
        if model.affine_guard[transition] == 1:
            affine_column(model, method, run, transition, column, h, path, work)
            rows[path.degree + 1, column] = guard_value(model, transition, t + h, work.new, work.scalar)
    return path


@njit(**INLINE)
def find_event(task, h, interpolated):
    """Shorten the attempted step to its first event, if there is one.

    ``interpolated`` says that the step's stages for its interpolant are known.

    Returns its length, the Euler step that completes it, and the transition. A step whose guards
    are proved on a part only is cut to that. A crossing that the interpolant has and the solution has not is
    a grazing; the step is then searched again without that guard. A step whose error may have made the
    crossing has the length zero and no transition, unless rounding of time allows none that is shorter.
    """
    _, model, method, run, _, work = task_of(task)
    mode, t, ignored, touched = run.mode, run.phase, NO_TRANSITION, 0.0
    for trial in range(2):
        if not (interpolated and trial == 0):
            interpolation_stages(model, method, mode, t, h, run.y, work)
        path = path_of_attempt(model, method, run, h, work)
        theta, fired, proved, blurred = first_event(task, path, True, ignored, touched)
        if blurred != NO_TRANSITION:
            restore_sides(model, run)
            if TRY_SHORTER * h > FINEST * measured_time(model, run, mode):
                return 0.0, 0.0, NO_TRANSITION
            correction, first = reach_any(task, h)
            if first != NO_TRANSITION:
                return 0.0, correction, first
            # No shorter step tells more: what this one shows has happened.
            attempt_again(task, h)
            interpolation_stages(model, method, mode, t, h, run.y, work)
            path = path_of_attempt(model, method, run, h, work)
            theta, fired, proved, _ = first_event(task, path, True, ignored, touched)
        if proved < min(theta, 1.0):
            attempt_again(task, proved * h)
            return proved * h, 0.0, NO_TRANSITION
        if fired == NO_TRANSITION:
            break
        side = run.side[fired]
        shortened, correction, first = land_on_first(task, fired, h, theta)
        if shortened != NOT_THERE:
            return shortened, correction, first
        attempt_again(task, h)
        beyond = sign_at_end(model, run, fired, t + h, work) == -side
        attempt_again(task, theta * h)
        bent = model.affine_guard[fired] == 0
        if beyond or (bent and sign_at_end(model, run, fired, t + theta * h, work) == 0):
            # Only a flight at the level of rounding lies between: the guard is as zero as it can be there.
            return theta * h, 0.0, fired
        attempt_again(task, h)
        ignored, touched = fired, theta
        note_touch(run, fired, theta, 0.0)
    share = share_with_one_touch(run)
    if share < 1.0:
        attempt_again(task, share * h)
        return share * h, 0.0, NO_TRANSITION
    return h, 0.0, NO_TRANSITION


@njit(**INLINE)
def carry_rates(method, length, work):
    """The rates at the end of a step are those at the start of the next."""
    s = method.b.shape[0]
    for i in range(length + 1):
        work.stages[0, i] = work.stages[s, i]


@njit(**INLINE)
def growth_factor(method, run, h, ratio):
    """Factor for the next step from this error ratio and from its trend over the last two steps.

    The trend (Gustafsson 1994, doi:10.1145/198429.198437) foresees the shrinking steps towards a singularity,
    such as the end of a Hertz contact, where each step would otherwise be tried too long.
    """
    factor = ratio ** (-method.exponent)
    if run.last_step > 0.0:
        trend = h / run.last_step * (run.last_ratio / ratio) ** method.exponent
        factor = min(factor, factor * trend)
    return min(GROW, max(SHRINK, SAFETY_FACTOR * factor))


@njit(**INLINE)
def alignment_ratio(method, n, tangents, work):
    """Error ratio due to the angles of the tangent vectors at the end of the attempted step.

    It makes the logarithm of the product of their sines a limit of the step's length. Above 1 they are too
    close together for the solver's error, which is relative to whole vectors.
    """
    product = independence(work.new, n, tangents, work.jacobian)
    if product < 0.0 or product >= 1.0:
        return 0.0
    if product == 0.0:
        return math.inf
    return (-0.5 * math.log(product) / CLOSEST) ** (1.0 / method.exponent)


@njit(**KERNEL)
def makes_ready(task, remaining):
    """Whether a run has rates and a length for its next step; both are computed after an event."""
    _, model, method, run, _, work = task_of(task)
    mode, t, tangents = run.mode, run.phase, task.tangents
    rates(model, mode, t, run.y, tangents, work.stages[0])
    if run.next_step <= 0.0:
        run.next_step = starting_step(model, method, mode, t, run.y, tangents, remaining, work)
    if not run.next_step > 0.0:
        return False
    run.stage = READY
    return True


@njit(**KERNEL)
def reject(task, h, ratio):
    """Make the next step shorter than an attempted one with this error ratio; a code and the step in time.

    Where no step can be shorter, the run ends, unless a guard is there.
    """
    _, model, method, run, _, work = task_of(task)
    mode = run.mode
    run.rejected += 1
    shrink = max(SHRINK, SAFETY_FACTOR * ratio ** (-method.exponent)) if ratio > 1.0 else 0.1
    run.next_step = h * shrink
    finest = h * shrink <= FINEST * measured_time(model, run, mode)
    if finest and ratio > 1.0 and model.timed[mode] == 0:
        finest = moves_nothing(model, run, work.stages[0], h * shrink)
    if not (finest or h * shrink < 1e-200):
        return GO_ON, 0.0
    correction, run.pending = reach_any(task, h)
    if run.pending == NO_TRANSITION:
        return STEP_TOO_SMALL if ratio > 1.0 else NON_FINITE, 0.0
    accept(model, method, run, task.tangents, 0.0, correction, work)
    return GO_ON, correction


@njit(**INLINE)
def try_shorter(run, h):
    """Reject an attempted step; the next one has the length ``h``."""
    run.rejected += 1
    run.next_step = h
    return GO_ON, 0.0


@njit(**INLINE)
def is_lost(model, work):
    """Whether the end of the attempted step has no value."""
    lost = False
    for i in range(model.dimension):
        lost = lost or math.isnan(work.new[i])
    return lost


@njit(**INLINE)
def take(task, h, correction, fired, whole):
    """Move the run to the end of the attempted step, of which the length ``h`` of the ``whole`` is taken."""
    _, model, method, run, record, work = task_of(task)
    t, tangents = run.phase, task.tangents
    if record.step_phase.shape[0] > 0 and h > 0.0:
        remember_step(model, method, run, record, t, h, work)
    accept(model, method, run, tangents, h, correction, work)
    run.pending = fired
    if fired == NO_TRANSITION:
        carry_rates(method, model.dimension * (1 + tangents), work)


@njit(**INLINE)
def follows(task, h, whole):
    """Whether the interpolant of the ``whole`` attempted step, or of the part that is taken, has the field.

    A step that ends at an event is not asked: the field may change behind a guard, where its last stages lie.
    """
    attempts, model, method, run, _, work = task_of(task)
    if h < whole:
        interpolation_stages(model, method, run.mode, run.phase, h, run.y, work)
    return attempts.follows_attempt(model, method, run, h, work)


@exported(Pair(REAL), Task, REAL)
def runge_kutta_step(task, remaining):
    """One step, to the first event on it or to the end of the run; returns a code and the step in time.

    The transition of an event is left in ``run.pending``. A rejected step has the length zero.
    """
    attempts, model, method, run, record, work = task_of(task)
    mode, t = run.mode, run.phase
    if run.stage == STALE and not makes_ready(task, remaining):
        return NON_FINITE, 0.0
    proposed = min(run.next_step, method.max_step)
    last = proposed >= remaining
    h = remaining if last else proposed
    if is_forced(model, mode):
        h = attempts.explained_step(model, method, run, h, work)
        last = last and h == remaining
    ratio = attempt(task, h)
    if task.orthonormal != 0 and method.implicit != 0 and ratio <= 1.0:
        ratio = max(ratio, alignment_ratio(method, model.dimension, task.tangents, work))
    run.steps += 1
    if not ratio <= 1.0:
        return reject(task, h, ratio)
    interpolated = is_forced(model, mode)
    if interpolated:
        interpolation_stages(model, method, mode, t, h, run.y, work)
        explained = attempts.explained_attempt(model, method, run, h, work)
        if explained < h:
            return try_shorter(run, explained)
    fired, correction, whole = NO_TRANSITION, 0.0, h
    guarded = model.first_outgoing[mode + 1] > model.first_outgoing[mode]
    if guarded:
        h, correction, fired = find_event(task, h, interpolated)
        # Where the field ends at the guard, a landing may have no value: a shorter step comes nearer to it.
        if h == 0.0 if fired == NO_TRANSITION else is_lost(model, work):
            restore_sides(model, run)
            return try_shorter(run, TRY_SHORTER * whole)
    if interpolated and fired == NO_TRANSITION and not follows(task, h, whole):
        if guarded:
            restore_sides(model, run)
        return reject(task, whole, math.inf)
    if guarded and run.grazing_place * whole <= h:
        remember_touch_on_step(model, method, run, record, t, h, whole, work)
    grow = growth_factor(method, run, whole, max(ratio, 1e-16))
    run.next_step = max(proposed, whole * grow) if last else whole * grow
    run.last_step, run.last_ratio = whole, max(ratio, 1e-16)
    if fired != NO_TRANSITION:
        run.next_step = min(run.next_step, LONGEST_AFTER_EVENT * h)
    elif run.first_step[mode] <= 0.0:
        run.first_step[mode] = h
    take(task, h, correction, fired, whole)
    return GO_ON, h + correction
