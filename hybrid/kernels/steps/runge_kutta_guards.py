"""Guards along a Runge-Kutta step: the earliest crossing, whether it is resolved, and landing on it."""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.arithmetic.bernstein import (
    NO_ROOT,
    crosses_towards,
    divide_by_theta,
    stays,
)
from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    error_band,
    guard_speed,
    guard_value,
    may_jump,
    rounding_band,
)
from hybrid.kernels.events.onset import BY_SPEED, LATER
from hybrid.kernels.events.resolution import (
    MARGIN,
    field_holds,
    keep_outcome,
    keep_side,
    keeps_sign,
    set_sides_before,
    underflows,
)
from hybrid.kernels.guards.pieces import NO_COLUMN
from hybrid.kernels.guards.touch import forget_touches, note_touch, share_with_one_touch
from hybrid.kernels.steps.step import attempt_again
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.kinds import REAL, TRUTH
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL
from hybrid.kernels.types.task import task_of

# Below this share of the step, one Euler step completes a correction: the error left is its square.
EULER_IS_ENOUGH = 1e-8
# Largest Newton step, as a share of the step, for a guard that may have kinks and jumps.
FARTHEST = 1e-3
# First distance, as a share of the step, at which the other side of a guard is searched.
FIRST_REACH = 1e-10
MOST_LANDINGS = 200
NOT_THERE = -1.0


@njit(**INLINE)
def affine_polynomial(model, method, transition, t, h, x, value, work):
    """Bernstein coefficients of an affine guard on the interpolant, exactly; returns their degree."""
    n = model.dimension
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    degree, count = method.interpolant.shape[0] - 1, method.a.shape[0]
    for j in range(count):
        speed = 0.0
        for i in range(n):
            speed += work.gradient[i] * work.stages[j, i]
        work.speeds[j] = h * speed
    for i in range(degree + 1):
        total = value + h * work.gradient[n] * i / degree
        for j in range(count):
            total += method.interpolant[i, j] * work.speeds[j]
        work.polynomial[i] = total
    return degree


@njit(**KERNEL)
def affine_powers(model, method, value, h, work):
    """Powers of an affine guard on the interpolant behind those of the state, after ``affine_polynomial``."""
    n, path = model.dimension, work.path
    for k in range(method.powers.shape[0]):
        total = 0.0
        for j in range(method.a.shape[0]):
            total += method.powers[k, j] * work.speeds[j]
        path[k, n] = total
    path[0, n] = value
    path[1, n] += h * work.gradient[n]


@njit(**KERNEL)
def rounding_on_step(model, run, transition, t, h, work):
    """Largest value that rounding can give a guard at rest on a step; ``work.gradient`` is current.

    A state and a time that are zero where the step starts have no size there, only further on.
    """
    n = model.dimension
    moved = abs(work.gradient[n])
    for i in range(n):
        moved += abs(work.gradient[i] * work.stages[0, i])
    band = rounding_band(model, run, transition, t, run.y, work)
    return band + ROUNDING_OF_STATE * EPSILON * h * moved


@njit(**KERNEL)
def leave_guard(model, run, transition, t, work):
    """Set the side of a guard to its side at the end of the attempted step, ``work.new``."""
    value = guard_value(model, transition, t, work.new, work.scalar)
    model.guard_gradient(transition, t, work.new, model.parameters, work.gradient)
    if abs(value) > rounding_band(model, run, transition, t, work.new, work):
        run.side[transition] = 1 if value > 0.0 else -1
        run.on_guard[transition] = 0


@njit(**INLINE)
def error_of_step(model, run, h, work):
    """The estimated error of the attempted step into ``work.field_after``, where it is more than rounding."""
    for i in range(model.dimension):
        # Where a step is too long, either estimate may be close to zero.
        error = h * (abs(work.error[i]) + abs(work.second_error[i]))
        size = max(abs(run.y[i]), abs(work.new[i]), abs(h * work.stages[0, i]))
        work.field_after[i] = error if error > ROUNDING_OF_STATE * EPSILON * size else 0.0


@njit(**INLINE)
def moved_by_error(model, work):
    """How far the error in ``work.field_after`` may move a guard with the gradient ``work.gradient``."""
    moved = 0.0
    for i in range(model.dimension):
        moved += abs(work.gradient[i]) * work.field_after[i]
    return moved


@njit(**INLINE)
def asks_error(run, on_guard):
    """Whether a guard is left by a derivative that is known at the start of this step.

    A guard that has stayed within rounding of zero on the steps before has other derivatives by now.
    """
    return on_guard == BY_SPEED and run.since_entry == 0.0


@njit(**KERNEL)
def outweighs_error(model, run, growth, h, work):
    """Whether a guard grows by more on the attempted step than its error; ``work.gradient`` is current.

    ``growth`` is what the first derivative that is not zero, that of a guard which is zero at the start of
    the step, adds to the guard over the step, counted towards the known side. A step on which the error may
    outweigh it says nothing of the guard: the error may have made a crossing, or hide one. A shorter step has
    less error.
    """
    error_of_step(model, run, h, work)
    return growth > MARGIN * moved_by_error(model, work)


@njit(**KERNEL)
def leaves_as_known(model, run, transition, t, h, work):
    """``outweighs_error`` for a guard that is no polynomial on the step."""
    for i in range(model.dimension):
        work.field[i] = work.stages[0, i]
    speed = guard_speed(model, transition, t, run.y, work.field, work.gradient)
    growth = h * speed
    return math.isnan(growth) or outweighs_error(model, run, growth * run.side[transition], h, work)


@njit(**KERNEL)
def is_resolved(model, method, run, transition, t, h, work):
    """Whether the error of the attempted step leaves the sign of a guard at both ends of the step alone.

    The tolerances let the error of a state be many times the state itself, if that is small enough. The signs
    of such a state, and crossings found from them, are those of the error. It is not asked of a guard that is
    zero at the start: its derivatives tell its side. Nor is it asked where the guard moves on through zero,
    much farther than the error: this step or the next finds the crossing.
    """
    error_of_step(model, run, h, work)
    if keeps_sign(model, transition, t, run.y, work) and keeps_sign(model, transition, t + h, work.new, work):
        return True
    s = method.b.shape[0]
    before = guard_speed(model, transition, t, run.y, work.stages[0], work.gradient)
    after = guard_speed(model, transition, t + h, work.new, work.stages[s], work.gradient)
    slower = min(abs(before), abs(after))
    return before * after > 0.0 and slower * h > MARGIN * moved_by_error(model, work)


@njit(**KERNEL)
def largest_magnitude(coefficients, degree):
    """The largest magnitude of the coefficients of a polynomial."""
    largest = 0.0
    for i in range(degree + 1):
        largest = max(largest, abs(coefficients[i]))
    return largest


@njit(**KERNEL)
def stays_on_side(model, method, run, transition, path, work):
    """Whether an affine guard surely has no zero on a step, or rests at zero, by its Bernstein coefficients.

    Else the powers of its polynomial are left behind those of the state on the path.
    """
    t, h, on_guard = path.start, path.pace, run.on_guard[transition]
    start = 0.0 if on_guard > 0 else guard_value(model, transition, t, run.y, work.scalar)
    degree = affine_polynomial(model, method, transition, t, h, run.y, start, work)
    if on_guard > 0:
        band = rounding_on_step(model, run, transition, t, h, work)
        if largest_magnitude(work.polynomial, degree) <= band:
            return True
    if on_guard == BY_SPEED:
        degree = divide_by_theta(work.polynomial, degree)
    error = error_band(method, run, work.gradient, model.controlled)
    if on_guard < LATER and stays(work.polynomial, degree, run.side[transition], error):
        run.on_guard[transition] = 0
        return True
    affine_powers(model, method, start, h, work)
    return False


@njit(**KERNEL)
def crossing_on_step(attempts, model, method, run, transition, path, work):
    """Where a guard crosses, the share of the step that is proved, and whether the crossing is resolved."""
    t, h, on_guard, column = path.start, path.pace, run.on_guard[transition], NO_COLUMN
    if model.affine_guard[transition] == 1:
        if stays_on_side(model, method, run, transition, path, work):
            return NO_ROOT, 1.0, True
        column = model.dimension
    end = guard_value(model, transition, t + h, work.new, work.scalar) if on_guard >= LATER else 0.0
    known = asks_error(run, on_guard)
    unsure = known and not leaves_as_known(model, run, transition, t, h, work)
    theta, share = attempts.crossing_on_path(model, method, run, transition, column, path, end, work)
    side = run.rehearsal[3, transition]
    run.rehearsal[3, transition] = 0
    if underflows(model, transition, t, run.y, t + h, work.new, work.scalar):
        return NO_ROOT, share, True
    hidden = unsure or (on_guard == 0 and not is_resolved(model, method, run, transition, t, h, work))
    keep_outcome(run, transition, theta, side)
    return theta, share, not hidden


@njit(**INLINE)
def earliest_crossing(attempts, model, method, run, path, ignored, touched, work):
    """Earliest crossing on the attempted step over the mode's guards but ``ignored``, and its transition.

    The guard of ``ignored`` touches zero at the share ``touched`` of the step. Returns
    ``(theta, transition, proved, blurred)``, with ``(NO_ROOT, NO_TRANSITION)`` if nothing crosses before the
    share ``proved`` of the step, to which the step is to be cut. ``blurred`` is a transition whose guard
    changes sides, or grazes, on the step, although ``is_resolved`` is false for it, or none. The sides of
    guards without a crossing are brought up to date, to the end of the step, and guards that were left are no
    longer held to be zero at its start; ``resolution.restore_sides`` takes that back. For a guard with a
    crossing, ``run.rehearsal[3]`` holds its side before that.
    The ``path`` must be the interpolant if any guard of the mode is not affine.
    """
    mode = run.mode
    earliest, fired, proved, blurred = NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION
    forget_touches(run)
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        keep_side(run, transition)
        if transition == ignored:
            leave_guard(model, run, transition, path.start + path.pace, work)
            note_touch(run, transition, touched, 0.0)
            continue
        theta, share, resolved = crossing_on_step(attempts, model, method, run, transition, path, work)
        proved = min(proved, share)
        if not resolved:
            blurred = transition
        if theta < earliest:
            earliest, fired = theta, transition
    set_sides_before(model, run, earliest)
    return earliest, fired, min(proved, share_with_one_touch(run)), blurred


@njit(**KERNEL)
def reach(model, run, transition, t, h, tangents, work):
    """The Euler step, of at most ``h``, that takes the state to a guard as near as rounding of time tells.

    The end is in ``work.new``. Returns the length of the step, or ``NOT_THERE`` if the guard is farther away,
    or does not hold the state: then the field beyond the guard leads on.
    """
    value = guard_value(model, transition, t, run.y, work.scalar)
    speed = guard_speed(model, transition, t, run.y, work.stages[0], work.gradient)
    if not speed * value < 0.0 or not abs(value) <= abs(speed) * h:
        return NOT_THERE
    length = -value / speed
    for i in range(model.dimension * (1 + tangents)):
        work.new[i] = run.y[i] + length * work.stages[0, i]
    return length if field_holds(model, transition, run.mode, t, run.y, speed, work) else NOT_THERE


@njit(**KERNEL)
def reach_any(model, run, t, h, tangents, work):
    """``reach`` for the first guard of the mode that is there and fires; the transition comes second."""
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        run.rehearsal[3, model.outgoing[slot]] = 0
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        side = run.side[transition]
        if run.on_guard[transition] == 0 and crosses_towards(model.direction[transition], -side):
            length = reach(model, run, transition, t, h, tangents, work)
            if length != NOT_THERE:
                run.rehearsal[3, transition] = side
                return length, transition
    return NOT_THERE, NO_TRANSITION


class Lengths(NamedTuple):
    """The lengths of a step between which its end passes a guard.

    The guard has been seen on its side at ``low`` if ``before``, and not on it at ``high`` if ``after``.
    """

    low: REAL
    high: REAL
    before: TRUTH
    after: TRUTH


@njit(**INLINE)
def narrowed(bracket, length, short):
    """A bracket after a length that is too short, or long enough."""
    low, high, before, after = bracket
    if short:
        return Lengths(length, high, True, after)
    return Lengths(low, length, before, True)


@njit(**KERNEL)
def searched_at(bracket, begins, distance, h):
    """The length at which the other side of a guard is searched, at a distance; with what is known then.

    The length is ``NOT_THERE`` if no place is left. The guard is on its side at the start if it ``begins``
    there.
    """
    low, high, before, after = bracket
    length = low + distance if before else high - distance
    if before and low < h <= length:
        # The end of the step is the farthest place.
        return h, bracket
    if begins and after and length <= low:
        # The start of the step is the farthest place on this side.
        return 0.5 * high, Lengths(low, high, True, after)
    return length if low < length < high else NOT_THERE, bracket


@njit(**KERNEL)
def turns_back(model, run, transition, side, t, s, work):
    """Whether a guard that does not jump leads back to its side, where a step ends within its rounding."""
    speed = guard_speed(model, transition, t, work.new, work.stages[s], work.gradient)
    if not speed * side > 0.0 or may_jump(model, run, transition, t, work.new, work):
        return False
    value = guard_value(model, transition, t, work.new, work.scalar)
    return abs(value) <= rounding_band(model, run, transition, t, work.new, work)


@njit(**KERNEL)
def land(task, transition, side, h, theta):
    """Shorten the step so that it ends on the guard, with the end in ``work.new``.

    The step is taken again up to the root of the interpolant and corrected by Newton's method on the guard,
    so that the state and the tangents at the event carry the error of the method, not that of its
    interpolant. The guard comes from ``side``; Newton is kept in a bracket as soon as both sides have been
    seen. Returns the length of the step last taken and the small Euler step that completed it; ``NOT_THERE``
    instead of the length if the guard of the step, unlike that of its interpolant, only comes close to zero.
    """
    _, model, method, run, _, work = task_of(task)
    t, s, rounding = run.phase, method.b.shape[0], measured_time(model, run, run.mode)
    begins = guard_value(model, transition, t, run.y, work.scalar) * side > 0.0
    # Along the step an affine guard is as smooth as the state. Other guards may have kinks, jumps and flat
    # roots, and may cross more than once on the step. The ends of the step are then no bracket.
    smooth = model.affine_guard[transition] == 1
    after = smooth and guard_value(model, transition, t + h, work.new, work.scalar) * side <= 0.0
    bracket = Lengths(0.0, h, smooth and begins, after)
    length, last, reach = theta * h, math.inf, FIRST_REACH * h
    for trial in range(MOST_LANDINGS):
        attempt_again(task, length)
        if length == 0.0:
            return 0.0, 0.0
        value = guard_value(model, transition, t + length, work.new, work.scalar)
        speed = guard_speed(model, transition, t + length, work.new, work.stages[s], work.gradient)
        correction = -value / speed
        # The next correction is predicted from the last two, because Newton's method converges quadratically.
        converges = smooth or (trial > 0 and abs(correction) ** 3 <= EPSILON * length * last * last)
        if speed * side < 0.0 and abs(correction) <= EULER_IS_ENOUGH * length and converges:
            for i in range(model.dimension * (1 + task.tangents)):
                work.new[i] += correction * work.stages[s, i]
            return length, correction
        # A guard that stays zero for a while changes its side at the end of that.
        at_rest = not smooth and value == 0.0 and speed == 0.0
        # A guard without a value has not crossed yet if the interpolant crosses farther on.
        short = value * side > 0.0 or at_rest or (math.isnan(value) and length < theta * h)
        bracket = narrowed(bracket, length, short)
        low, high, closed = bracket.low, bracket.high, bracket.before and bracket.after
        if closed and high - low <= 2.0 * EPSILON * (max(high, rounding) if smooth else high):
            if length != high:
                attempt_again(task, high)
            return (NOT_THERE if turns_back(model, run, transition, side, t + high, s, work) else high), 0.0
        newton = length + correction
        slow = trial >= MOST_LANDINGS // 2 if smooth else trial > 2 and not abs(correction) <= 0.5 * last
        # A place that does not come from Newton's method gives no rate of convergence.
        last = 0.0
        # A Newton step longer than the error of the interpolant follows another slope, that beside a jump.
        trusted = smooth or abs(correction) <= FARTHEST * h
        if low < newton < high and trusted and not slow:
            length, last = newton, abs(correction)
        elif closed:
            length = 0.5 * (low + high)
        elif smooth:
            break
        else:
            # Only one side is known: search the other side at growing distances.
            length, bracket = searched_at(bracket, begins, reach, h)
            reach *= 8.0
            if length == NOT_THERE:
                break
    return NOT_THERE, 0.0


@njit(**KERNEL)
def is_beyond(model, run, transition, side, t, work):
    """Whether the end of the attempted step, at ``t``, is surely not on a side of a guard."""
    value = guard_value(model, transition, t, work.new, work.scalar)
    model.guard_gradient(transition, t, work.new, model.parameters, work.gradient)
    return -value * side > rounding_band(model, run, transition, t, work.new, work)


@njit(**KERNEL)
def passed_before(model, run, fired, t, work):
    """A transition whose guard a landing on the guard of ``fired``, at ``t``, lies beyond; or none.

    The guard has a crossing on the step that fires, and is on one side up to that crossing.
    """
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        side = run.rehearsal[3, transition]
        # Where no crossing fires, the side is already that at the end of the step.
        fires = side != 0 and side == run.side[transition] and run.passed[transition] == NO_ROOT
        if transition != fired and fires and is_beyond(model, run, transition, side, t, work):
            return transition
    return NO_TRANSITION


@njit(**KERNEL)
def land_on_first(task, fired, h, theta):
    """Land on the guard of ``fired``, or on one that the landing shows to be crossed before.

    The error of the interpolant may put guards that cross almost together in the wrong order. Returns the
    lengths as ``land`` does, and the transition.
    """
    _, model, _, run, _, work = task_of(task)
    mode = run.mode
    length, correction = land(task, fired, run.rehearsal[3, fired], h, theta)
    for _ in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        if not length > 0.0:
            break
        other = passed_before(model, run, fired, run.phase + length + correction, work)
        if other == NO_TRANSITION:
            break
        end = length
        length, correction = land(task, other, run.rehearsal[3, other], end, 1.0)
        if length == NOT_THERE:
            # The guard only comes close to zero: the landing before stands.
            length, correction = land(task, fired, run.rehearsal[3, fired], end, 1.0)
            break
        fired = other
    return length, correction, fired
