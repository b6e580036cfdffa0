"""How long a guard that is zero where a step starts, without speed or acceleration, stays close to zero.

So starts a flight when a contact force has come to zero: the gap grows like the third power of time, or a
higher one. At first it is less than the rounding of its polynomial, and less than the error of the method.
Its signs there say nothing, and the sign that it has where it leaves them is the side to which it goes.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.bernstein import halve
from hybrid.kernels.events.guards import (
    ROUNDING_OF_STATE,
    error_band,
    guard_value,
    has_program,
    may_jump,
    rounding_band,
)
from hybrid.kernels.events.path import state_at, time_at
from hybrid.kernels.types.codes import HIGH, LOW
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# The least share of a step that is looked at is a half to this power.
MOST_HALVINGS = 50
# The error of an interpolant is at most so many times the tolerances.
MARGIN = 100.0
# Number of places at which a guard is evaluated that could not be traced.
PLACES = 8


@njit(**KERNEL)
def sample(model, transition, path, place, work):
    """Value of a guard at a place of the step, from the compiled function."""
    state_at(path, model.dimension, place, work.state)
    return guard_value(model, transition, time_at(path, place), work.state, work.scalar)


@njit(**KERNEL)
def farthest_from_zero(model, transition, path, place, work):
    """How far a guard comes from zero up to a place of the step, at most; infinite if it has no bounds there.

    A guard that could not be traced is only sampled.
    """
    if has_program(model, transition):
        half = 0.5 * place
        row = work.registers[model.bound(model.programs, transition, path, half, half, work.registers)]
        distance = max(abs(row[LOW]), abs(row[HIGH]))
        return distance if distance >= 0.0 else math.inf
    distance = 0.0
    for i in range(1, PLACES + 1):
        there = place * i / PLACES
        value = abs(sample(model, transition, path, there, work))
        distance = max(distance, value) if value >= 0.0 else math.inf
    return distance


@njit(**INLINE)
def noise_of_signs(rounding, error, end):
    """A guard that is zero at the start of a step tells no side before it is farther from zero than this.

    The tolerances bound the ``error`` of a step, not that of its interpolant, which may be larger. Then the
    guard's value at the ``end`` of the step tells its side.
    """
    return rounding + min(max(error, abs(end)), MARGIN * error)


@njit(**KERNEL)
def hidden_until(model, method, run, transition, path, end, work):
    """The place of a step up to which the signs of a guard that is zero at its start are noise.

    ``end`` is the value of the guard at the end of the step. Returned second is whether the guard rests at
    zero.

    A guard that jumps is never small, and its signs are no noise.
    """
    start, length = path.start, path.length
    if may_jump(model, run, transition, start, run.y, work):
        return 0.0, False
    model.guard_gradient(transition, start, run.y, model.parameters, work.gradient)
    error = 0.0 if path.exact else error_band(method, run, work.gradient, model.dimension)
    rounding = rounding_band(model, run, transition, start, run.y, work)
    size = farthest_from_zero(model, transition, path, length, work)
    if size < math.inf:
        # What is zero at the start has a size and rounding on the step.
        rounding += ROUNDING_OF_STATE * EPSILON * size
    noise, place, farthest = noise_of_signs(rounding, error, end), length, size
    for _ in range(MOST_HALVINGS):
        if farthest <= noise:
            break
        place *= 0.5
        farthest = farthest_from_zero(model, transition, path, place, work)
    return place, size <= rounding


@njit(**KERNEL)
def hidden_share(coefficients, degree, rounding, error, end, stack):
    """``hidden_until`` for a guard that is a polynomial in Bernstein form, as a share of the step.

    The ``coefficients (degree + 1,)`` become those on the rest of the step. ``stack`` is scratch.
    """
    noise, share = noise_of_signs(rounding, error, end), 1.0
    coefficients[degree] = end
    for i in range(degree + 1):
        stack[0, 2 + i] = coefficients[i]
    for _ in range(MOST_HALVINGS):
        farthest = 0.0
        for i in range(degree + 1):
            farthest = max(farthest, abs(stack[0, 2 + i]))
        if farthest <= noise:
            break
        halve(stack, 0, degree)
        for i in range(degree + 1):
            stack[0, 2 + i] = stack[1, 2 + i]
        share *= 0.5
    for level in range(degree, 0, -1):
        for i in range(level):
            coefficients[i] += share * (coefficients[i + 1] - coefficients[i])
    return share
