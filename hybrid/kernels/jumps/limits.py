"""Limits of chatter: whether jumps accumulate before the end of a run, and the jump to where they do.

Most runs never get there, so the driver asks ``may_accumulate`` first.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import forward
from hybrid.kernels.arithmetic.slopes import whole_jacobian
from hybrid.kernels.events.sides import mode_of_limit
from hybrid.kernels.jumps.chatter import (
    accumulation,
    add_change_of_duration,
    chatter_matrix,
)
from hybrid.kernels.jumps.drift import (
    BRIEF,
    drift,
    drift_is_known,
    feedback,
    rounding_of_tangents,
)
from hybrid.kernels.jumps.endless import may_be_held
from hybrid.kernels.jumps.jump import assume_sizes, carry_tangents, go_onward, move
from hybrid.kernels.jumps.locked import (
    begin_instant,
)
from hybrid.kernels.jumps.record import remember_flight, remember_jump
from hybrid.kernels.jumps.rounds import (
    limit_of_rounds,
    next_in_turn,
    shortens,
    transitions_in_turn,
)
from hybrid.kernels.jumps.skipped import MANY_AT_ONCE, has_come_to_rest, jumps_in_turn, way_is_free
from hybrid.kernels.types.codes import (
    LIMIT_OF_CHATTER,
    NO_TRANSITION,
)
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import Task
from hybrid.kernels.types.options import KERNEL, exported
from hybrid.kernels.types.task import task_of


@njit(**KERNEL)
def may_accumulate(model, run, transition):
    """Whether ``finish_chatter`` may have something to do after a jump; cheap, and seldom true in vain."""
    if run.mode == run.previous_mode and model.marker[transition] == 0:
        return True
    if run.jumps_here >= MANY_AT_ONCE:
        return True
    return shortens(model, run) and transitions_in_turn(model, run) > 0


@njit(**KERNEL)
def follow_impacts(task, transition, remaining):
    """``finish_chatter`` for impacts of one transition on one guard, with the tangent map."""
    _, model, method, run, record, work = task_of(task)
    tangents = task.tangents
    if run.mode != run.previous_mode or model.marker[transition] == 1:
        return False
    if not 0.0 < run.restitution < 1.0:
        run.chattering = 0
        return False
    span = accumulation(model, method, run, transition, run.stay[run.mode], work)
    if not 0.0 < span <= remaining:
        return False
    x_limit = work.settled
    target, onward = mode_of_limit(model, run, transition, run.phase + span, x_limit, work)
    steep, noise = 0.0, 0.0
    if tangents > 0:
        noise = rounding_of_tangents(model, run, transition, span, work)
        if not drift_is_known(model, run, target, span, noise, work):
            return False
        steep = span * feedback(work.jacobian, model.dimension)
    if not way_is_free(model, method, run, 1, span, work):
        return False
    chatter_matrix(model, run, transition, work)
    apart = add_change_of_duration(model, method, run, target, span, work)
    # Tangent vectors along the mean field have an error of third order.
    if apart and steep > max(BRIEF, noise ** (1.0 / 3.0)):
        return False
    if not may_be_held(model, run, 1, span):
        return False
    remember_flight(run, record, model.dimension, span, x_limit)
    begin_instant(run, model.dimension, tangents, work)
    forward(run, model.period, span)
    remember_jump(run, record, transition, 0.0, LIMIT_OF_CHATTER, True, x_limit, work)
    if tangents > 0:
        n = model.dimension
        assume_sizes(n, work)
        carry_tangents(model, run, tangents, task.orthonormal != 0, False, work)
        if not apart:
            whole_jacobian(model, target, run.phase, x_limit, work.jacobian)
            drift(run.y, n, tangents, work.jacobian, span, work.state, work.field)
            drift(run.instant, n, n, work.jacobian, span, work.state, work.field)
    run.round = 1
    move(model, run, transition, target, x_limit)
    go_onward(run, onward)
    return True


@njit(**KERNEL)
def follow_rounds(task, remaining):
    """``finish_chatter`` for transitions that fire in turn; the tangent map of their limit is not known."""
    _, model, method, run, _, work = task_of(task)
    left, turn = limit_of_rounds(model, method, run, work)
    if not 0.0 < left <= remaining or not way_is_free(model, method, run, turn, left, work):
        return False
    return go_to_limit(task, turn, left)


@njit(**KERNEL)
def follow_to_rest(task):
    """``finish_chatter`` for jumps without a steady ratio, once the state has come to rest at one instant."""
    _, model, method, run, _, work = task_of(task)
    if run.jumps_here < MANY_AT_ONCE:
        return False
    turn = jumps_in_turn(run)
    for i in range(model.dimension):
        work.settled[i] = run.y[i]
    if not has_come_to_rest(model, run, turn, work.settled, work):
        return False
    return way_is_free(model, method, run, turn, 0.0, work) and go_to_limit(task, turn, 0.0)


@njit(**KERNEL)
def go_to_limit(task, turn, left):
    """Go to the limit ``work.settled`` of the last ``turn`` jumps, reached after the time ``left``.

    Returns false, and does nothing, if a later jump of the round names the mode of the limit.
    """
    _, model, _, run, record, work = task_of(task)
    n, tangents = model.dimension, task.tangents
    transition = next_in_turn(model, run, turn)
    if transition == NO_TRANSITION:
        return False
    if not may_be_held(model, run, turn, left):
        return False
    target, onward = mode_of_limit(model, run, transition, run.phase + left, work.settled, work)
    if left > 0.0:
        remember_flight(run, record, n, left, work.settled)
    for i in range(n):
        for j in range(n):
            work.saltation[i, j] = math.nan
    forward(run, model.period, left)
    remember_jump(run, record, transition, 0.0, LIMIT_OF_CHATTER, True, work.settled, work)
    if tangents > 0:
        run.singular_jumps += 1
        run.log_determinant = math.nan
        for i in range(n, n * (1 + tangents)):
            run.y[i] = math.nan
    begin_instant(run, n, tangents, work)
    for j in range(n):
        run.instant[j] = math.nan
    run.round = turn
    move(model, run, transition, target, work.settled)
    go_onward(run, onward)
    return True


@exported(TRUTH, Task, INTEGER, REAL)
def finish_chatter(task, transition, remaining):
    """After a jump: go to the limit if jumps accumulate before the end of the run; returns whether it did.

    The limit is a jump of its own, into the mode that the transition names, if it names one.
    """
    if follow_impacts(task, transition, remaining) or follow_rounds(task, remaining):
        return True
    return follow_to_rest(task)
