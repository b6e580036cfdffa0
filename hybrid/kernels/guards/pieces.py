"""A guard at the places and on the pieces of a path, by bounds on the guard itself.

A guard that is a polynomial in a column of the path is bounded by its expansion around the middle of a piece;
any other guard by its program. All that follows from the bounds is the same for both.
"""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.events.bounds import bound_state
from hybrid.kernels.events.guards import guard_value
from hybrid.kernels.events.onset import AT_REST, BY_SPEED
from hybrid.kernels.events.path import state_at, time_at
from hybrid.kernels.guards.touch import TOUCHES_APART
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

# Returned instead of a place on the path if there is none.
NOWHERE = -1.0
# The column of a guard that is none of the path.
NO_COLUMN = -1
# A range up to this factor wider than the range in the middle is all rounding: the sums that give the two
# differ in their last digits only.
NO_BETTER = 1.01
# A place on a piece at a share of it that no jumps at simple shares meet.
ASIDE = 0.3819660112501051
# Pieces longer than this share of the step are not tested for lying within the tolerances: a guard that has
# no zero is then clear on most of the step without that test.
SHORT_PIECE = 1e-2
# More than any bracket in floating-point numbers can be halved, with as many steps of Newton's method.
MOST_ROOT_STEPS = 200
# Share of a bracket that tells a guard that stays zero from one with a flat root: a root of a low order has
# grown beyond underflow there.
BESIDE = 1e-3


class Guard(NamedTuple):
    """A guard on a path, and what is known of it up to a place.

    The guard is the polynomial in ``column`` of the path, or has a program. ``side`` is its sign at the
    place, ``sure`` the last place where that was certain, ``on_guard`` its order at the start.
    ``base + tilt * place`` counts as zero: it is the ``onset.known_part`` of the guard.
    """

    transition: INTEGER
    column: INTEGER
    side: INTEGER
    on_guard: INTEGER
    sure: REAL
    base: REAL
    tilt: REAL


class Bounds(NamedTuple):
    """Ranges of a guard on a piece: of its value, of its slope, and of its value in the middle."""

    low: REAL
    high: REAL
    least_slope: REAL
    most_slope: REAL
    low_middle: REAL
    high_middle: REAL


class Piece(NamedTuple):
    """What the bounds of a guard on a piece of a path tell, with the side that it was on before the piece.

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


@njit(**INLINE)
def in_column(path, column, size):
    """How large a size of a guard is in its column, which may hold the guard's root."""
    if column == NO_COLUMN or path.root == 1:
        return size
    return math.sqrt(size) if path.root == 2 else size ** (1.0 / path.root)


@njit(**INLINE)
def entire(guard):
    """A guard of which nothing counts as zero."""
    return Guard(guard.transition, guard.column, guard.side, guard.on_guard, guard.sure, 0.0, 0.0)


@njit(**INLINE)
def _has_known_part(guard):
    return guard.base != 0.0 or guard.tilt != 0.0


@njit(**INLINE)
def _around_middle(bounds, radius):
    """Bounds narrowed by the mean value theorem; a known part has been taken off values and slopes apart."""
    low, high, least, most, low_middle, high_middle = bounds
    reach = radius * max(abs(least), abs(most)) if radius > 0.0 else 0.0
    reach += 2.0 * EPSILON * reach
    low, high = max(low, low_middle - reach), min(high, high_middle + reach)
    return Bounds(low, high, least, most, low_middle, high_middle)


@njit(**KERNEL)
def bounds_on(model, path, guard, low, high, work):
    """``Bounds`` of a guard, less its known part, between two places."""
    middle, last, base, tilt = 0.5 * (low + high), 0, guard.base, guard.tilt
    radius = max(high - middle, middle - low)
    if guard.column == NO_COLUMN:
        last = model.bound(model.programs, guard.transition, path, middle, radius, work.registers)
    else:
        bound_state(path, guard.column, middle, radius, work.registers[0])
    row = work.registers[last]
    bounds = Bounds(
        row[LOW] - (base + max(tilt * low, tilt * high)),
        row[HIGH] - (base + min(tilt * low, tilt * high)),
        row[LEAST_SLOPE] - tilt,
        row[MOST_SLOPE] - tilt,
        row[LOW_MIDDLE] - (base + tilt * middle),
        row[HIGH_MIDDLE] - (base + tilt * middle),
    )
    return bounds if tilt == 0.0 else _around_middle(bounds, radius)


@njit(**INLINE)
def bounds_at(model, path, guard, place, work):
    """``Bounds`` of a guard at one place, as wide as its rounding."""
    return bounds_on(model, path, guard, place, place, work)


@njit(**INLINE)
def middle_of(bounds):
    """Value of a guard in the middle of its bounds."""
    return 0.5 * (bounds.low_middle + bounds.high_middle)


@njit(**KERNEL)
def sample(model, transition, path, place, work):
    """Value of a guard at a place of the path, from the compiled function."""
    state_at(path, model.dimension, place, work.state)
    return guard_value(model, transition, time_at(path, place), work.state, work.scalar)


@njit(**KERNEL)
def _value_at(model, path, guard, place, bounds, work):
    """Value of a guard at one place, where it has these bounds.

    Within rounding of a jump or of a vertical tangent the bounds are useless: the compiled function is
    evaluated instead.
    """
    unbounded = not (bounds.most_slope < math.inf and bounds.least_slope > -math.inf)
    if unbounded and bounds.low_middle <= 0.0 <= bounds.high_middle:
        return sample(model, guard.transition, path, place, work) - guard.base - guard.tilt * place
    return middle_of(bounds)


@njit(**INLINE)
def _least_slope(bounds):
    """The flattest slope that the bounds allow a guard at a place; nan if they leave its sign open.

    Near a vertical tangent the bounds are wide: a steeper slope would end Newton's method before the root.
    """
    if bounds.least_slope > 0.0:
        return bounds.least_slope
    return bounds.most_slope if bounds.most_slope < 0.0 else math.nan


@njit(**KERNEL)
def certain_sign(model, path, guard, place, work):
    """Sign of a guard at a place of the path, 0 if rounding leaves it open."""
    bounds = bounds_at(model, path, guard, place, work)
    return 1 if bounds.low > 0.0 else (-1 if bounds.high < 0.0 else 0)


@njit(**KERNEL)
def distance_at(model, path, guard, place, work):
    """How far a guard is from zero at a place of the path, on its side, at least."""
    bounds = bounds_at(model, path, entire(guard), place, work)
    return bounds.low if guard.side > 0 else -bounds.high


@njit(**KERNEL)
def _has_value(model, path, guard, place, work):
    """Whether a guard is bounded at a place of the path; ``sqrt(z)`` is not where ``z < 0``."""
    bounds = bounds_at(model, path, guard, place, work)
    return bounds.low > -math.inf or bounds.high < math.inf


@njit(**INLINE)
def _rests_at_zero(value, bounds):
    """Whether a guard stays zero for a while; it changes its side at the end of that."""
    return value == 0.0 and bounds.least_slope == 0.0 and bounds.most_slope == 0.0


@njit(**KERNEL)
def known_at(model, path, guard, place, side, work):
    """What is known of a guard from a place on, where it is on ``side``.

    Nothing of it counts as zero once the whole guard is certain to be on its side: later roots, which may be
    flat, are those of the whole guard.
    """
    base, tilt = guard.base, guard.tilt
    if _has_known_part(guard) and certain_sign(model, path, entire(guard), place, work) == side:
        base, tilt = 0.0, 0.0
    return Guard(guard.transition, guard.column, side, guard.on_guard, place, base, tilt)


@njit(**KERNEL)
def _begins_on_side(model, path, guard, high, work):
    """Whether a guard is on its side at the start of a path, if it is not at ``high``."""
    at = bounds_at(model, path, guard, 0.0, work)
    if guard.on_guard in (BY_SPEED, AT_REST):
        begins = guard.on_guard == BY_SPEED
        value = middle_of(at)
    else:
        value = _value_at(model, path, guard, 0.0, at, work)
        begins = value * guard.side > 0.0 or math.isnan(value)
    if not begins and (_rests_at_zero(value, at) or at.most_slope - at.least_slope == math.inf):
        # A little farther on, a flat root has a slope, and a guard that only jumps has left its jump.
        beside = bounds_at(model, path, guard, BESIDE * high, work)
        begins = _rests_at_zero(middle_of(beside), beside)
    return begins


@njit(**KERNEL)
def root_in_bracket(model, path, guard, low, high, work):
    """Where a guard changes its sign between two places; it is on its side at ``low`` and not at ``high``.

    Newton's method on the guard is kept in the bracket, and replaced by halving where it does not converge.
    The place returned is the end of the bracket beyond the change of sign, or the root.
    """
    place, last = 0.5 * (low + high), high - low
    for trial in range(MOST_ROOT_STEPS):
        at = bounds_at(model, path, guard, place, work)
        value, slope = _value_at(model, path, guard, place, at, work), _least_slope(at)
        at_rest = _rests_at_zero(value, at)
        # A guard without a value has not crossed yet: it crosses after that.
        if value * guard.side > 0.0 or at_rest or math.isnan(value):
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
def place_of_change(model, path, guard, low, high, work):
    """Where a guard leaves its side before ``high``; 0 if it is on the other one at the start of the path.

    After a jump at the start, it may be certain of its side from ``low`` on only.
    """
    sure = guard.sure
    if sure < low and certain_sign(model, path, guard, low, work) == guard.side:
        sure = low
    if sure == 0.0 and not _begins_on_side(model, path, guard, high, work):
        return 0.0
    return root_in_bracket(model, path, guard, sure, high, work)


@njit(**KERNEL)
def _turn_between(model, path, guard, low, high, work):
    """Where a guard comes closest to zero between two places; NOWHERE if it does not turn there.

    A turn next to the end of the path counts as on it: the next path may begin beyond the turn, by rounding.
    """
    side, end = guard.side, high
    if high == path.length:
        high *= 1.0 + TOUCHES_APART
    at = bounds_at(model, path, guard, high, work)
    if not (at.most_slope if side > 0 else -at.least_slope) >= 0.0:
        return NOWHERE
    at = bounds_at(model, path, guard, low, work)
    if not (at.least_slope + at.most_slope) * side < 0.0:
        return NOWHERE
    while high - low > 2.0 * EPSILON * high:
        place = 0.5 * (low + high)
        if not low < place < high:
            break
        at = bounds_at(model, path, guard, place, work)
        if 0.5 * (at.least_slope + at.most_slope) * side < 0.0:
            low = place
        else:
            high = place
    return min(0.5 * (low + high), end)


@njit(**INLINE)
def is_short(piece, path):
    """Whether a piece of a path is tested for lying within the tolerances."""
    return piece.high - piece.low <= SHORT_PIECE * path.length


@njit(**KERNEL)
def piece_of(model, path, guard, place, work):
    """The piece of a path in a row of ``work.intervals``, with what the bounds of a guard on it tell."""
    low, high, side = work.intervals[place, 0], work.intervals[place, 1], guard.side
    on = bounds_on(model, path, guard, low, high, work)
    middle, least, most = 0.5 * (low + high), on.least_slope, on.most_slope
    smooth = -math.inf < least and most < math.inf and low < middle < high and side != 0
    return Piece(
        low,
        middle,
        high,
        min(abs(on.low), abs(on.high)),
        max(abs(on.low), abs(on.high)),
        on.high - on.low,
        on.high_middle - on.low_middle,
        on.low * side > 0.0 and on.high * side > 0.0,
        on.low > -math.inf or on.high < math.inf,
        least >= 0.0 or most <= 0.0,
        smooth,
        smooth and (least <= 0.0 if side > 0 else most >= 0.0),
    )


@njit(**INLINE)
def _is_divisible(piece, path):
    """Whether rounding lets a piece of a path be halved."""
    return piece.low < piece.middle < piece.high and piece.high - piece.low > EPSILON * path.length


@njit(**KERNEL)
def halves_tell_more(model, path, guard, piece, work):
    """Whether halving a piece helps: not if the guard's range on it is no wider than at one place.

    In the middle the range of a guard that jumps just there is as wide as on the whole piece. It is not at a
    place beside.
    """
    if not _is_divisible(piece, path):
        return False
    if not piece.width <= NO_BETTER * piece.spread:
        return True
    if piece.spread < math.inf:
        beside = bounds_at(model, path, guard, piece.low + ASIDE * (piece.high - piece.low), work)
        return not piece.width <= NO_BETTER * (beside.high_middle - beside.low_middle)
    # The guard may have no value in the middle, but one elsewhere.
    return _has_value(model, path, guard, piece.low, work) or _has_value(model, path, guard, piece.high, work)


@njit(**KERNEL)
def may_have_crossed(model, path, guard, piece, work):
    """Whether a guard without a value at the end of a piece may have changed its side before."""
    return (
        _is_divisible(piece, path)
        and not _has_value(model, path, guard, piece.high, work)
        and (piece.bounded or _has_value(model, path, guard, piece.low, work))
    )


@njit(**KERNEL)
def turn_on(model, path, guard, piece, work):
    """Where a guard comes closest to zero on a piece, or may at its end; NOWHERE if it does not.

    Returned next are its value there, towards its side, with its rounding, and whether it is beyond zero.
    """
    side, turn = guard.side, piece.high if not piece.smooth and piece.high < path.length else NOWHERE
    if piece.turns:
        turn = _turn_between(model, path, guard, piece.low, piece.high, work)
    if turn == NOWHERE or side == 0:
        return NOWHERE, math.inf, 0.0, False
    at = bounds_at(model, path, guard, turn, work)
    rounding = 0.5 * (at.high_middle - at.low_middle)
    return turn, middle_of(at) * side, rounding, at.low * side < 0.0 and at.high * side < 0.0
