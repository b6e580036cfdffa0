"""Guards reached together: whether the order in which they fire matters."""

from numba import int64, njit

from hybrid.kernels.codes import (
    MODE,
    NO_MODE,
    NO_TRANSITION,
    ORDER_MATTERED,
    PHASE,
    PHASE_OF_RUN,
    PREVIOUS_MODE,
    RESUMING,
    SIMULTANEOUS,
)
from hybrid.kernels.guards import (
    acceleration_rounding,
    allowed,
    guard_acceleration,
    guard_speed,
    guard_value,
    keep_grazing,
    rounding_band,
    sides_at_point,
    speed_rounding,
)
from hybrid.kernels.layout import KERNEL, MODEL, PART, RECORD, RUN, WORK

MOST_JUMPS = 50
# States that differ by less than this, relative to their sizes, came out the same.
SAME = 1e-9


@njit(**KERNEL)
def is_due(model, run, transition, mode, t, x, work):
    """Whether a guard is zero, up to rounding, and moving to where its transition fires, as it may."""
    value = guard_value(model, transition, t, x, work.scalar)
    model.flow(mode, t, x, model.parameters, work.field)
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    if abs(value) > rounding_band(model, run, transition, t, x, work):
        return False
    return speed * model.direction[transition] > 0.0 and allowed(model, transition, t, x, work.scalar)


@njit(**KERNEL)
def companion(model, run, mode, t, x, fired, markers, work):
    """Another transition due at the very point of ``fired``, or none; ``markers`` says whether they count."""
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        other = model.outgoing[slot]
        if other == fired or (model.marker[other] == 1 and not markers):
            continue
        if is_due(model, run, other, mode, t, x, work):
            return other
    return NO_TRANSITION


@njit(**KERNEL)
def settle(model, run, first, out, work):
    """State ``(n,)`` after ``first`` and all that it sets off at the same instant; returns the mode."""
    n, t = model.dimension, run.clock[PHASE]
    mode, fired = run.count[MODE], first
    for i in range(n):
        out[i] = run.y[i]
    for _ in range(MOST_JUMPS):
        model.reset(fired, t, out, model.parameters, work.state)
        for i in range(n):
            out[i] = work.state[i]
        mode = model.target[fired]
        if mode == NO_MODE:
            break
        fired = companion(model, run, mode, t, out, fired, False, work)
        if fired == NO_TRANSITION:
            break
    return mode


@njit(**KERNEL)
def order_matters(model, run, one, other, work):
    """Whether firing ``one`` or ``other`` first leads to different states or modes."""
    mode_one = settle(model, run, one, work.error, work)
    mode_other = settle(model, run, other, work.second_error, work)
    if mode_one != mode_other:
        return True
    for i in range(model.dimension):
        scale = max(run.scale[i], abs(work.error[i]))
        if abs(work.error[i] - work.second_error[i]) > SAME * scale:
            return True
    return False


@njit(**KERNEL)
def turns_back(model, run, transition, work):
    """Whether a guard only touches zero here: it moves to where it was, or turns there if it is at rest.

    At the bottom of a dip that is no deeper than rounding either end may be found first. A guard that is at
    rest and turns no faster than rounding would have it has been crossed, by its third derivative.
    """
    mode, t = run.count[MODE], run.clock[PHASE]
    model.flow(mode, t, run.y, model.parameters, work.field)
    speed = guard_speed(model, transition, t, run.y, work.field, work.gradient)
    direction = model.direction[transition]
    before = run.side[transition] if direction == 0 else -direction
    if abs(speed) > speed_rounding(model, run, mode, t, work):
        return speed * before > 0.0
    acceleration = guard_acceleration(model, transition, mode, t, run.y, work)
    return acceleration * before > acceleration_rounding(model, run, t, work)


@njit(int64(MODEL, RUN, RECORD, int64, WORK), **PART)
def first_in_order(model, run, record, fired, work):
    """Of the transitions due where the run landed, the one listed first; notes whether order matters.

    None if ``fired`` may not fire or has only touched, and no other is due: the run then takes its sides anew
    at this point. What comes before the guard there, and what after it, may differ by rounding alone, so its
    side is left to the next step: the crossing is behind, and cannot be found where it was refused.
    """
    mode, t = run.count[MODE], run.clock[PHASE]
    fires = allowed(model, fired, t, run.y, work.scalar)
    if fires and turns_back(model, run, fired, work):
        fires = False
        value = guard_value(model, fired, t, run.y, work.scalar)
        keep_grazing(model, run, record, fired, t, run.y, value, work)
    if not fires:
        other = companion(model, run, mode, t, run.y, fired, True, work)
        if other == NO_TRANSITION:
            sides_at_point(model, run, work)
            run.count[PREVIOUS_MODE] = mode
            run.side[fired] = 0
            run.count[PHASE_OF_RUN] = RESUMING
        return other
    other = companion(model, run, mode, t, run.y, fired, False, work)
    if other == NO_TRANSITION:
        return fired
    run.count[SIMULTANEOUS] += 1
    if order_matters(model, run, fired, other, work):
        run.count[ORDER_MATTERED] += 1
    return min(fired, other)
