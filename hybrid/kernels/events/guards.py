"""Guards at a point: value, speed and acceleration, and how far rounding can move each of them."""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import change_of_rate, jacobian_with_opposites, spread_of_rate
from hybrid.kernels.types.codes import TERMS
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Rounding error that a component of the state may have, as a multiple of EPSILON times its size.
ROUNDING_OF_STATE = 16
# How far from zero a jump may leave a guard, as a multiple of its rounding band.
LEFT_BEHIND = 16.0


@njit(**INLINE)
def guard_value(model, transition, t, x, scalar):
    """``g(t, x, p)``; ``scalar (1,)`` is scratch."""
    model.guard(transition, t, x, model.parameters, scalar)
    return scalar[0]


@njit(**INLINE)
def size_of_time(model, t):
    """Largest time whose rounding the phase ``t`` may carry: it has come here from the end of a period."""
    return max(abs(t), model.period)


@njit(**KERNEL)
def allowed(model, transition, t, x, scalar):
    """Whether the condition of a transition holds; a transition without a condition is always allowed."""
    scalar[0] = 1.0
    return guard_value(model, transition + model.target.shape[0], t, x, scalar) > 0.0


@njit(**INLINE)
def guard_speed(model, transition, t, x, field, gradient):
    """Transversality ``D_t g + D_x g f``; writes ``(D_x g, D_t g)`` into ``gradient (n + 1,)``."""
    model.guard_gradient(transition, t, x, model.parameters, gradient)
    speed = gradient[model.dimension]
    for i in range(model.dimension):
        speed += gradient[i] * field[i]
    return speed


@njit(**INLINE)
def has_program(model, transition):
    """Whether a guard has a program that bounds it: the guard is then neither affine nor opaque."""
    return model.programs.first[transition + 1] > model.programs.first[transition]


@njit(**INLINE)
def is_forced(model, mode):
    """Whether the vector field of a mode has terms in time alone that are bounded over each step."""
    return model.first_forcing[mode + 1] > model.first_forcing[mode]


@njit(**INLINE)
def has_terms_in_state(model, mode):
    """Whether the vector field of a mode has parts that may be flat and have a pulse in the state."""
    last = model.first_forcing[mode + 1] - 1
    return last >= model.first_forcing[mode] and model.forcing_kind[last] == TERMS


@njit(**KERNEL)
def rounding_band(model, run, transition, t, x, work):
    """How far from zero rounding alone can leave a guard at ``(t, x)``; ``work.gradient`` is current.

    ``run.scale`` holds the sizes of the state's components. Near a flat root, a kink or a jump the gradient
    is no measure of this distance: a guard that has a program is bounded over the states that rounding cannot
    tell from ``x``.
    """
    if has_program(model, transition):
        share = ROUNDING_OF_STATE * EPSILON
        clock = size_of_time(model, t)
        band = abs(model.spread(model.programs, transition, t, clock, x, run.scale, share, work.registers))
        return band if band >= 0.0 else 0.0
    return smooth_band(model, run, transition, t, x, work)


@njit(**KERNEL)
def may_jump(model, run, transition, t, x, work):
    """Whether a guard that has a program may jump between states that rounding cannot tell from ``x``."""
    if not has_program(model, transition):
        return False
    share = ROUNDING_OF_STATE * EPSILON
    clock = size_of_time(model, t)
    return model.spread(model.programs, transition, t, clock, x, run.scale, share, work.registers) < 0.0


@njit(**KERNEL)
def was_left_behind(model, run, transition, t, x, speed, side, work):
    """Whether the rounding of a jump has left a guard beyond zero that moves back to the known ``side``.

    Such a guard has not been crossed. A guard that jumps is never left beyond zero by rounding.
    """
    if not speed * side > 0.0:
        return False
    if may_jump(model, run, transition, t, x, work):
        return False
    value = guard_value(model, transition, t, x, work.scalar)
    return abs(value) <= LEFT_BEHIND * rounding_band(model, run, transition, t, x, work)


@njit(**INLINE)
def gradient_band(model, run, t, gradient):
    """How far rounding of state and time moves a guard with this gradient ``(n + 1,)``."""
    n = model.dimension
    size = abs(gradient[n]) * size_of_time(model, t)
    for i in range(n):
        size += abs(gradient[i]) * run.scale[i]
    return ROUNDING_OF_STATE * EPSILON * size


@njit(**KERNEL)
def carry_rounding(model, run, transition, t, x, after, jacobian, sizes):
    """Carry the sizes by which rounding is judged through a reset from ``x (n,)`` to ``after (n,)``.

    A reset moves the rounding ``r`` of the state to ``abs(D_x R) r``, and rounds its own result. Within a
    mode the state keeps its units: these sizes are for a reset into another one.
    ``jacobian (n, n + 1)`` and ``sizes (n,)`` are scratch.
    """
    n = model.dimension
    model.reset_jacobian(transition, t, x, model.parameters, jacobian)
    for i in range(n):
        size = 0.0
        for j in range(n):
            size += abs(jacobian[i, j]) * run.scale[j]
        sizes[i] = max(run.scale[i], size if size < math.inf else 0.0, abs(after[i]))
    for i in range(n):
        run.scale[i] = sizes[i]


@njit(**INLINE)
def displace(model, x, distance, gradient, out):
    """Write the state beside ``x (n,)`` where a guard is larger by ``distance`` into ``out``.

    If the guard, whose gradient is given, does not depend on the state, that is ``x``.
    """
    n, square = model.dimension, 0.0
    for i in range(n):
        square += gradient[i] * gradient[i]
    for i in range(n):
        out[i] = x[i] + (distance * gradient[i] / square if square > 0.0 else 0.0)


@njit(**INLINE)
def smooth_band(model, run, transition, t, x, work):
    """``rounding_band`` from the gradient in ``work.gradient`` and from terms that may cancel."""
    band = gradient_band(model, run, t, work.gradient)
    program = transition + model.target.shape[0] + model.first_forcing[-1] + model.first_residue[-1]
    return band + spread_of_terms(model, run, program, ROUNDING_OF_STATE * EPSILON, t, x, work)


@njit(**KERNEL)
def spread_of_terms(model, run, program, share, t, x, work):
    """How far rounding can move terms from their value; 0 if they have no program or may jump.

    The state and the time are off by this ``share`` of their sizes; with 0 only the terms are rounded.
    """
    if not has_program(model, program):
        return 0.0
    clock = size_of_time(model, t)
    spread = model.spread(model.programs, program, t, clock, x, run.scale, share, work.registers)
    return spread if 0.0 < spread < math.inf else 0.0


@njit(**KERNEL)
def pace_of_feedback(model, mode, jacobian):
    """How fast the fastest feedback of a component on itself acts, or of two components on each other."""
    fastest = 0.0
    for i in range(model.dimension):
        for place in range(model.first_slope[mode, i], model.first_slope[mode, i + 1]):
            j = model.slope_column[place]
            fastest = max(fastest, abs(jacobian[i, j] * jacobian[j, i]))
    return math.sqrt(fastest)


@njit(**KERNEL)
def widen_scale(model, run, work):
    """Make rounding bands alike at the start and the end of a run, whatever steps lead there.

    The scale of each component is at least its change while its rate changes by its own size, or while the
    fastest feedback between two components acts, if that is shorter, or during the run. A rate that changes
    by no more than rounding tells nothing. Then a run that ends on a guard and a run that starts there agree
    that the guard is zero, in any units. ``work.field`` is current.
    """
    n, mode, t = model.dimension, run.mode, run.phase
    jacobian_with_opposites(model, mode, t, run.y, work.jacobian)
    rounding, feedback = work.state, pace_of_feedback(model, mode, work.jacobian)
    longest = max(run.horizon, size_of_time(model, t)) if run.horizon > 0.0 else math.inf
    for i in range(n):
        size = abs(work.field[i]) + abs(work.jacobian[i, n]) * size_of_time(model, t)
        for place in range(model.first_slope[mode, i], model.first_slope[mode, i + 1]):
            j = model.slope_column[place]
            size += abs(work.jacobian[i, j] * run.y[j])
        rounding[i] = ROUNDING_OF_STATE * EPSILON * size
    first = model.target.shape[0] + model.first_forcing[-1]
    for residue in range(model.first_residue[mode], model.first_residue[mode + 1]):
        share = ROUNDING_OF_STATE * EPSILON
        spread = spread_of_terms(model, run, first + residue, share, t, run.y, work)
        rounding[model.residue_component[residue]] += spread
    for i in range(n):
        change = work.jacobian[i, n] + change_of_rate(model, mode, i, work.jacobian, work.field)
        noise = spread_of_rate(model, mode, i, work.jacobian, rounding)
        rate = abs(work.field[i])
        moment = rate / abs(change) if abs(change) > noise else math.inf
        if feedback > 0.0:
            moment = min(moment, 1.0 / feedback)
        if moment < math.inf:
            moment = min(moment, longest)
            run.scale[i] = max(run.scale[i], rate * moment)


@njit(**INLINE)
def error_band(method, run, gradient, n):
    """How far the tolerances can move a guard with this gradient; a turn closer to zero is a grazing."""
    size = 0.0
    for i in range(n):
        size += abs(gradient[i]) * (method.atol + method.rtol * run.scale[i])
    return size


@njit(**INLINE)
def acceleration_along(model, mode, work):
    """Acceleration of a plane with normal ``work.gradient``; field and Jacobian in ``work`` are current."""
    total = 0.0
    for i in range(model.dimension):
        if work.gradient[i] != 0.0:
            bend = change_of_rate(model, mode, i, work.jacobian, work.field)
            total += work.gradient[i] * (work.jacobian[i, model.dimension] + bend)
    return total


@njit(**KERNEL)
def guard_acceleration(model, run, transition, mode, t, x, work):
    """Second Lie derivative of a guard along the flow; ``work.field`` and ``work.gradient`` are current.

    ``D_x g (D_x f f + D_t f)`` is exact, and so is the curvature of a traced guard along the frozen vector
    field. That of any other guard is the difference quotient of its speed.
    """
    n = model.dimension
    model.field_jacobian(mode, t, x, model.parameters, work.jacobian)
    total = acceleration_along(model, mode, work)
    if model.affine_guard[transition] == 1:
        return total
    for i in range(n):
        work.state[i] = work.field[i]
    model.guard_curvature(transition, t, x, model.parameters, work.state)
    if not math.isnan(work.state[0]):
        return total + work.state[0]
    size, speed = 0.0, 0.0
    for i in range(n):
        # The size of a component that the guard does not have says nothing of how the guard bends.
        if work.gradient[i] != 0.0:
            size = max(size, abs(x[i]), run.scale[i])
        speed = max(speed, abs(work.field[i]))
    epsilon = 1e-7 * (size if size > 0.0 else 1.0) / (speed if speed > 0.0 else 1.0)
    for i in range(n):
        work.state[i] = x[i] + epsilon * work.field[i]
    before = guard_speed(model, transition, t, x, work.field, work.gradient)
    after = guard_speed(model, transition, t + epsilon, work.state, work.field, work.gradient)
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return total + (after - before) / epsilon


@njit(**KERNEL)
def keep_grazing(model, run, record, transition, t, x, value, work):
    """Count a touch of a guard at the state ``x (n,)``, and record it if the record has room."""
    run.grazings += 1
    slot, mode = record.grazings, run.mode
    if slot == record.grazing_phase.shape[0]:
        return
    for i in range(model.dimension):
        record.grazing_state[slot, i] = x[i]
    place = record.grazing_state[slot]
    model.field(mode, t, place, model.parameters, work.field)
    guard_speed(model, transition, t, place, work.field, work.gradient)
    record.grazing_phase[slot] = t
    record.grazing_cycle[slot] = run.cycle
    record.grazing_transition[slot] = transition
    record.grazing_jumps[slot] = run.jumps
    record.grazing_value[slot] = value
    record.grazing_acceleration[slot] = guard_acceleration(model, run, transition, mode, t, place, work)
    record.grazings = slot + 1
