"""The first event on the path of a step: cheap proofs about each guard, and its isolation where they fail.

All methods ask here. A path is a series, or the interpolant of an attempted Runge-Kutta step. A guard that is
a column of the path is a polynomial, up to the error of the method; for any other guard its own expression is
bounded on the path of the state.

Error control keeps the error of a step below the tolerances, not below the state: a state that decays below
its absolute tolerance may have either sign at the end of a step, and anything between. A change of side found
there is one of the error. So a step on which a guard changes sides, or grazes, must tell the sides at its
ends, unless the guard moves on through zero; else the step is repeated with a shorter length, on which the
error is smaller.
"""

from numba import njit

from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    guard_speed,
    guard_value,
    rounding_band,
)
from hybrid.kernels.events.onset import BY_SPEED, NO_ROOT
from hybrid.kernels.events.path import end_of, time_along, time_at
from hybrid.kernels.events.resolution import (
    UNDERFLOW,
    keep_side,
    sides_at_share,
    underflows,
)
from hybrid.kernels.guards.form import NO_COLUMN
from hybrid.kernels.guards.leading import CROSSES, ROUNDING_OF_TERMS, UNKNOWN, crossing_by_leading
from hybrid.kernels.guards.touch import forget_touches, note_touch, share_with_one_touch
from hybrid.kernels.types.codes import NO_TRANSITION
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL
from hybrid.kernels.types.task import task_of

# The signs at the ends of a step must bear so many times its estimated error.
MARGIN = 100.0
# Number of terms at the end of a series by which its error is judged: some may be zero.
TAIL_OF_GUARD = 5
# What a crossing counts that is not certain: a guard that is clear of zero on both sides of it is.
UNCERTAIN = 2


@njit(**INLINE)
def keeps_half(first, value, size):
    """A cheap proof that a polynomial on ``[0, 1]`` keeps half of its ``first`` value, from its value at 1.

    With ``size`` the sum of the magnitudes of its terms, those that take it down on the way come to
    ``(size - value) / 2``.
    """
    return first > size - value + ROUNDING_OF_TERMS * size


@njit(**INLINE)
def last_terms(series, column, order, h):
    """The sum of the magnitudes of the last terms of a series: more than all that are left out."""
    least, total, power = max(order - TAIL_OF_GUARD, 0) + 1, 0.0, 1.0
    for o in range(order, least - 1, -1):
        total = total * h + abs(series[o, column])
    for _ in range(least):
        power *= h
    return total * power


@njit(**INLINE)
def underflows_in_column(powers, column, order):
    """``underflows`` for a guard that is a column of the path."""
    return 0.0 < max(abs(powers[0, column]), abs(powers[order + 1, column])) < UNDERFLOW


@njit(**INLINE)
def keep_error(i, error, size, work):
    """Keep how far a step may be off in component ``i``, where it is more than the rounding of its size."""
    work.path_error[i] = error if error > ROUNDING_OF_STATE * EPSILON * size else 0.0


@njit(**INLINE)
def keep_error_of_series(model, path, work):
    """Keep how far the terms that a series leaves out may move the state at the end of its path."""
    series, order = path.powers, path.degree
    for i in range(model.dimension):
        keep_error(i, last_terms(series, i, order, path.length), series[order + 2, i], work)


@njit(**INLINE)
def moved_by_error(model, work):
    """How far the error of a step may move a guard with the gradient ``work.gradient``."""
    moved = 0.0
    for i in range(model.dimension):
        moved += abs(work.gradient[i]) * work.path_error[i]
    return moved


@njit(**KERNEL)
def is_clear(model, transition, t, x, work):
    """Whether a guard is farther from zero at ``x (n,)`` than the error of the step may move it."""
    value = abs(guard_value(model, transition, t, x, work.scalar))
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return not value < MARGIN * moved_by_error(model, work)


@njit(**KERNEL)
def moves_on(model, run, transition, path, work):
    """Whether a guard moves through zero much farther than the error of a step: some step finds that."""
    mode, t, later = run.mode, path.start, time_at(path, path.length)
    model.field(mode, t, run.y, model.parameters, work.field)
    before = guard_speed(model, transition, t, run.y, work.field, work.gradient)
    model.field(mode, later, work.trial, model.parameters, work.field)
    after = guard_speed(model, transition, later, work.trial, work.field, work.gradient)
    way = min(abs(before), abs(after)) * time_along(path, path.length)
    return before * after > 0.0 and way > MARGIN * moved_by_error(model, work)


@njit(**INLINE)
def is_clear_in_column(path, column):
    """Whether a guard that is a column of a series is farther from zero at both ends than its last terms.

    What is less than the rounding of all its terms is no error.
    """
    powers, order = path.powers, path.degree
    error = last_terms(powers, column, order, path.length)
    if error <= ROUNDING_OF_STATE * EPSILON * powers[order + 2, column]:
        return True
    return min(abs(powers[0, column]), abs(powers[order + 1, column])) >= MARGIN * error


@njit(**KERNEL)
def is_resolved(model, run, transition, column, path, attempted, on_guard, work):
    """Whether the error of a step leaves the sign of a guard at both of its ends alone.

    It is not asked of a guard that is zero at the start, but for a step that leaves it after a jump: the
    derivatives tell its side. An ``attempted`` step has its error in ``work.path_error``.
    """
    asked = on_guard == 0 or (attempted and on_guard == BY_SPEED and run.since_entry == 0.0)
    if not asked or (not attempted and model.degree[run.mode] > 0):
        return True
    if not attempted and column != NO_COLUMN:
        return is_clear_in_column(path, column)
    if not attempted:
        keep_error_of_series(model, path, work)
    end_of(path, model.dimension, work.trial)
    later = time_at(path, path.length)
    begins = on_guard > 0 or is_clear(model, transition, path.start, run.y, work)
    clear = begins and is_clear(model, transition, later, work.trial, work)
    return clear or moves_on(model, run, transition, path, work)


@njit(**KERNEL)
def crossing_of(task, transition, column, path, attempted):
    """Where a guard crosses, the share of the step that is proved, and whether the crossing is resolved."""
    attempts, model, method, run, _, work = task_of(task)
    if column != NO_COLUMN:
        small = underflows_in_column(path.powers, column, path.degree)
    else:
        end_of(path, model.dimension, work.trial)
        later = time_at(path, path.length)
        small = underflows(model, transition, path.start, run.y, later, work.trial, work.scalar)
    if small:
        return NO_ROOT, 1.0, True
    on_guard = run.on_guard[transition]
    if column != NO_COLUMN and on_guard <= BY_SPEED and not attempted:
        verdict, theta, certain = crossing_by_leading(model, method, run, transition, column, path, work)
        resolved = verdict != CROSSES or is_resolved(
            model, run, transition, column, path, attempted, on_guard, work
        )
        if verdict == CROSSES:
            run.crossings += 1 if certain and resolved else UNCERTAIN
            run.changes[transition] = theta
        if verdict != UNKNOWN:
            run.on_guard[transition] = 0
            return theta, 1.0, resolved
    theta, share = attempts.crossing_on_path(model, method, run, transition, column, path, work)
    run.crossings += UNCERTAIN
    return theta, share, is_resolved(model, run, transition, column, path, attempted, on_guard, work)


@njit(**KERNEL)
def leave_guard(model, run, transition, path, work):
    """Set the side of a guard to its side at the end of the path, if rounding does not hide that."""
    t = time_at(path, path.length)
    end_of(path, model.dimension, work.trial)
    value = guard_value(model, transition, t, work.trial, work.scalar)
    model.guard_gradient(transition, t, work.trial, model.parameters, work.gradient)
    if abs(value) > rounding_band(model, run, transition, t, work.trial, work):
        run.side[transition] = 1 if value > 0.0 else -1
        run.on_guard[transition] = 0


@njit(**INLINE)
def column_of(model, transition, place, attempted):
    """The column of the path that is a guard, the one at a ``place`` in its mode; or ``NO_COLUMN``."""
    held = model.affine_guard[transition] if attempted else model.guard_in_series[transition]
    return model.dimension + place if held == 1 else NO_COLUMN


@njit(**KERNEL)
def first_event(task, path, attempted, ignored, touched):
    """Earliest crossing on a path over the guards of the mode but ``ignored``, and its transition.

    The guard of ``ignored`` touches zero at the share ``touched`` of the step. Behind its powers a path has
    the values at its end, and below them what the guards among its columns are sums of there; an
    ``attempted`` Runge-Kutta step has its error in ``work.path_error``.

    Returns ``(theta, transition, proved, blurred)``, with ``(NO_ROOT, NO_TRANSITION)`` if nothing crosses
    before the share ``proved`` of the step, to which the step is to be cut. ``blurred`` is a transition whose
    guard changes sides, or grazes, on the step, although ``is_resolved`` is false for it, or none. The sides
    are brought up to date, to the event, the cut or the end, and guards that were left are no longer held to
    be zero at the start of the step; ``resolution.restore_sides`` takes that back.
    """
    _, model, _, run, _, work = task_of(task)
    mode, powers, order = run.mode, path.powers, path.degree
    earliest, fired, proved, blurred = NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION
    forget_touches(run)
    run.crossings = UNCERTAIN if attempted else 0
    first = model.first_outgoing[mode]
    for slot in range(first, model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        keep_side(run, transition)
        if transition == ignored:
            leave_guard(model, run, transition, path, work)
            note_touch(run, transition, touched, 0.0)
            continue
        column = column_of(model, transition, slot - first, attempted)
        if column != NO_COLUMN and run.on_guard[transition] <= BY_SPEED and not attempted:
            # Steps of a series are long: on none of them does a guard stay as close to zero as its error.
            side, size = run.side[transition], powers[order + 2, column]
            value, begins = powers[order + 1, column] * side, powers[0, column] * side
            if run.on_guard[transition] == BY_SPEED:
                # Its value is rounding, and its speed takes it to its side.
                size, begins = size - abs(begins), powers[1, column] * side * path.length
            if keeps_half(begins, value, size):
                run.on_guard[transition] = 0
                continue
        theta, share, resolved = crossing_of(task, transition, column, path, attempted)
        proved = min(proved, share)
        if not resolved:
            blurred = transition
        if theta < earliest:
            earliest, fired = theta, transition
    proved = min(proved, share_with_one_touch(run))
    if proved < min(earliest, 1.0):
        sides_at_share(model, run, proved, NO_TRANSITION)
    elif fired != NO_TRANSITION:
        sides_at_share(model, run, earliest, fired)
    return earliest, fired, proved, blurred
