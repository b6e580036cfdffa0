"""Landing on an event of a Runge-Kutta step: the step is taken again up to its guard."""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.events.guards import guard_speed, guard_value, may_jump, rounding_band
from hybrid.kernels.events.onset import NO_ROOT, crosses_towards
from hybrid.kernels.events.resolution import speed_displaced
from hybrid.kernels.steps.step import attempt_again
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL
from hybrid.kernels.types.task import task_of

# Below this share of the step, one Euler step completes a correction: the error left is its square.
EULER_IS_ENOUGH = 1e-8
# Largest Newton step, as a share of the step, for a guard that may have kinks and jumps.
MOST_CORRECTION = 1e-3
# First distance, as a share of the step, at which the other side of a guard is searched.
FIRST_REACH = 1e-10
MOST_LANDINGS = 200
NOT_THERE = -1.0


@njit(**KERNEL)
def reach(model, run, transition, t, h, tangents, work):
    """The Euler step, of at most ``h``, that takes the state to a guard as near as rounding of time tells.

    The end is in ``work.new``. Returns the length of the step, or ``NOT_THERE`` if the guard is farther away,
    or does not hold the state: then the field as far beyond the guard leads on.
    """
    value = guard_value(model, transition, t, run.y, work.scalar)
    speed = guard_speed(model, transition, t, run.y, work.stages[0], work.gradient)
    if not speed * value < 0.0 or not abs(value) <= abs(speed) * h:
        return NOT_THERE
    length = -value / speed
    for i in range(model.dimension * (1 + tangents)):
        work.new[i] = run.y[i] + length * work.stages[0, i]
    beyond = speed_displaced(model, transition, run.mode, t, run.y, -2.0 * value, work)
    return length if not beyond * speed > 0.0 else NOT_THERE


@njit(**KERNEL)
def reach_any(task, h):
    """``reach`` for the first guard of the mode that is there and fires; the transition comes second.

    A field that is not smooth at a guard has an error on every step that reaches the guard, until rounding
    of time allows none that is shorter: ``h' = -sqrt(h)`` comes to rest at zero so, and may end there.
    """
    _, model, _, run, _, work = task_of(task)
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        side = run.side[transition]
        if run.on_guard[transition] == 0 and crosses_towards(model.direction[transition], -side):
            length = reach(model, run, transition, run.phase, h, task.tangents, work)
            if length != NOT_THERE:
                return length, transition
    return NOT_THERE, NO_TRANSITION


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
    interpolant. The guard comes from ``side``; Newton is kept between the longest length before which it has
    been seen there and the shortest behind which it has not. Returns the length of the step last taken and
    the small Euler step that completed it; ``NOT_THERE`` instead of the length if the guard of the step,
    unlike that of its interpolant, only comes close to zero.
    """
    _, model, method, run, _, work = task_of(task)
    t, s, rounding = run.phase, method.b.shape[0], measured_time(model, run, run.mode)
    begins = guard_value(model, transition, t, run.y, work.scalar) * side > 0.0
    # Along the step an affine guard is as smooth as the state. Other guards may have kinks, jumps and flat
    # roots, and may cross more than once on the step: its ends are no bracket.
    smooth = model.affine_guard[transition] == 1
    low, high, before, after = 0.0, h, False, False
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
        # A guard that stays zero for a while changes its side at the end of that. One without a value has not
        # crossed yet if the interpolant crosses farther on.
        at_rest = not smooth and value == 0.0 and speed == 0.0
        if value * side > 0.0 or at_rest or (math.isnan(value) and length < theta * h):
            low, before = length, True
        else:
            high, after = length, True
        if before and after and high - low <= 2.0 * EPSILON * max(high, rounding):
            if length != high:
                attempt_again(task, high)
            return (NOT_THERE if turns_back(model, run, transition, side, t + high, s, work) else high), 0.0
        newton, change = length + correction, abs(correction)
        # A Newton step longer than the error of the interpolant follows another slope, that beside a jump.
        trusted = (smooth or change <= MOST_CORRECTION * h) and (trial < 3 or change <= 0.5 * last)
        # A place that does not come from Newton's method gives no rate of convergence.
        last = 0.0
        if low < newton < high and trusted:
            length, last = newton, change
        elif before and after:
            length = 0.5 * (low + high)
        else:
            # Only one side is known: the other is searched at growing distances, up to an end of the step.
            length, reach = (low + reach if before else high - reach), 8.0 * reach
            if before and low < h <= length:
                length = h
            elif begins and length <= 0.0:
                length, low, before = 0.5 * high, 0.0, True
            elif not low < length < high:
                break
    return NOT_THERE, 0.0


@njit(**KERNEL)
def sign_at_end(model, run, transition, t, work):
    """The sign of a guard at the end of the attempted step, at ``t``; 0 if rounding hides it."""
    value = guard_value(model, transition, t, work.new, work.scalar)
    model.guard_gradient(transition, t, work.new, model.parameters, work.gradient)
    if abs(value) <= rounding_band(model, run, transition, t, work.new, work):
        return 0
    return 1 if value > 0.0 else -1


@njit(**KERNEL)
def passed_before(model, run, fired, t, work):
    """A transition whose guard a landing on the guard of ``fired``, at ``t``, lies beyond; or none.

    The guard has a crossing on the step that fires, and is on one side up to that crossing.
    """
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        side = run.side[transition]
        fires = run.changes[transition] < NO_ROOT and crosses_towards(model.direction[transition], -side)
        fires = fires and side != 0 and transition != fired
        if fires and sign_at_end(model, run, transition, t, work) == -side:
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
    length, correction = land(task, fired, run.side[fired], h, theta)
    for _ in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        if not length > 0.0:
            break
        other = passed_before(model, run, fired, run.phase + length + correction, work)
        if other == NO_TRANSITION:
            break
        end = length
        length, correction = land(task, other, run.side[other], end, 1.0)
        if length == NOT_THERE:
            # The guard only comes close to zero: the landing before stands.
            length, correction = land(task, fired, run.side[fired], end, 1.0)
            break
        fired = other
    return length, correction, fired
