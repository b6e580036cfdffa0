"""Entering a mode, and the jump: reset, saltation matrix, tangent vectors."""

import math

from numba import boolean, float64, int64, njit, types, void

from hybrid.kernels.codes import (
    CYCLE,
    ENTERING,
    JUMPS,
    JUMPS_HERE,
    LARGEST_SALTATION,
    LAST_FIRED,
    LAST_JUMP_CYCLE,
    LAST_JUMP_PHASE,
    LOG_DETERMINANT,
    MODE,
    NO_TRANSITION,
    PHASE,
    PHASE_OF_RUN,
    PREVIOUS_MODE,
    SINGULAR_JUMPS,
    STEPS,
)
from hybrid.kernels.guards import guard_acceleration, guard_speed, guard_value, rounding_band, widen_scale
from hybrid.kernels.layout import ENTRY, KERNEL, MODEL, RECORD, RUN, VECTOR, WORK
from hybrid.kernels.tangent import COLLAPSED, log_abs_determinant, orthonormalise


@njit(void(MODEL, RUN, WORK), **KERNEL)
def sides_at_jump(model, run, work):
    """Bring the sides of the guards of the mode, known at the ends of a step only, to the point of the jump.

    A guard on which the jump happens has not been crossed yet: it keeps the side it had before. A guard that
    fires both ways is followed no further than that: its side is 0 away from the guard.
    """
    mode, t = run.count[MODE], run.clock[PHASE]
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        direction = model.direction[transition]
        value = guard_value(model, transition, t, run.y, work.scalar)
        model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
        beyond = value * direction > 0.0
        if abs(value) > rounding_band(model, run, t, work.gradient):
            run.side[transition] = direction if beyond else -direction
        elif direction != 0:
            run.side[transition] = -direction


@njit(types.Tuple((int64, boolean))(MODEL, RUN, WORK), **ENTRY)
def enter(model, run, work):
    """Take sides at every guard of the mode just entered; return a transition that must fire at once, if any.

    The half-open rule: a guard that is zero here, up to rounding, takes its side from its speed, and from its
    acceleration where the speed vanishes too. A guard that the state has come to lie on or beyond fires at
    once, except the transition that has just fired: if the state moves on through its guard the crossing is
    done, and if it rests there the second value is true: the transition would fire for ever. A guard that
    fires both ways does so at once if it was crossed, on the way, at the very instant of another's jump.
    """
    mode, t = run.count[MODE], run.clock[PHASE]
    n = model.dimension
    landed = run.count[JUMPS] > 0
    fires, stuck = NO_TRANSITION, False
    model.flow(mode, t, run.y, model.parameters, work.field)
    if run.count[STEPS] == 0:
        widen_scale(model, run, work)
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        value = guard_value(model, transition, t, run.y, work.scalar)
        speed = guard_speed(model, transition, t, run.y, work.field, work.gradient)
        band = rounding_band(model, run, t, work.gradient)
        on_guard = abs(value) <= band
        resting = False
        trend = value
        if on_guard:
            trend = speed
            size = abs(work.gradient[n])
            for i in range(n):
                size += abs(work.gradient[i] * work.field[i])
            if abs(speed) <= 1e-14 * size or speed == 0.0:
                resting = True
                trend = guard_acceleration(model, transition, mode, t, run.y, work)
        direction = model.direction[transition]
        before = run.side[transition] if run.count[PREVIOUS_MODE] == mode else 0
        side = 1 if trend > 0.0 else (-1 if trend < 0.0 else -direction)
        run.side[transition] = side
        run.on_guard[transition] = (2 if resting else 1) if on_guard else 0
        inbound = side == direction or (direction == 0 and on_guard and side * before < 0)
        if not inbound or model.marker[transition] == 1:
            continue
        if landed and transition == run.count[LAST_FIRED]:
            stuck = stuck or (on_guard and resting)
        elif (
            fires == NO_TRANSITION
            and before != side
            and (on_guard or landed or model.boundary[transition] == 1)
        ):
            fires = transition
    return fires, stuck


@njit(float64(MODEL, int64, int64, float64, VECTOR, VECTOR, WORK), **ENTRY)
def saltation(model, transition, mode, t, x_minus, x_plus, work):
    """Saltation matrix into ``work.saltation (n, n)`` and the state after the jump into ``x_plus (n,)``.

    ``Xi = D_x R + (f_plus - D_x R f_minus - D_t R) D_x g / (D_t g + D_x g f_minus)``, with all time terms
    (Kong, Payne, Zhu and Johnson 2024, arXiv:2306.06862). Returns the transversality, the denominator. Where
    that is zero the matrix holds ``D_x R`` alone if the fields agree, else infinities.
    """
    n = model.dimension
    model.flow(mode, t, x_minus, model.parameters, work.field)
    transversality = guard_speed(model, transition, t, x_minus, work.field, work.gradient)
    model.reset(transition, t, x_minus, model.parameters, x_plus)
    model.reset_jacobian(transition, t, x_minus, model.parameters, work.reset_jacobian)
    model.flow(model.target[transition], t, x_plus, model.parameters, work.field_after)
    for i in range(n):
        difference = work.field_after[i] - work.reset_jacobian[i, n]
        for j in range(n):
            difference -= work.reset_jacobian[i, j] * work.field[j]
        for j in range(n):
            work.saltation[i, j] = work.reset_jacobian[i, j]
            term = difference * work.gradient[j]
            if term != 0.0:
                work.saltation[i, j] += term / transversality
    return transversality


@njit(void(MODEL, RUN, RECORD, int64, int64, boolean, WORK), **KERNEL)
def jump(model, run, record, transition, tangents, orthonormal, work):
    """Make a jump at the current point of the run: state, tangent vectors, counters, record.

    With ``orthonormal`` the tangent vectors are orthonormalised before and after, so that a direction the
    saltation matrix annihilates is told from one that is merely short.
    """
    n = model.dimension
    t, y = run.clock[PHASE], run.y
    x_plus = work.new
    transversality = saltation(model, transition, run.count[MODE], t, y, x_plus, work)
    sides_at_jump(model, run, work)
    slot = record.used[1]
    if slot < record.jump_time.shape[0]:
        record.jump_time[slot, 0] = t
        record.jump_time[slot, 1] = transversality
        record.jump_place[slot, 0] = run.count[CYCLE]
        record.jump_place[slot, 1] = transition
        for i in range(n):
            record.jump_states[slot, 0, i] = y[i]
            record.jump_states[slot, 1, i] = x_plus[i]
            for j in range(n):
                record.jump_saltation[slot, i, j] = work.saltation[i, j]
        record.used[1] = slot + 1
    largest = 0.0
    for i in range(n):
        for j in range(n):
            largest = max(largest, abs(work.saltation[i, j]))
    run.clock[LARGEST_SALTATION] = max(run.clock[LARGEST_SALTATION], largest)
    if not math.isfinite(largest):
        run.count[SINGULAR_JUMPS] += 1
    if tangents > 0:
        if orthonormal:
            orthonormalise(y, n, tangents, run.growth, 0.0)
        for start in range(n, n * (1 + tangents), n):
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += work.saltation[i, j] * y[start + j]
                work.state[i] = total
            for i in range(n):
                y[start + i] = work.state[i]
        if orthonormal:
            orthonormalise(y, n, tangents, run.growth, COLLAPSED)
        run.clock[LOG_DETERMINANT] += log_abs_determinant(work.saltation, work.reset_jacobian, n)
    for i in range(n):
        y[i] = x_plus[i]
        run.scale[i] = max(run.scale[i], abs(x_plus[i]))
    same_instant = run.clock[LAST_JUMP_PHASE] == t and run.clock[LAST_JUMP_CYCLE] == run.count[CYCLE]
    run.count[JUMPS_HERE] = run.count[JUMPS_HERE] + 1 if same_instant else 1
    run.clock[LAST_JUMP_PHASE] = t
    run.clock[LAST_JUMP_CYCLE] = run.count[CYCLE]
    run.count[JUMPS] += 1
    run.count[LAST_FIRED] = transition
    run.count[PREVIOUS_MODE] = run.count[MODE]
    run.count[MODE] = model.target[transition]
    run.count[PHASE_OF_RUN] = ENTERING
