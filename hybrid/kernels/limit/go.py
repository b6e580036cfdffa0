"""The limit of a chatter: whether jumps accumulate before the end of a run, and the jump to where they do.

Most runs never get there, so the driver asks ``may_accumulate`` first.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import forward, measured_time
from hybrid.kernels.arithmetic.slopes import spread_of_rate
from hybrid.kernels.events.guards import (
    guard_speed,
    guard_value,
    has_program,
    may_jump,
    rounding_band,
    size_of_time,
)
from hybrid.kernels.events.moments import speed_rounding
from hybrid.kernels.events.onset import crosses_towards
from hybrid.kernels.events.sides import mode_of_limit
from hybrid.kernels.guards.form import NO_COLUMN, Guard
from hybrid.kernels.guards.isolate import first_change
from hybrid.kernels.guards.roots import NOWHERE
from hybrid.kernels.jumps.jump import assume_sizes, carry_tangents, go_onward, move
from hybrid.kernels.jumps.locked import keep_map, keep_tangents
from hybrid.kernels.jumps.past import fired_before, follows_impact, time_between
from hybrid.kernels.jumps.record import remember_flight, remember_jump
from hybrid.kernels.jumps.rest import RESOLVED, ROUNDED
from hybrid.kernels.limit.endless import hold_endless, may_be_held
from hybrid.kernels.limit.impacts import extrapolate_impacts, series_of_impacts
from hybrid.kernels.limit.meeting import hides_next_round, may_be_mapped, meeting_matrix
from hybrid.kernels.limit.rounds import (
    FEWEST_JUMPS,
    NO_SERIES,
    Series,
    extrapolate_rounds,
    fewest_jumps,
    rounding_of_landing,
    series_of_rounds,
    sizes_of_visits,
    state_is_known,
    still_changes,
)
from hybrid.kernels.limit.tangent import drift_is_known, limit_matrix
from hybrid.kernels.types.codes import ENDLESS, LIMIT, LIMIT_OF_CHATTER, NO_MODE, NO_TRANSITION
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import Path, Task
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.task import task_of

# The guards of a round are landed on in turn, so many times: once is enough if no two read one component.
SWEEPS = 3


@njit(**KERNEL)
def may_accumulate(model, run, transition):
    """Whether ``finish_chatter`` may have something to do after a jump; cheap, and seldom true in vain.

    Ticks of a clock never come closer to each other.
    """
    if model.clock[transition] != 0:
        return False
    if run.mode == run.previous_mode and model.marker[transition] == 0:
        return True
    return run.jumps_here > FEWEST_JUMPS or series_of_rounds(model, run).turn > 0


@njit(**KERNEL)
def known_limit(model, method, run, transition, work):
    """The series of jumps whose limit is known, as ``work.settled (n,)``; none if there is none yet.

    Two estimates of time and state agree up to the tolerances and what the rounding of a landing hides: it is
    magnified by the sum of the series and by the rounding of its ratio, but it hides no more than the last
    round.
    """
    series = NO_SERIES
    if run.mode == run.previous_mode and model.marker[transition] == 0:
        series = series_of_impacts(model, run, transition, work)
    impacts = series.turn > 0
    if not impacts:
        series = series_of_rounds(model, run)
    turn, left, before = series.turn, series.left, run.trail[LIMIT]
    if turn == 0:
        return series
    # In the next round landings are slower, so that rounding moves them by more.
    # The length of a flight keeps the digits that a late time has lost; that of a round does not.
    time = measured_time(model, run, run.mode) if impacts else abs(run.phase)
    landing, next_round = rounding_of_landing(model, run, time, work), series.ratio**2 * series.latest
    hidden = min(landing / (1.0 - series.ratio) ** 2, series.latest)
    lasted = time_between(model, run, 0, min(series.jumps, run.visits.shape[0]) - 1)
    if still_changes(series) * abs(series.shift) > method.rtol * lasted + hidden:
        before[0] = math.inf
        return NO_SERIES
    if impacts:
        extrapolate_impacts(model, run, transition, left, work)
    else:
        extrapolate_rounds(model, run, turn, turn, before)
        extrapolate_rounds(model, run, turn, 0, work.settled)
    hold_endless(model, run, turn, left, work)
    known = state_is_known(model, method, run, series, hidden, work)
    for i in range(model.dimension):
        before[i] = work.settled[i]
    visible = left > RESOLVED * lasted and landing < RESOLVED * next_round
    if visible and series.jumps < fewest_jumps(turn):
        return NO_SERIES
    # Where the next round cannot be resolved, there will be no better estimate.
    return series if known or landing >= next_round else NO_SERIES


@njit(**KERNEL)
def series_at_rest(model, run, work):
    """The series of the jumps at one instant, whatever their order; their limit is where the state is.

    So ends a chatter whose flights shorten without a steady ratio, such as that of two balls on a floor that
    take turns in varying order: its last jumps happen within the rounding of time. A round is the shortest
    recent window that holds every recent transition.
    """
    if run.jumps_here <= FEWEST_JUMPS:
        return NO_SERIES
    turn = 1
    for back in range(1, min(run.jumps, run.recent.shape[0])):
        known = False
        for later in range(back):
            known = known or fired_before(run, later) == fired_before(run, back)
        turn = turn if known else back + 1
    sizes, clock = work.trial, size_of_time(model, run.phase)
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    sizes_of_visits(model, run, run.visits.shape[0], sizes)
    for i in range(model.dimension):
        work.settled[i] = run.y[i]
        sizes[i] += clock * abs(work.field[i])
    hold_endless(model, run, turn, 0.0, work)
    return Series(turn, run.jumps_here, 0.0, 0.0, 0.0, 0.0)


@njit(**KERNEL)
def stands_still(model, run, transition, t, x, share, work):
    """Whether a guard's speed at ``x (n,)`` is rounding, or a ``share`` of what the sizes make of it."""
    n, moved = model.dimension, work.new
    model.field(run.mode, t, x, model.parameters, work.field)
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    fastest = speed_rounding(model, run, transition, run.mode, t, x, work)
    for i in range(n):
        moved[i] = share * work.trial[i]
    for i in range(n):
        fastest += abs(work.gradient[i]) * spread_of_rate(model, run.mode, i, work.jacobian, moved)
    return abs(speed) <= fastest


@njit(**KERNEL)
def is_limit(model, run, turn, left, share, work):
    """Whether a round of jumps from ``work.settled`` finds the state on each guard, and leads back to it.

    Up to a ``share`` of the sizes of the components in ``work.trial``, and but for counters. A state that
    is there already, at this instant, has come to rest at the guards.
    """
    n, t, place, sizes = model.dimension, run.phase + left, work.error, work.trial
    for i in range(n):
        place[i] = work.settled[i]
    for back in range(turn - 1, -1, -1):
        transition = fired_before(run, back)
        value = guard_value(model, transition, t, place, work.scalar)
        model.guard_gradient(transition, t, place, model.parameters, work.gradient)
        size = abs(work.gradient[n] * t)
        for i in range(n):
            size += abs(work.gradient[i]) * sizes[i]
        if left == 0.0 and not stands_still(model, run, transition, t, place, share, work):
            return False
        near = abs(value) <= share * size + rounding_band(model, run, transition, t, place, work)
        # A guard that jumps across zero is small on neither side of its jump.
        if not (near or may_jump(model, run, transition, t, place, work)):
            return False
        model.reset(transition, t, place, model.parameters, work.state)
        for i in range(n):
            place[i] = work.state[i]
    for i in range(n):
        moves = not abs(place[i] - work.settled[i]) <= share * sizes[i]
        if moves and run.trail[ENDLESS, i] == 0.0:
            return False
    return True


@njit(**KERNEL)
def takes_turns(model, run, transition, turn):
    """Whether a transition's guard is that of one of the last ``turn`` jumps."""
    for back in range(turn):  # noqa: SIM110 (no generators in kernels)
        if model.surface[fired_before(run, back)] == model.surface[transition]:
            return True
    return False


@njit(**KERNEL)
def way_is_free(model, method, run, turn, span, work):
    """Whether no other guard is crossed on the straight way from the state to ``work.settled (n,)``.

    The last ``turn`` jumps are those that accumulate, ``span`` is the time that the way takes. If another
    guard is crossed before the limit, the jumps do not reach that limit. Nor do they if the last reset has
    crossed another guard, whose transition is due.
    """
    t, path = run.phase, work.path
    for i in range(model.dimension):
        path[0, i], path[1, i] = run.y[i], work.settled[i] - run.y[i]
    for slot in range(model.first_outgoing[run.mode], model.first_outgoing[run.mode + 1]):
        other = model.outgoing[slot]
        if takes_turns(model, run, other, turn):
            continue
        value = guard_value(model, other, t, run.y, work.scalar)
        model.guard_gradient(other, t, run.y, model.parameters, work.gradient)
        if abs(value) <= rounding_band(model, run, other, t, run.y, work):
            continue
        side = 1 if value > 0.0 else -1
        turned = run.mode == run.previous_mode and run.side[other] == -side
        if run.due[other] == 1 or (turned and crosses_towards(model.direction[other], side)):
            return False
        if has_program(model, other):
            way = Path(path, 1, -1, t, span, 1.0, True, 1)
            guard = Guard(other, NO_COLUMN, side, 0, 0.0, 0.0, 0.0, 0.0)
            place, _, _ = first_change(model, run, way, guard, 0.0, work)
            crossed = place != NOWHERE
        else:
            end = guard_value(model, other, t + span, work.settled, work.scalar)
            crossed = end * side <= 0.0 and crosses_towards(model.direction[other], -side)
        if crossed:
            return False
    return True


@njit(**KERNEL)
def next_in_turn(model, run, turn):
    """The transition that would fire next; none if another transition names the mode of the limit."""
    following = fired_before(run, turn - 1)
    if model.accumulates_to[following] != NO_MODE:
        return following
    for back in range(turn):
        if model.accumulates_to[fired_before(run, back)] != NO_MODE:
            return NO_TRANSITION
    return following


@njit(**KERNEL)
def forget_tangents(task):
    """Make the tangent map of the limit unknown, and with it the tangent vectors."""
    model, run, work, tangents = task.model, task.run, task.work, task.tangents
    n = model.dimension
    for i in range(n):
        run.instant[i] = math.nan
        for j in range(n):
            work.saltation[i, j] = math.nan
    if tangents > 0:
        run.singular_jumps += 1


@njit(**KERNEL)
def land_on_guards(model, turn, t, run, work):
    """Move the limit ``work.settled (n,)`` of the last ``turn`` jumps onto their guards, to first order.

    Extrapolation leaves it beside them by its rounding. The components move in proportion to the squares of
    their sizes in ``work.trial``, so that units do not matter.
    """
    n, x, sizes = model.dimension, work.settled, work.trial
    for _ in range(SWEEPS):
        for back in range(turn):
            transition = fired_before(run, back)
            if may_jump(model, run, transition, t, x, work):
                continue
            value = guard_value(model, transition, t, x, work.scalar)
            model.guard_gradient(transition, t, x, model.parameters, work.gradient)
            total = 0.0
            for i in range(n):
                total += (work.gradient[i] * sizes[i]) ** 2
            for i in range(n if total > 0.0 else 0):
                x[i] -= value * work.gradient[i] * sizes[i] ** 2 / total


@njit(**KERNEL)
def go_to_limit(task, series, transition):
    """Go to the limit ``work.settled`` of a series, whose next jump would be that ``transition``.

    The limit is a jump of its own, into the mode that the transition names, if it names one. Its tangent map
    is known for impacts on one guard, and for rounds between two guards that keep the state. Returns false,
    and does nothing, if later jumps tell it better.
    """
    _, model, method, run, record, work = task_of(task)
    n, tangents, turn, left = model.dimension, task.tangents, series.turn, series.left
    alone = turn == 1 and left > 0.0 and follows_impact(model, run)
    if not alone:
        land_on_guards(model, turn, run.phase + left, run, work)
    target, onward = mode_of_limit(model, run, transition, run.phase + left, work.settled, work)
    if alone and tangents > 0 and not drift_is_known(model, run, transition, left, work):
        return False
    named = model.accumulates_to[transition] != NO_MODE
    mapped = tangents > 0 and named and may_be_mapped(model, run, turn)
    if mapped and left > 0.0 and not hides_next_round(model, method, run, series, work):
        return False
    if not may_be_held(model, run, turn, left):
        return False
    if alone:
        limit_matrix(model, method, run, transition, target, left, work)
    elif not (mapped and meeting_matrix(model, run, turn, target, left, work)):
        forget_tangents(task)
    if left > 0.0:
        remember_flight(run, record, n, left, work.settled)
    keep_tangents(run, n, tangents)
    keep_map(run, n, work)
    forward(run, model.period, left)
    remember_jump(run, record, transition, 0.0, LIMIT_OF_CHATTER, True, work.settled, work)
    if tangents > 0:
        assume_sizes(model, work)
        carry_tangents(model, run, tangents, task.orthonormal != 0, False, work)
    run.round = turn
    move(model, run, transition, target, work.settled)
    go_onward(run, onward)
    return True


@njit(**KERNEL)
def follow_series(task, series, share, remaining):
    """Go to where a series leads, if that is its limit and before the end of the run; whether it did."""
    _, model, method, run, _, work = task_of(task)
    turn, left = series.turn, series.left
    if turn == 0 or left > remaining or not is_limit(model, run, turn, left, share, work):
        return False
    following = next_in_turn(model, run, turn)
    if following == NO_TRANSITION or not way_is_free(model, method, run, turn, left, work):
        return False
    return go_to_limit(task, series, following)


@exported(TRUTH, Task, INTEGER, REAL)
def finish_chatter(task, transition, remaining):
    """After a jump: go to the limit if jumps accumulate before the end of the run; returns whether it did."""
    _, model, method, run, _, work = task_of(task)
    if follow_series(task, known_limit(model, method, run, transition, work), RESOLVED, remaining):
        return True
    return follow_series(task, series_at_rest(model, run, work), ROUNDED, remaining)
