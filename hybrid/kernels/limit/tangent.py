"""The tangent map of a complete chatter on one guard, from the last jump that is made to its limit.

A displacement of speed or height vanishes, and changes the time of the limit (``jumps.rest``). What is left
of it drifts along the mean field, which pull, restitution and impulse of the displaced state change; their
derivatives are central differences. Compare Nordmark and Piiroinen (2009, doi:10.1007/s11071-009-9463-y).
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import spread_of_rate, whole_jacobian
from hybrid.kernels.events.guards import ROUNDING_OF_STATE, rounding_band
from hybrid.kernels.jumps.rest import NEARBY, ROUNDED, rest_matrix
from hybrid.kernels.limit.impacts import far_side, follow_mean, impact, mean_field
from hybrid.kernels.types.codes import ENDLESS, IMPULSE
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL


@njit(**KERNEL)
def feedback(matrix, n):
    """Upper bound of how fast components act back on themselves, over at most two others, in any units."""
    most = 0.0
    for i in range(n):
        for j in range(n):
            there = abs(matrix[i, j])
            most = max(most, math.sqrt(there * abs(matrix[j, i])))
            for k in range(n if there > 0.0 else 0):
                most = max(most, (there * abs(matrix[j, k]) * abs(matrix[k, i])) ** (1.0 / 3.0))
    return n * most


@njit(**KERNEL)
def drift_is_known(model, run, transition, span, work):
    """Whether the mean field tells how tangent vectors drift to the limit, after the time ``span``.

    Its error is of third order in the time. That is no more than the error of a central difference, or than
    the rounding of the height ``v T (1 - r) / 4`` of the flight that begins here.
    """
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, transition, run.phase, run.y, work)
    noise = 4.0 * band / (run.trail[IMPULSE, model.dimension] * span * (1.0 - run.restitution))
    whole_jacobian(model, run.mode, run.phase, run.y, work.jacobian)
    return (feedback(work.jacobian, model.dimension) * span) ** 3 <= max(NEARBY * NEARBY, noise)


@njit(**KERNEL)
def changed(up, down, noise):
    """``up - down``, or zero if that may be rounding."""
    return up - down if abs(up - down) > ROUNDED * (abs(up) + abs(down)) + noise else 0.0


@njit(**KERNEL)
def rounding_of_impulse(run, i, change):
    """How far rounding may move a component of the impulse, the quotient by a ``change`` of the speed."""
    return ROUNDING_OF_STATE * EPSILON * run.scale[i] / abs(change)


@njit(**KERNEL)
def add_turn_of_impulse(model, run, transition, t, speed, span, work):
    """Add the effect of an impulse that turns along the way to the limit to ``work.saltation``.

    A height is taken out along ``D_x f p`` less the rate at which ``p`` turns, as on a curved wall. That rate
    is the difference quotient from the last impact to one at the limit. The speed has its sign.
    """
    n, impulse, slope = model.dimension, run.trail[IMPULSE], work.error
    place, after, turn = work.new, work.second_error, work.trial
    for i in range(n):
        place[i] = work.settled[i] - speed * impulse[i]
    _, change = impact(model, run, transition, t, place, after, work)
    coupling = 0.0
    for i in range(n):
        noise = rounding_of_impulse(run, i, change)
        turn[i] = changed((after[i] - place[i]) / change, impulse[i], noise) / span
        if run.trail[ENDLESS, i] != 0.0:
            turn[i] = 0.0
        coupling += slope[i] * turn[i]
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    for i in range(n):
        for j in range(n):
            work.saltation[i, j] += (turn[i] - coupling * impulse[i]) * work.gradient[j]


@njit(**KERNEL)
def rounding_of_drift(model, run, transition, start, span, out, work):
    """How far rounding may move what ``follow_mean`` returns, into ``out (n,)``."""
    n, moved = model.dimension, work.error
    pull = abs(mean_field(model, run, transition, run.phase, start, moved, work))
    for i in range(n):
        moved[i] = ROUNDED * span * (abs(work.field[i]) + pull * abs(run.trail[IMPULSE, i]))
    for i in range(n):
        out[i] = moved[i] + span * spread_of_rate(model, run.mode, i, work.jacobian, moved)


@njit(**KERNEL)
def add_drift(model, run, transition, j, speed, span, work):
    """Carry the column ``j`` of ``work.saltation`` to the limit, and add what it does to the limit's instant.

    The column keeps the state without its speed, ``work.trial``, on its guard. The impulse takes out the
    guard's speed, and what the pull adds to it in the time ``span``; the speed has its sign.
    """
    n, t, impulse, start = model.dimension, run.phase, run.trail[IMPULSE], work.trial
    place, after, turned, noise = work.second_error, work.new, work.sizes[0], work.rounding[2]
    step, bend, ratio, bent, change = math.inf, 0.0, 0.0, 0.0, 1.0
    for i in range(n):
        size, entry = max(abs(start[i]), run.scale[i]), abs(work.saltation[i, j])
        if size > 0.0 and entry > 0.0:
            step = min(step, NEARBY * size / entry)
    if step == math.inf:
        return
    for part in range(2):
        sign = 1.0 - 2.0 * part
        for i in range(n):
            place[i] = start[i] + sign * step * work.saltation[i, j]
        acceleration = follow_mean(model, run, transition, place, span, work.rounding[part], work)
        for i in range(n):
            place[i] -= speed * impulse[i]
        share, change = impact(model, run, transition, t, place, after, work)
        for i in range(n):
            here, before = (after[i] - place[i]) / change, turned[i]
            turned[i] = here if part == 0 else changed(before, here, rounding_of_impulse(run, i, change))
        bend = acceleration if part == 0 else changed(bend, acceleration, 0.0)
        ratio = share if part == 0 else changed(ratio, share, 0.0)
        bent += 0.5 * acceleration
    run.instant[j] += span * (ratio / (1.0 - run.restitution) - bend / bent) / (2.0 * step)
    for i in range(n):
        drift = changed(work.rounding[0, i], work.rounding[1, i], noise[i])
        if run.trail[ENDLESS, i] == 0.0:
            drift -= turned[i] * (speed + bent * span)
        work.saltation[i, j] += drift / (2.0 * step)


@njit(**KERNEL)
def difference_of_fields(model, method, run, transition, target, span, work):
    """Mean field less the field of the mode ``target`` at the limit, into ``work.field_after``; the pull.

    The two are alike if they differ by no more than the error of the limit makes of them.
    """
    n, limit, speed = model.dimension, run.phase + span, run.trail[IMPULSE, model.dimension]
    mean, excess, tolerances = work.trial, work.field_after, work.rounding[2]
    pull = abs(mean_field(model, run, transition, limit, work.settled, mean, work))
    model.field(target, limit, work.settled, model.parameters, excess)
    model.field_jacobian(target, limit, work.settled, model.parameters, work.reset_jacobian)
    for j in range(n):
        tolerances[j] = method.atol + method.rtol * run.scale[j]
    for i in range(n):
        blurred = abs(work.field[i]) + abs(excess[i]) + pull * run.scale[i] / speed
        blurred *= ROUNDING_OF_STATE * EPSILON
        blurred += spread_of_rate(model, run.mode, i, work.jacobian, tolerances)
        blurred += spread_of_rate(model, target, i, work.reset_jacobian, tolerances)
        excess[i] = mean[i] - excess[i]
        if abs(excess[i]) <= blurred:
            excess[i] = 0.0
    return pull


@njit(**KERNEL)
def limit_matrix(model, method, run, transition, target, span, work):
    """Tangent map of the jumps to come and of the limit, into ``work.saltation (n, n)``.

    A state that chatters longer drifts longer with the mean field, and shorter with that of the mode
    ``target`` after the limit. The duration ``2 v / (a (1 - r))`` changes with the speed, with the height
    through its energy, and with what changes pull or restitution; its derivative, that of the instant of the
    limit, goes to ``run.instant``.
    """
    n, side, ratio = model.dimension, -far_side(model, run, transition), run.restitution
    speed, start = side * run.trail[IMPULSE, n], work.trial
    pull = difference_of_fields(model, method, run, transition, target, span, work)
    rest_matrix(model, run, transition, work)
    by_speed, by_height = 2.0 * side / (pull * (1.0 - ratio)), (1.0 + ratio) / (speed * (1.0 - ratio))
    for j in range(n):
        run.instant[j] = by_speed * work.error[j] + by_height * work.gradient[j]
    add_turn_of_impulse(model, run, transition, run.phase + span, speed, span, work)
    for i in range(n):
        start[i] = run.y[i] - speed * run.trail[IMPULSE, i]
    rounding_of_drift(model, run, transition, start, span, work.rounding[2], work)
    for j in range(n):
        add_drift(model, run, transition, j, speed, span, work)
    for i in range(n):
        for j in range(n):
            work.saltation[i, j] += work.field_after[i] * run.instant[j]
