"""The first change of sign of a guard on a step, proved by bounds on the guard itself.

The step is halved until on each piece the guard has no zero, or its slope keeps its sign, or the piece is as
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
    has_program,
    size_of_time,
    was_left_behind,
)
from hybrid.kernels.events.hidden import hidden_until
from hybrid.kernels.events.moments import Place, sign_along
from hybrid.kernels.events.onset import (
    AT_REST,
    LATER,
    has_just_fired,
    known_part,
    side_is_certain,
)
from hybrid.kernels.events.path import pace_at_start, rounding_of_start, state_at, time_at
from hybrid.kernels.events.pieces import (
    NOTHING,
    Known,
    certain_sign,
    distance_at,
    halves_tell_more,
    is_short,
    known_at,
    may_have_crossed,
    middle_of,
    piece_of,
    place_of_change,
    row_at,
    turn_on,
)
from hybrid.kernels.events.sampled import NOWHERE, SETTLED, sampled_change
from hybrid.kernels.events.touches import note_touch
from hybrid.kernels.types.codes import (
    LEAST_SLOPE,
    MOST_SLOPE,
)
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.options import INLINE, KERNEL

# After this many pieces the step is cut to its proved part, if that is more than a small share of the step.
# Otherwise the signs at the ends of the pieces decide, and the run counts them as unproved.
MOST_PIECES = 3000
SMALL_SHARE = 1e-2
# A piece lies within rounding if, all over it, the guard is no farther from zero than this many times the
# rounding in its middle.
WITHIN_ROUNDING = 4.0


class Begin(NamedTuple):
    """How a guard begins on a step.

    ``side`` is its sign before; for a guard that is zero at the start, it is the sign that the guard takes
    from there. ``on_guard`` is its order (``onset``). Up to the place ``hidden`` its signs are noise.
    """

    side: INTEGER
    on_guard: INTEGER
    hidden: REAL


class Touch(NamedTuple):
    """Where and how close a guard has come to zero: a touch, once the guard is farther from zero again."""

    place: REAL
    depth: REAL


NO_TOUCH = Touch(NOWHERE, math.inf)


@njit(**KERNEL)
def _tolerated(model, method, run, transition, path, piece, work):
    """How far from zero the tolerances of the state can leave a guard that may turn on a piece of a step."""
    may_touch = piece.turns and (piece.clear or is_short(piece, path))
    if path.exact or not may_touch:
        return 0.0
    state_at(path, model.dimension, piece.middle, work.state)
    t = time_at(path, piece.middle)
    model.guard_gradient(transition, t, work.state, model.parameters, work.gradient)
    return error_band(method, run, work.gradient, model.dimension)


@njit(**KERNEL)
def _returns(model, run, transition, path, known, work):
    """Whether the rounding of a jump has left the guard beyond zero at the start of the step."""
    if known.on_guard > 0:
        return False
    side = known.side
    row = work.registers[row_at(model, transition, path, 0.0, NOTHING, work)]
    slope = row[LEAST_SLOPE] if side > 0 else row[MOST_SLOPE]
    return was_left_behind(model, run, transition, path.start, run.y, slope, side, work)


@njit(**KERNEL)
def _known_at_start(model, transition, path, begin, work):
    """What is known of a guard at the start of a step, and whether it leaves to its side for certain."""
    on_guard, sure, base, tilt = begin.on_guard, 0.0, 0.0, 0.0
    leaves = on_guard == LATER and begin.hidden > 0.0
    if leaves:
        sure = begin.hidden
    elif on_guard > 0:
        row = work.registers[row_at(model, transition, path, 0.0, NOTHING, work)]
        least, most = row[LEAST_SLOPE], row[MOST_SLOPE]
        base, tilt = known_part(middle_of(row), 0.5 * (least + most), on_guard)
        leaves = side_is_certain(on_guard, least, most)
    return Known(begin.side, on_guard, sure, base, tilt), leaves


@njit(**KERNEL)
def _first_place(model, run, path, begin):
    """The place of a step from which on the signs of a guard tell anything."""
    if begin.on_guard == 0:
        return 0.0
    place = max(begin.hidden, SETTLED * path.length)
    if begin.on_guard == LATER and not begin.hidden > 0.0:
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
def _may_touch(known):
    """Whether a guard has left zero, if it was zero at the start of the step."""
    return known.on_guard == 0 or known.sure > 0.0


@njit(**INLINE)
def _halve(stack, top, piece):
    """Put the halves of a piece on the stack, from ``top`` on; returns where the first half is."""
    stack[top, 0], stack[top, 1] = piece.middle, piece.high
    stack[top + 1, 0], stack[top + 1, 1] = piece.low, piece.middle
    return top + 1


@njit(**KERNEL)
def _noted(run, transition, path, touch, side):
    """Note a touch, if there is one; returns that there is none any more."""
    if touch.place != NOWHERE:
        note_touch(run, transition, touch.place / path.length, touch.depth * side)
    return NO_TOUCH


@njit(**KERNEL)
def first_change(model, method, run, transition, path, begin, work):
    """First change of sign of a guard in its transition's direction, on a step.

    Returns ``(place, side after, proved)``. The place is ``NOWHERE`` if the guard does not change its sign
    before ``proved``; the step is to be cut to ``proved``.
    """
    length, stack, pieces, top, touch = path.length, work.intervals, 0, 0, NO_TOUCH
    known, leaves = _known_at_start(model, transition, path, begin, work)
    # If the transition has just fired and its speed is uncertain, the step only shows to which side its guard
    # leaves zero.
    fired = has_just_fired(run, transition, begin.on_guard) and not leaves
    stack[0, 0], stack[0, 1] = _first_place(model, run, path, begin), length
    while top >= 0:
        piece, side = piece_of(model, transition, path, top, known, work), known.side
        high, pieces = piece.high, pieces + 1
        tolerated = _tolerated(model, method, run, transition, path, piece, work)
        if _stays_clear(piece, tolerated):
            touch, top = _noted(run, transition, path, touch, side), top - 1
            known = known_at(model, transition, path, high, side, known, work)
            continue
        shallow = _is_shallow(piece, path, tolerated)
        if not (piece.monotone or shallow) and halves_tell_more(model, transition, path, piece, work):
            if pieces <= MOST_PIECES:
                top = _halve(stack, top, piece)
                continue
            if piece.low > SMALL_SHARE * length:
                _noted(run, transition, path, touch, side)
                return NOWHERE, side, piece.low
            run.unproved += 0 if piece.clear else 1
        turn, value, rounding, beyond = turn_on(model, transition, path, piece, known, work)
        if shallow and beyond and piece.low < turn < high:
            # The guard crosses zero and turns back: each side of the turn has one change of sign.
            stack[top, 0], high, top = turn, turn, top + 1
        elif value <= max(tolerated, rounding) and value < touch.depth and _may_touch(known):
            touch = Touch(turn, value)
        top -= 1
        after = side if piece.clear else certain_sign(model, transition, path, high, known, work)
        if after == 0:
            if pieces <= MOST_PIECES and may_have_crossed(model, transition, path, piece, work):
                top = _halve(stack, top + 1, piece)
            continue
        if after != side and side != 0:
            place = place_of_change(model, transition, path, piece.low, high, known, work)
            early = place <= SETTLED * length
            if not (early and (fired or _returns(model, run, transition, path, known, work))):
                if crosses_towards(model.direction[transition], after):
                    return place, after, length
                run.passed[transition] = place / length
            touch = NO_TOUCH
        elif touch.place != NOWHERE and touch.depth < distance_at(model, transition, path, high, side, work):
            touch = _noted(run, transition, path, touch, side)
        known = known_at(model, transition, path, high, after, known, work)
    _noted(run, transition, path, touch, known.side)
    return NOWHERE, known.side, length


@njit(**KERNEL)
def _begin(model, method, run, transition, path, end, work):
    """How a guard begins on a step (``Begin``), and whether it rests at zero throughout."""
    side, on_guard, hidden, rests = run.side[transition], run.on_guard[transition], 0.0, False
    if on_guard == AT_REST:
        hidden, rests = hidden_until(model, method, run, transition, path, end, work)
    if on_guard == LATER:
        t, rate = path.start, pace_at_start(path)
        model.field(run.mode, t, run.y, model.parameters, work.field)
        beside, moment, _ = sign_along(model, run, transition, Place(run.mode, t, run.y), 1.0, work)
        if beside == side and rate > 0.0:
            # Up to there the state may be on either side by rounding.
            hidden = min(moment / rate, 0.5 * path.length)
            if not path.exact:
                later, _ = hidden_until(model, method, run, transition, path, end, work)
                hidden = max(hidden, min(later, 0.5 * path.length))
    return Begin(side, on_guard, hidden), rests


@njit(**KERNEL)
def crossing_on_path(model, method, run, transition, path, end, work):
    """``first_change`` from the side that the run knows; ``sampled_change`` if the guard has no program.

    ``end`` is the value of a guard at the end of the step, which the path may hold with other rounding; only
    one that has left zero other than by its speed needs it.
    Returns the share of the step at which the guard crosses, its side after the crossing or at the end, and
    the share of the step that is proved. The guard is no longer held to be zero at the start of the step,
    unless it rests there.
    """
    begin, rests = _begin(model, method, run, transition, path, end, work)
    side, length = begin.side, path.length
    if rests:
        return NO_ROOT, side, 1.0
    run.on_guard[transition] = 0
    if begin.hidden == length:
        after = 1 if end > 0.0 else (-1 if end < 0.0 else side)
        crosses = crosses_towards(model.direction[transition], after) and side * after < 0
        again = has_just_fired(run, transition, begin.on_guard)
        return (0.0 if crosses and not again else NO_ROOT), after, 1.0
    if has_program(model, transition):
        place, side, proved = first_change(model, method, run, transition, path, begin, work)
    else:
        place, side, proved = sampled_change(model, run, transition, path, begin, work)
    return (NO_ROOT if place == NOWHERE else place / length), side, proved / length
