"""On which side of each guard a state is, and which guards it has crossed at this instant."""

import math
from typing import Any, NamedTuple

from numba import njit

from hybrid.kernels.events.guards import (
    allowed,
    error_band,
    guard_speed,
    guard_value,
    may_jump,
    rounding_band,
    was_left_behind,
)
from hybrid.kernels.events.moments import (
    Place,
    moment_of_rounding,
    move_for,
    sign_along,
    sign_at_speed,
    sign_of_speed,
)
from hybrid.kernels.events.onset import AT_REST, BY_SPEED, LATER
from hybrid.kernels.types.codes import NO_MODE, NO_TRANSITION, RESTING
from hybrid.kernels.types.options import INLINE, KERNEL

# How the state came to this point: the run starts here, the flow led here, or a reset put the state here.
STARTED, FLOWED, LANDED = range(3)
# A reset that keeps less than this share of a guard's speed holds a state that the flow pushes through it.
KEPT_BY_RESET = 1e-3
# A landing may lie so many moments of rounding beyond its guard (``landing``).
LANDED_BY = 4096.0


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
    """The side of one guard before, and its order; it is ``new`` in a mode that another one led to."""

    side: Any
    order: Any
    new: Any


@njit(**INLINE)
def sides_of(run):
    """What a run knows of its guards."""
    return Sides(run.side, run.due, run.on_guard)


@njit(**KERNEL)
def excludes_start(model, mode, fired):
    """Whether a transition has fired because the mode excludes the start: the run was never in the mode."""
    for slot in range(model.first_at_start[mode], model.first_at_start[mode + 1]):
        if model.at_start[slot] == fired:
            return model.enters[fired] == 1
    return False


@njit(**KERNEL)
def inherit(model, left, fired, transition, sides):
    """Take over what the mode just left knew of a transition's guard; returns whether it has the guard.

    A mode that excludes the start of the run knows nothing. A crossing is still due only if no transition on
    that guard in that direction has fired for it. On a guard at rest each direction has its own near side:
    the side for the same direction counts, if there is one.
    """
    side, due, zero = sides
    known, pending, now, order = False, -1, 0, 0
    first, last = model.first_outgoing[left], model.first_outgoing[left + 1]
    for slot in range(first, first if excludes_start(model, left, fired) else last):
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
def error_of(model, method, run, transition, value, band, work):
    """How many times its rounding, the ``band``, errors may have left a guard beyond zero; else 1.

    A mode that holds a guard at zero, as a taut rope its length, does so up to the tolerances. The mode that
    is entered then is not beyond that guard, but on it. ``work.gradient`` is current.
    """
    error = error_band(method, run, work.gradient, model.controlled)
    return error / band if 0.0 < band < value * model.direction[transition] <= error else 1.0


@njit(**KERNEL)
def side_of(model, method, run, place, transition, came, before, work):
    """Side of a guard, and how it has left zero (``onset``): 0 off the guard. ``work.field`` is current.

    A guard within its rounding is on the side to which the flow takes it; one that is new here may also
    have been moved there by the error of the method. If it is at rest there, it has not crossed: it keeps the
    side ``before`` if it was on the guard then, or fires both ways; otherwise it is on the near side. A guard
    without a value keeps its side. A guard that jumps is never at rest: if the flow does not tell its side,
    and at the start of a run, its sign does.
    """
    _, t, x = place
    value = guard_value(model, transition, t, x, work.scalar)
    if math.isnan(value):
        return before.side, LATER if may_jump(model, run, transition, t, x, work) else 0
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    band = rounding_band(model, run, transition, t, x, work)
    sign = 1 if value > 0.0 else -1
    error = error_of(model, method, run, transition, value, band, work) if before.new else 1.0
    if abs(value) == math.inf or abs(value) > error * band:
        return sign, 0
    jumps = value != 0.0 and may_jump(model, run, transition, t, x, work)
    if came == STARTED and jumps:
        return sign, 0
    side, _, straight = sign_at_speed(model, run, transition, place, 1.0, speed, band, error, work)
    if error > 1.0 and side == sign:
        return sign, 0
    if side != 0:
        return side, BY_SPEED if straight else LATER
    if jumps:
        return sign, 0
    direction = model.direction[transition]
    keeps = before.side != 0 and (before.order > 0 or direction == 0)
    return before.side if keeps else -direction, AT_REST


@njit(**KERNEL)
def crossed_by_landing(model, transition, known, own, before, now, order):
    """Whether a reset has taken a guard from its near side to its far side.

    If the reset has put the state on the guard, the guard is on its near side until the state moves off. Only
    in that case can the reset of a guard's own transition fire the guard again.
    """
    direction = model.direction[transition]
    if direction == 0:
        return not own and before.side != 0 and now == -before.side
    if now != direction:
        return False
    if order > 0 and before.order == 0:
        return True
    if own:
        return False
    if known:
        return before.side == -direction
    return model.paired[transition] == 0


@njit(**KERNEL)
def is_held(model, run, place, transition, towards, work):
    """Whether a reset removes or reverses the speed that pushes a state at rest through a guard.

    The speed, which has the sign ``towards``, is that at the moment when the guard is certainly beyond zero.
    ``work.field`` is current.
    """
    mode, t, x = place
    sign, moment, _ = sign_along(model, run, transition, place, 1.0, work)
    if sign != towards:
        return False
    later, end = work.settled, t + 2.0 * moment
    move_for(model, mode, t, x, 2.0 * moment, later, work)
    model.field(mode, end, later, model.parameters, work.field)
    speed = guard_speed(model, transition, end, later, work.field, work.gradient) * towards
    model.reset(transition, end, later, model.parameters, work.state)
    model.field(mode, end, work.state, model.parameters, work.field_after)
    kept = work.gradient[model.dimension]
    for i in range(model.dimension):
        kept += work.gradient[i] * work.field_after[i]
    model.field(mode, t, x, model.parameters, work.field)
    # Without products of speeds, which may be too small for a number.
    return speed > 0.0 and not kept * towards > KEPT_BY_RESET * speed


@njit(**KERNEL)
def side_here(model, method, run, place, transition, came, before, own, work):
    """``side_of`` a guard, where one that a coarser rounding let fire early is not taken for crossed."""
    _, t, x = place
    now, order = side_of(model, method, run, place, transition, came, before, work)
    if not own and order == 0 and before.side == -now:
        speed = guard_speed(model, transition, t, x, work.field, work.gradient)
        if was_left_behind(model, run, transition, t, x, speed, before.side, work):
            # It has fired within a coarser rounding of this place, and only now reaches its guard.
            now = before.side
    return now, order


@njit(**KERNEL)
def is_back_soon(model, run, place, transition, now, work):
    """Whether the flow takes a guard from the side ``now`` to the other within the rounding of a landing."""
    mode, t, x = place
    moment = LANDED_BY * moment_of_rounding(model, run, t, work)
    move_for(model, mode, t, x, moment, work.settled, work)
    return guard_value(model, transition, t + moment, work.settled, work.scalar) * now < 0.0


@njit(**KERNEL)
def take_side(model, method, run, place, transition, arrival, known_sides, work):
    """Take the side of one guard; returns whether the state rests on it, pushed against it."""
    mode, t, x = place
    came, left, fired = arrival
    direction = model.direction[transition]
    known, changed = came != STARTED, came == LANDED and left != mode
    if changed:
        known = inherit(model, left, fired, transition, known_sides)
    before = Before(0, 0, changed)
    if known:
        before = Before(known_sides.side[transition], known_sides.zero[transition], False)
    own = came == LANDED and left == mode and transition == fired
    now, order = side_here(model, method, run, place, transition, came, before, own, work)
    if own and order == 0 and is_back_soon(model, run, place, transition, now, work):
        # Off the guard, where it has left the state, the reset's own guard has not been reached again.
        now, order = -now, LATER
    if own and order > 0 and (order != BY_SPEED or now != -direction):
        given = sign_of_speed(model, run, transition, place, work)
        if given != 0:
            # Its own reset has begun a flight, even if that is lower or shorter than rounding.
            now, order = given, BY_SPEED
        elif order == BY_SPEED:
            # The speed is rounding, which may have made it a push.
            order = LATER
    if own and order == AT_REST and direction != 0:
        # Its own reset has stopped the state on the guard, as a plastic impact does.
        now = -direction
    due, rests = known_sides.due[transition] == 1, False
    if came == STARTED:
        crossed = order > 0 and direction != 0 and now == direction
    elif came == FLOWED:
        crossed = order != AT_REST and before.side == -now and direction in (0, now)
        # The step to another guard may have passed this one by more than rounding.
        order = BY_SPEED if crossed and order == 0 else order
    else:
        crossed = crossed_by_landing(model, transition, known, own, before, now, order)
        # A guard that fires both ways and was due already: this crossing takes the first one back.
        crossed = crossed and not (direction == 0 and due)
    beyond = now == (direction if direction != 0 else before.side)
    pushed = came == LANDED and left == mode and before.order > 0 and order == LATER
    pushed = pushed and beyond and not crossed
    if pushed and not due and model.marker[transition] == 0:
        pushed = is_held(model, run, place, transition, now, work)
        # Another transition's reset left the state at rest: the guard's own reset must hold it again.
        crossed = pushed and not own
        rests = pushed and own and allowed(model, transition, t, x, work.scalar)
        if pushed and own and direction != 0:
            # Held on the guard, the state has not crossed it: another reset may yet push it through.
            now = -direction
    pending = came == LANDED and due and beyond
    if model.marker[transition] == 1 and came != FLOWED:
        # A marker fires where the flow crosses it. After a jump it fires only if the flow has reached it
        # together with the first jump, and has not been stopped there.
        stopped = order == AT_REST and before.order != AT_REST
        crossed, pending = False, pending and before.order > 0 and order > 0 and not stopped
    # A marker that a run starts on has crossed nothing, whichever side the next step shows.
    unknown = model.marker[transition] == 1 and came == STARTED and order == AT_REST
    known_sides.side[transition], known_sides.zero[transition] = 0 if unknown else now, order
    known_sides.due[transition] = 1 if crossed or pending else 0
    return rests


@njit(**KERNEL)
def take_sides(model, method, run, mode, t, x, arrival, known_sides, work):
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
        if take_side(model, method, run, place, transition, arrival, known_sides, work):
            rests = True
        due = known_sides.due[transition] == 1
        if due and chosen == NO_TRANSITION and allowed(model, transition, t, x, work.scalar):
            chosen = transition
    if chosen != NO_TRANSITION:
        return chosen
    return RESTING if rests else NO_TRANSITION


@njit(**KERNEL)
def listed_behind(model, mode, fired):
    """The slot behind a transition among those that fire only at a start here; behind all for others."""
    last = model.first_at_start[mode + 1]
    for slot in range(model.first_at_start[mode], last):
        if model.at_start[slot] == fired:
            return slot + 1
    return last


@njit(**KERNEL)
def beyond_at_start(model, run, mode, t, x, first, work):
    """The first transition from a slot on that fires only at a start beyond its guard, if ``x (n,)`` is."""
    for slot in range(first, model.first_at_start[mode + 1]):
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
    onward = beyond_at_start(model, run, mode, t, x, model.first_at_start[mode], work)
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
        onward = beyond_at_start(model, run, mode, t, x, model.first_at_start[mode], work)
    return mode, onward


@njit(**KERNEL)
def end_instant(model, mode, due):
    """End an instant: guards still due were refused, and are passed as if they did not exist."""
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        due[model.outgoing[slot]] = 0
