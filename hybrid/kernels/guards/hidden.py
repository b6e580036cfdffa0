"""How long a guard that is zero where a step starts, without speed or acceleration, stays close to zero.

So starts a flight when a contact force has come to zero: the gap grows like the third power of time, or a
higher one. At first it is less than the rounding of its polynomial, and less than the error of the method.
Its signs there say nothing, and the sign that it has where it leaves them is the side to which it goes.
"""

import math

from numba import njit

from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    error_band,
    has_program,
    may_jump,
    rounding_band,
)
from hybrid.kernels.events.onset import AT_REST
from hybrid.kernels.guards.pieces import NO_COLUMN, bounds_on, in_column, sample
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# The least share of a step that is looked at is a half to this power.
MOST_HALVINGS = 50
# The error of an interpolant is at most so many times the tolerances.
MOST_ERROR = 100.0
# Number of places at which a guard is evaluated that could not be traced.
PLACES = 8


@njit(**KERNEL)
def farthest_from_zero(model, path, guard, place, work):
    """How far a guard comes from zero up to a place of the step, at most; infinite if it has no bounds there.

    A guard that could not be traced is only sampled.
    """
    if guard.column != NO_COLUMN or has_program(model, guard.transition):
        bounds = bounds_on(model, path, guard, 0.0, place, work)
        distance = max(abs(bounds.low), abs(bounds.high))
        return distance if distance >= 0.0 else math.inf
    distance = 0.0
    for i in range(1, PLACES + 1):
        there = place * i / PLACES
        value = abs(sample(model, guard.transition, path, there, work))
        distance = max(distance, value) if value >= 0.0 else math.inf
    return distance


@njit(**KERNEL)
def hidden_until(model, method, run, path, guard, end, work):
    """The place of a step up to which the error of the method hides the signs of a guard zero at its start.

    Returned second is whether the guard rests at zero. The tolerances bound the error of a step, not that of
    its interpolant, which may be larger. Then the value of the guard at the ``end`` of the step tells its
    side. A guard that jumps is never small, and its signs are no noise.
    """
    start, length, transition = path.start, path.length, guard.transition
    if may_jump(model, run, transition, start, run.y, work):
        return 0.0, False
    model.guard_gradient(transition, start, run.y, model.parameters, work.gradient)
    error = in_column(path, guard.column, error_band(method, run, work.gradient, model.controlled))
    rounding = in_column(path, guard.column, rounding_band(model, run, transition, start, run.y, work))
    if path.exact and farthest_from_zero(model, path, guard, 0.0, work) <= rounding:
        # Nor has a method that is not exact led to the start of the step.
        error = 0.0
    size = farthest_from_zero(model, path, guard, length, work)
    if guard.on_guard == AT_REST and size < math.inf:
        # What is zero at the start and rests there has a size and rounding on the step.
        rounding += ROUNDING_OF_STATE * EPSILON * size
    noise = rounding + min(max(error, abs(end)), MOST_ERROR * error)
    place, farthest = length, size
    for _ in range(MOST_HALVINGS):
        if farthest <= noise:
            break
        place *= 0.5
        farthest = farthest_from_zero(model, path, guard, place, work)
    return place, size <= rounding
