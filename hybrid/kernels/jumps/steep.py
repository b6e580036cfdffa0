"""Roots of a guard in modes that steps in time follow: they do not know the last part of the way to zero.

Near a guard ``z`` a slope like ``z**(p - 1)`` with ``p < 1`` changes tangent vectors by ``z**p`` until ``z``
is zero; rounding hides the last part, and with ``p = 1/2`` the root of rounding is missing. A level that such
a root brings to zero is not known below the tolerances. Series in the root of the guard miss nothing.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import spread_of_rate
from hybrid.kernels.events.guards import displace, error_band, gradient_band, guard_speed
from hybrid.kernels.events.resolution import FARTHER, speed_displaced
from hybrid.kernels.types.codes import RUNGE_KUTTA
from hybrid.kernels.types.options import INLINE, KERNEL

# The time of a jump may be off by this many times ``rtol``, as a share of the time spent in the mode.
MOST_UNKNOWN = 100.0


@njit(**INLINE)
def hides_roots(model, mode):
    """Whether steps in time follow a mode whose field may have roots of its guards."""
    return model.steep[mode] == 1 and model.propagator[mode] == RUNGE_KUTTA


@njit(**KERNEL)
def note_steep(model, method, run, speed, work):
    """Count a jump, at a guard with this ``speed``, beside which tangent vectors change in its rounding.

    The guard's gradient is ``work.gradient``. They change there by more than the tolerance.
    """
    mode, n, moved, lost = run.mode, model.dimension, work.error, 0.0
    band = gradient_band(model, run, run.phase, work.gradient)
    for i in range(n):
        moved[i] = band
    for side in (-1.0, 1.0):
        displace(model, run.y, side * band, work.gradient, work.state)
        model.field_jacobian(mode, run.phase, work.state, model.parameters, work.jacobian)
        for i in range(n):
            change = spread_of_rate(model, mode, i, work.jacobian, moved)
            # No number: the mode has no field on that side.
            lost = change if change > lost else lost
    run.steep_jumps += 1 if lost > method.rtol * abs(speed) else 0


@njit(**KERNEL)
def keep_unknown_time(model, method, run, transition, speed, work):
    """Keep how far the time of a jump may be off if its guard, with this ``speed``, comes to rest.

    A guard ``h`` that comes to rest as ``h' = -c h**q`` takes the time ``h / ((1 - q) c h**q)`` from where
    the tolerances cease to know it. The guard's gradient is ``work.gradient``.
    """
    t, level = run.phase, error_band(method, run, work.gradient, model.controlled)
    for side in (-1.0, 1.0):
        if side == model.direction[transition]:
            continue
        near = abs(speed_displaced(model, transition, run.mode, t, run.y, side * level, work))
        far = abs(speed_displaced(model, transition, run.mode, t, run.y, side * FARTHER * level, work))
        # A guard that is crossed at a speed has about that speed beside zero.
        if not 2.0 * abs(speed) < near:
            continue
        exponent = math.log(far / near) / math.log(FARTHER)
        unknown = level / near / (1.0 - exponent) if exponent < 1.0 else math.inf
        if unknown > max(run.unknown_time, MOST_UNKNOWN * method.rtol * run.since_entry):
            run.unknown_time, run.ran_dry = unknown, transition


@njit(**KERNEL)
def look_for_roots(model, method, run, transition, tangents, work):
    """Note what steps in time do not know of the way to the guard of a transition that is about to fire."""
    model.field(run.mode, run.phase, run.y, model.parameters, work.field)
    speed = guard_speed(model, transition, run.phase, run.y, work.field, work.gradient)
    if tangents > 0:
        note_steep(model, method, run, speed, work)
    keep_unknown_time(model, method, run, transition, speed, work)
