"""The first change of sign of a guard on a step, proved by bounds on the guard itself.

The step is halved until on each piece the guard has no zero, or its slope keeps its sign, or the piece is as
short as rounding allows. A slope that keeps its sign leaves room for one change of sign at most, which the
signs at the ends of the piece decide. This holds for roots of any order, for kinks and for jumps: where a
guard jumps across zero the change of sign is the jump.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.bernstein import NO_ROOT, crosses_towards
from hybrid.kernels.events.guards import error_band, guard_value, has_program, rounding_band, was_left_behind
from hybrid.kernels.events.onset import BY_STEP, has_just_fired, is_zero, known_part, side_is_certain
from hybrid.kernels.events.path import state_at, time_at
from hybrid.kernels.types.codes import (
    HIGH,
    HIGH_MIDDLE,
    LEAST_SLOPE,
    LOW,
    LOW_MIDDLE,
    MOST_SLOPE,
)
from hybrid.kernels.types.layout import EPSILON, INLINE, KERNEL

# Instead of a place on the step.
NOWHERE = -1.0
# After so many pieces the step is cut to what has been proved of it, if that is more than a small share. If
# not, the signs at the ends of the pieces decide, and the run says so.
MOST_PIECES = 3000
SMALL_SHARE = 1e-2
# Pieces longer than this share of the step are not asked whether they lie within the tolerances.
SHORT_PIECE = 1e-2
# A guard that comes closer to zero than this share of its largest value on a piece may be a touch.
CLOSE = 1e-4
# A piece lies within rounding if nowhere on it the guard is farther from zero than this many times the
# rounding in its middle.
WITHIN_ROUNDING = 4.0
# A range is no wider than that of the middle if it is not wider by more than this factor.
NO_BETTER = 1.01
MOST_ROOT_STEPS = 200
# A guard that is zero at the start of the step is not looked at before this share of the step.
SETTLED = 64.0 * EPSILON
# Parts of a step at whose ends a guard that could not be traced is looked at.
SAMPLES = 32
# In how many places of a step a guard is looked at whose speed and acceleration are zero too.
PLACES_AT_REST = 8


@njit(**INLINE)
def _shifted(row, base, tilt, low, high):
    """Take ``base + tilt * place`` out of the bounds over the places from ``low`` to ``high``."""
    middle = 0.5 * (low + high)
    row[LOW] -= base + max(tilt * low, tilt * high)
    row[HIGH] -= base + min(tilt * low, tilt * high)
    row[LOW_MIDDLE] -= base + tilt * middle
    row[HIGH_MIDDLE] -= base + tilt * middle
    row[LEAST_SLOPE] -= tilt
    row[MOST_SLOPE] -= tilt


@njit(**INLINE)
def _row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work):
    """Row of ``work.registers`` with the bounds of a guard at one place: what rounding leaves unknown.

    The guard is looked at without ``base + tilt * place``, its ``onset.known_part``.
    """
    last = model.bound(
        model.programs, transition, path, order, clock, start, pace, place, 0.0, work.registers
    )
    if base != 0.0 or tilt != 0.0:
        _shifted(work.registers[last], base, tilt, place, place)
    return last


@njit(**KERNEL)
def _sample(model, transition, path, order, clock, start, pace, place, work):
    """Value of a guard at a place of the step, from the compiled function."""
    state_at(path, order, model.dimension, place, work.state)
    t = time_at(path, order, clock, start, pace, place)
    return guard_value(model, transition, t, work.state, work.scalar)


@njit(**KERNEL)
def _value_at(model, transition, path, order, clock, start, pace, place, row, base, tilt, work):
    """Value of a guard at one place, where ``row`` has its bounds.

    Within rounding of a jump or of a vertical tangent the bounds know nothing: the function itself does.
    """
    unbounded = not (row[MOST_SLOPE] < math.inf and row[LEAST_SLOPE] > -math.inf)
    if unbounded and row[LOW_MIDDLE] <= 0.0 <= row[HIGH_MIDDLE]:
        return _sample(model, transition, path, order, clock, start, pace, place, work) - base - tilt * place
    return 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE])


@njit(**INLINE)
def _least_slope(row):
    """The flattest slope that the bounds leave a guard at a place; nan if they do not know its sign.

    Near a vertical tangent the bounds are wide: a steeper slope would end Newton's method before the root.
    """
    if row[LEAST_SLOPE] > 0.0:
        return row[LEAST_SLOPE]
    return row[MOST_SLOPE] if row[MOST_SLOPE] < 0.0 else math.nan


@njit(**KERNEL)
def certain_sign(model, transition, path, order, clock, start, pace, place, base, tilt, work):
    """Sign of a guard at a place of the step, 0 if rounding could have made it."""
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work)]
    return 1 if row[LOW] > 0.0 else (-1 if row[HIGH] < 0.0 else 0)


@njit(**KERNEL)
def _still_hidden(model, transition, path, order, clock, start, pace, place, side, base, tilt, work):
    """What is taken out of a guard from a place on: nothing once the whole guard is on its side for certain.

    Its later roots, which may be flat, are those of the guard itself.
    """
    whole = certain_sign(model, transition, path, order, clock, start, pace, place, 0.0, 0.0, work)
    if whole == side:
        return 0.0, 0.0
    return base, tilt


@njit(**KERNEL)
def root_in_bracket(
    model, transition, path, order, clock, start, pace, low, high, side, on_guard, base, tilt, work
):
    """Where a guard changes its sign between two places; it is on ``side`` at ``low`` and not at ``high``.

    Newton's method on the guard, kept in the bracket; halving where it does not settle. The place returned is
    the end of the bracket beyond the change of sign, or the root. At the start of the step the guard may be
    on the other side already: that is where it crosses.
    """
    if low == 0.0:
        row = work.registers[
            _row_at(model, transition, path, order, clock, start, pace, 0.0, base, tilt, work)
        ]
        if is_zero(on_guard):
            begins = side_is_certain(on_guard, row[LEAST_SLOPE], row[MOST_SLOPE])
        else:
            value = _value_at(model, transition, path, order, clock, start, pace, 0.0, row, base, tilt, work)
            begins = value * side > 0.0
        if not begins:
            return 0.0
    place, last = 0.5 * (low + high), high - low
    for trial in range(MOST_ROOT_STEPS):
        row = work.registers[
            _row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work)
        ]
        value = _value_at(model, transition, path, order, clock, start, pace, place, row, base, tilt, work)
        slope = _least_slope(row)
        if value * side > 0.0:
            low = place
        else:
            high = place
        if value == 0.0 or high - low <= 2.0 * EPSILON * high:
            break
        closer = place - value / slope if abs(slope) < math.inf else math.nan
        change = abs(closer - place)
        if change <= EPSILON * high:
            return place
        # Newton's method halves its steps, or is replaced by halving.
        if not low < closer < high or (trial > 2 and change > 0.5 * last):
            closer = 0.5 * (low + high)
            change = high - low
        if closer == place:
            break
        place, last = closer, change
    return high


@njit(**KERNEL)
def _turn_between(model, transition, path, order, clock, start, pace, low, high, side, base, tilt, work):
    """Where a guard on ``side`` comes closest to zero between two places, or NOWHERE if that is an end."""
    for place, towards in ((low, True), (high, False)):
        row = work.registers[
            _row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work)
        ]
        slope = 0.5 * (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side
        if not abs(slope) < math.inf or (slope < 0.0) != towards:
            return NOWHERE
    while high - low > 2.0 * EPSILON * high:
        place = 0.5 * (low + high)
        if not low < place < high:
            break
        row = work.registers[
            _row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work)
        ]
        if 0.5 * (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side < 0.0:
            low = place
        else:
            high = place
    return 0.5 * (low + high)


@njit(**KERNEL)
def _tolerated(model, method, run, transition, path, order, clock, start, pace, place, work):
    """How far from zero the tolerances of the state can leave a guard, at a place of the step."""
    state_at(path, order, model.dimension, place, work.state)
    t = time_at(path, order, clock, start, pace, place)
    model.guard_gradient(transition, t, work.state, model.parameters, work.gradient)
    return error_band(method, run, work.gradient, model.dimension)


@njit(**KERNEL)
def _note_touch(run, transition, place, value, length):
    """Keep the earliest touch of the step."""
    if 0.0 < place < length and place / length < run.grazing_place:
        run.grazing_place, run.grazing_value = place / length, value
        run.grazing_guard = transition


@njit(**KERNEL)
def _returns(model, run, transition, path, order, clock, start, pace, side, on_guard, work):
    """Whether the rounding of a jump has left the guard beyond zero, where the step starts."""
    if on_guard > 0:
        return False
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, 0.0, 0.0, 0.0, work)]
    slope = row[LEAST_SLOPE] if side > 0 else row[MOST_SLOPE]
    return was_left_behind(model, run, transition, start, run.y, slope, side, work)


@njit(**KERNEL)
def first_change(
    model, method, run, transition, path, order, clock, start, pace, length, side, on_guard, exact, work
):
    """First change of sign of a guard in its transition's direction, for variables in ``[0, length]``.

    ``side`` is the sign before; a guard that is zero at the start has the sign it takes from there. Returns
    ``(place, side after, proved)``: ``NOWHERE`` where the guard does not change its sign before ``proved``,
    to which the step is to be cut.
    """
    direction = model.direction[transition]
    pieces, top = 0, 0
    # The last place where the guard was on its side, beyond rounding, and where it came closest to zero.
    sure = 0.0
    touch, depth = NOWHERE, math.inf
    base, tilt = 0.0, 0.0
    if is_zero(on_guard):
        row = work.registers[_row_at(model, transition, path, order, clock, start, pace, 0.0, 0.0, 0.0, work)]
        value = 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE])
        base, tilt = known_part(value, 0.5 * (row[LEAST_SLOPE] + row[MOST_SLOPE]), on_guard)
    stack = work.intervals
    stack[0, 0], stack[0, 1] = SETTLED * length if on_guard > 0 else 0.0, length
    while top >= 0:
        low, high = stack[top, 0], stack[top, 1]
        middle = 0.5 * (low + high)
        radius = max(high - middle, middle - low)
        last = model.bound(
            model.programs, transition, path, order, clock, start, pace, middle, radius, work.registers
        )
        row = work.registers[last]
        if base != 0.0 or tilt != 0.0:
            _shifted(row, base, tilt, low, high)
        pieces += 1
        clear = row[LOW] * side > 0.0 and row[HIGH] * side > 0.0
        monotone = row[LEAST_SLOPE] >= 0.0 or row[MOST_SLOPE] <= 0.0
        nearest, farthest = min(abs(row[LOW]), abs(row[HIGH])), max(abs(row[LOW]), abs(row[HIGH]))
        rounding = WITHIN_ROUNDING * (row[HIGH_MIDDLE] - row[LOW_MIDDLE])
        bounded = -math.inf < row[LEAST_SLOPE] and row[MOST_SLOPE] < math.inf
        smooth = bounded and low < middle < high and side != 0
        if clear and not (smooth and nearest <= CLOSE * farthest):
            sure = high
            if base != 0.0 or tilt != 0.0:
                base, tilt = _still_hidden(
                    model, transition, path, order, clock, start, pace, high, side, base, tilt, work
                )
            top -= 1
            continue
        tolerated = 0.0
        if smooth and not exact and (clear or high - low <= SHORT_PIECE * length):
            tolerated = _tolerated(
                model, method, run, transition, path, order, clock, start, pace, middle, work
            )
        shallow = smooth and not monotone and farthest <= max(rounding, tolerated)
        # Halves of a piece on which the guard is no less certain than in its middle would tell no more.
        tells = not row[HIGH] - row[LOW] <= NO_BETTER * (row[HIGH_MIDDLE] - row[LOW_MIDDLE])
        splits = low < middle < high and high - low > EPSILON * length and tells
        if splits and not (clear or monotone or shallow):
            if pieces <= MOST_PIECES:
                stack[top, 0] = middle
                top += 1
                stack[top, 0], stack[top, 1] = low, middle
                continue
            if low > SMALL_SHARE * length:
                return NOWHERE, side, low
            run.unproved += 1
        turn = high
        if smooth and not monotone:
            turn = _turn_between(
                model, transition, path, order, clock, start, pace, low, high, side, base, tilt, work
            )
        if turn != NOWHERE and side != 0:
            row = work.registers[
                _row_at(model, transition, path, order, clock, start, pace, turn, base, tilt, work)
            ]
            value = 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE]) * side
            within = value <= max(tolerated, 0.5 * (row[HIGH_MIDDLE] - row[LOW_MIDDLE]))
            if shallow and low < turn < high and row[LOW] * side < 0.0 and row[HIGH] * side < 0.0:
                # Down to the turn and up again: two pieces with one change of sign each.
                stack[top, 0], high = turn, turn
                top += 1
            elif within and value < depth and on_guard == 0:
                touch, depth = turn, value
        top -= 1
        after = side
        if not clear:
            after = certain_sign(model, transition, path, order, clock, start, pace, high, base, tilt, work)
        if after == 0:
            continue
        if after != side and side != 0:
            # Behind a jump at the start the guard may be on its side for certain from this piece on.
            if (
                sure < low
                and certain_sign(model, transition, path, order, clock, start, pace, low, base, tilt, work)
                == side
            ):
                sure = low
            place = root_in_bracket(
                model,
                transition,
                path,
                order,
                clock,
                start,
                pace,
                sure,
                high,
                side,
                on_guard,
                base,
                tilt,
                work,
            )
            touch, depth = NOWHERE, math.inf
            # Where it has just fired, the step only shows to which side the guard leaves zero.
            again = place <= SETTLED * length and (
                has_just_fired(run, transition, on_guard)
                or _returns(model, run, transition, path, order, clock, start, pace, side, on_guard, work)
            )
            side = after
            if crosses_towards(direction, after) and not again:
                return place, side, length
        side, sure = after, high
        if base != 0.0 or tilt != 0.0:
            base, tilt = _still_hidden(
                model, transition, path, order, clock, start, pace, high, side, base, tilt, work
            )
    if touch != NOWHERE:
        _note_touch(run, transition, touch, depth * side, length)
    return NOWHERE, side, length


@njit(**KERNEL)
def sampled_change(model, run, transition, path, order, clock, start, pace, length, side, on_guard, work):
    """As ``first_change`` for a guard that could not be traced: it is looked at in some places only."""
    run.unproved += 1
    direction, low = model.direction[transition], 0.0
    for i in range(1, SAMPLES + 1):
        high = length * i / SAMPLES
        value = _sample(model, transition, path, order, clock, start, pace, high, work)
        if value * side < 0.0:
            left, right = low, high
            if low == 0.0 and not is_zero(on_guard):
                first = _sample(model, transition, path, order, clock, start, pace, 0.0, work)
                right = 0.0 if first * side <= 0.0 else high
            elif low == 0.0 and on_guard == BY_STEP:
                right = 0.0
            while right - left > 2.0 * EPSILON * right:
                middle = 0.5 * (left + right)
                if not left < middle < right:
                    break
                if _sample(model, transition, path, order, clock, start, pace, middle, work) * side > 0.0:
                    left = middle
                else:
                    right = middle
            side = -side
            again = right <= SETTLED * length and has_just_fired(run, transition, on_guard)
            if crosses_towards(direction, side) and not again:
                return right, side, length
        elif side == 0 and value != 0.0:
            side = 1 if value > 0.0 else -1
        low = high
    return NOWHERE, side, length


@njit(**KERNEL)
def rests(model, run, transition, path, order, clock, start, pace, length, work):
    """Whether the state rests on a guard: it started there without speed, and the guard stays zero.

    Zero at the end of the step alone says nothing: a guard may come back.
    """
    if run.on_guard[transition] != BY_STEP:
        return False
    for i in range(1, PLACES_AT_REST + 1):
        place = length * i / PLACES_AT_REST
        value = _sample(model, transition, path, order, clock, start, pace, place, work)
        t = time_at(path, order, clock, start, pace, place)
        model.guard_gradient(transition, t, work.state, model.parameters, work.gradient)
        if abs(value) > rounding_band(model, run, transition, t, work.state, work):
            return False
    return True


@njit(**KERNEL)
def crossing_on_path(model, method, run, transition, path, order, clock, start, pace, length, exact, work):
    """``first_change`` from the side that the run knows, or samples where a guard has no program.

    Returns the share of the step at which the guard crosses, its side after that or at the end, and the share
    of the step that is proved.
    """
    side, on_guard = run.side[transition], run.on_guard[transition]
    if not has_program(model, transition):
        place, side, proved = sampled_change(
            model, run, transition, path, order, clock, start, pace, length, side, on_guard, work
        )
    else:
        place, side, proved = first_change(
            model,
            method,
            run,
            transition,
            path,
            order,
            clock,
            start,
            pace,
            length,
            side,
            on_guard,
            exact,
            work,
        )
    return (NO_ROOT if place == NOWHERE else place / length), side, proved / length
