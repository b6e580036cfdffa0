"""A jump that is plain: it is alone at its instant, and leaves the state clear of every guard but its own.

Nearly all jumps are. Such a jump needs no search for what else happens at the instant, and the mode that it
enters is entered at once. What is not plain is left to ``jump`` and ``enter``, which ask more; then nothing
has been changed.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.tangent import STRAINED, multiply, strain
from hybrid.kernels.events.guards import (
    LEFT_BEHIND,
    acceleration_along,
    guard_speed,
    guard_value,
    rounding_band,
)
from hybrid.kernels.events.moments import speed_rounding
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.events.surface import finds_surface
from hybrid.kernels.jumps.jump import ends_own_flight, is_grazing, judge, move
from hybrid.kernels.jumps.locked import postpone_map
from hybrid.kernels.jumps.past import impulse_of
from hybrid.kernels.jumps.record import remember_jump
from hybrid.kernels.types.codes import (
    IMPULSE,
    NO_MODE,
    RUNGE_KUTTA,
    TRANSVERSE,
)
from hybrid.kernels.types.kinds import INTEGER, TRUTH
from hybrid.kernels.types.layout import Task
from hybrid.kernels.types.options import INLINE, exported
from hybrid.kernels.types.task import task_of

# A guard is clear of zero if it is so many times as far from it as rounding, and so is a speed.
CLEAR = 2.0 * LEFT_BEHIND
# A speed tells the side if it keeps itself up to this share until the guard is out of its rounding.
CHANGE = 0.1
# A pivot below this share of the largest entry may be rounding.
LEAST_PIVOT = 1e-8


@njit(**INLINE)
def may_be_plain(model, run, fired, tangents):
    """Whether a jump may be plain, as far as its transition tells."""
    mode, target = run.mode, model.target[fired]
    if target == NO_MODE or model.clock[fired] != 0 or model.marker[fired] == 1 or run.locked == 1:
        return False
    if run.steps == 0:
        return False
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        other = model.outgoing[slot]
        if other != fired and run.due[other] == 1:
            return False
    if model.first_at_start[target + 1] > model.first_at_start[target]:
        return False
    if tangents > 0 and not (model.field_before[fired] == mode and model.field_behind[fired] == target):
        return False
    for each in (mode, target):
        if model.steep[each] == 1 and model.propagator[each] == RUNGE_KUTTA:
            return False
    return True


@njit(**INLINE)
def saltation_of(model, fired, transversality, work):
    """The saltation matrix from the rates before and after; ``work.reset_jacobian`` is current."""
    n = model.dimension
    for i in range(n):
        kick = work.field_after[i] - work.reset_jacobian[i, n]
        for j in range(n):
            kick -= work.reset_jacobian[i, j] * work.field[j]
        kick /= transversality
        for j in range(n):
            work.saltation[i, j] = work.reset_jacobian[i, j] + kick * work.gradient[j]


@njit(**INLINE)
def log_determinant_of(matrix, scratch, n):
    """``log |det|`` of a matrix; minus infinity if a pivot may be rounding, or the product is no float."""
    total, largest = 1.0, 0.0
    for i in range(n):
        for j in range(n):
            scratch[i, j] = matrix[i, j]
            largest = max(largest, abs(matrix[i, j]))
    for c in range(n):
        pivot = c
        for i in range(c + 1, n):
            if abs(scratch[i, c]) > abs(scratch[pivot, c]):
                pivot = i
        size = abs(scratch[pivot, c])
        if not size > LEAST_PIVOT * largest:
            return -math.inf
        for j in range(c, n if pivot != c else 0):
            scratch[c, j], scratch[pivot, j] = scratch[pivot, j], scratch[c, j]
        total *= size
        for i in range(c + 1, n):
            factor = scratch[i, c] / scratch[c, c]
            for j in range(c + 1, n if factor != 0.0 else 0):
                scratch[i, j] -= factor * scratch[c, j]
    return math.log(total) if 0.0 < total < math.inf else -math.inf


@njit(**INLINE)
def acceleration(model, other, mode, t, work):
    """The acceleration of a guard at ``work.new``: field, gradient and Jacobian in ``work`` are current."""
    total = acceleration_along(model, mode, work)
    if model.affine_guard[other] == 1:
        return total
    for i in range(model.dimension):
        work.state[i] = work.field[i]
    model.guard_curvature(other, t, work.new, model.parameters, work.state)
    return total + work.state[0]


@njit(**INLINE)
def carry_sizes(model, run, work):
    """Carry the sizes by which rounding is judged through a reset; ``work.reset_jacobian`` is current."""
    for i in range(model.dimension):
        size = 0.0
        for j in range(model.dimension):
            size += abs(work.reset_jacobian[i, j]) * work.error[j]
        if size < math.inf:
            run.scale[i] = max(run.scale[i], size)


@njit(**INLINE)
def enters_plainly(model, run, fired, target, work):
    """Whether the state ``work.new`` is clear of all guards of a mode but of the surface just crossed.

    That guard leaves zero by its speed, to its near side. The sides go to ``run.rehearsal``.
    """
    t, n = run.phase, model.dimension
    for slot in range(model.first_outgoing[target], model.first_outgoing[target + 1]):
        other = model.outgoing[slot]
        direction = model.direction[other]
        value = guard_value(model, other, t, work.new, work.scalar)
        model.guard_gradient(other, t, work.new, model.parameters, work.gradient)
        band = rounding_band(model, run, other, t, work.new, work)
        run.rehearsal[0, other], run.rehearsal[1, other] = -direction, 0
        if direction == 0:
            return False
        if model.surface[other] == model.surface[fired] and abs(value) <= band:
            speed = work.gradient[n]
            for i in range(n):
                speed += work.gradient[i] * work.field_after[i]
            for i in range(n):
                work.field[i] = work.field_after[i]
            drift = speed_rounding(model, run, other, target, t, work.new, work)
            bend = acceleration(model, other, target, t, work)
            steady = abs(bend) * band <= CHANGE * speed * speed
            if not (steady and -direction * speed > CLEAR * drift and abs(speed) < math.inf):
                return False
            run.rehearsal[1, other] = BY_SPEED
        elif not -direction * value > CLEAR * band:
            return False
    return True


@exported(TRUTH, Task, INTEGER)
def jump_plainly(task, fired):
    """Make a jump, and note how its target is entered, if that is plain; returns whether it was."""
    _, model, method, run, record, work = task_of(task)
    n, mode, tangents, t, target = model.dimension, run.mode, task.tangents, run.phase, model.target[fired]
    if not may_be_plain(model, run, fired, tangents):
        return False
    parameters = model.parameters
    model.field(mode, t, run.y, parameters, work.field)
    transversality = guard_speed(model, fired, t, run.y, work.field, work.gradient)
    model.reset(fired, t, run.y, parameters, work.new)
    model.field(target, t, work.new, parameters, work.field_after)
    total = abs(transversality)
    for i in range(n):
        total += abs(work.new[i]) + abs(work.field_after[i])
    for i in range(n, n * (1 + tangents)):
        total += abs(run.y[i])
    if not (total < math.inf and transversality != 0.0):
        return False
    asked = tangents > 0 or record.jump_phase.shape[0] > 0
    log_determinant, distortion = 0.0, 0.0
    if tangents > 0:
        if model.affine_guard[fired] == 0 and finds_surface(model, fired, t, run.y, transversality, work):
            return False
        model.reset_jacobian(fired, t, run.y, parameters, work.reset_jacobian)
        saltation_of(model, fired, transversality, work)
        log_determinant = log_determinant_of(work.saltation, work.jacobian, n)
        if not log_determinant > -math.inf:
            return False
        distortion = run.strain + strain(work.saltation, model.controlled, log_determinant)
        if task.orthonormal != 0 and not distortion < STRAINED:
            return False
    judged = asked and not ends_own_flight(model, run, fired, transversality)
    if judged and is_grazing(model, method, run, fired, transversality, work):
        return False
    restitution = 0.0
    if mode == target:
        restitution = impulse_of(model, run, fired, transversality, work, work.settled)
    for i in range(n):
        work.error[i] = run.scale[i]
    if mode != target:
        if tangents == 0:
            model.reset_jacobian(fired, t, run.y, parameters, work.reset_jacobian)
        carry_sizes(model, run, work)
    for i in range(n):
        run.scale[i] = max(run.scale[i], abs(work.new[i]))
    if not enters_plainly(model, run, fired, target, work):
        for i in range(n):
            run.scale[i] = work.error[i]
        return False
    remember_jump(run, record, fired, transversality, TRANSVERSE, tangents > 0, work.new, work)
    if tangents > 0:
        judge(model, run, work)
        run.log_determinant += log_determinant
        run.strain = distortion
        multiply(work.saltation, run.y, n, tangents, work.state, work.rounding)
    if mode == target:
        run.restitution = restitution
        for i in range(n):
            run.trail[IMPULSE, i] = work.settled[i]
    run.last_kind, run.last_transversality, run.locked = TRANSVERSE, transversality, 0
    run.due[fired] = 0
    postpone_map(run, n)
    move(model, run, fired, target, work.new)
    run.clear = 1
    return True
