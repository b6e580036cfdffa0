"""What a step tells of the sides of guards, and whether a field holds the state at one."""

from numba import njit

from hybrid.kernels.events.guards import displace, error_band, guard_speed, guard_value, rounding_band
from hybrid.kernels.events.onset import NO_ROOT
from hybrid.kernels.types.codes import NO_MODE, NO_TRANSITION
from hybrid.kernels.types.options import INLINE, KERNEL

# The last terms of a series for a guard below this size may have lost their digits.
UNDERFLOW = 1e-250
# Speeds as near to a guard as its rounding, and so many times farther, tell how the speed grows with the
# distance. Below this share of proportional growth the state reaches the guard in finite time.
FARTHER = 16.0
PROPORTIONAL = 0.5


@njit(**INLINE)
def keep_side(run, transition):
    """Remember what is known of a guard at the start of a step."""
    run.side_before[transition] = run.side[transition]
    run.order_before[transition] = run.on_guard[transition]
    run.unproved_before[transition] = run.unproved[transition]
    run.changes[transition] = NO_ROOT


@njit(**INLINE)
def sides_at_share(model, run, share, fired):
    """Give guards the sides that they have at a share of the step, before the event of ``fired`` there.

    A guard that crosses in its direction may have passed zero the other way before; where that was the last
    to happen, it is there still. If the event is closer to that passing than to the crossing, the guard has
    not crossed again, whatever rounding and the error of the step make of its sign there. One whose side the
    step itself has shown has none yet, unless it crosses later on the step.
    """
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        before = run.side_before[transition]
        if before == 0 and run.changes[transition] == NO_ROOT:
            run.side[transition] = 0
        elif before != 0 and transition != fired:
            run.side[transition] = -before if run.changes[transition] < share else before


@njit(**KERNEL)
def restore_sides(model, run):
    """Return to what was known of the guards at the start of the step."""
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        transition = model.outgoing[slot]
        run.side[transition] = run.side_before[transition]
        run.on_guard[transition] = run.order_before[transition]
        run.unproved[transition] = run.unproved_before[transition]


@njit(**KERNEL)
def underflows(model, transition, t, x, later, y, scalar):
    """Whether a guard is too small for a sign at both of two places, but not zero."""
    first = abs(guard_value(model, transition, t, x, scalar))
    last = abs(guard_value(model, transition, later, y, scalar))
    return 0.0 < max(first, last) < UNDERFLOW


@njit(**KERNEL)
def speed_displaced(model, transition, mode, t, x, distance, work):
    """Speed of a guard at a state beside ``x``, where the guard is larger by ``distance``.

    ``work.gradient`` is current, and tells where that is.
    """
    displace(model, x, distance, work.gradient, work.state)
    model.field(mode, t, work.state, model.parameters, work.field_after)
    return guard_speed(model, transition, t, work.state, work.field_after, work.gradient)


@njit(**KERNEL)
def speed_beside(model, transition, mode, t, x, value, distance, work):
    """Speed of a guard beside ``x``, where its value is about ``distance``; zero if the guard jumps there.

    ``value`` is that of the guard at ``x``.
    """
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    speed = speed_displaced(model, transition, mode, t, x, distance - value, work)
    there = guard_value(model, transition, t, work.state, work.scalar)
    return speed if 0.5 < there / distance < 2.0 else 0.0


@njit(**KERNEL)
def draws_state(model, run, transition, mode, t, x, value, work):
    """Whether the field leads to a guard from both sides, and reaches it in finite time.

    A smooth field does not: near a guard that attracts the state, its speed is proportional to the distance.
    ``value`` is that of the guard.
    """
    distance = max(abs(value), rounding_band(model, run, transition, t, x, work))
    side = -1.0 if model.direction[transition] > 0 else 1.0
    for _ in range(2):
        near = side * speed_beside(model, transition, mode, t, x, value, side * distance, work)
        far = side * speed_beside(model, transition, mode, t, x, value, side * FARTHER * distance, work)
        if not PROPORTIONAL * FARTHER * near < far < 0.0:
            return False
        side = -side
    return True


@njit(**KERNEL)
def stays_on_guard(model, method, run, work):
    """Whether a jump has left the state on its guard, within the tolerances, and the field holds it there.

    The flow would lead the state back to the guard at once. So would the flow of another mode from which the
    same guard leads back to the mode before.
    """
    mode, left, fired, t = run.mode, run.previous_mode, run.last_fired, run.phase
    if left == NO_MODE or fired == NO_TRANSITION:
        return False
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        if left == mode:
            returns = transition == fired
        else:
            returns = model.target[transition] == left and model.surface[transition] == model.surface[fired]
        if not returns:
            continue
        value = guard_value(model, transition, t, run.y, work.scalar)
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        if abs(value) <= error_band(method, run, work.gradient, model.controlled) and draws_state(
            model, run, transition, mode, t, run.y, value, work
        ):
            return True
    return False
