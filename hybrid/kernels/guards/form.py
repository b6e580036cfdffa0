"""A guard on the pieces of a path: one enclosure, from which all that is asked of the guard is read.

A guard that is a column of the path is bounded by its expansion around the middle of a piece, and any other
one by its program. One that could not be traced is evaluated at the ends of short pieces.
"""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.events.bounds import bound_state
from hybrid.kernels.events.guards import guard_value, has_program
from hybrid.kernels.events.path import state_at, time_at
from hybrid.kernels.types.codes import HIGH, HIGH_MIDDLE, LEAST_SLOPE, LOW, LOW_MIDDLE, MOST_SLOPE
from hybrid.kernels.types.kinds import INTEGER, REAL
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# The column of a guard that is none of the path.
NO_COLUMN = -1
# Number of parts of a step; a guard that could not be traced is evaluated at their ends.
SAMPLES = 32
# Rounding hides a guard on a piece if its range there is at most so many times as wide as that at one place.
WITHIN_ROUNDING = 4.0
# A place on a piece at a share of it that no jumps at simple shares meet.
ASIDE = 0.3819660112501051


class Guard(NamedTuple):
    """A guard on a path, and what is known of it up to a place.

    The guard is the polynomial in ``column`` of the path, or has a program. ``side`` is its sign at the
    place, ``sure`` the last place where that was certain, ``on_guard`` its order at the start. Before its
    first certain sign, ``base`` counts as zero, and signs of values within ``radius`` are noise. A turn as
    close to zero as ``tolerated`` is a touch.
    """

    transition: INTEGER
    column: INTEGER
    side: INTEGER
    on_guard: INTEGER
    sure: REAL
    base: REAL
    radius: REAL
    tolerated: REAL


class Form(NamedTuple):
    """The ranges of a guard on a piece of a path, of its value in the middle, its slope and its bend.

    The bend is half of the second derivative; it is known of a guard that is a column of the path.
    """

    start: REAL
    end: REAL
    low: REAL
    high: REAL
    low_middle: REAL
    high_middle: REAL
    least_slope: REAL
    most_slope: REAL
    least_bend: REAL
    most_bend: REAL


@njit(**INLINE)
def in_column(path, column, size):
    """How large a size of a guard is in its column, which may hold the guard's root."""
    if column == NO_COLUMN or path.root == 1:
        return size
    return math.sqrt(size) if path.root == 2 else size ** (1.0 / path.root)


@njit(**KERNEL)
def sample(model, transition, path, place, work):
    """Value of a guard at a place of the path, from the compiled function."""
    state_at(path, model.dimension, place, work.state)
    return guard_value(model, transition, time_at(path, place), work.state, work.scalar)


@njit(**KERNEL)
def _bound_samples(model, path, transition, start, end, row, work):
    """Bounds of a guard that could not be traced: on a short piece it is taken for monotone."""
    row[LOW], row[HIGH], row[LEAST_SLOPE], row[MOST_SLOPE] = -math.inf, math.inf, -math.inf, math.inf
    if SAMPLES * (end - start) < 1.5 * path.length:
        one = sample(model, transition, path, start, work)
        other = sample(model, transition, path, end, work) if end > start else one
        if abs(one) + abs(other) < math.inf:
            row[LOW], row[HIGH] = min(one, other), max(one, other)
            if end > start:
                row[LEAST_SLOPE], row[MOST_SLOPE] = (
                    (other - one) / (end - start),
                    (other - one) / (end - start),
                )
    row[LOW_MIDDLE], row[HIGH_MIDDLE] = row[LOW], row[HIGH]


@njit(**KERNEL)
def form_on(model, path, guard, start, end, work):
    """The ``Form`` of a guard between two places."""
    middle, row = 0.5 * (start + end), work.registers[0]
    radius, least_bend, most_bend = max(end - middle, middle - start), -math.inf, math.inf
    if guard.column != NO_COLUMN:
        least_bend, most_bend = bound_state(path, guard.column, middle, radius, row)
    elif has_program(model, guard.transition):
        row = work.registers[
            model.bound(model.programs, guard.transition, path, middle, radius, work.registers)
        ]
    else:
        _bound_samples(model, path, guard.transition, start, end, row, work)
    return Form(
        start,
        end,
        row[LOW] - guard.base,
        row[HIGH] - guard.base,
        row[LOW_MIDDLE] - guard.base,
        row[HIGH_MIDDLE] - guard.base,
        row[LEAST_SLOPE],
        row[MOST_SLOPE],
        least_bend,
        most_bend,
    )


@njit(**INLINE)
def form_at(model, path, guard, place, work):
    """The ``Form`` of a guard at one place, as wide as its rounding."""
    return form_on(model, path, guard, place, place, work)


@njit(**INLINE)
def letter_of(form, radius):
    """The certain sign of a guard on a piece, 0 where rounding or a ``radius`` hides it."""
    return 1 if form.low > radius else (-1 if form.high < -radius else 0)


@njit(**INLINE)
def middle_slope(form):
    """The slope of a guard in the middle of its form; nan where it has none."""
    return 0.5 * (form.least_slope + form.most_slope)


@njit(**INLINE)
def is_smooth(form):
    """Whether a guard neither jumps nor is vertical on a piece, as far as its form tells."""
    return -math.inf < form.least_slope and form.most_slope < math.inf


@njit(**INLINE)
def is_monotone(form):
    """Whether the slope of a guard keeps its sign on a piece."""
    return is_smooth(form) and (form.least_slope >= 0.0 or form.most_slope <= 0.0)


@njit(**INLINE)
def may_turn(form, side, path):
    """Whether a guard may come closer to zero on a piece and turn back, or at the end of the path."""
    if side == 0 or not is_smooth(form):
        return False
    if side > 0:
        nearer, farther, bends = form.least_slope < 0.0, form.most_slope > 0.0, form.most_bend > 0.0
    else:
        nearer, farther, bends = form.most_slope > 0.0, form.least_slope < 0.0, form.least_bend < 0.0
    return nearer and bends and (farther or form.end == path.length)


@njit(**INLINE)
def has_value(form):
    """Whether a guard is bounded on a piece; ``sqrt(z)`` is not where ``z < 0``."""
    return form.low > -math.inf or form.high < math.inf


@njit(**KERNEL)
def signs_are_told(model, path, guard, form, work):
    """Whether the signs of a guard at the end of a piece, and where it turns there, tell all its signs.

    A guard that bends one way may cross twice, unless its side at the start is known. One that ends on the
    piece, as ``sqrt(z)`` where ``z`` becomes negative, has no sign at the end.
    """
    one_turn = form.most_bend <= 0.0 or form.least_bend >= 0.0
    decided = is_monotone(form) or (one_turn and guard.side != 0 and guard.radius == 0.0)
    if guard.column != NO_COLUMN or not decided:
        return decided
    return has_value(form_at(model, path, guard, form.end, work))


@njit(**KERNEL)
def halves_tell_more(model, path, guard, form, work):
    """Whether halving a piece helps: not if the range of a guard is little wider there than at one place.

    In the middle the range of a guard that jumps just there is as wide as on the whole piece. It is not at a
    place beside. And the guard may have no value at either, but one elsewhere.
    """
    start, end, width = form.start, form.end, form.high - form.low
    if not start < 0.5 * (start + end) < end or end - start <= EPSILON * path.length:
        return False
    if not width <= WITHIN_ROUNDING * (form.high_middle - form.low_middle):
        return True
    beside = form_at(model, path, guard, start + ASIDE * (end - start), work)
    if beside.high - beside.low < math.inf:
        return not width <= WITHIN_ROUNDING * (beside.high - beside.low)
    if has_value(form) or has_value(form_at(model, path, guard, start, work)):
        return True
    return has_value(form_at(model, path, guard, end, work))
