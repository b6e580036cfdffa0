"""The first change of sign of a guard on a path, proved by bounds on the guard itself.

The path is halved until on each piece the guard has no zero, or its slope keeps its sign, or the piece is as
short as rounding allows. If the slope keeps its sign, the guard changes sign at most once, and the signs at
the ends of the piece decide whether it does. This holds for roots of any order, for kinks and for jumps: if a
guard jumps across zero, the change of sign is at the jump.
"""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.arithmetic.bernstein import NO_ROOT, crosses_towards
from hybrid.kernels.events.guards import (
    error_band,
    gradient_band,
    has_program,
    size_of_time,
    was_left_behind,
)
from hybrid.kernels.events.moments import Place, sign_along
from hybrid.kernels.events.onset import (
    AT_REST,
    BY_SPEED,
    LATER,
    has_just_fired,
    known_part,
)
from hybrid.kernels.events.path import pace_at_start, rounding_of_start, state_at, time_at
from hybrid.kernels.guards.hidden import hidden_until
from hybrid.kernels.guards.pieces import (
    NO_COLUMN,
    NOWHERE,
    Guard,
    bounds_at,
    certain_sign,
    distance_at,
    halves_tell_more,
    in_column,
    is_short,
    known_at,
    may_have_crossed,
    middle_of,
    piece_of,
    place_of_change,
    turn_on,
)
from hybrid.kernels.guards.sampled import AT_START, sampled_change
from hybrid.kernels.guards.touch import note_touch
from hybrid.kernels.types.kinds import INTEGER, REAL, Pair
from hybrid.kernels.types.layout import Method, Model, Path, Run, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# After this many pieces the step is cut to its proved part, if that is more than a small share of the step.
# Otherwise the signs at the ends of the pieces decide, and the run counts them as unproved.
MOST_PIECES = 3000
SMALL_SHARE = 1e-2
# A piece lies within rounding if, all over it, the guard is no farther from zero than this many times the
# rounding in its middle.
WITHIN_ROUNDING = 4.0


class Touch(NamedTuple):
    """Where and how close a guard has come to zero: a touch, once the guard is farther from zero again."""

    place: REAL
    depth: REAL


NO_TOUCH = Touch(NOWHERE, math.inf)


@njit(**KERNEL)
def guard_at_start(run, transition, column, path):
    """A guard as the run knows it at the start of a step.

    The root of a guard that is zero without speed begins to grow like its variable, too.
    """
    side, on_guard = run.side[transition], run.on_guard[transition]
    if path.root > 1 and column != NO_COLUMN and on_guard == LATER:
        on_guard = BY_SPEED
    return Guard(transition, column, side, on_guard, 0.0, 0.0, 0.0)


@njit(**KERNEL)
def _tolerated(model, method, run, path, guard, piece, work):
    """How far from zero the tolerances of the state can leave a guard that may turn on a piece of a step."""
    may_touch = piece.turns and (piece.clear or is_short(piece, path))
    if not may_touch or (path.exact and guard.column == NO_COLUMN):
        return 0.0
    state_at(path, model.dimension, piece.middle, work.state)
    t = time_at(path, piece.middle)
    model.guard_gradient(guard.transition, t, work.state, model.parameters, work.gradient)
    if path.exact:
        # The program of a guard shows what rounding of the state does to it, a column does not.
        band = gradient_band(model, run, t, work.gradient)
    else:
        band = error_band(method, run, work.gradient, model.controlled)
    return in_column(path, guard.column, band)


@njit(**KERNEL)
def _returns(model, run, path, guard, work):
    """Whether the rounding of a jump has left the guard beyond zero at the start of the step."""
    if guard.on_guard > 0:
        return False
    side, at = guard.side, bounds_at(model, path, guard, 0.0, work)
    slope = at.least_slope if side > 0 else at.most_slope
    return was_left_behind(model, run, guard.transition, path.start, run.y, slope, side, work)


@njit(**KERNEL)
def _known_at_start(model, path, guard, hidden, work):
    """A guard with what is known of it at the start, and whether it leaves to its side for certain.

    Up to the place ``hidden`` its signs are noise.
    """
    on_guard, sure, base, tilt = guard.on_guard, 0.0, 0.0, 0.0
    leaves = on_guard == LATER and hidden > 0.0
    if leaves:
        sure = hidden
    elif on_guard in (BY_SPEED, AT_REST):
        at = bounds_at(model, path, guard, 0.0, work)
        least, most = at.least_slope, at.most_slope
        base, tilt = known_part(middle_of(at), 0.5 * (least + most), on_guard)
        leaves = on_guard == BY_SPEED
    return Guard(guard.transition, guard.column, guard.side, on_guard, sure, base, tilt), leaves


@njit(**KERNEL)
def _first_place(model, run, path, on_guard, hidden):
    """The place of a path from which on the signs of a guard tell anything."""
    if on_guard == 0:
        return 0.0
    place = max(hidden, AT_START * path.length)
    if on_guard == LATER and not hidden > 0.0:
        # By rounding the state may still be before the jump.
        beyond = rounding_of_start(path, model.dimension, run.scale, size_of_time(model, path.start))
        place = max(place, min(beyond, 0.5 * path.length))
    return place


@njit(**INLINE)
def _stays_clear(piece, tolerated):
    """Whether a guard keeps to its side on a piece, and does not turn as close to zero as ``tolerated``."""
    near = max(WITHIN_ROUNDING * piece.spread, tolerated)
    return piece.clear and not (piece.turns and piece.nearest <= near)


@njit(**INLINE)
def _is_shallow(piece, path, tolerated):
    """Whether a guard may turn on a piece, all over which rounding or what is ``tolerated`` may hide it."""
    rounding = WITHIN_ROUNDING * piece.spread
    level = is_short(piece, path) or piece.width <= rounding
    near = max(rounding, tolerated if level else 0.0)
    return piece.turns and not piece.monotone and piece.farthest <= near


@njit(**INLINE)
def _may_touch(guard):
    """Whether a guard has left zero, if it was zero at the start of the path."""
    return guard.on_guard == 0 or guard.sure > 0.0


@njit(**INLINE)
def _halve(stack, top, piece):
    """Put the halves of a piece on the stack, from ``top`` on; returns where the first half is."""
    stack[top, 0], stack[top, 1] = piece.middle, piece.high
    stack[top + 1, 0], stack[top + 1, 1] = piece.low, piece.middle
    return top + 1


@njit(**KERNEL)
def _noted(run, path, guard, touch):
    """Note a touch, if there is one; returns that there is none any more."""
    if touch.place != NOWHERE:
        note_touch(run, guard.transition, touch.place / path.length, touch.depth * guard.side)
    return NO_TOUCH


@njit(**KERNEL)
def first_change(model, method, run, path, guard, hidden, work):
    """First change of sign of a guard in its transition's direction, on a path.

    Up to the place ``hidden`` its signs are noise. Returns ``(place, side after, proved)``. The place is
    ``NOWHERE`` if the guard does not change its sign before ``proved``; the step is to be cut to ``proved``.
    """
    length, stack, pieces, top, touch = path.length, work.intervals, 0, 0, NO_TOUCH
    transition, proved = guard.transition, True
    guard, leaves = _known_at_start(model, path, guard, hidden, work)
    # If the transition has just fired and its speed is uncertain, the step only shows to which side its guard
    # leaves zero.
    fired = has_just_fired(run, transition, guard.on_guard) and not leaves
    stack[0, 0], stack[0, 1] = _first_place(model, run, path, guard.on_guard, hidden), length
    while top >= 0:
        piece, side = piece_of(model, path, guard, top, work), guard.side
        high, pieces = piece.high, pieces + 1
        tolerated = _tolerated(model, method, run, path, guard, piece, work)
        if _stays_clear(piece, tolerated):
            touch, top = _noted(run, path, guard, touch), top - 1
            guard = known_at(model, path, guard, high, side, work)
            continue
        shallow = _is_shallow(piece, path, tolerated)
        if not (piece.monotone or shallow) and halves_tell_more(model, path, guard, piece, work):
            if pieces <= MOST_PIECES:
                top = _halve(stack, top, piece)
                continue
            if piece.low > SMALL_SHARE * length:
                _noted(run, path, guard, touch)
                return NOWHERE, side, piece.low
            if proved and not piece.clear:
                run.unproved[transition], proved = run.unproved[transition] + 1, False
        turn, value, rounding, beyond = turn_on(model, path, guard, piece, work)
        if shallow and beyond and piece.low < turn < high:
            # The guard crosses zero and turns back: each side of the turn has one change of sign.
            stack[top, 0], high, top = turn, turn, top + 1
        elif value <= max(tolerated, rounding) and value < touch.depth and _may_touch(guard):
            touch = Touch(turn, value)
        top -= 1
        after = side if piece.clear else certain_sign(model, path, guard, high, work)
        if after == 0:
            if pieces <= MOST_PIECES and may_have_crossed(model, path, guard, piece, work):
                top = _halve(stack, top + 1, piece)
            continue
        if after != side and side != 0:
            place = place_of_change(model, path, guard, piece.low, high, work)
            early = place <= AT_START * length
            if not (early and (fired or _returns(model, run, path, guard, work))):
                if crosses_towards(model.direction[transition], after):
                    return place, after, length
                run.passed[transition] = place / length
            touch = NO_TOUCH
        elif touch.place != NOWHERE and touch.depth < distance_at(model, path, guard, high, work):
            touch = _noted(run, path, guard, touch)
        guard = known_at(model, path, guard, high, after, work)
    _noted(run, path, guard, touch)
    return NOWHERE, guard.side, length


@njit(**KERNEL)
def _hidden_at_start(model, method, run, path, guard, end, work):
    """The place of a step up to which the signs of a guard are noise, and whether it rests at zero."""
    if guard.on_guard < LATER:
        return 0.0, False
    hidden, rests = hidden_until(model, method, run, path, guard, end, work)
    if guard.on_guard == AT_REST:
        return hidden, rests
    t, rate = path.start, pace_at_start(path)
    model.field(run.mode, t, run.y, model.parameters, work.field)
    side, moment, _ = sign_along(model, run, guard.transition, Place(run.mode, t, run.y), 1.0, work)
    if side == guard.side and rate > 0.0:
        # Up to there the state may be on either side by rounding.
        hidden = max(hidden, moment / rate)
    return hidden, hidden >= path.length


@exported(Pair(REAL), Model, Method, Run, INTEGER, INTEGER, Path, REAL, Work)
def crossing_on_path(model, method, run, transition, column, path, end, work):
    """``first_change`` from the side that the run knows; ``sampled_change`` if the guard was not traced.

    ``column`` is that of the guard on the path, or ``NO_COLUMN``. ``end`` is the value of a guard at the end
    of the step, which the path may hold with other rounding. A guard that leaves by its speed needs none.
    Returns the share of the step at which the guard crosses, and the share that is proved; the side after the
    crossing, or at the end, goes to ``run.event_side[transition]``. The guard is no longer held to be zero
    at the start of the step, unless it rests there.
    """
    guard, length = guard_at_start(run, transition, column, path), path.length
    hidden, rests = _hidden_at_start(model, method, run, path, guard, end, work)
    run.event_side[transition] = guard.side
    if rests:
        # Or it leaves zero on a later step.
        return NO_ROOT, 1.0
    run.on_guard[transition] = 0
    if hidden == length:
        after = 1 if end > 0.0 else (-1 if end < 0.0 else guard.side)
        crosses = crosses_towards(model.direction[transition], after) and guard.side * after < 0
        again = has_just_fired(run, transition, guard.on_guard)
        run.event_side[transition] = after
        return (0.0 if crosses and not again else NO_ROOT), 1.0
    if column != NO_COLUMN or has_program(model, transition):
        place, side, proved = first_change(model, method, run, path, guard, hidden, work)
    else:
        place, side, proved = sampled_change(model, run, path, guard, hidden, work)
    run.event_side[transition] = side
    return (NO_ROOT if place == NOWHERE else place / length), proved / length
