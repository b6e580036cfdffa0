"""The sign of a guard along the flow, a moment before or after a place where rounding hides it.

A guard that rounding cannot tell from zero is on the side to which the flow takes it. Its speed tells the
side if it takes the guard out of its rounding. Otherwise the sign of the guard itself does, at the first
moment at which rounding no longer hides it. That holds for a guard that leaves zero by its acceleration or by
a higher derivative, at a kink, and where the guard jumps.

The moments grow from the rounding of the time. Each is one step of the classical Runge-Kutta method, whose
error goes with the fifth power of the step. Up to the fifth root of rounding, in units of the time in which
the state changes by its size or a feedback acts, that error is less than rounding. A guard that is still
hidden then is at rest.
"""

import math
from typing import Any, NamedTuple

from numba import njit

from hybrid.kernels.arithmetic.slopes import spread_of_rate
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    guard_speed,
    guard_value,
    may_jump,
    pace_of_feedback,
    rounding_band,
    size_of_time,
    spread_of_terms,
)
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Relative rounding of a state.
ROUNDING_SHARE = ROUNDING_OF_STATE * EPSILON
# Each moment is so many times as long as the last.
LONGER = 16.0
# A guard leaves zero by its speed if that keeps this share of itself until the guard is out of its rounding:
# at a steady acceleration, what it takes to get there.
KEPT_ON_THE_WAY = 0.5
# The longest moment, in units of the time in which the state changes by its size or a feedback acts.
LONGEST_MOMENT = EPSILON**0.2


class Place(NamedTuple):
    """Where a run is: its mode, the time ``t`` and the state ``x (n,)``."""

    mode: Any
    t: Any
    x: Any


@njit(**INLINE)
def unit_of_time(model, run, work):
    """The time in which the state changes by its size, and no more than the run takes, if that is known.

    ``work.field`` is current.
    """
    size, pace = 0.0, 0.0
    for i in range(model.dimension):
        if work.field[i] != 0.0:
            size, pace = max(size, run.scale[i]), max(pace, abs(work.field[i]))
    longest = run.horizon if run.horizon < math.inf else 0.0
    if not size * pace > 0.0:
        return longest
    return min(size / pace, longest) if longest > 0.0 else size / pace


@njit(**INLINE)
def moment_of_rounding(model, run, t, work):
    """The time in which the state moves as far as its rounding; ``work.field`` is current."""
    return EPSILON * max(unit_of_time(model, run, work), size_of_time(model, t))


@njit(**KERNEL)
def speed_rounding(model, run, transition, mode, t, x, work):
    """How far rounding of state and time can move the speed of a guard along its gradient.

    ``work.field`` and ``work.gradient`` are current. Terms in time and parameters alone that may cancel have
    programs of their own (``Model.residue_component``).
    """
    n, gradient, total = model.dimension, work.gradient, abs(work.gradient[model.dimension])
    model.field_jacobian(mode, t, x, model.parameters, work.jacobian)
    for i in range(n):
        if gradient[i] != 0.0:
            spread = abs(work.field[i]) + abs(work.jacobian[i, n]) * size_of_time(model, t)
            spread += spread_of_rate(model, mode, i, work.jacobian, run.scale)
            total += abs(gradient[i]) * spread
    first, cancelling = model.target.shape[0] + model.first_forcing[-1], 0.0
    for residue in range(model.first_residue[mode], model.first_residue[mode + 1]):
        slope = abs(gradient[model.residue_component[residue]])
        if slope != 0.0:
            cancelling += slope * spread_of_terms(model, run, first + residue, ROUNDING_SHARE, t, x, work)
    return ROUNDING_SHARE * total + cancelling


@njit(**KERNEL)
def move_for(model, mode, t, x, moment, out, work):
    """The state a ``moment`` after ``t``, or before, into ``out (n,)``.

    ``work.field`` is that at ``x (n,)``. Where the field has no value the flow goes straight on.
    """
    n, place, rate = model.dimension, work.state, work.field_after
    for i in range(n):
        place[i], out[i] = x[i] + 0.5 * moment * work.field[i], x[i] + moment / 6.0 * work.field[i]
    for stage in range(3):
        later = t + (0.5 if stage < 2 else 1.0) * moment
        model.field(mode, later, place, model.parameters, rate)
        for i in range(n):
            place[i] = x[i] + (0.5 if stage == 0 else 1.0) * moment * rate[i]
            out[i] += moment * (1.0 / 6.0 if stage == 2 else 1.0 / 3.0) * rate[i]
    for i in range(n):
        if math.isnan(out[i]):
            for j in range(n):
                out[j] = x[j] + moment * work.field[j]
            break


@njit(**KERNEL)
def keeps_speed(model, transition, place, speed, moment, work):
    """Whether a guard keeps half of its ``speed`` for a ``moment``; ``work.field`` is current."""
    mode, t, x = place
    for i in range(model.dimension):
        work.settled[i] = x[i] + moment * work.field[i]
    model.field(mode, t + moment, work.settled, model.parameters, work.field_after)
    there = guard_speed(model, transition, t + moment, work.settled, work.field_after, work.gradient)
    return there * speed > KEPT_ON_THE_WAY * speed * speed


@njit(**KERNEL)
def sign_along(model, run, transition, place, way, work):
    """The sign of a guard along the flow, and the first moment when it is certain; zeros if there is none.

    ``way`` is 1 for what comes after the ``place`` of a run, and -1 for what came before. Third comes whether
    the speed of the guard at the place tells. ``work.field`` is current, and is on return.
    """
    _, t, x = place
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    band = rounding_band(model, run, transition, t, x, work)
    return sign_at_speed(model, run, transition, place, way, speed, band, 1.0, work)


@njit(**KERNEL)
def sign_at_speed(model, run, transition, place, way, speed, band, error, work):
    """``sign_along`` for a guard whose ``speed`` and rounding at the place are known.

    The speed tells if it keeps half of itself until the guard is out of its rounding, the ``band``, in a unit
    of time or less. State and time are off by their rounding, or by an ``error`` so many times as large.
    ``work.gradient`` is current.
    """
    mode, t, x = place
    drift = error * speed_rounding(model, run, transition, mode, t, x, work)
    moment, band = error * moment_of_rounding(model, run, t, work), error * band
    if drift < abs(speed) < math.inf and not may_jump(model, run, transition, t, x, work):
        needed = max(band / abs(speed), moment)
        in_time = needed <= max(unit_of_time(model, run, work), moment)
        if in_time and keeps_speed(model, transition, place, speed, way * needed, work):
            return (1 if speed * way > 0.0 else -1), needed, True
    moment *= LONGER
    model.field_jacobian(mode, t, x, model.parameters, work.jacobian)
    longest, feedback = unit_of_time(model, run, work), pace_of_feedback(model, mode, work.jacobian)
    longest = LONGEST_MOMENT * error**0.2 * (min(longest, 1.0 / feedback) if feedback > 0.0 else longest)
    if not drift < math.inf:
        drift = 0.0
    while 0.0 < moment <= longest < math.inf:
        later = t + way * moment
        move_for(model, mode, t, x, way * moment, work.settled, work)
        value = guard_value(model, transition, later, work.settled, work.scalar)
        if abs(value) > moment * drift:
            model.guard_gradient(transition, later, work.settled, model.parameters, work.gradient)
            band = error * rounding_band(model, run, transition, later, work.settled, work)
            if abs(value) > band + moment * drift:
                return (1 if value > 0.0 else -1), moment, False
        moment *= LONGER
    return 0, 0.0, False


@njit(**KERNEL)
def sign_of_speed(model, run, transition, place, work):
    """The sign that a guard's speed has at all states that rounding cannot tell from a place; else 0.

    The speed of a guard that may jump says nothing. ``work.field`` is current.
    """
    mode, t, x = place
    n, beside = model.dimension, work.settled
    speed = guard_speed(model, transition, t, x, work.field, work.gradient)
    drift = speed_rounding(model, run, transition, mode, t, x, work)
    if not drift < abs(speed) < math.inf or may_jump(model, run, transition, t, x, work):
        return 0
    for i in range(n):
        beside[i] = x[i]
    for i in range(n + 1 if model.affine_guard[transition] == 0 else 0):
        for way in (-ROUNDING_SHARE, ROUNDING_SHARE):
            later = t
            if i < n:
                beside[i] = x[i] + way * run.scale[i]
            else:
                later = t + way * size_of_time(model, t)
            if guard_speed(model, transition, later, beside, work.field, work.gradient) * speed < 0.0:
                return 0
        if i < n:
            beside[i] = x[i]
    return 1 if speed > 0.0 else -1
