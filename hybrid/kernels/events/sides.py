"""On which side of its guards a state is, and which of them it has crossed at this instant."""

from numba import njit

from hybrid.kernels.events.guards import (
    acceleration_rounding,
    allowed,
    guard_acceleration,
    guard_speed,
    guard_value,
    has_program,
    may_jump,
    rounding_band,
    smooth_band,
    speed_rounding,
)
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING, is_zero
from hybrid.kernels.types.codes import NO_TRANSITION, RESTING
from hybrid.kernels.types.layout import KERNEL

# How the state came to the point: a run starts there, the flow led there, or a reset put it there.
STARTED, FLOWED, LANDED = range(3)
# A guard larger than this many times what rounding makes of it through its gradient jumps.
SMOOTH = 4.0
# A reset that keeps less than this share of a guard's speed holds a state that is pushed through the guard.
KEPT = 1e-3


@njit(**KERNEL)
def inherit(model, left, transition, side, due, zero):
    """Take over what the mode just left knew of the guard of a transition; says whether it knew the guard.

    A crossing is still due only if no transition on that guard and in that direction has fired for it.
    """
    known, pending, now, order = False, -1, 0, 0
    for slot in range(model.first_outgoing[left], model.first_outgoing[left + 1]):
        other = model.outgoing[slot]
        if model.surface[other] != model.surface[transition]:
            continue
        known = True
        turned = model.orientation[other] * model.orientation[transition]
        order = max(order, zero[other])
        if side[other] != 0:
            now = turned * side[other]
        if turned * model.direction[other] == model.direction[transition]:
            pending = due[other] if pending < 0 else min(pending, due[other])
    side[transition], due[transition], zero[transition] = now, max(pending, 0), order
    return known


@njit(**KERNEL)
def side_of(model, run, mode, transition, t, x, before, was_on, work):
    """Side of a guard, 0 if the next step has to show it, and by which derivative the state leaves zero.

    That order is 0 off the guard, 1 where its speed decides, 2 where the speed is zero up to rounding and the
    acceleration decides, 3 where that is zero too: then nothing has changed since the guard was last looked
    at, if it was zero before, and else it counts as not yet crossed. It is ``JUMPING`` where the guard jumps
    across zero within the rounding of the state: its derivatives say nothing then. ``work.field`` is current.
    """
    value = guard_value(model, transition, t, x, work.scalar)
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    trend, order = value, 0
    if abs(value) <= rounding_band(model, run, transition, t, x, work):
        if has_program(model, transition) and abs(value) > SMOOTH * smooth_band(
            model, run, transition, t, x, work
        ):
            if was_on and before != 0:
                return before, JUMPING
            return 1 if value > 0.0 else -1, JUMPING
        trend, order = speed, BY_SPEED
        if abs(speed) <= speed_rounding(model, run, mode, t, work):
            if may_jump(model, run, transition, t, x, work):
                # In the middle of the jump, where neither side is.
                if was_on and before != 0:
                    return before, JUMPING
                trend, order = 0.0, BY_STEP
            else:
                trend, order = guard_acceleration(model, run, transition, mode, t, x, work), BY_ACCELERATION
                if abs(trend) <= acceleration_rounding(model, run, t, work):
                    trend, order = 0.0, BY_STEP
    direction = model.direction[transition]
    if trend > 0.0:
        return 1, order
    if trend < 0.0:
        return -1, order
    return before if before != 0 and (was_on or direction == 0) else -direction, order


@njit(**KERNEL)
def crossed_by_landing(model, transition, known, own, was_on, before, now, order):
    """Whether a reset has taken a guard from its near side to its far side.

    A guard on which the reset has put the state is on its near side until the state moves off. The reset of
    its own transition fires a guard again in that case only.
    """
    direction = model.direction[transition]
    if direction == 0:
        return not own and before != 0 and now == -before
    if now != direction:
        return False
    if order > 0 and not was_on:
        return True
    if own:
        return False
    if known:
        return before == -direction
    return model.paired[transition] == 0


@njit(**KERNEL)
def is_held(model, run, transition, mode, t, x, work):
    """Whether a reset takes, or turns round, the speed with which a state at rest is pushed through a guard.

    Judged a moment after ``t``; ``work.field`` is current.
    """
    n = model.dimension
    size, pace = 0.0, 0.0
    for i in range(n):
        size, pace = max(size, abs(x[i]), run.scale[i]), max(pace, abs(work.field[i]))
    moment = 1e-7 * (size if size > 0.0 else 1.0) / (pace if pace > 0.0 else 1.0)
    later, after = work.settled, work.state
    for i in range(n):
        later[i] = x[i] + moment * work.field[i]
    model.reset(transition, t + moment, later, model.parameters, after)
    model.field(mode, t + moment, later, model.parameters, work.field_after)
    speed = guard_speed(model, transition, t + moment, later, work.field_after, work.gradient)
    model.field(mode, t + moment, after, model.parameters, work.field_after)
    kept = guard_speed(model, transition, t + moment, after, work.field_after, work.gradient)
    return not kept * speed > KEPT * speed * speed


@njit(**KERNEL)
def take_sides(model, run, mode, t, x, came, left, fired, side, due, zero, work):
    """Take sides at every guard of a mode; return the transition that must fire now, if any.

    ``side``, ``due`` and ``zero (transitions,)`` hold the side of each guard, whether it has been crossed at
    this instant without having fired, and the order from ``side_of``: from the point before, of the mode
    ``left``, and then from this one. ``fired`` is the transition whose reset led here. A guard that has been
    crossed stays due while the state is beyond it. Of those whose condition holds the one listed first fires;
    ``RESTING`` instead if none does and the state rests on the guard that has just fired, pushed against it.
    """
    model.field(mode, t, x, model.parameters, work.field)
    chosen, rests = NO_TRANSITION, False
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        direction = model.direction[transition]
        known = came != STARTED
        if came == LANDED and left != mode:
            known = inherit(model, left, transition, side, due, zero)
        before = side[transition] if known else 0
        was_on = known and zero[transition] > 0
        own = came == LANDED and left == mode and transition == fired
        now, order = side_of(model, run, mode, transition, t, x, before, was_on, work)
        if came == STARTED:
            crossed = is_zero(order) and direction != 0 and now == direction
        elif came == FLOWED:
            crossed = order in (BY_SPEED, JUMPING) and before == -now and (direction == 0 or now == direction)
        else:
            crossed = crossed_by_landing(model, transition, known, own, was_on, before, now, order)
            # A guard that fires both ways and has been crossed has been taken back.
            crossed = crossed and not (direction == 0 and due[transition] == 1)
        beyond = now == (direction if direction != 0 else before)
        pushed = (
            came == LANDED and left == mode and was_on and not crossed and beyond and order == BY_ACCELERATION
        )
        if pushed and due[transition] == 0 and model.marker[transition] == 0:
            pushed = is_held(model, run, transition, mode, t, x, work)
            # Another's reset has left the state where it rests: its own has to hold it once more.
            crossed = pushed and not own
            rests = rests or (pushed and own and allowed(model, transition, t, x, work.scalar))
        pending = came == LANDED and due[transition] == 1 and beyond
        if model.marker[transition] == 1 and came != FLOWED:
            # It marks what the flow crosses: at most what was reached together with the first jump.
            crossed, pending = False, pending and was_on and order > 0
        # A root of third order that was crossed without speed: the next step shows the side.
        flat = (
            own
            and order == BY_STEP
            and abs(run.last_transversality) <= speed_rounding(model, run, mode, t, work)
        )
        side[transition], zero[transition] = 0 if flat else now, order
        due[transition] = 1 if crossed or pending else 0
        if due[transition] == 1 and chosen == NO_TRANSITION and allowed(model, transition, t, x, work.scalar):
            chosen = transition
    if chosen != NO_TRANSITION:
        return chosen
    return RESTING if rests else NO_TRANSITION


@njit(**KERNEL)
def beyond_at_start(model, run, mode, t, work):
    """A transition that only the start of a run fires, if the state lies beyond its guard; else none."""
    for slot in range(model.first_at_start[mode], model.first_at_start[mode + 1]):
        transition = model.at_start[slot]
        value = guard_value(model, transition, t, run.y, work.scalar)
        beyond = value * model.direction[transition] > rounding_band(model, run, transition, t, run.y, work)
        if beyond and allowed(model, transition, t, run.y, work.scalar):
            return transition
    return NO_TRANSITION


@njit(**KERNEL)
def end_instant(model, mode, due):
    """Nothing fires any more: what is still due has been refused, and is passed as if there were no guard."""
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        due[model.outgoing[slot]] = 0
