"""Chatter: jumps of one transition that accumulate, their limit, and what it does to tangent vectors."""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.arithmetic.slopes import change_of_rate, spread_of_rate, whole_jacobian
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    guard_acceleration,
    guard_speed,
    guard_value,
    rounding_band,
)
from hybrid.kernels.jumps.rounds import fired_before, mark_endless
from hybrid.kernels.types.codes import ENDLESS
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Rows of Run.trail, written by the previous jump. The last column holds a time or a speed; the first row
# begins with the speed after the first jump.
BEFORE = 0
LIMIT = 1
IMPULSE = 2
# A component that the impacts move at the limit, too, by this share of what the last impact has moved it.
MOVES_ON = 0.1
# No limit is taken before this many jumps, so that the visible jumps are in the arc.
FEWEST_JUMPS = 16
# The limit is taken earlier if the speed is below this share of that after the first jump: such jumps are not
# visible, and the rounding errors of tangent vectors grow like the reciprocal of the speed.
INVISIBLE = 1e-6
# It is also taken earlier if a flight is no higher than this many times rounding: the rounding error of its
# duration grows like the reciprocal of its speed and would spoil the limit.
SHALLOW = 1e6
# Largest relative change of the limit that may be due to rounding.
ROUGH = 1e-6
# That change is no more than this many times what the rounding of the last landing makes of it.
NOISE = 8.0
# If the time of the limit still changes by more than this share, the limit is not computed.
FAR = 1e3 * ROUGH
# Share by which a flight at the level of rounding, and the speed after it, may differ from a steady series.
STEADY = 0.5


@njit(**KERNEL)
def far_side(model, run, transition):
    """The side of the guard on which the state was before the transition that has just fired."""
    if model.direction[transition] != 0:
        return model.direction[transition]
    return 1 if run.last_transversality > 0.0 else -1


@njit(**KERNEL)
def remaining_chatter(model, run, transition, speed, work):
    """Time ``2 v / (a (1 - r))`` that infinitely many flights with speeds ``v, r v, r^2 v, ...`` still take.

    The acceleration ``a`` towards the guard is taken here, ``r`` is the restitution of the jump just made.
    Zero if the flights do not shrink or nothing pulls the state back.
    """
    ratio = run.restitution
    pull = far_side(model, run, transition) * guard_acceleration(
        model, run, transition, run.mode, run.phase, run.y, work
    )
    if not (0.0 < ratio < 1.0 and pull > 0.0):
        return 0.0
    return 2.0 * speed / (pull * (1.0 - ratio))


@njit(**KERNEL)
def mean_field(model, run, transition, t, x, out, work):
    """Field of a chatter averaged over its flights, ``f - a p`` into ``out (n,)``; returns ``a``.

    ``a`` is the guard's acceleration and ``p`` the impulse per unit of the guard's speed: the impulses give
    back the speed that the pull takes.
    """
    mode = run.mode
    model.field(mode, t, x, model.parameters, work.field)
    guard_speed(model, transition, t, x, work.field, work.gradient)
    acceleration = guard_acceleration(model, run, transition, mode, t, x, work)
    for i in range(model.dimension):
        out[i] = work.field[i] - acceleration * run.trail[IMPULSE, i]
    return acceleration


@njit(**KERNEL)
def follow_mean(model, run, transition, speed, span, work):
    """Limit of the state into ``work.settled (n,)``: its speed taken out, then along the mean field until it.

    ``speed`` is the guard's, with its sign. The error is of third order in it where pull and impulse are
    constant, and one step of the classical Runge-Kutta method follows the mean field.
    """
    n, t = model.dimension, run.phase
    start, place, slope = work.trial, work.error, work.new
    for i in range(n):
        start[i] = run.y[i] - speed * run.trail[IMPULSE, i]
        work.settled[i], slope[i] = start[i], 0.0
    for stage in range(4):
        part = 0.5 * span * ((stage + 1) // 2)
        weight = span / (6.0 if stage in (0, 3) else 3.0)
        for i in range(n):
            place[i] = start[i] + part * slope[i]
        mean_field(model, run, transition, t + part, place, slope, work)
        for i in range(n):
            work.settled[i] += weight * slope[i]


@njit(**KERNEL)
def keep_endless(model, run, transition, speed, work):
    """Mark the components that the impacts move for ever, such as a counter, and take out their impulse.

    They keep the value after the last impact. ``speed`` is the guard's after that impact, with its sign.
    """
    n, rest, share = model.dimension, work.trial, work.error
    change = speed * (1.0 + 1.0 / run.restitution)
    for i in range(n):
        impulse = run.trail[IMPULSE, i]
        rest[i] = run.y[i] - speed * impulse
        rounding = ROUNDING_OF_STATE * EPSILON * run.scale[i]
        share[i] = math.inf if impulse == 0.0 else max(MOVES_ON * abs(impulse * change), rounding)
    if not mark_endless(model, run, 1, run.phase, rest, share, work):
        return
    for i in range(n):
        if run.trail[ENDLESS, i] != 0.0:
            run.trail[IMPULSE, i] = 0.0


@njit(**INLINE)
def change_of_limit_time(model, method, run, gain, shift, span):
    """The change of the time to the limit by later jumps, in units of the tolerances.

    Judged from the change since the jump before, by ``shift``, of which they will still make ``gain`` times.
    """
    rounding = 8.0 * EPSILON * measured_time(model, run, run.mode)
    return gain * abs(shift) / (method.rtol * span + rounding)


@njit(**KERNEL)
def change_of_limit(model, method, run, gain, misfit, work):
    """The same for the limit in ``work.settled``; ``misfit`` is the change of its time."""
    for i in range(model.dimension):
        if run.trail[ENDLESS, i] != 0.0:
            continue
        limit = work.settled[i]
        scale = method.atol + method.rtol * max(abs(limit), run.scale[i])
        misfit = max(misfit, gain * abs(limit - run.trail[LIMIT, i]) / scale)
        run.trail[LIMIT, i] = limit
    return misfit


@njit(**INLINE)
def gain_of_ratio(ratio):
    """So many times the last change of a limit, which goes with the speed squared, do later jumps make."""
    return ratio * ratio / (1.0 - ratio * ratio)


@njit(**KERNEL)
def misfit_of_limit(model, method, run, speed, span, shift, drowned, work):
    """What later jumps may still change the limit by, in units of the tolerances; the limit is followed.

    ``speed`` is the guard's after the last jump, with its sign; ``shift`` is the move of the limit's time.
    Where jumps are driven and not ``drowned`` in rounding, there is no limit to compare with yet.
    """
    gain = gain_of_ratio(run.restitution)
    misfit = change_of_limit_time(model, method, run, gain, shift, span)
    if misfit * method.rtol > FAR and not drowned:
        run.trail[LIMIT, 0] = math.inf
        return misfit
    keep_endless(model, run, run.last_fired, speed, work)
    follow_mean(model, run, run.last_fired, speed, span, work)
    return change_of_limit(model, method, run, gain, misfit, work)


@njit(**KERNEL)
def limit_is_known(model, method, run, speed, span, since_last, band, work):
    """Whether the limit of the jumps is known after this one; the limit state goes to ``work.settled``.

    ``speed`` is the guard's, away from zero, ``span`` the time to the limit, and ``band`` the rounding of the
    guard.
    """
    n, ratio = model.dimension, run.restitution
    # The flight that has ended, and the speed after it, in the series with the ratio of this impact.
    flight, slower = run.trail[LIMIT, n] * (1.0 - ratio), ratio * run.trail[BEFORE, n]
    steady = abs(since_last - flight) <= STEADY * flight + 8.0 * EPSILON * abs(run.phase)
    steady = steady and abs(speed - slower) <= STEADY * slower
    # A flight whose height v^2 / 2 a is at the level of rounding cannot be followed.
    height = 0.25 * speed * span * (1.0 - ratio)
    drowned = steady and height <= band
    seen = run.chattering >= FEWEST_JUMPS or speed <= INVISIBLE * run.trail[BEFORE, 0]
    shallow = height <= SHALLOW * band or seen
    shift = span - (run.trail[LIMIT, n] - since_last)
    signed = -far_side(model, run, run.last_fired) * speed
    misfit = misfit_of_limit(model, method, run, signed, span, shift, drowned, work)
    # The misfit shrinks with the square of the speed until rounding, which grows as the speed falls, takes
    # over. Where it is more than rounding, jumps are slightly driven, and more of them are needed.
    noise = NOISE * gain_of_ratio(ratio) * band / height
    floor = misfit > ratio * run.trail[IMPULSE, n] and misfit * method.rtol < min(ROUGH, noise)
    run.trail[IMPULSE, n] = misfit
    return drowned or (shallow and (misfit <= 1.0 or floor))


@njit(**KERNEL)
def accumulation(model, method, run, transition, since_last, work):
    """Follow the jumps of one transition; once their limit is known, return the time to it, else 0.

    To be called right after a jump, ``since_last`` after the one before. The state is followed along the mean
    field for the time that is left, whose error is of second order in the remaining speed; two successive
    limits tell how large it is. (They could take it away too, but would amplify rounding.) The limit state
    goes to ``work.settled``.
    """
    n = model.dimension
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    speed = guard_speed(model, transition, run.phase, run.y, work.field, work.gradient)
    speed *= -far_side(model, run, transition)
    value = guard_value(model, transition, run.phase, run.y, work.scalar)
    band = rounding_band(model, run, transition, run.phase, run.y, work)
    span, found = 0.0, False
    # No chatter begins with a reset that leaves the guard.
    if abs(value) <= band:
        span = remaining_chatter(model, run, transition, speed, work)
    if not span > 0.0:
        run.chattering = 0
        return 0.0
    consecutive = run.chatter_jumps + 1 == run.jumps and run.chattering > 0
    if consecutive and fired_before(run, 1) == transition:
        found = limit_is_known(model, method, run, speed, span, since_last, band, work)
        run.chattering += 1
    else:
        run.chattering = 1
        run.trail[BEFORE, 0] = speed
        run.trail[LIMIT, 0], run.trail[IMPULSE, n] = math.inf, math.inf
    run.trail[LIMIT, n], run.trail[BEFORE, n] = span, speed
    run.chatter_jumps = run.jumps
    return span if found else 0.0


@njit(**KERNEL)
def remember_impulse(model, run, transition, transversality, work):
    """Keep the restitution of the jump to ``work.new``, and its direction per unit of speed."""
    n = model.dimension
    after = guard_speed(model, transition, run.phase, work.new, work.field_after, work.gradient)
    run.restitution = -after / transversality
    for i in range(n):
        change = work.new[i] - run.y[i]
        # A reset that puts the state back on the guard only removes the rounding error of the landing.
        rounding = abs(change) <= 16.0 * EPSILON * run.scale[i]
        run.trail[IMPULSE, i] = 0.0 if rounding else change / (after - transversality)


@njit(**KERNEL)
def impact(model, run, transition, t, x, after, work):
    """Restitution of an impact from ``x (n,)`` to ``after (n,)``, and the change of the guard's speed."""
    model.field(run.mode, t, x, model.parameters, work.field)
    before = guard_speed(model, transition, t, x, work.field, work.gradient)
    model.reset(transition, t, x, model.parameters, after)
    model.field(run.mode, t, after, model.parameters, work.field)
    later = guard_speed(model, transition, t, after, work.field, work.gradient)
    return -later / before, later - before


@njit(**KERNEL)
def speed_gradient(model, run, transition, mode, t, x, out, work):
    """Derivative of the guard's speed along the flow in the state, ``(n,)``.

    ``D_x g D_x f`` is exact; the curvature of a guard that is not affine is a central difference of its
    gradient.
    """
    n = model.dimension
    model.field(mode, t, x, model.parameters, work.field)
    whole_jacobian(model, mode, t, x, work.jacobian)
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    for j in range(n):
        total = 0.0
        for i in range(n):
            total += work.gradient[i] * work.jacobian[i, j]
        out[j] = total
    if model.affine_guard[transition] == 1:
        return
    for j in range(n):
        size = max(abs(x[j]), run.scale[j])
        step = 6e-6 * (size if size > 0.0 else 1.0)
        for i in range(n):
            work.state[i] = x[i]
        work.state[j] = x[j] + step
        up = guard_speed(model, transition, t, work.state, work.field, work.gradient)
        work.state[j] = x[j] - step
        down = guard_speed(model, transition, t, work.state, work.field, work.gradient)
        out[j] += (up - down) / (2.0 * step)


@njit(**KERNEL)
def chatter_matrix(model, run, transition, work):
    """Tangent map of a complete chatter at its beginning, into ``work.saltation (n, n)``.

    It projects on the states that rest on the guard: the speed is taken out along the impulse ``p`` and the
    height along ``D_x f p``, the motion it brings, ``Xi = I - p (D_x v - (D_x v D_x f p) D_x g) - (D_x f p)
    D_x g`` with ``v`` the guard's speed. The drift during the chatter is that of the resting mode (compare
    Nordmark and Piiroinen 2009, doi:10.1007/s11071-009-9463-y).
    """
    n = model.dimension
    slope, carried = work.error, work.second_error
    impulse = run.trail[IMPULSE]
    speed_gradient(model, run, transition, run.mode, run.phase, run.y, slope, work)
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    coupling = 0.0
    for i in range(n):
        carried[i] = 0.0
        for j in range(n):
            carried[i] += work.jacobian[i, j] * impulse[j]
        coupling += slope[i] * carried[i]
    for i in range(n):
        for j in range(n):
            kept = 1.0 if i == j else 0.0
            taken = impulse[i] * (slope[j] - coupling * work.gradient[j]) + carried[i] * work.gradient[j]
            terms = abs(slope[j]) + abs(coupling * work.gradient[j])
            terms = kept + abs(impulse[i]) * terms + abs(carried[i] * work.gradient[j])
            # The projection is exact in this entry: its rounding error would look like a direction.
            work.saltation[i, j] = kept - taken if abs(kept - taken) > 1e-13 * terms else 0.0


@njit(**KERNEL)
def along_mean(model, run, transition, t, direction, span, out, work):
    """Derivative of the mean field at ``work.trial (n,)`` in a direction, into ``out (n,)``.

    ``work.new (n,)`` and ``work.reset_jacobian`` are the mean field and the Jacobian of the field there. The
    derivative of the guard's acceleration is a central difference. It moves no component by more than a share
    of the component's size, or of the way that the component goes in the time ``span``.
    """
    n, place, beside = model.dimension, work.rounding[0], work.rounding[1]
    x, mean, jacobian = work.trial, work.new, work.reset_jacobian
    step = math.inf
    for i in range(n):
        size = max(abs(x[i]), run.scale[i], span * abs(mean[i]))
        if size > 0.0 and direction[i] != 0.0:
            step = min(step, 6e-6 * size / abs(direction[i]))
    step = step if step < math.inf else 1.0
    for i in range(n):
        place[i] = x[i] + step * direction[i]
    change = mean_field(model, run, transition, t, place, beside, work)
    for i in range(n):
        place[i] = x[i] - step * direction[i]
    change -= mean_field(model, run, transition, t, place, beside, work)
    for i in range(n):
        out[i] = change_of_rate(model, run.mode, i, jacobian, direction)
        out[i] -= change / (2.0 * step) * run.trail[IMPULSE, i]


@njit(**KERNEL)
def drift_with_mean(model, run, transition, span, work):
    """Carry the columns of ``work.saltation`` along the mean field for a short time, to its second order."""
    n, t = model.dimension, run.phase + 0.5 * span
    middle, column, image = work.trial, work.error, work.second_error
    mean, jacobian = work.new, work.reset_jacobian
    for i in range(n):
        middle[i] = 0.5 * (run.y[i] + work.settled[i])
    mean_field(model, run, transition, t, middle, mean, work)
    model.field_jacobian(run.mode, t, middle, model.parameters, jacobian)
    for j in range(n):
        for i in range(n):
            column[i] = work.saltation[i, j]
        for order in range(1, 3):
            along_mean(model, run, transition, t, column, span, image, work)
            for i in range(n):
                column[i] = image[i] * span / order
                work.saltation[i, j] += column[i]


@njit(**KERNEL)
def changed(up, down, noise):
    """``up - down``, or zero if that may be rounding."""
    return up - down if abs(up - down) > 64.0 * EPSILON * (abs(up) + abs(down)) + noise else 0.0


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
        noise = ROUNDING_OF_STATE * EPSILON * run.scale[i] / abs(change)
        turn[i] = changed((after[i] - place[i]) / change, impulse[i], noise) / span
        if run.trail[ENDLESS, i] != 0.0:
            turn[i] = 0.0
        coupling += slope[i] * turn[i]
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    for i in range(n):
        for j in range(n):
            work.saltation[i, j] += (turn[i] - coupling * impulse[i]) * work.gradient[j]


@njit(**KERNEL)
def add_change_of_impacts(model, run, transition, speed, span, work):
    """Add the effect of a change of the impulse to ``work.saltation``, which holds the chatter matrix.

    The impulse takes out the guard's ``speed``, and what the pull adds in the time ``span`` to the limit.
    Acceleration, restitution and impulse of the remaining impacts are those of the state without its speed.
    Their derivatives along the columns of the matrix, which keep that state on its guard, are central
    differences; those of acceleration and restitution go to the first two rows of ``work.rounding``. The
    speed has its sign.
    """
    n, t, impulse = model.dimension, run.phase, run.trail[IMPULSE]
    place, after, start = work.new, work.second_error, work.trial
    bends, ratios, up = work.rounding[0], work.rounding[1], work.rounding[2]
    for i in range(n):
        start[i] = run.y[i] - speed * impulse[i]
    for j in range(n):
        step = math.inf
        for i in range(n):
            size = max(abs(start[i]), run.scale[i])
            if size > 0.0 and work.saltation[i, j] != 0.0:
                step = min(step, 6e-6 * size / abs(work.saltation[i, j]))
        bends[j], ratios[j] = 0.0, 0.0
        for i in range(n):
            work.sizes[i, j] = 0.0
        if step == math.inf:
            continue
        bend, ratio = 0.0, 0.0
        for part in range(2):
            for i in range(n):
                place[i] = start[i] + (step if part == 0 else -step) * work.saltation[i, j]
            model.field(run.mode, t, place, model.parameters, work.field)
            guard_speed(model, transition, t, place, work.field, work.gradient)
            bent = guard_acceleration(model, run, transition, run.mode, t, place, work)
            for i in range(n):
                place[i] -= speed * impulse[i]
            share, change = impact(model, run, transition, t, place, after, work)
            for i in range(n):
                here = (after[i] - place[i]) / change
                if part == 0:
                    up[i] = here
                elif run.trail[ENDLESS, i] == 0.0:
                    noise = ROUNDING_OF_STATE * EPSILON * run.scale[i] / abs(change)
                    work.sizes[i, j] = changed(up[i], here, noise) / (2.0 * step)
            if part == 0:
                bend, ratio = bent, share
            else:
                bends[j] = changed(bend, bent, 0.0) / (2.0 * step)
                ratios[j] = changed(ratio, share, 0.0) / (2.0 * step)
                for i in range(n):
                    work.sizes[i, j] *= speed + 0.5 * (bend + bent) * span
    for i in range(n):
        for j in range(n):
            work.saltation[i, j] -= work.sizes[i, j]


@njit(**KERNEL)
def add_change_of_duration(model, method, run, target, span, work):
    """Add the effect of a change of the chatter's duration to ``work.saltation``; whether there is one.

    A state that chatters longer drifts longer with the mean field of the chatter, and shorter with that of
    the limit mode; where the two agree, up to what the error of the limit makes of them, nothing is added.
    Where they do not, the matrix is made that of the whole chatter, from its beginning to its end.
    The duration ``2 v / (a (1 - r))`` after a jump at speed ``v`` changes with the speed, and with the height
    through its energy, and with what changes the acceleration or the restitution; its derivative, that of the
    instant of the limit, goes to ``run.instant``. To be called after ``chatter_matrix``, whose slope it uses.
    """
    n, transition = model.dimension, run.last_fired
    ratio, speed = run.restitution, run.trail[BEFORE, n]
    limit, side = run.phase + span, -far_side(model, run, transition)
    mean = work.trial
    add_turn_of_impulse(model, run, transition, limit, side * speed, span, work)
    add_change_of_impacts(model, run, transition, side * speed, span, work)
    pull = -side * mean_field(model, run, transition, limit, work.settled, mean, work)
    model.field(target, limit, work.settled, model.parameters, work.field_after)
    model.field_jacobian(target, limit, work.settled, model.parameters, work.reset_jacobian)
    by_speed = 2.0 * side / (pull * (1.0 - ratio))
    by_height = side * (1.0 + ratio) / (speed * (1.0 - ratio))
    # The gradient has since been that at the limit. A guard that bends has another one here.
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    for j in range(n):
        run.instant[j] = by_speed * work.error[j] + by_height * work.gradient[j]
        run.instant[j] += span * (side * work.rounding[0, j] / pull + work.rounding[1, j] / (1.0 - ratio))
    apart, excess, tolerances = False, work.field_after, work.rounding[2]
    for j in range(n):
        tolerances[j] = method.atol + method.rtol * run.scale[j]
    for i in range(n):
        # Rounding of the fields and of the impulse, a quotient by the speed, and the error of the limit.
        blurred = abs(work.field[i]) + abs(work.field_after[i]) + pull * run.scale[i] / speed
        blurred *= 16.0 * EPSILON
        blurred += spread_of_rate(model, run.mode, i, work.jacobian, tolerances)
        blurred += spread_of_rate(model, target, i, work.reset_jacobian, tolerances)
        excess[i] = mean[i] - excess[i]
        if abs(excess[i]) > blurred:
            apart = True
        else:
            excess[i] = 0.0
    if apart:
        drift_with_mean(model, run, transition, span, work)
        for i in range(n):
            for j in range(n):
                work.saltation[i, j] += excess[i] * run.instant[j]
    return apart
