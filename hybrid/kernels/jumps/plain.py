"""A jump that is plain: it is alone at its instant, and leaves the state clear of every guard but its own.

Nearly all jumps are. Such a jump needs no search for what else happens at the instant, and the mode that it
enters is entered at once. What is not plain is left to ``jump`` and ``enter``, which ask more; then nothing
has been changed.
"""

import math
from typing import NamedTuple

from numba import njit

from hybrid.kernels.arithmetic.tangent import STRAINED, multiply, strain_of_square
from hybrid.kernels.events.guards import (
    LEFT_BEHIND,
    acceleration_along,
    guard_value,
    rounding_band,
)
from hybrid.kernels.events.moments import speed_rounding
from hybrid.kernels.events.onset import BY_SPEED
from hybrid.kernels.events.surface import jumps_across
from hybrid.kernels.jumps.jump import ends_own_flight, is_grazing, judge, move
from hybrid.kernels.jumps.locked import postpone_map
from hybrid.kernels.jumps.past import impulse_of
from hybrid.kernels.jumps.record import remember_jump
from hybrid.kernels.jumps.steep import hides_roots
from hybrid.kernels.types.codes import (
    IMPULSE,
    NO_MODE,
    TRANSVERSE,
)
from hybrid.kernels.types.kinds import INTEGER, REAL, TRUTH
from hybrid.kernels.types.layout import Task
from hybrid.kernels.types.options import INLINE, exported
from hybrid.kernels.types.task import task_of

# A guard is clear of zero if it is so many times as far from it as rounding, and so is a speed.
CLEAR_BY = 2.0 * LEFT_BEHIND
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
    return not (hides_roots(model, mode) or hides_roots(model, target))


class Saltation(NamedTuple):
    """What is asked of a saltation matrix: ``log |det|``, the sum of its squares, its largest entry.

    The sum and the largest entry leave out counters.
    """

    log_determinant: REAL
    square: REAL
    largest: REAL


NO_MATRIX = Saltation(0.0, 0.0, 0.0)


@njit(**INLINE)
def saltation_of(model, fired, transversality, work):
    """The saltation matrix into ``work.saltation``; ``work.reset_jacobian`` is current."""
    n, square, largest = model.dimension, 0.0, 0.0
    for i in range(n):
        kick = work.field_after[i] - work.reset_jacobian[i, n]
        for j in range(n):
            kick -= work.reset_jacobian[i, j] * work.field[j]
        kick /= transversality
        for j in range(n):
            work.saltation[i, j] = work.reset_jacobian[i, j] + kick * work.gradient[j]
        for j in range(model.controlled if i < model.controlled else 0):
            square += work.saltation[i, j] * work.saltation[i, j]
            largest = max(largest, abs(work.saltation[i, j]))
    return Saltation(log_determinant_of(work.saltation, work.jacobian, n, largest), square, largest)


@njit(**INLINE)
def shear_of(model, transversality, work):
    """The saltation matrix ``I + kick slope`` of a jump that keeps the state.

    ``kick (n,)``, the change of the field per transversality, goes to ``work.trial``, and ``slope (n,)``, the
    gradient of the guard, to ``work.second_error``. The determinant is ``1 + slope kick``.
    """
    controlled, determinant, terms, square, largest = model.controlled, 1.0, 1.0, 0.0, 0.0
    for i in range(model.dimension):
        kick, slope = (work.field_after[i] - work.field[i]) / transversality, work.gradient[i]
        work.trial[i], work.second_error[i] = kick, slope
        determinant += kick * slope
        terms += abs(kick * slope)
    for i in range(controlled):
        kick = work.trial[i]
        if kick == 0.0:
            square, largest = square + 1.0, max(largest, 1.0)
            continue
        for j in range(controlled):
            entry = kick * work.second_error[j] + (1.0 if i == j else 0.0)
            square, largest = square + entry * entry, max(largest, abs(entry))
    known = abs(determinant) > LEAST_PIVOT * terms and terms < math.inf
    return Saltation(math.log(abs(determinant)) if known else -math.inf, square, largest)


@njit(**INLINE)
def write_shear(model, work):
    """The matrix of ``shear_of`` into ``work.saltation``, for the record."""
    for i in range(model.dimension):
        for j in range(model.dimension):
            work.saltation[i, j] = work.trial[i] * work.second_error[j] + (1.0 if i == j else 0.0)


@njit(**INLINE)
def shear(y, n, tangents, kick, slope):
    """Add to each of the tangent vectors ``v`` in ``y (n (1 + k),)`` its ``kick slope v``."""
    for start in range(n, n * (1 + tangents), n):
        delay = 0.0
        for i in range(n):
            delay += slope[i] * y[start + i]
        for i in range(n):
            y[start + i] += delay * kick[i]


@njit(**INLINE)
def log_determinant_of(matrix, scratch, n, largest):
    """``log |det|`` of a matrix; minus infinity if a pivot may be rounding, or the product is no float.

    The ``largest`` entry is known.
    """
    total = 1.0
    for i in range(n):
        for j in range(n):
            scratch[i, j] = matrix[i, j]
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
def acceleration(model, other, mode, t, x, work):
    """The acceleration of a guard at ``x (n,)``: field, gradient and Jacobian in ``work`` are current."""
    total = acceleration_along(model, mode, work)
    if model.affine_guard[other] == 1:
        return total
    for i in range(model.dimension):
        work.state[i] = work.field[i]
    model.guard_curvature(other, t, x, model.parameters, work.state)
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
def enters_plainly(model, run, fired, target, x, work):
    """Whether the state ``x (n,)`` is clear of all guards of a mode but of the surface just crossed.

    That guard leaves zero by its speed, to its near side. The sides go to ``run.tried_side``.
    """
    t, n = run.phase, model.dimension
    for slot in range(model.first_outgoing[target], model.first_outgoing[target + 1]):
        other = model.outgoing[slot]
        direction = model.direction[other]
        value = guard_value(model, other, t, x, work.scalar)
        model.guard_gradient(other, t, x, model.parameters, work.gradient)
        band = rounding_band(model, run, other, t, x, work)
        run.tried_side[other], run.tried_order[other] = -direction, 0
        if direction == 0:
            return False
        if model.surface[other] == model.surface[fired] and abs(value) <= band:
            speed = work.gradient[n]
            for i in range(n):
                speed += work.gradient[i] * work.field_after[i]
                work.field[i] = work.field_after[i]
            drift = speed_rounding(model, run, other, target, t, x, work)
            bend = acceleration(model, other, target, t, x, work)
            steady = abs(bend) * band <= CHANGE * speed * speed
            if not (steady and -direction * speed > CLEAR_BY * drift and abs(speed) < math.inf):
                return False
            run.tried_order[other] = BY_SPEED
        elif not -direction * value > CLEAR_BY * band:
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
    model.guard_gradient(fired, t, run.y, parameters, work.gradient)
    keeps = mode != target and model.keeps_state[fired] == 1
    after = run.y if keeps else work.new
    if not keeps:
        model.reset(fired, t, run.y, parameters, after)
    model.field(target, t, after, parameters, work.field_after)
    transversality, total = work.gradient[n], 0.0
    for i in range(n):
        transversality += work.gradient[i] * work.field[i]
        total += abs(after[i]) + abs(work.field_after[i])
    total += abs(transversality)
    if not (total < math.inf and transversality != 0.0):
        return False
    asked = tangents > 0 or record.jump_phase.shape[0] > 0
    matrix, distortion = NO_MATRIX, 0.0
    if tangents > 0:
        if jumps_across(model, fired, t, run.y, work):
            return False
        if keeps:
            matrix = shear_of(model, transversality, work)
        else:
            model.reset_jacobian(fired, t, run.y, parameters, work.reset_jacobian)
            matrix = saltation_of(model, fired, transversality, work)
        if not matrix.log_determinant > -math.inf:
            return False
        distortion = run.strain + strain_of_square(matrix.square, model.controlled, matrix.log_determinant)
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
        run.scale[i] = max(run.scale[i], abs(after[i]))
    if mode != target and not keeps:
        if tangents == 0:
            model.reset_jacobian(fired, t, run.y, parameters, work.reset_jacobian)
        carry_sizes(model, run, work)
    if not enters_plainly(model, run, fired, target, after, work):
        for i in range(n):
            run.scale[i] = work.error[i]
        return False
    if keeps and tangents > 0 and record.jump_phase.shape[0] > 0:
        write_shear(model, work)
    remember_jump(run, record, fired, transversality, TRANSVERSE, tangents > 0, after, work)
    if tangents > 0:
        judge(run, matrix.largest)
        run.log_determinant += matrix.log_determinant
        run.strain = distortion
        if keeps:
            shear(run.y, n, tangents, work.trial, work.second_error)
        else:
            multiply(work.saltation, run.y, n, tangents, work.state, work.rounding)
    if mode == target:
        run.restitution = restitution
        for i in range(n):
            run.trail[IMPULSE, i] = work.settled[i]
    run.last_kind, run.last_transversality, run.locked = TRANSVERSE, transversality, 0
    run.due[fired] = 0
    postpone_map(run, n)
    move(model, run, fired, target, after)
    run.clear = 1
    return True
