"""Slopes of a field that are infinite at a guard, where steps in time lose digits of the tangent vectors.

Near a guard ``z`` a slope like ``z**(p - 1)`` with ``p < 1`` changes tangent vectors by ``z**p`` until ``z``
is zero. Rounding hides the last part of ``z``: with ``p = 1/2``, the root of rounding is missing. Series in
the root of the guard miss nothing.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import change_of_rate
from hybrid.kernels.events.guards import displace, error_band, gradient_band, guard_speed
from hybrid.kernels.events.resolution import FARTHER, speed_displaced
from hybrid.kernels.types.codes import RUNGE_KUTTA
from hybrid.kernels.types.options import KERNEL

# A slope that is larger at the guard by this factor grows without limit.
GROWS = 1.02
# A guard comes to rest if its speed is lower by this factor than where the tolerances cease to know it.
SLOWS = 0.5
# The time of a jump may be off by this many times ``rtol``, as a share of the time spent in the mode.
MOST_UNKNOWN = 100.0


@njit(**KERNEL)
def rates_beside(model, run, mode, t, distance, tangents, out, work):
    """Rates of the tangent vectors at a ``distance`` from the guard with the gradient ``work.gradient``."""
    n = model.dimension
    displace(model, run.y, distance, work.gradient, work.state)
    model.field_jacobian(mode, t, work.state, model.parameters, work.jacobian)
    for start in range(n, n * (1 + tangents), n):
        for i in range(n):
            out[start + i] = change_of_rate(model, mode, i, work.jacobian, run.y[start:])


@njit(**KERNEL)
def is_lost_at_slope(model, method, run, mode, transition, side, tangents, work):
    """Whether tangent vectors change by more than the tolerance over the rounding of a guard, on one side.

    Uses ``work.new`` and ``work.trial`` as scratch.
    """
    n, t = model.dimension, run.phase
    if model.steep[mode] == 0 or model.propagator[mode] != RUNGE_KUTTA:
        return False
    model.field(mode, t, run.y, model.parameters, work.field)
    speed = abs(guard_speed(model, transition, t, run.y, work.field, work.gradient))
    distance = gradient_band(model, run, t, work.gradient)
    rates_beside(model, run, mode, t, side * distance, tangents, work.new, work)
    rates_beside(model, run, mode, t, side * FARTHER * distance, tangents, work.trial, work)
    for start in range(n, n * (1 + tangents), n):
        square = 0.0
        for i in range(start, start + n):
            square += run.y[i] * run.y[i]
        floor = math.sqrt(square / model.controlled)
        for i in range(start, start + n):
            grows = abs(work.new[i]) > GROWS * abs(work.trial[i])
            lost = abs(work.new[i]) * distance
            if grows and lost > method.rtol * (floor + abs(run.y[i])) * speed:
                return True
    return False


@njit(**KERNEL)
def is_steep(model, method, run, transition, tangents, work):
    """Whether steps have lost digits on the way to the guard of a transition that is about to fire."""
    side = -float(model.direction[transition])
    return is_lost_at_slope(model, method, run, run.mode, transition, side, tangents, work)


@njit(**KERNEL)
def is_steep_behind(model, method, run, fired, tangents, work):
    """Whether steps will lose digits on the way from the guard of the transition that has just fired."""
    mode = run.mode
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        other = model.outgoing[slot]
        if model.surface[other] == model.surface[fired] and is_lost_at_slope(
            model, method, run, mode, other, -float(model.direction[other]), tangents, work
        ):
            return True
    return False


@njit(**KERNEL)
def time_to_run_dry(model, method, run, transition, side, speed, work):
    """How long the guard needs from where the tolerances cease to know it; 0 if it is crossed at a speed.

    A guard ``h`` that comes to rest as ``h' = -c h**q`` takes the time ``h / ((1 - q) c h**q)``. ``speed`` is
    that at the guard, and ``work.gradient`` its gradient there.
    """
    t, level = run.phase, error_band(method, run, work.gradient, model.controlled)
    near = abs(speed_displaced(model, transition, run.mode, t, run.y, side * level, work))
    if not abs(speed) < SLOWS * near:
        return 0.0
    far = abs(speed_displaced(model, transition, run.mode, t, run.y, side * FARTHER * level, work))
    exponent = math.log(far / near) / math.log(FARTHER)
    return level / near / (1.0 - exponent) if exponent < 1.0 else math.inf


@njit(**KERNEL)
def keep_unknown_time(model, method, run, transition, work):
    """Keep how far the time of the pending jump may be off if its guard comes to rest in steps in time.

    Such steps do not control the level below the tolerances, and it may take long to run out.
    """
    mode, t, direction = run.mode, run.phase, model.direction[transition]
    if model.steep[mode] == 0 or model.propagator[mode] != RUNGE_KUTTA:
        return
    for side in (-1, 1):
        if side == direction:
            continue
        model.field(mode, t, run.y, model.parameters, work.field)
        speed = guard_speed(model, transition, t, run.y, work.field, work.gradient)
        unknown = time_to_run_dry(model, method, run, transition, float(side), speed, work)
        if unknown > max(run.unknown_time, MOST_UNKNOWN * method.rtol * run.since_entry):
            run.unknown_time = unknown
            run.ran_dry = transition
