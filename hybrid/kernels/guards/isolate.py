"""The first change of sign of a guard on a path, proved by enclosures of the guard itself.

Along a path a guard reads as a word over its certain signs, and zeros where rounding hides them. The path is
halved until on each piece the guard has one sign, or its slope or its bend keeps its sign, or the piece is as
short as rounding allows. Then the sign at the end of the piece, and that where the guard turns, tell the
word. This holds for roots of any order, for kinks and for jumps: if a guard jumps across zero, the change of
sign is at the jump.
"""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.events.guards import (
    error_band,
    gradient_band,
    guard_value,
    has_program,
    may_jump,
    rounding_band,
    size_of_time,
    was_left_behind,
)
from hybrid.kernels.events.moments import Place, sign_along
from hybrid.kernels.events.onset import AT_REST, BY_SPEED, LATER, NO_ROOT, crosses_towards, has_just_fired
from hybrid.kernels.events.path import pace_at_start, rounding_of_start
from hybrid.kernels.guards.form import (
    NO_COLUMN,
    WITHIN_ROUNDING,
    Guard,
    form_at,
    form_on,
    halves_tell_more,
    in_column,
    letter_of,
    may_turn,
    signs_are_told,
)
from hybrid.kernels.guards.roots import NOWHERE, place_of_change, place_of_turn
from hybrid.kernels.guards.touch import note_touch
from hybrid.kernels.types.kinds import INTEGER, REAL, Pair
from hybrid.kernels.types.layout import EPSILON, Method, Model, Path, Run, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported

# After this many pieces the step is cut to its proved part, if that is more than a small share of the step.
# Otherwise the signs at the ends of the pieces decide, and the run counts them as unproved.
MOST_PIECES = 3000
SMALL_SHARE = 1e-2
# The error of an interpolant is at most so many times the tolerances, which bound that of a step.
MOST_ERROR = 100.0
# A guard that leaves zero by its speed is searched from this share of the step on, at least.
AT_START = 64.0 * EPSILON


class Touch(NamedTuple):
    """Where and how close a guard has come to zero: a touch, once the guard is farther from zero again."""

    place: REAL
    depth: REAL


NO_TOUCH = Touch(NOWHERE, math.inf)


@njit(**INLINE)
def _sure_at(guard, form, side):
    """A guard that is certainly on a side at the end of a form: later roots are those of the whole guard."""
    base = guard.base
    if (form.low if side > 0 else -form.high) + base * side > 0.0:
        base = 0.0
    return Guard(guard.transition, guard.column, side, guard.on_guard, form.end, base, 0.0, guard.tolerated)


@njit(**KERNEL)
def _noted(run, path, guard, touch):
    """Note a touch, if there is one; returns that there is none any more."""
    if touch.place != NOWHERE:
        note_touch(run, guard.transition, touch.place / path.length, touch.depth * guard.side)
    return NO_TOUCH


@njit(**KERNEL)
def first_change(model, run, path, guard, first, work):
    """First change of sign of a guard in its transition's direction, on a path from the place ``first`` on.

    Returns its place, the guard after it or at the end, and what is proved. The place is ``NOWHERE`` if the
    guard does not change its sign before that; the step is to be cut to it.
    """
    length, stack, pieces, top, touch = path.length, work.intervals, 0, 0, NO_TOUCH
    transition, proved = guard.transition, True
    stack[0, 0], stack[0, 1] = first, length
    while top >= 0:
        form, side = form_on(model, path, guard, stack[top, 0], stack[top, 1], work), guard.side
        end, pieces, turns, near = form.end, pieces + 1, may_turn(form, side, path), 0.0
        if turns:
            near = max(guard.tolerated, WITHIN_ROUNDING * (form.high_middle - form.low_middle))
        clear = letter_of(form, max(guard.radius, near))
        if clear != 0 and (clear == side or side == 0):
            touch, top = _noted(run, path, guard, touch), top - 1
            guard = _sure_at(guard, form, clear)
            continue
        if -guard.radius <= form.low and form.high <= guard.radius:
            top -= 1
            continue
        if not signs_are_told(model, path, guard, form, work) and halves_tell_more(
            model, path, guard, form, work
        ):
            if pieces <= MOST_PIECES:
                middle = 0.5 * (form.start + end)
                stack[top, 0], stack[top + 1, 0], stack[top + 1, 1] = middle, form.start, middle
                top += 1
                continue
            if form.start > SMALL_SHARE * length:
                _noted(run, path, guard, touch)
                return NOWHERE, guard, form.start
            if proved and letter_of(form, guard.radius) != side:
                run.unproved[transition], proved = run.unproved[transition] + 1, False
        top -= 1
        turn = place_of_turn(model, path, guard, form, work) if turns else NOWHERE
        if turn != NOWHERE:
            at = form_at(model, path, guard, turn, work)
            value, rounding = 0.5 * (at.low + at.high) * side, 0.5 * (at.high - at.low)
            if value < -rounding and form.start < turn < end:
                # The guard crosses zero and turns back: each side of the turn has one change of sign.
                top += 1
                stack[top, 0], stack[top, 1], end = turn, end, turn
            elif value <= max(near, rounding) and value < touch.depth and guard.radius == 0.0:
                touch = Touch(turn, value)
        at = form_at(model, path, guard, end, work)
        after = letter_of(at, guard.radius)
        if after == 0:
            # A guard that has left zero, and returns to it at the end, is certain of its side on the way.
            at = form_at(model, path, guard, 0.5 * (form.start + end), work)
            if letter_of(at, guard.radius) * side > 0:
                guard = _sure_at(guard, at, side)
            continue
        if after != side and side != 0:
            place = place_of_change(model, path, guard, form, end, work)
            again = place == 0.0 and has_just_fired(run, transition, guard.on_guard)
            guard, touch = _sure_at(guard, at, after), NO_TOUCH
            if not again:
                if crosses_towards(model.direction[transition], after):
                    return place, guard, length
                run.changes[transition] = place / length
            continue
        if touch.place != NOWHERE and touch.depth < min(abs(at.low), abs(at.high)):
            touch = _noted(run, path, guard, touch)
        guard = _sure_at(guard, at, after)
    _noted(run, path, guard, touch)
    return NOWHERE, guard, length


@njit(**INLINE)
def _leaving_by_speed(guard, at):
    """A guard that leaves zero by its speed: what its form ``at`` the start has is rounding."""
    base = 0.5 * (at.low_middle + at.high_middle)
    return Guard(guard.transition, guard.column, guard.side, BY_SPEED, 0.0, base, 0.0, guard.tolerated)


@njit(**KERNEL)
def _later(model, run, path, guard, noise, work):
    """A guard that leaves zero without speed, or not, and from where its signs count.

    The flow may tell its side from a moment on. A guard that jumps is never small: its signs are no noise.
    """
    transition, t, sure, first = guard.transition, path.start, 0.0, AT_START * path.length
    jumps = may_jump(model, run, transition, t, run.y, work)
    if guard.on_guard == LATER:
        model.field(run.mode, t, run.y, model.parameters, work.field)
        towards, moment, _ = sign_along(model, run, transition, Place(run.mode, t, run.y), 1.0, work)
        pace = pace_at_start(path)
        if towards == guard.side and pace > 0.0:
            sure = moment / pace
        elif jumps:
            # By rounding the state may still be before the jump.
            beyond = rounding_of_start(path, model.dimension, run.scale, size_of_time(model, t))
            first = max(first, min(beyond, 0.5 * path.length))
    guard = Guard(
        transition,
        guard.column,
        guard.side,
        guard.on_guard,
        sure,
        0.0,
        0.0 if jumps else noise,
        guard.tolerated,
    )
    return guard, max(first, sure)


@njit(**KERNEL)
def _at_start(model, method, run, path, transition, column, work):
    """A guard with what is known of it at the start of a step (``onset``), and from where its signs count."""
    side, on_guard, t = run.side[transition], run.on_guard[transition], path.start
    model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
    error = in_column(path, column, error_band(method, run, work.gradient, model.controlled))
    tolerated = error
    if path.exact:
        # The program of a guard shows what rounding of the state does to it, a column does not.
        tolerated = (
            0.0
            if column == NO_COLUMN
            else in_column(path, column, gradient_band(model, run, t, work.gradient))
        )
    guard = Guard(transition, column, side, on_guard, 0.0, 0.0, 0.0, tolerated)
    if on_guard == 0 and guard_value(model, transition, t, run.y, work.scalar) * side >= 0.0:
        return guard, 0.0
    at = form_at(model, path, guard, 0.0, work)
    rounding = in_column(path, column, rounding_band(model, run, transition, t, run.y, work))
    if on_guard == 0:
        # By the rounding of a jump the guard may have been left beyond zero: it returns.
        slope = at.least_slope if side > 0 else at.most_slope
        returns = was_left_behind(model, run, transition, t, run.y, slope, side, work)
        return (_leaving_by_speed(guard, at), AT_START * path.length) if returns else (guard, 0.0)
    rooted = path.root > 1 and column != NO_COLUMN
    if on_guard == BY_SPEED:
        return _leaving_by_speed(guard, at), AT_START * path.length
    # On an exact path noise is rounding, if no method that is not exact has led to its start. So is that of a
    # root, which grows like the variable.
    exact = max(abs(at.low), abs(at.high)) <= rounding if path.exact else rooted
    return _later(model, run, path, guard, rounding if exact else rounding + MOST_ERROR * error, work)


@exported(Pair(REAL), Model, Method, Run, INTEGER, INTEGER, Path, Work)
def crossing_on_path(model, method, run, transition, column, path, work):
    """``first_change`` from the side that the run knows.

    ``column`` is that of the guard on the path, or ``NO_COLUMN``. Returns the share of the step at which the
    guard crosses, and the share that is proved. The run knows then the side before the crossing, or at the
    end, and where it has changed before; the guard is no longer held to be zero at the start of the step,
    unless it stays there: it leaves zero on a later step.
    """
    on_guard = run.on_guard[transition]
    guard, first = _at_start(model, method, run, path, transition, column, work)
    if column == NO_COLUMN and not has_program(model, transition):
        run.unproved[transition] += 1
    place, guard, proved = first_change(model, run, path, guard, first, work)
    hidden = place == NOWHERE and on_guard > 0 and (guard.radius > 0.0 or guard.sure == 0.0)
    if hidden and on_guard != AT_REST:
        return NO_ROOT, 1.0
    if hidden:
        # The error of an interpolant hides what the end of its step, from which the run goes on, tells.
        model.guard_gradient(transition, path.start, run.y, model.parameters, work.gradient)
        rounding = rounding_band(model, run, transition, path.start, run.y, work)
        after = letter_of(form_at(model, path, guard, path.length, work), in_column(path, column, rounding))
        if after == 0:
            return NO_ROOT, 1.0
        if after * guard.side < 0 and crosses_towards(model.direction[transition], after):
            place = NOWHERE if has_just_fired(run, transition, on_guard) else 0.0
        guard = _sure_at(guard, form_at(model, path, guard, path.length, work), after)
    theta, passed = (NO_ROOT if place == NOWHERE else place / path.length), run.changes[transition]
    run.on_guard[transition] = 0
    run.side[transition] = guard.side if theta == NO_ROOT else -guard.side
    if passed < NO_ROOT and (theta < NO_ROOT or run.side_before[transition] != 0):
        run.changes[transition] = 0.5 * (passed + min(theta, 1.0))
    else:
        run.changes[transition] = theta
    return theta, proved / path.length
