"""On which side of each guard a state is, and which guards it has crossed at this instant."""

import math
from typing import Any, NamedTuple

from numba import njit

from hybrid.kernels.events.beside import (
    FEW_MOMENTS,
    LONGER,
    LONGEST,
    MOST_MOMENTS,
    leaves_by_signs,
    signs_beside,
    turns_within,
)
from hybrid.kernels.events.derivatives import (
    acceleration_sign,
    moment_of_rounding,
    speed_rounding,
    speed_sign,
)
from hybrid.kernels.events.guards import (
    allowed,
    exceeds_slope,
    guard_speed,
    guard_value,
    has_program,
    may_jump,
    rounding_band,
    was_left_behind,
)
from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING, is_zero
from hybrid.kernels.events.soon import acceleration_soon
from hybrid.kernels.types.codes import NO_MODE, NO_TRANSITION, RESTING
from hybrid.kernels.types.options import INLINE, KERNEL

# How the state came to this point: the run starts here, the flow led here, or a reset put the state here.
STARTED, FLOWED, LANDED = range(3)
# A reset that keeps less than this share of a guard's speed holds a state that the flow pushes through it.
KEPT = 1e-3


class Place(NamedTuple):
    """Where a run is: its mode, the time ``t`` and the state ``x (n,)``."""

    mode: Any
    t: Any
    x: Any


class Arrival(NamedTuple):
    """How the state came there, the mode that it has left, and the transition whose reset led here."""

    came: Any
    left: Any
    fired: Any


class Sides(NamedTuple):
    """What is known of the guards ``(transitions,)``.

    The ``side`` of each; whether it is ``due``, as it has been crossed at this instant and has not fired; and
    its order from ``side_of``, which is ``zero`` off the guard.
    """

    side: Any
    due: Any
    zero: Any


class Before(NamedTuple):
    """The side of one guard before, and its order."""

    side: Any
    order: Any


@njit(**INLINE)
def sides_of(run):
    """What a run knows of its guards."""
    return Sides(run.side, run.due, run.on_guard)


@njit(**KERNEL)
def inherit(model, left, transition, sides):
    """Take over what the mode just left knew of a transition's guard; returns whether it has the guard.

    A crossing is still due only if no transition on that guard in that direction has fired for it. On a guard
    at rest each direction has its own near side: the side for the same direction counts, if there is one.
    """
    side, due, zero = sides
    known, pending, now, order = False, -1, 0, 0
    for slot in range(model.first_outgoing[left], model.first_outgoing[left + 1]):
        other = model.outgoing[slot]
        if model.surface[other] != model.surface[transition]:
            continue
        known = True
        turned = model.orientation[other] * model.orientation[transition]
        order = max(order, zero[other])
        alike = turned * model.direction[other] == model.direction[transition]
        if side[other] != 0 and (alike or pending < 0):
            now = turned * side[other]
        if alike:
            pending = due[other] if pending < 0 else min(pending, due[other])
    side[transition], due[transition], zero[transition] = now, max(pending, 0), order
    return known


@njit(**KERNEL)
def side_of(model, run, place, transition, before, was_on, work):
    """Side of a guard, 0 if the next step has to show it, and the order of the derivative that decides.

    The order is 0 off the guard, 1 if the guard's speed decides, and 2 if rounding may hide or reverse the
    speed and the acceleration decides. It is 3 if the same holds for the acceleration: then the side is
    unchanged if the guard was zero before; otherwise the acceleration soon after decides, and if that does
    not either, the guard counts as not yet crossed. It is ``JUMPING`` if the guard jumps across zero within
    the rounding of the state: then its derivatives are no guide. A guard without a value keeps its side, and
    may jump; an infinite one has the side of its sign.
    ``work.field`` is current.
    """
    mode, t, x = place
    value = guard_value(model, transition, t, x, work.scalar)
    if math.isnan(value):
        return before, JUMPING if may_jump(model, run, transition, t, x, work) else 0
    if abs(value) == math.inf:
        return (1 if value > 0.0 else -1), 0
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    trend, order, direction = value, 0, model.direction[transition]
    keeps = before != 0 and (was_on or direction == 0)
    if abs(value) <= rounding_band(model, run, transition, t, x, work):
        if has_program(model, transition) and exceeds_slope(model, run, transition, t, x, value, work):
            if was_on and before != 0:
                return before, JUMPING
            return 1 if value > 0.0 else -1, JUMPING
        # In the middle of a jump, where a sign is zero, the speed a moment later is that beside the jump.
        jumps, order = speed == 0.0 and may_jump(model, run, transition, t, x, work), BY_SPEED
        trend = 0.0 if jumps else speed_sign(model, run, transition, mode, t, x, speed, work)
        if trend == 0.0:
            if jumps or may_jump(model, run, transition, t, x, work):
                # The state is on neither side.
                if was_on and before != 0:
                    return before, JUMPING
                order = BY_STEP
            else:
                trend, order = acceleration_sign(model, run, transition, mode, t, x, work), BY_ACCELERATION
                if trend == 0.0:
                    order = BY_STEP
                    if not keeps:
                        trend = float(acceleration_soon(model, run, transition, mode, t, x, work))
    if trend > 0.0:
        return 1, order
    if trend < 0.0:
        return -1, order
    return before if keeps else -direction, order


@njit(**KERNEL)
def order_passed(model, transition):
    """The order of a guard that has been crossed and is not small: one that is bounded has jumped."""
    by_bounds = has_program(model, transition) and model.guard_in_series[transition] == 0
    return JUMPING if by_bounds else BY_SPEED


@njit(**KERNEL)
def crossed_by_landing(model, transition, known, own, was_on, before, now, order):
    """Whether a reset has taken a guard from its near side to its far side.

    If the reset has put the state on the guard, the guard is on its near side until the state moves off. Only
    in that case can the reset of a guard's own transition fire the guard again.
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
def is_held(model, run, transition, mode, t, x, towards, work):
    """Whether a reset removes or reverses the speed that pushes a state at rest through a guard.

    The speed, which has the sign ``towards``, is evaluated two moments after ``t``: a push may begin at ``t``
    and have moved nothing after one. ``work.field`` is current.
    """
    n = model.dimension
    size, pace = 0.0, 0.0
    for i in range(n):
        if work.gradient[i] != 0.0:
            size = max(size, abs(x[i]), run.scale[i])
        pace = max(pace, abs(work.field[i]))
    moment = 1e-7 * (size if size > 0.0 else 1.0) / (pace if pace > 0.0 else 1.0)
    later, after, end = work.settled, work.state, t + 2.0 * moment
    for i in range(n):
        later[i] = x[i] + moment * work.field[i]
    model.field(mode, t + moment, later, model.parameters, work.field_after)
    for i in range(n):
        later[i] += moment * work.field_after[i]
    model.reset(transition, end, later, model.parameters, after)
    model.field(mode, end, later, model.parameters, work.field_after)
    speed = guard_speed(model, transition, end, later, work.field_after, work.gradient)
    model.field(mode, end, after, model.parameters, work.field_after)
    kept = guard_speed(model, transition, end, after, work.field_after, work.gradient)
    # Without products of speeds, which may be too small for a number.
    return speed * towards > 0.0 and not kept * towards > KEPT * abs(speed)


@njit(**KERNEL)
def is_held_beside(model, run, transition, mode, t, x, towards, work):
    """``is_held`` for a guard whose speed is zero at the guard itself: signs beside it tell instead.

    The state has come so close to rest that no moment beside it shows a change of sign.
    """
    n, later = model.dimension, work.settled
    moment = LONGEST * moment_of_rounding(model, run, t, work)
    for i in range(n):
        later[i] = x[i] + moment * work.field[i]
    model.field(mode, t + moment, later, model.parameters, work.field)
    for i in range(n):
        later[i] += moment * work.field[i]
    end = t + 2.0 * moment
    held = guard_value(model, transition, end, later, work.scalar) * towards > 0.0
    if held:
        model.reset(transition, end, later, model.parameters, work.field_after)
        for i in range(n):
            later[i] = work.field_after[i]
        model.field(mode, end, later, model.parameters, work.field)
        _, beside, _ = signs_beside(model, run, transition, end, later, MOST_MOMENTS, work)
        held = beside == -towards
    model.field(mode, t, x, model.parameters, work.field)
    return held


@njit(**KERNEL)
def side_here(model, run, place, transition, before, known, own, work):
    """``side_of`` a guard, where one that a coarser rounding let fire early is not taken for crossed."""
    _, t, x = place
    was_on = known and before.order > 0
    now, order = side_of(model, run, place, transition, before.side, was_on, work)
    if known and not own and order == 0 and before.side == -now:
        speed = guard_speed(model, transition, t, x, work.field, work.gradient)
        if was_left_behind(model, run, transition, t, x, speed, before.side, work):
            # It has fired within a coarser rounding of this place, and only now reaches its guard.
            now = before.side
    return now, order


@njit(**KERNEL)
def crosses_slowly(model, run, place, transition, work):
    """Whether the jump that led here has crossed its guard with no more speed than rounding makes."""
    mode, t, x = place
    return abs(run.last_transversality) <= speed_rounding(model, run, transition, mode, t, x, work)


@njit(**KERNEL)
def side_after_own_reset(model, run, place, transition, now, order, was_on, work):
    """The side of the guard that has just fired and whose reset led back to its mode, and its order.

    Also whether the next step must show the side, since the guard has a root of third order that was crossed
    without speed, and whether the reset holds the state on the guard.
    """
    mode, t, x = place
    direction = model.direction[transition]
    flat = was_on and order == BY_STEP and crosses_slowly(model, run, place, transition, work)
    jumps = order == JUMPING or (order == BY_STEP and may_jump(model, run, transition, t, x, work))
    if not flat and order == BY_STEP and direction != 0:
        # Its own reset has stopped the state on the guard, as a plastic impact does.
        now = -direction
    signs = order != BY_ACCELERATION and leaves_by_signs(model, transition)
    if signs and order == BY_SPEED:
        signs = crosses_slowly(model, run, place, transition, work)
    held = False
    if jumps or signs:
        # The flow may go on across the guard that has just fired, or back from it.
        moments = MOST_MOMENTS if order > 0 else FEW_MOMENTS
        _, beside, moment = signs_beside(model, run, transition, t, x, moments, work)
        if beside != 0:
            # Off the guard, where it has left the state, it has not been reached again.
            if order > 0 or beside != now:
                now, order, flat = beside, JUMPING, False
            held = signs and turns_within(model, transition, mode, t, x, LONGER * moment, beside, work)
        elif signs and order > 0 and direction != 0:
            held = is_held_beside(model, run, transition, mode, t, x, direction, work)
    return now, order, flat, held


@njit(**KERNEL)
def crossed_by_flow(model, run, place, transition, before, now, order, work):
    """Whether the flow has taken a guard across zero here; with its side and its order."""
    _, t, x = place
    direction = model.direction[transition]
    if order == JUMPING or (order == BY_STEP and may_jump(model, run, transition, t, x, work)):
        order = JUMPING
        first, beside, _ = signs_beside(model, run, transition, t, x, MOST_MOMENTS, work)
        now = beside if beside != 0 else now
        # The guard may have jumped and fired already, within the rounding of this place.
        before = (first if first != 0 else now) if before == 0 else before
    on = order in (0, BY_SPEED, JUMPING)
    crossed = on and before == -now and (direction == 0 or now == direction)
    if crossed and order == 0:
        # The step to another guard has passed this one by more than rounding.
        order = order_passed(model, transition)
    return crossed, now, order


@njit(**KERNEL)
def take_side(model, run, place, transition, arrival, known_sides, work):
    """Take the side of one guard; returns whether the state rests on it, pushed against it."""
    mode, t, x = place
    came, left, fired = arrival
    direction = model.direction[transition]
    known = came != STARTED
    if came == LANDED and left != mode:
        known = inherit(model, left, transition, known_sides)
    side = known_sides.side[transition] if known else 0
    before = Before(side, known_sides.zero[transition])
    was_on = known and before.order > 0
    own = came == LANDED and left == mode and transition == fired
    now, order = side_here(model, run, place, transition, before, known, own, work)
    flat, rests = False, False
    if own:
        now, order, flat, held = side_after_own_reset(model, run, place, transition, now, order, was_on, work)
        rests = held and allowed(model, transition, t, x, work.scalar)
    due = known_sides.due[transition] == 1
    if came == STARTED:
        crossed = is_zero(order) and direction != 0 and now == direction
    elif came == FLOWED:
        crossed, now, order = crossed_by_flow(model, run, place, transition, before.side, now, order, work)
    else:
        crossed = crossed_by_landing(model, transition, known, own, was_on, before.side, now, order)
        # A guard that fires both ways and was due already: this crossing takes the first one back.
        crossed = crossed and not (direction == 0 and due)
    beyond = now == (direction if direction != 0 else before.side)
    pushed = (
        came == LANDED and left == mode and was_on and not crossed and beyond and order == BY_ACCELERATION
    )
    if pushed and not due and model.marker[transition] == 0:
        pushed = is_held(model, run, transition, mode, t, x, now, work)
        # Another transition's reset left the state at rest: the guard's own reset must hold it again.
        crossed = pushed and not own
        rests = rests or (pushed and own and allowed(model, transition, t, x, work.scalar))
        if pushed and own and direction != 0:
            # Held on the guard, the state has not crossed it: another reset may yet push it through.
            now = -direction
    elif flat and direction != 0 and is_held(model, run, transition, mode, t, x, direction, work):
        # A push that only begins: it has no acceleration yet.
        rests = rests or allowed(model, transition, t, x, work.scalar)
    pending = came == LANDED and due and beyond
    if model.marker[transition] == 1 and came != FLOWED:
        # A marker fires where the flow crosses it. After a jump it fires only if the flow has reached it
        # together with the first jump, and has not been stopped there.
        stopped = order == BY_STEP and before.order != BY_STEP
        crossed, pending = False, pending and was_on and order > 0 and not stopped
        # A run that starts on the guard has crossed nothing, whichever side the next step shows.
        flat = flat or (came == STARTED and order == BY_STEP)
    known_sides.side[transition], known_sides.zero[transition] = 0 if flat else now, order
    known_sides.due[transition] = 1 if crossed or pending else 0
    return rests


@njit(**KERNEL)
def take_sides(model, run, mode, t, x, arrival, known_sides, work):
    """Take sides at every guard of a mode; return the transition that must fire now, if any.

    ``known_sides`` belong to the previous point on entry, and to this point on return. A guard that has been
    crossed stays due while the state is beyond it. Of the due transitions whose condition holds, the first in
    the list fires. If none fires and the state rests on the guard that has just fired, pushed against it, the
    result is ``RESTING``.
    """
    model.field(mode, t, x, model.parameters, work.field)
    chosen, rests, place = NO_TRANSITION, False, Place(mode, t, x)
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        if take_side(model, run, place, transition, arrival, known_sides, work):
            rests = True
        due = known_sides.due[transition] == 1
        if due and chosen == NO_TRANSITION and allowed(model, transition, t, x, work.scalar):
            chosen = transition
    if chosen != NO_TRANSITION:
        return chosen
    return RESTING if rests else NO_TRANSITION


@njit(**KERNEL)
def beyond_at_start(model, run, mode, t, x, work):
    """A transition that fires only at the start of a run, if ``x (n,)`` lies beyond its guard; else none."""
    for slot in range(model.first_at_start[mode], model.first_at_start[mode + 1]):
        transition = model.at_start[slot]
        value = guard_value(model, transition, t, x, work.scalar)
        model.guard_gradient(transition, t, x, model.parameters, work.gradient)
        beyond = value * model.direction[transition] > rounding_band(model, run, transition, t, x, work)
        if beyond and allowed(model, transition, t, x, work.scalar):
            return transition
    return NO_TRANSITION


@njit(**KERNEL)
def mode_of_limit(model, run, transition, t, x, work):
    """The mode in which a run goes on from the limit ``x (n,)`` of a chatter, and a transition still to fire.

    The mode that the ``transition`` names may have several parts. A run goes on in the part in which it would
    start: transitions at the start that keep the state lead there. One that ends the run, or has a reset, is
    left to be fired.
    """
    mode = model.accumulates_to[transition]
    if mode == NO_MODE:
        return run.mode, NO_TRANSITION
    onward = beyond_at_start(model, run, mode, t, x, work)
    for _ in range(model.first_at_start.shape[0]):
        if onward == NO_TRANSITION or model.target[onward] == NO_MODE:
            break
        model.reset(onward, t, x, model.parameters, work.state)
        keeps = True
        for i in range(model.dimension):
            keeps = keeps and work.state[i] == x[i]
        if not keeps:
            break
        mode = model.target[onward]
        onward = beyond_at_start(model, run, mode, t, x, work)
    return mode, onward


@njit(**KERNEL)
def end_instant(model, mode, due):
    """End an instant: guards still due were refused, and are passed as if they did not exist."""
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        due[model.outgoing[slot]] = 0
