"""The first change of sign of a guard on a step, proved by bounds on the guard itself.

The step is halved until on each piece the guard has no zero, or its slope keeps its sign, or the piece is as
short as rounding allows. If the slope keeps its sign, the guard changes sign at most once, and the signs at
the ends of the piece decide whether it does. This holds for roots of any order, for kinks and for jumps: if a
guard jumps across zero, the change of sign is at the jump.
"""

import math

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
from hybrid.kernels.events.path import rounding_of_start, state_at, time_at
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


@njit(**INLINE)
def _shifted(row, base, tilt, low, high):
    """Subtract ``base + tilt * place`` from the bounds over the places from ``low`` to ``high``."""
    middle = 0.5 * (low + high)
    row[LOW] -= base + max(tilt * low, tilt * high)
    row[HIGH] -= base + min(tilt * low, tilt * high)
    row[LOW_MIDDLE] -= base + tilt * middle
    row[HIGH_MIDDLE] -= base + tilt * middle
    row[LEAST_SLOPE] -= tilt
    row[MOST_SLOPE] -= tilt


@njit(**INLINE)
def _row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work):
    """Row of ``work.registers`` with the bounds of a guard at one place, as wide as its rounding.

    ``base + tilt * place``, the ``onset.known_part`` of the guard, is subtracted.
    """
    last = model.bound(
        model.programs, transition, path, order, clock, start, pace, place, 0.0, work.registers
    )
    if base != 0.0 or tilt != 0.0:
        _shifted(work.registers[last], base, tilt, place, place)
    return last


@njit(**KERNEL)
def _value_at(model, transition, path, order, clock, start, pace, place, row, base, tilt, work):
    """Value of a guard at one place, where ``row`` has its bounds.

    Within rounding of a jump or of a vertical tangent the bounds are useless: the compiled function is
    evaluated instead.
    """
    unbounded = not (row[MOST_SLOPE] < math.inf and row[LEAST_SLOPE] > -math.inf)
    if unbounded and row[LOW_MIDDLE] <= 0.0 <= row[HIGH_MIDDLE]:
        return sample(model, transition, path, order, clock, start, pace, place, work) - base - tilt * place
    return 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE])


@njit(**INLINE)
def _least_slope(row):
    """The flattest slope that the bounds allow a guard at a place; nan if they leave its sign open.

    Near a vertical tangent the bounds are wide: a steeper slope would end Newton's method before the root.
    """
    if row[LEAST_SLOPE] > 0.0:
        return row[LEAST_SLOPE]
    return row[MOST_SLOPE] if row[MOST_SLOPE] < 0.0 else math.nan


@njit(**KERNEL)
def certain_sign(model, transition, path, order, clock, start, pace, place, base, tilt, work):
    """Sign of a guard at a place of the step, 0 if rounding leaves it open."""
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work)]
    return 1 if row[LOW] > 0.0 else (-1 if row[HIGH] < 0.0 else 0)


@njit(**KERNEL)
def _distance_at(model, transition, path, order, clock, start, pace, place, side, work):
    """How far a guard is from zero at a place of the step, on its side, at least."""
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, place, 0.0, 0.0, work)]
    return row[LOW] if side > 0 else -row[HIGH]


@njit(**KERNEL)
def _has_value(model, transition, path, order, clock, start, pace, place, work):
    """Whether a guard is bounded at a place of the step; ``sqrt(z)`` is not where ``z < 0``."""
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, place, 0.0, 0.0, work)]
    return row[LOW] > -math.inf or row[HIGH] < math.inf


@njit(**INLINE)
def _rests_at_zero(value, row):
    """Whether a guard stays zero for a while; it changes its side at the end of that."""
    return value == 0.0 and row[LEAST_SLOPE] == 0.0 and row[MOST_SLOPE] == 0.0


@njit(**KERNEL)
def _still_hidden(model, transition, path, order, clock, start, pace, place, side, base, tilt, work):
    """The base and tilt to subtract from a guard from a place on.

    Both are zero once the whole guard is certain to be on its side: later roots, which may be flat, are those
    of the whole guard.
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

    Newton's method on the guard is kept in the bracket, and replaced by halving where it does not converge.
    The place returned is the end of the bracket beyond the change of sign, or the root. If the guard is on
    the other side already at the start of the step, it crosses there.
    """
    if low == 0.0:
        row = work.registers[
            _row_at(model, transition, path, order, clock, start, pace, 0.0, base, tilt, work)
        ]
        if is_zero(on_guard):
            begins = side_is_certain(on_guard, row[LEAST_SLOPE], row[MOST_SLOPE])
            value = 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE])
        else:
            value = _value_at(model, transition, path, order, clock, start, pace, 0.0, row, base, tilt, work)
            begins = value * side > 0.0 or math.isnan(value)
        if not begins and (_rests_at_zero(value, row) or row[MOST_SLOPE] - row[LEAST_SLOPE] == math.inf):
            # A little farther on, a flat root has a slope, and a guard that only jumps has left its jump.
            beside = work.registers[
                _row_at(model, transition, path, order, clock, start, pace, BESIDE * high, base, tilt, work)
            ]
            begins = _rests_at_zero(0.5 * (beside[LOW_MIDDLE] + beside[HIGH_MIDDLE]), beside)
        if not begins:
            return 0.0
    place, last = 0.5 * (low + high), high - low
    for trial in range(MOST_ROOT_STEPS):
        row = work.registers[
            _row_at(model, transition, path, order, clock, start, pace, place, base, tilt, work)
        ]
        value = _value_at(model, transition, path, order, clock, start, pace, place, row, base, tilt, work)
        slope = _least_slope(row)
        at_rest = _rests_at_zero(value, row)
        # A guard without a value has not crossed yet: it crosses after that.
        if value * side > 0.0 or at_rest or math.isnan(value):
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
def _turn_between(model, transition, path, order, clock, start, pace, low, high, side, base, tilt, work):
    """Where a guard on ``side`` comes closest to zero between two places; NOWHERE if it does not turn there.

    A turn within rounding of the upper end counts as between them.
    """
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, high, base, tilt, work)]
    if not (row[MOST_SLOPE] if side > 0 else -row[LEAST_SLOPE]) >= 0.0:
        return NOWHERE
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, low, base, tilt, work)]
    if not (row[LEAST_SLOPE] + row[MOST_SLOPE]) * side < 0.0:
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
    """How far from zero the tolerances of the state can leave a guard at a place of the step."""
    state_at(path, order, model.dimension, place, work.state)
    t = time_at(path, order, clock, start, pace, place)
    model.guard_gradient(transition, t, work.state, model.parameters, work.gradient)
    return error_band(method, run, work.gradient, model.dimension)


@njit(**KERNEL)
def _returns(model, run, transition, path, order, clock, start, pace, side, on_guard, work):
    """Whether the rounding of a jump has left the guard beyond zero at the start of the step."""
    if on_guard > 0:
        return False
    row = work.registers[_row_at(model, transition, path, order, clock, start, pace, 0.0, 0.0, 0.0, work)]
    slope = row[LEAST_SLOPE] if side > 0 else row[MOST_SLOPE]
    return was_left_behind(model, run, transition, start, run.y, slope, side, work)


@njit(**KERNEL)
def first_change(
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
    hidden,
    exact,
    work,
):
    """First change of sign of a guard in its transition's direction, for variables in ``[0, length]``.

    ``side`` is the sign before; for a guard that is zero at the start, it is the sign that the guard takes
    from there. Up to the place ``hidden`` its signs are noise. Returns ``(place, side after, proved)``. The
    place is ``NOWHERE`` if the guard does not change its sign before ``proved``; the step is to be cut to
    ``proved``.
    """
    direction, proved = model.direction[transition], length
    pieces, top = 0, 0
    # The last place where the guard was certain to be on its side.
    sure = 0.0
    # Where and how close the guard has come to zero: a touch, once the guard is farther from zero again.
    touch, depth = NOWHERE, math.inf
    base, tilt = 0.0, 0.0
    leaves = on_guard == JUMPING and hidden > 0.0
    if is_zero(on_guard):
        row = work.registers[_row_at(model, transition, path, order, clock, start, pace, 0.0, 0.0, 0.0, work)]
        value = 0.5 * (row[LOW_MIDDLE] + row[HIGH_MIDDLE])
        base, tilt = known_part(value, 0.5 * (row[LEAST_SLOPE] + row[MOST_SLOPE]), on_guard)
        leaves = on_guard == BY_SPEED and side_is_certain(on_guard, row[LEAST_SLOPE], row[MOST_SLOPE])
    stack = work.intervals
    stack[0, 0], stack[0, 1] = max(hidden, SETTLED * length) if on_guard > 0 else 0.0, length
    if leaves and on_guard == JUMPING:
        sure = hidden
    elif on_guard == JUMPING:
        # By rounding the state may still be before the jump.
        beyond = rounding_of_start(path, model.dimension, run.scale, clock, size_of_time(model, start), pace)
        stack[0, 0] = max(stack[0, 0], min(beyond, 0.5 * length))
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
        known = row[LOW] > -math.inf or row[HIGH] < math.inf
        rounding = WITHIN_ROUNDING * (row[HIGH_MIDDLE] - row[LOW_MIDDLE])
        bounded = -math.inf < row[LEAST_SLOPE] and row[MOST_SLOPE] < math.inf
        smooth = bounded and low < middle < high and side != 0
        turns = smooth and (row[LEAST_SLOPE] <= 0.0 if side > 0 else row[MOST_SLOPE] >= 0.0)
        short, tolerated = high - low <= SHORT_PIECE * length, 0.0
        if turns and not exact and (clear or short):
            tolerated = _tolerated(
                model, method, run, transition, path, order, clock, start, pace, middle, work
            )
        if clear and not (turns and nearest <= max(rounding, tolerated)):
            if touch != NOWHERE:
                note_touch(run, transition, touch / length, depth * side)
                touch, depth = NOWHERE, math.inf
            sure = high
            if base != 0.0 or tilt != 0.0:
                base, tilt = _still_hidden(
                    model, transition, path, order, clock, start, pace, high, side, base, tilt, work
                )
            top -= 1
            continue
        level = short or row[HIGH] - row[LOW] <= rounding
        shallow = turns and not monotone and farthest <= max(rounding, tolerated if level else 0.0)
        # If the guard's range on the piece is no wider than in its middle, halving the piece does not help.
        tells = not row[HIGH] - row[LOW] <= NO_BETTER * (row[HIGH_MIDDLE] - row[LOW_MIDDLE])
        if not tells and not row[HIGH_MIDDLE] - row[LOW_MIDDLE] < math.inf:
            # The guard has no value in the middle, but it may have one elsewhere.
            tells = _has_value(model, transition, path, order, clock, start, pace, low, work) or _has_value(
                model, transition, path, order, clock, start, pace, high, work
            )
            last = model.bound(
                model.programs, transition, path, order, clock, start, pace, middle, radius, work.registers
            )
            row = work.registers[last]
            if base != 0.0 or tilt != 0.0:
                _shifted(row, base, tilt, low, high)
        splits = low < middle < high and high - low > EPSILON * length and tells
        if splits and not (monotone or shallow):
            if pieces <= MOST_PIECES:
                stack[top, 0] = middle
                top += 1
                stack[top, 0], stack[top, 1] = low, middle
                continue
            if low > SMALL_SHARE * length:
                proved = low
                break
            run.unproved += 0 if clear else 1
        turn = high if not smooth and high < length else NOWHERE
        if turns:
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
                # The guard crosses zero and turns back: each side of the turn has one change of sign.
                stack[top, 0], high = turn, turn
                top += 1
            elif within and value < depth and (on_guard == 0 or sure > 0.0):
                touch, depth = turn, value
        top -= 1
        after = side
        if not clear:
            after = certain_sign(model, transition, path, order, clock, start, pace, high, base, tilt, work)
        if after == 0:
            # A guard without a value at the end of the piece may have changed its side before.
            divisible = low < middle < high and high - low > EPSILON * length and pieces <= MOST_PIECES
            if (
                divisible
                and not _has_value(model, transition, path, order, clock, start, pace, high, work)
                and (known or _has_value(model, transition, path, order, clock, start, pace, low, work))
            ):
                stack[top + 1, 0], stack[top + 2, 0], stack[top + 2, 1] = middle, low, middle
                top += 2
            continue
        if after != side and side != 0:
            # After a jump of the guard at the start, it may be certain of its side from this piece on only.
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
            # If the transition has just fired and its speed is uncertain, the step only shows to which side
            # its guard leaves zero.
            again = place <= SETTLED * length and (
                (has_just_fired(run, transition, on_guard) and not leaves)
                or _returns(model, run, transition, path, order, clock, start, pace, side, on_guard, work)
            )
            side = after
            if crosses_towards(direction, after) and not again:
                return place, side, length
            if not again:
                run.passed[transition] = place / length
        elif touch != NOWHERE and depth < _distance_at(
            model, transition, path, order, clock, start, pace, high, side, work
        ):
            note_touch(run, transition, touch / length, depth * side)
            touch, depth = NOWHERE, math.inf
        side, sure = after, high
        if base != 0.0 or tilt != 0.0:
            base, tilt = _still_hidden(
                model, transition, path, order, clock, start, pace, high, side, base, tilt, work
            )
    if touch != NOWHERE:
        note_touch(run, transition, touch / length, depth * side)
    return NOWHERE, side, proved


@njit(**KERNEL)
def crossing_on_path(
    model, method, run, transition, path, order, clock, start, pace, length, end, exact, work
):
    """``first_change`` from the side that the run knows; ``sampled_change`` if the guard has no program.

    ``end`` is the value of a guard at the end of the step, which the path may hold with other rounding; only
    one of the order ``BY_STEP`` needs it.
    Returns the share of the step at which the guard crosses, its side after the crossing or at the end, and
    the share of the step that is proved. The guard is no longer held to be zero at the start of the step,
    unless it rests there.
    """
    side, on_guard, hidden = run.side[transition], run.on_guard[transition], 0.0
    if on_guard == BY_STEP:
        hidden, rests = hidden_until(
            model, method, run, transition, path, order, clock, start, pace, length, end, exact, work
        )
        if rests:
            return NO_ROOT, side, 1.0
    if on_guard == JUMPING and has_just_fired(run, transition, on_guard):
        model.field(run.mode, start, run.y, model.parameters, work.field)
        _, beside, moment = signs_beside(model, run, transition, start, run.y, MOST_MOMENTS, work)
        rate = path[1, clock] if clock >= 0 else pace
        if beside == side and rate > 0.0:
            # Up to there the state may be on either side by rounding.
            hidden = min(moment / rate, 0.5 * length)
    run.on_guard[transition] = 0
    if hidden == length:
        after = 1 if end > 0.0 else (-1 if end < 0.0 else side)
        crosses = crosses_towards(model.direction[transition], after) and side * after < 0
        again = has_just_fired(run, transition, on_guard)
        return (0.0 if crosses and not again else NO_ROOT), after, 1.0
    if not has_program(model, transition):
        place, side, proved = sampled_change(
            model, run, transition, path, order, clock, start, pace, length, side, on_guard, hidden, work
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
            hidden,
            exact,
            work,
        )
    return (NO_ROOT if place == NOWHERE else place / length), side, proved / length
