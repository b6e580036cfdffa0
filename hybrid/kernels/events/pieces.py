"""A guard at the places and on the pieces of a step, by bounds on the guard itself."""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.events.hidden import sample
from hybrid.kernels.events.onset import LATER, side_is_certain
from hybrid.kernels.events.sampled import NOWHERE
from hybrid.kernels.types.codes import HIGH, HIGH_MIDDLE, LEAST_SLOPE, LOW, LOW_MIDDLE, MOST_SLOPE
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# A range up to this factor wider than the range in the middle counts as no wider.
NO_BETTER = 1.01
# Pieces longer than this share of the step are not tested for lying within the tolerances.
SHORT_PIECE = 1e-2
MOST_ROOT_STEPS = 200
# Share of a bracket that tells a guard that stays zero from one with a flat root.
BESIDE = 1e-3


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
def row_at(model, transition, path, place, known, work):
    """Row of ``work.registers`` with the bounds of a guard at one place, as wide as its rounding."""
    return _row_on(model, transition, path, place, place, known, work)


@njit(**INLINE)
def middle_of(row):
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
    return middle_of(row)


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
    row = work.registers[row_at(model, transition, path, place, known, work)]
    return 1 if row[LOW] > 0.0 else (-1 if row[HIGH] < 0.0 else 0)


@njit(**KERNEL)
def distance_at(model, transition, path, place, side, work):
    """How far a guard is from zero at a place of the step, on its side, at least."""
    row = work.registers[row_at(model, transition, path, place, NOTHING, work)]
    return row[LOW] if side > 0 else -row[HIGH]


@njit(**KERNEL)
def _has_value(model, transition, path, place, work):
    """Whether a guard is bounded at a place of the step; ``sqrt(z)`` is not where ``z < 0``."""
    row = work.registers[row_at(model, transition, path, place, NOTHING, work)]
    return row[LOW] > -math.inf or row[HIGH] < math.inf


@njit(**INLINE)
def _rests_at_zero(value, row):
    """Whether a guard stays zero for a while; it changes its side at the end of that."""
    return value == 0.0 and row[LEAST_SLOPE] == 0.0 and row[MOST_SLOPE] == 0.0


@njit(**KERNEL)
def known_at(model, transition, path, place, side, known, work):
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
    row = work.registers[row_at(model, transition, path, 0.0, known, work)]
    if known.on_guard > 0 and known.on_guard != LATER:
        begins = side_is_certain(known.on_guard, row[LEAST_SLOPE], row[MOST_SLOPE])
        value = middle_of(row)
    else:
        value = _value_at(model, transition, path, 0.0, row, known, work)
        begins = value * known.side > 0.0 or math.isnan(value)
    if not begins and (_rests_at_zero(value, row) or row[MOST_SLOPE] - row[LEAST_SLOPE] == math.inf):
        # A little farther on, a flat root has a slope, and a guard that only jumps has left its jump.
        beside = work.registers[row_at(model, transition, path, BESIDE * high, known, work)]
        begins = _rests_at_zero(middle_of(beside), beside)
    return begins


@njit(**KERNEL)
def root_in_bracket(model, transition, path, low, high, known, work):
    """Where a guard changes its sign between two places; it is on its side at ``low`` and not at ``high``.

    Newton's method on the guard is kept in the bracket, and replaced by halving where it does not converge.
    The place returned is the end of the bracket beyond the change of sign, or the root.
    """
    place, last = 0.5 * (low + high), high - low
    for trial in range(MOST_ROOT_STEPS):
        row = work.registers[row_at(model, transition, path, place, known, work)]
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
def place_of_change(model, transition, path, low, high, known, work):
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
    row = work.registers[row_at(model, transition, path, high, known, work)]
    if not (row[MOST_SLOPE] if side > 0 else -row[LEAST_SLOPE]) >= 0.0:
        return NOWHERE
    row = work.registers[row_at(model, transition, path, low, known, work)]
    if not (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side < 0.0:
        return NOWHERE
    while high - low > 2.0 * EPSILON * high:
        place = 0.5 * (low + high)
        if not low < place < high:
            break
        row = work.registers[row_at(model, transition, path, place, known, work)]
        if 0.5 * (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side < 0.0:
            low = place
        else:
            high = place
    return 0.5 * (low + high)


@njit(**INLINE)
def is_short(piece, path):
    """Whether a piece of a step is tested for lying within the tolerances."""
    return piece.high - piece.low <= SHORT_PIECE * path.length


@njit(**KERNEL)
def piece_of(model, transition, path, place, known, work):
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
def _is_divisible(piece, path):
    """Whether rounding lets a piece of a step be halved."""
    return piece.low < piece.middle < piece.high and piece.high - piece.low > EPSILON * path.length


@njit(**KERNEL)
def halves_tell_more(model, transition, path, piece, work):
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
def may_have_crossed(model, transition, path, piece, work):
    """Whether a guard without a value at the end of a piece may have changed its side before."""
    return (
        _is_divisible(piece, path)
        and not _has_value(model, transition, path, piece.high, work)
        and (piece.bounded or _has_value(model, transition, path, piece.low, work))
    )


@njit(**KERNEL)
def turn_on(model, transition, path, piece, known, work):
    """Where a guard comes closest to zero on a piece, or may at its end; NOWHERE if it does not.

    Returned next are its value there, towards its side, with its rounding, and whether it is beyond zero.
    """
    side, turn = known.side, piece.high if not piece.smooth and piece.high < path.length else NOWHERE
    if piece.turns:
        turn = _turn_between(model, transition, path, piece.low, piece.high, known, work)
    if turn == NOWHERE or side == 0:
        return NOWHERE, math.inf, 0.0, False
    row = work.registers[row_at(model, transition, path, turn, known, work)]
    rounding = 0.5 * (row[HIGH_MIDDLE] - row[LOW_MIDDLE])
    return turn, middle_of(row) * side, rounding, row[LOW] * side < 0.0 and row[HIGH] * side < 0.0
