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
from hybrid.kernels.events.beside import MOST_MOMENTS, signs_beside
from hybrid.kernels.events.guards import (
    error_band,
    has_program,
    size_of_time,
    was_left_behind,
)
from hybrid.kernels.events.hidden import hidden_until, sample
from hybrid.kernels.events.onset import (
    BY_SPEED,
    BY_STEP,
    JUMPING,
    has_just_fired,
    is_zero,
    known_part,
    side_is_certain,
)
from hybrid.kernels.events.path import pace_at_start, rounding_of_start, state_at, time_at
from hybrid.kernels.events.sampled import NOWHERE, SETTLED, sampled_change
from hybrid.kernels.events.touches import note_touch
from hybrid.kernels.types.codes import (
    HIGH,
    HIGH_MIDDLE,
    LEAST_SLOPE,
    LOW,
    LOW_MIDDLE,
    MOST_SLOPE,
)
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# After this many pieces the step is cut to its proved part, if that is more than a small share of the step.
# Otherwise the signs at the ends of the pieces decide, and the run counts them as unproved.
MOST_PIECES = 3000
SMALL_SHARE = 1e-2
# Pieces longer than this share of the step are not tested for lying within the tolerances.
SHORT_PIECE = 1e-2
# A piece lies within rounding if, all over it, the guard is no farther from zero than this many times the
# rounding in its middle.
WITHIN_ROUNDING = 4.0
# A range up to this factor wider than the range in the middle counts as no wider.
NO_BETTER = 1.01
MOST_ROOT_STEPS = 200
# Share of a bracket that tells a guard that stays zero from one with a flat root.
BESIDE = 1e-3


class Begin(NamedTuple):
    """How a guard begins on a step.

    ``side`` is its sign before; for a guard that is zero at the start, it is the sign that the guard takes
    from there. ``on_guard`` is its order (``onset``). Up to the place ``hidden`` its signs are noise.
    """

    side: INTEGER
    on_guard: INTEGER
    hidden: REAL


class Known(NamedTuple):
    """What is known of a guard up to a place of a step.

    ``side`` is its sign there, ``sure`` the last place where that was certain, ``on_guard`` its order at the
    start. ``base + tilt * place`` counts as zero: it is the ``onset.known_part`` of the guard.
    """

    side: INTEGER
    on_guard: INTEGER
    sure: REAL
    base: REAL
    tilt: REAL


class Touch(NamedTuple):
    """Where and how close a guard has come to zero: a touch, once the guard is farther from zero again."""

    place: REAL
    depth: REAL


class Piece(NamedTuple):
    """What the bounds of a guard on a piece of a step tell, with the side that it was on before the piece.

    ``nearest`` and ``farthest`` are the distances of its range from zero, ``width`` is that of the range, and
    ``spread`` that of the range in the ``middle``. The guard is ``clear`` if it keeps to its side, and
    ``bounded`` if it has a value somewhere. If it ``turns``, it may come closer to zero and turn back.
    """

    low: REAL
    middle: REAL
    high: REAL
    nearest: REAL
    farthest: REAL
    width: REAL
    spread: REAL
    clear: TRUTH
    bounded: TRUTH
    monotone: TRUTH
    smooth: TRUTH
    turns: TRUTH


NOTHING = Known(0, 0, 0.0, 0.0, 0.0)
NO_TOUCH = Touch(NOWHERE, math.inf)


@njit(**INLINE)
def _has_known_part(known):
    return known.base != 0.0 or known.tilt != 0.0


@njit(**KERNEL)
def _row_on(model, transition, path, low, high, known, work):
    """Row of ``work.registers`` with the bounds of a guard, less its known part, between two places."""
    middle = 0.5 * (low + high)
    radius = max(high - middle, middle - low)
    last = model.bound(model.programs, transition, path, middle, radius, work.registers)
    if _has_known_part(known):
        row, base, tilt = work.registers[last], known.base, known.tilt
        row[LOW] -= base + max(tilt * low, tilt * high)
        row[HIGH] -= base + min(tilt * low, tilt * high)
        row[LOW_MIDDLE] -= base + tilt * middle
        row[HIGH_MIDDLE] -= base + tilt * middle
        row[LEAST_SLOPE] -= tilt
        row[MOST_SLOPE] -= tilt
    return last


@njit(**INLINE)
def _row_at(model, transition, path, place, known, work):
    """Row of ``work.registers`` with the bounds of a guard at one place, as wide as its rounding."""
    return _row_on(model, transition, path, place, place, known, work)


@njit(**INLINE)
def _middle_of(row):
    """Value of a guard in the middle of its bounds."""
    return 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE])


@njit(**KERNEL)
def _value_at(model, transition, path, place, row, known, work):
    """Value of a guard at one place, where ``row`` has its bounds.

    Within rounding of a jump or of a vertical tangent the bounds are useless: the compiled function is
    evaluated instead.
    """
    unbounded = not (row[MOST_SLOPE] < math.inf and row[LEAST_SLOPE] > -math.inf)
    if unbounded and row[LOW_MIDDLE] <= 0.0 <= row[HIGH_MIDDLE]:
        return sample(model, transition, path, place, work) - known.base - known.tilt * place
    return _middle_of(row)


@njit(**INLINE)
def _least_slope(row):
    """The flattest slope that the bounds allow a guard at a place; nan if they leave its sign open.

    Near a vertical tangent the bounds are wide: a steeper slope would end Newton's method before the root.
    """
    if row[LEAST_SLOPE] > 0.0:
        return row[LEAST_SLOPE]
    return row[MOST_SLOPE] if row[MOST_SLOPE] < 0.0 else math.nan


@njit(**KERNEL)
def certain_sign(model, transition, path, place, known, work):
    """Sign of a guard at a place of the step, 0 if rounding leaves it open."""
    row = work.registers[_row_at(model, transition, path, place, known, work)]
    return 1 if row[LOW] > 0.0 else (-1 if row[HIGH] < 0.0 else 0)


@njit(**KERNEL)
def _distance_at(model, transition, path, place, side, work):
    """How far a guard is from zero at a place of the step, on its side, at least."""
    row = work.registers[_row_at(model, transition, path, place, NOTHING, work)]
    return row[LOW] if side > 0 else -row[HIGH]


@njit(**KERNEL)
def _has_value(model, transition, path, place, work):
    """Whether a guard is bounded at a place of the step; ``sqrt(z)`` is not where ``z < 0``."""
    row = work.registers[_row_at(model, transition, path, place, NOTHING, work)]
    return row[LOW] > -math.inf or row[HIGH] < math.inf


@njit(**INLINE)
def _rests_at_zero(value, row):
    """Whether a guard stays zero for a while; it changes its side at the end of that."""
    return value == 0.0 and row[LEAST_SLOPE] == 0.0 and row[MOST_SLOPE] == 0.0


@njit(**KERNEL)
def _known_at(model, transition, path, place, side, known, work):
    """What is known of a guard from a place on, where it is on ``side``.

    Nothing of it counts as zero once the whole guard is certain to be on its side: later roots, which may be
    flat, are those of the whole guard.
    """
    base, tilt = known.base, known.tilt
    if _has_known_part(known) and certain_sign(model, transition, path, place, NOTHING, work) == side:
        base, tilt = 0.0, 0.0
    return Known(side, known.on_guard, place, base, tilt)


@njit(**KERNEL)
def _begins_on_side(model, transition, path, high, known, work):
    """Whether a guard is on its side at the start of a step, if it is not at ``high``."""
    row = work.registers[_row_at(model, transition, path, 0.0, known, work)]
    if is_zero(known.on_guard):
        begins = side_is_certain(known.on_guard, row[LEAST_SLOPE], row[MOST_SLOPE])
        value = _middle_of(row)
    else:
        value = _value_at(model, transition, path, 0.0, row, known, work)
        begins = value * known.side > 0.0 or math.isnan(value)
    if not begins and (_rests_at_zero(value, row) or row[MOST_SLOPE] - row[LEAST_SLOPE] == math.inf):
        # A little farther on, a flat root has a slope, and a guard that only jumps has left its jump.
        beside = work.registers[_row_at(model, transition, path, BESIDE * high, known, work)]
        begins = _rests_at_zero(_middle_of(beside), beside)
    return begins


@njit(**KERNEL)
def root_in_bracket(model, transition, path, low, high, known, work):
    """Where a guard changes its sign between two places; it is on its side at ``low`` and not at ``high``.

    Newton's method on the guard is kept in the bracket, and replaced by halving where it does not converge.
    The place returned is the end of the bracket beyond the change of sign, or the root.
    """
    place, last = 0.5 * (low + high), high - low
    for trial in range(MOST_ROOT_STEPS):
        row = work.registers[_row_at(model, transition, path, place, known, work)]
        value = _value_at(model, transition, path, place, row, known, work)
        slope = _least_slope(row)
        at_rest = _rests_at_zero(value, row)
        # A guard without a value has not crossed yet: it crosses after that.
        if value * known.side > 0.0 or at_rest or math.isnan(value):
            low = place
        else:
            high = place
        if (value == 0.0 and not at_rest) or high - low <= 2.0 * EPSILON * high:
            break
        closer = place - value / slope if abs(slope) < math.inf else math.nan
        change = abs(closer - place)
        if change <= EPSILON * high:
            return place
        # If Newton's method does not halve its steps, the bracket is halved instead.
        if not low < closer < high or (trial > 2 and change > 0.5 * last):
            closer = 0.5 * (low + high)
            change = high - low
        if closer == place:
            break
        place, last = closer, change
    return high


@njit(**KERNEL)
def _place_of_change(model, transition, path, low, high, known, work):
    """Where a guard leaves its side before ``high``; 0 if it is on the other one at the start of the step.

    After a jump at the start, it may be certain of its side from ``low`` on only.
    """
    sure = known.sure
    if sure < low and certain_sign(model, transition, path, low, known, work) == known.side:
        sure = low
    if sure == 0.0 and not _begins_on_side(model, transition, path, high, known, work):
        return 0.0
    return root_in_bracket(model, transition, path, sure, high, known, work)


@njit(**KERNEL)
def _turn_between(model, transition, path, low, high, known, work):
    """Where a guard comes closest to zero between two places; NOWHERE if it does not turn there.

    A turn within rounding of the upper end counts as between them.
    """
    side = known.side
    row = work.registers[_row_at(model, transition, path, high, known, work)]
    if not (row[MOST_SLOPE] if side > 0 else -row[LEAST_SLOPE]) >= 0.0:
        return NOWHERE
    row = work.registers[_row_at(model, transition, path, low, known, work)]
    if not (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side < 0.0:
        return NOWHERE
    while high - low > 2.0 * EPSILON * high:
        place = 0.5 * (low + high)
        if not low < place < high:
            break
        row = work.registers[_row_at(model, transition, path, place, known, work)]
        if 0.5 * (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side < 0.0:
            low = place
        else:
            high = place
    return 0.5 * (low + high)


@njit(**INLINE)
def _is_short(piece, path):
    """Whether a piece of a step is tested for lying within the tolerances."""
    return piece.high - piece.low <= SHORT_PIECE * path.length


@njit(**KERNEL)
def _tolerated(model, method, run, transition, path, piece, work):
    """How far from zero the tolerances of the state can leave a guard that may turn on a piece of a step."""
    may_touch = piece.turns and (piece.clear or _is_short(piece, path))
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
    row = work.registers[_row_at(model, transition, path, 0.0, NOTHING, work)]
    slope = row[LEAST_SLOPE] if side > 0 else row[MOST_SLOPE]
    return was_left_behind(model, run, transition, path.start, run.y, slope, side, work)


@njit(**KERNEL)
def _known_at_start(model, transition, path, begin, work):
    """What is known of a guard at the start of a step, and whether it leaves to its side for certain."""
    on_guard, sure, base, tilt = begin.on_guard, 0.0, 0.0, 0.0
    leaves = on_guard == JUMPING and begin.hidden > 0.0
    if leaves:
        sure = begin.hidden
    if is_zero(on_guard):
        row = work.registers[_row_at(model, transition, path, 0.0, NOTHING, work)]
        least, most = row[LEAST_SLOPE], row[MOST_SLOPE]
        base, tilt = known_part(_middle_of(row), 0.5 * (least + most), on_guard)
        leaves = on_guard == BY_SPEED and side_is_certain(on_guard, least, most)
    return Known(begin.side, on_guard, sure, base, tilt), leaves


@njit(**KERNEL)
def _first_place(model, run, path, begin):
    """The place of a step from which on the signs of a guard tell anything."""
    if begin.on_guard == 0:
        return 0.0
    place = max(begin.hidden, SETTLED * path.length)
    if begin.on_guard == JUMPING and not begin.hidden > 0.0:
        # By rounding the state may still be before the jump.
        beyond = rounding_of_start(path, model.dimension, run.scale, size_of_time(model, path.start))
        place = max(place, min(beyond, 0.5 * path.length))
    return place


@njit(**KERNEL)
def _piece(model, transition, path, place, known, work):
    """The piece of a step in a row of ``work.intervals``, with what the bounds of a guard on it tell."""
    low, high, side = work.intervals[place, 0], work.intervals[place, 1], known.side
    row = work.registers[_row_on(model, transition, path, low, high, known, work)]
    middle, least, most = 0.5 * (low + high), row[LEAST_SLOPE], row[MOST_SLOPE]
    smooth = -math.inf < least and most < math.inf and low < middle < high and side != 0
    return Piece(
        low,
        middle,
        high,
        min(abs(row[LOW]), abs(row[HIGH])),
        max(abs(row[LOW]), abs(row[HIGH])),
        row[HIGH] - row[LOW],
        row[HIGH_MIDDLE] - row[LOW_MIDDLE],
        row[LOW] * side > 0.0 and row[HIGH] * side > 0.0,
        row[LOW] > -math.inf or row[HIGH] < math.inf,
        least >= 0.0 or most <= 0.0,
        smooth,
        smooth and (least <= 0.0 if side > 0 else most >= 0.0),
    )


@njit(**INLINE)
def _stays_clear(piece, tolerated):
    """Whether a guard keeps to its side on a piece, and does not turn as close to zero as ``tolerated``."""
    near = max(WITHIN_ROUNDING * piece.spread, tolerated)
    return piece.clear and not (piece.turns and piece.nearest <= near)


@njit(**INLINE)
def _is_shallow(piece, path, tolerated):
    """Whether a guard may turn on a piece, all over which rounding or what is ``tolerated`` may hide it."""
    rounding = WITHIN_ROUNDING * piece.spread
    level = _is_short(piece, path) or piece.width <= rounding
    near = max(rounding, tolerated if level else 0.0)
    return piece.turns and not piece.monotone and piece.farthest <= near


@njit(**INLINE)
def _is_divisible(piece, path):
    """Whether rounding lets a piece of a step be halved."""
    return piece.low < piece.middle < piece.high and piece.high - piece.low > EPSILON * path.length


@njit(**KERNEL)
def _halves_tell_more(model, transition, path, piece, work):
    """Whether halving a piece helps: not if the guard's range on it is no wider than in its middle."""
    if not _is_divisible(piece, path):
        return False
    if not piece.width <= NO_BETTER * piece.spread:
        return True
    # The guard may have no value in the middle, but one elsewhere.
    return not piece.spread < math.inf and (
        _has_value(model, transition, path, piece.low, work)
        or _has_value(model, transition, path, piece.high, work)
    )


@njit(**KERNEL)
def _may_have_crossed(model, transition, path, piece, work):
    """Whether a guard without a value at the end of a piece may have changed its side before."""
    return (
        _is_divisible(piece, path)
        and not _has_value(model, transition, path, piece.high, work)
        and (piece.bounded or _has_value(model, transition, path, piece.low, work))
    )


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
def _turn_on(model, transition, path, piece, known, work):
    """Where a guard comes closest to zero on a piece, or may at its end; NOWHERE if it does not.

    Returned next are its value there, towards its side, with its rounding, and whether it is beyond zero.
    """
    side, turn = known.side, piece.high if not piece.smooth and piece.high < path.length else NOWHERE
    if piece.turns:
        turn = _turn_between(model, transition, path, piece.low, piece.high, known, work)
    if turn == NOWHERE or side == 0:
        return NOWHERE, math.inf, 0.0, False
    row = work.registers[_row_at(model, transition, path, turn, known, work)]
    rounding = 0.5 * (row[HIGH_MIDDLE] - row[LOW_MIDDLE])
    return turn, _middle_of(row) * side, rounding, row[LOW] * side < 0.0 and row[HIGH] * side < 0.0


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
        piece, side = _piece(model, transition, path, top, known, work), known.side
        high, pieces = piece.high, pieces + 1
        tolerated = _tolerated(model, method, run, transition, path, piece, work)
        if _stays_clear(piece, tolerated):
            touch, top = _noted(run, transition, path, touch, side), top - 1
            known = _known_at(model, transition, path, high, side, known, work)
            continue
        shallow = _is_shallow(piece, path, tolerated)
        if not (piece.monotone or shallow) and _halves_tell_more(model, transition, path, piece, work):
            if pieces <= MOST_PIECES:
                top = _halve(stack, top, piece)
                continue
            if piece.low > SMALL_SHARE * length:
                _noted(run, transition, path, touch, side)
                return NOWHERE, side, piece.low
            run.unproved += 0 if piece.clear else 1
        turn, value, rounding, beyond = _turn_on(model, transition, path, piece, known, work)
        if shallow and beyond and piece.low < turn < high:
            # The guard crosses zero and turns back: each side of the turn has one change of sign.
            stack[top, 0], high, top = turn, turn, top + 1
        elif value <= max(tolerated, rounding) and value < touch.depth and _may_touch(known):
            touch = Touch(turn, value)
        top -= 1
        after = side if piece.clear else certain_sign(model, transition, path, high, known, work)
        if after == 0:
            if pieces <= MOST_PIECES and _may_have_crossed(model, transition, path, piece, work):
                top = _halve(stack, top + 1, piece)
            continue
        if after != side and side != 0:
            place = _place_of_change(model, transition, path, piece.low, high, known, work)
            early = place <= SETTLED * length
            if not (early and (fired or _returns(model, run, transition, path, known, work))):
                if crosses_towards(model.direction[transition], after):
                    return place, after, length
                run.passed[transition] = place / length
            touch = NO_TOUCH
        elif touch.place != NOWHERE and touch.depth < _distance_at(model, transition, path, high, side, work):
            touch = _noted(run, transition, path, touch, side)
        known = _known_at(model, transition, path, high, after, known, work)
    _noted(run, transition, path, touch, known.side)
    return NOWHERE, known.side, length


@njit(**KERNEL)
def _begin(model, method, run, transition, path, end, work):
    """How a guard begins on a step (``Begin``), and whether it rests at zero throughout."""
    side, on_guard, hidden, rests = run.side[transition], run.on_guard[transition], 0.0, False
    if on_guard == BY_STEP:
        hidden, rests = hidden_until(model, method, run, transition, path, end, work)
    if on_guard == JUMPING and has_just_fired(run, transition, on_guard):
        model.field(run.mode, path.start, run.y, model.parameters, work.field)
        _, beside, moment = signs_beside(model, run, transition, path.start, run.y, MOST_MOMENTS, work)
        rate = pace_at_start(path)
        if beside == side and rate > 0.0:
            # Up to there the state may be on either side by rounding.
            hidden = min(moment / rate, 0.5 * path.length)
    return Begin(side, on_guard, hidden), rests


@njit(**KERNEL)
def crossing_on_path(model, method, run, transition, path, end, work):
    """``first_change`` from the side that the run knows; ``sampled_change`` if the guard has no program.

    ``end`` is the value of a guard at the end of the step, which the path may hold with other rounding; only
    one of the order ``BY_STEP`` needs it.
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
