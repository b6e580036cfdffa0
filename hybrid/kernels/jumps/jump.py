"""The jump: reset, saltation matrix, tangent vectors."""

import math

from numba import njit

from hybrid.kernels.arithmetic.tangent import (
    STRAINED,
    log_abs_determinant,
    multiply,
    orthonormalise,
    strain,
)
from hybrid.kernels.events.guards import (
    carry_rounding,
    error_band,
    guard_acceleration,
    guard_speed,
)
from hybrid.kernels.events.sides import mode_of_limit
from hybrid.kernels.events.surface import jumps_across
from hybrid.kernels.jumps.locked import (
    begin_at_start,
    change_of_instant,
    follow,
    keep_map,
    keep_tangents,
    map_of_instant,
    postpone_map,
    restore_tangents,
)
from hybrid.kernels.jumps.past import follows_impact, impulse_of, remember_visit, slot_of
from hybrid.kernels.jumps.record import remember_jump
from hybrid.kernels.jumps.rest import rest_matrix
from hybrid.kernels.jumps.steep import hides_roots, look_for_roots, note_steep
from hybrid.kernels.types.codes import (
    ENTERING,
    GRAZING,
    IMPULSE,
    NO_MODE,
    NO_TRANSITION,
    TRANSVERSE,
)
from hybrid.kernels.types.kinds import INTEGER, REAL, VECTOR
from hybrid.kernels.types.layout import Model, Task, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported
from hybrid.kernels.types.task import task_of


@njit(**KERNEL)
def cross(model, transition, before, behind, t, x_minus, x_plus, work):
    """The state after the jump into ``x_plus (n,)``, and all terms of its saltation matrix.

    ``before`` and ``behind`` are the numbers of the fields on the two sides.

    ``D_x R`` and ``D_t R`` into ``work.reset_jacobian``, ``f_plus - D_x R f_minus - D_t R`` into
    ``work.settled``; returns the transversality. After a transition that ends the run the state stays where
    it is, ``f_plus = 0``.
    """
    n = model.dimension
    model.field(before, t, x_minus, model.parameters, work.field)
    transversality = guard_speed(model, transition, t, x_minus, work.field, work.gradient)
    model.reset(transition, t, x_minus, model.parameters, x_plus)
    model.reset_jacobian(transition, t, x_minus, model.parameters, work.reset_jacobian)
    for i in range(n):
        work.field_after[i] = 0.0
    if behind != NO_MODE:
        model.field(behind, t, x_plus, model.parameters, work.field_after)
    for i in range(n):
        difference = work.field_after[i] - work.reset_jacobian[i, n]
        for j in range(n):
            difference -= work.reset_jacobian[i, j] * work.field[j]
        work.settled[i] = difference
    return transversality


@exported(REAL, Model, INTEGER, REAL, VECTOR, VECTOR, Work)
def saltation(model, transition, t, x_minus, x_plus, work):
    """Saltation matrix into ``work.saltation (n, n)`` and the state after the jump into ``x_plus (n,)``.

    ``Xi = D_x R + (f_plus - D_x R f_minus - D_t R) D_x g / (D_t g + D_x g f_minus)``, with all time terms
    (Kong, Payne, Zhu and Johnson 2024, arXiv:2306.06862). Returns the transversality, the denominator. Where
    that is zero, or the guard jumps, the matrix holds ``D_x R`` alone if the fields agree, else infinities.
    The sizes of the terms of each entry go to ``work.sizes``.
    """
    n = model.dimension
    before, behind = model.field_before[transition], model.field_behind[transition]
    transversality = cross(model, transition, before, behind, t, x_minus, x_plus, work)
    jumps = jumps_across(model, transition, t, x_minus, work)
    for i in range(n):
        moves, terms = work.settled[i] != 0.0, abs(work.field_after[i]) + abs(work.reset_jacobian[i, n])
        for j in range(n if moves else 0):
            terms += abs(work.reset_jacobian[i, j] * work.field[j])
        kick, terms = work.settled[i] / transversality, terms / abs(transversality)
        for j in range(n):
            work.saltation[i, j] = work.reset_jacobian[i, j]
            work.sizes[i, j] = abs(work.reset_jacobian[i, j])
            if moves and jumps:
                work.saltation[i, j] = work.sizes[i, j] = math.inf
            elif moves and work.gradient[j] != 0.0:
                work.saltation[i, j] += kick * work.gradient[j]
                work.sizes[i, j] += terms * abs(work.gradient[j])
    return transversality


@njit(**KERNEL)
def largest_entry(model, work):
    """The largest entry of ``work.saltation``, but for the rows and columns of counters."""
    largest = 0.0
    for i in range(model.controlled):
        for j in range(model.controlled):
            largest = max(largest, abs(work.saltation[i, j]))
    return largest


@njit(**KERNEL)
def assume_sizes(model, work):
    """Assume that the entries of ``work.saltation`` are made up of terms as large as its largest entry."""
    largest = largest_entry(model, work)
    for i in range(model.dimension):
        for j in range(model.dimension):
            work.sizes[i, j] = largest


@njit(**KERNEL)
def carry_tangents(model, run, tangents, orthonormal, apart, work):
    """Multiply the tangent vectors by ``work.saltation``, and add its log-determinant to the run's.

    ``work.sizes`` holds the sizes of the terms that made up its entries.

    With ``orthonormal`` they are orthonormalised before and after where the matrices since the last time
    strain them, so that a direction that one annihilates is told from one that is merely short; with
    ``apart`` too, and then what the jump alone added to the growth of the first is returned, else 0.
    """
    n = model.dimension
    for i in range(n):
        for j in range(n):
            work.jacobian[i, j] = work.saltation[i, j]
            work.reset_jacobian[i, j] = work.sizes[i, j]
    log_determinant, annihilated = log_abs_determinant(work.jacobian, work.reset_jacobian, n)
    run.log_determinant += log_determinant
    run.strain += strain(work.saltation, model.controlled, log_determinant)
    anew = orthonormal and (apart or not run.strain < STRAINED)
    if anew:
        run.indistinct += orthonormalise(run.y, n, tangents, run.growth, work.jacobian, False, 0)
        for c in range(tangents):
            for i in range(n):
                work.jacobian[c, i] = 0.0
                for j in range(n):
                    work.jacobian[c, i] += work.sizes[i, j] * abs(run.y[n * (1 + c) + j])
    before = run.growth[0]
    multiply(work.saltation, run.y, n, tangents, work.state, work.rounding)
    if not anew:
        return 0.0
    run.indistinct += orthonormalise(run.y, n, tangents, run.growth, work.jacobian, True, annihilated)
    run.strain = 0.0
    return run.growth[0] - before


@njit(**INLINE)
def ends_own_flight(model, run, transition, transversality):
    """Whether an impact ends the flight that the last one began, at least half as fast.

    A low bounce is no grazing: all orbits nearby hit the guard too, because the pull leads them back to it.
    """
    began = run.restitution * abs(run.last_transversality)
    return run.last_fired == transition and follows_impact(model, run) and 2.0 * abs(transversality) >= began


@njit(**KERNEL)
def is_grazing(model, method, run, transition, transversality, work):
    """Whether the guard dips to the other side of zero by less than the tolerances can tell.

    The depth of the dip is ``speed^2 / (2 acceleration)``; it lies ahead if the guard turns back, and behind
    if it comes from there. The saltation matrix is then an extrapolation of a square root from beside its
    branch point.
    """
    acceleration = guard_acceleration(model, run, transition, run.mode, run.phase, run.y, work)
    band = error_band(method, run, work.gradient, model.controlled)
    if transversality * transversality <= 2.0 * abs(acceleration) * band:
        return not jumps_across(model, transition, run.phase, run.y, work)
    # Inside such a dip the steps are as short as the dip, and so are the sizes that the tolerances refer to.
    way_in = run.last_transversality
    grazed = run.last_kind == GRAZING and run.last_fired == transition
    return grazed and way_in * transversality < 0.0 and abs(transversality) <= 2.0 * abs(way_in)


@njit(**KERNEL)
def judge(run, largest):
    """Store the largest entry of all saltation matrices so far, and count those that are not finite."""
    run.largest_saltation = max(run.largest_saltation, largest)
    if not largest < math.inf:
        run.singular_jumps += 1


@njit(**KERNEL)
def move(model, run, transition, target, x_plus):
    """Move the run past a jump: state, mode and counters."""
    for i in range(model.dimension):
        run.y[i] = x_plus[i]
        run.scale[i] = max(run.scale[i], abs(x_plus[i]))
    here = run.last_jump_phase == run.phase and run.last_jump_cycle == run.cycle
    run.jumps_here = run.jumps_here + 1 if here else 1
    run.last_jump_phase = run.phase
    run.last_jump_cycle = run.cycle
    run.recent[slot_of(run, run.jumps)] = transition
    run.jumps += 1
    run.fires[transition] += 1
    run.last_fired = transition
    run.stay[run.mode], run.since_entry = run.since_entry, 0.0
    run.previous_mode = run.mode
    run.mode = target
    run.stage, run.clear, run.distant = ENTERING, 0, 0
    remember_visit(model, run)


@njit(**KERNEL)
def leave(model, run, transition, transversality, work):
    """Move the run past a jump to ``work.new``."""
    mode, target = run.mode, model.target[transition]
    if mode == target and model.marker[transition] == 0 and model.clock[transition] == 0:
        run.restitution = impulse_of(model, run, transition, transversality, work, run.trail[IMPULSE])
    if target not in (NO_MODE, mode):
        carry_rounding(model, run, transition, run.phase, run.y, work.new, work.reset_jacobian, work.state)
    move(model, run, transition, mode if target == NO_MODE else target, work.new)


@njit(**KERNEL)
def cross_without_map(model, run, transition, mode, work):
    """``cross`` for runs without saltation matrices: the state after the jump, without derivatives."""
    t, target = run.phase, model.target[transition]
    model.field(mode, t, run.y, model.parameters, work.field)
    transversality = guard_speed(model, transition, t, run.y, work.field, work.gradient)
    model.reset(transition, t, run.y, model.parameters, work.new)
    if mode == target and model.marker[transition] == 0:
        model.field(mode, t, work.new, model.parameters, work.field_after)
    postpone_map(run, model.dimension)
    return transversality


@njit(**KERNEL)
def cross_with_map(model, run, transition, tangents, work):
    """Cross a guard that sets the time of the jump, and begin an instant; returns the transversality."""
    n = model.dimension
    transversality = saltation(model, transition, run.phase, run.y, work.new, work)
    change_of_instant(run, n, work)
    keep_tangents(run, n, tangents)
    keep_map(run, n, work)
    return transversality


@njit(**KERNEL)
def recall_map(model, run, tangents, work):
    """Compute the tangent map of the jump that began this instant, if it has not been computed."""
    n = model.dimension
    if run.last_fired == NO_TRANSITION:
        begin_at_start(run, n, tangents)
    if run.map_is_known == 1:
        return
    fired, x_minus = run.last_fired, run.instant[:n]
    saltation(model, fired, run.phase, x_minus, work.new, work)
    change_of_instant(run, n, work)
    keep_map(run, n, work)


@exported(None, Task, INTEGER)
def jump(task, transition):
    """Make a jump at the current point of the run: state, tangent vectors, counters, record.

    Without tangent vectors a saltation matrix is computed only for locked jumps, where it does not follow
    from the states at the jump.
    """
    _, model, method, run, record, work = task_of(task)
    n, mode, tangents = model.dimension, run.mode, task.tangents
    asked = tangents > 0 or record.jump_phase.shape[0] > 0
    locked = run.locked == 1 and asked
    known = tangents > 0 or locked
    run.locked = 0
    # A locked jump inherits the grazing flag of the jump that triggered it.
    kind = run.last_kind if locked else TRANSVERSE
    # The time of a tick is known.
    searched = not locked and model.clock[transition] == 0
    if searched and hides_roots(model, mode):
        look_for_roots(model, method, run, transition, tangents, work)
    if locked:
        recall_map(model, run, tangents, work)
        target = model.target[transition]
        transversality = cross(model, transition, mode, target, run.phase, run.y, work.new, work)
        follow(run, n, work)
    elif known:
        transversality = cross_with_map(model, run, transition, tangents, work)
    else:
        transversality = cross_without_map(model, run, transition, mode, work)
    judged = asked and searched and model.marker[transition] == 0
    judged = judged and not ends_own_flight(model, run, transition, transversality)
    if judged and is_grazing(model, method, run, transition, transversality, work):
        kind = GRAZING
    if kind == GRAZING:
        run.ill_conditioned += 1
    run.last_kind, run.last_transversality = kind, transversality
    run.due[transition] = 0
    remember_jump(run, record, transition, transversality, kind, known, work.new, work)
    if locked:
        map_of_instant(run, n, work.saltation)
        assume_sizes(model, work)
    if tangents > 0:
        judge(run, largest_entry(model, work))
        if locked:
            restore_tangents(run, n, tangents)
        grown = carry_tangents(model, run, tangents, task.orthonormal != 0, kind == GRAZING, work)
        if kind == GRAZING:
            run.ill_conditioned_growth += grown
    leave(model, run, transition, transversality, work)
    if searched and tangents > 0 and hides_roots(model, run.mode):
        model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
        note_steep(model, method, run, transversality, work)


@njit(**KERNEL)
def change_mode_of_instant(model, run, target, work):
    """Include a change to the mode ``target`` in the tangent map of this instant; the state stays the same.

    The change happens at the time of the first jump of the instant.
    """
    n, t = model.dimension, run.phase
    model.field(run.mode, t, run.y, model.parameters, work.field)
    model.field(target, t, run.y, model.parameters, work.field_after)
    for i in range(n):
        work.settled[i] = work.field_after[i] - work.field[i]
        for j in range(n):
            work.reset_jacobian[i, j] = 1.0 if i == j else 0.0
    follow(run, n, work)


@njit(**KERNEL)
def go_onward(run, onward):
    """Fire the transition that takes the state out of the mode of a limit at once, if there is one."""
    if onward != NO_TRANSITION:
        run.pending, run.locked = onward, 1


@exported(None, Task)
def rest(task):
    """Go on in the mode for the limit of a chatter that is over at once: the state rests on the guard."""
    _, model, _, run, _, work = task_of(task)
    n, transition, tangents = model.dimension, run.last_fired, task.tangents
    limit_mode, onward = mode_of_limit(model, run, transition, run.phase, run.y, work)
    recall_map(model, run, tangents, work)
    change_mode_of_instant(model, run, limit_mode, work)
    rest_matrix(model, run, transition, work)
    multiply(work.saltation, run.instant, n, n, work.state, work.rounding)
    if tangents > 0:
        map_of_instant(run, n, work.saltation)
        assume_sizes(model, work)
        restore_tangents(run, n, tangents)
        apart = run.last_kind == GRAZING
        grown = carry_tangents(model, run, tangents, task.orthonormal != 0, apart, work)
        if apart:
            run.ill_conditioned_growth += grown
    run.previous_mode = run.mode
    run.mode = limit_mode
    go_onward(run, onward)
