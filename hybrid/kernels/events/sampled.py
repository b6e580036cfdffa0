"""Guards evaluated at some places of a step: those that could not be traced, and those at rest at zero."""

from numba import njit

from hybrid.kernels.arithmetic.bernstein import crosses_towards
from hybrid.kernels.events.guards import guard_value, rounding_band
from hybrid.kernels.events.onset import BY_STEP, has_just_fired, is_zero
from hybrid.kernels.events.path import state_at, time_at
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# Returned instead of a place on the step if there is none.
NOWHERE = -1.0
# A guard that is zero at the start of the step is searched from this share of the step on.
SETTLED = 64.0 * EPSILON
# Number of parts of a step; a guard that could not be traced is evaluated at their ends.
SAMPLES = 32
# Number of places at which a guard is evaluated whose speed and acceleration are zero too.
PLACES_AT_REST = 8


@njit(**KERNEL)
def sample(model, transition, path, order, clock, start, pace, place, work):
    """Value of a guard at a place of the step, from the compiled function."""
    state_at(path, order, model.dimension, place, work.state)
    t = time_at(path, order, clock, start, pace, place)
    return guard_value(model, transition, t, work.state, work.scalar)


@njit(**KERNEL)
def sampled_change(model, run, transition, path, order, clock, start, pace, length, side, on_guard, work):
    """As ``first_change``, for a guard that could not be traced: it is evaluated at some places only."""
    run.unproved += 1
    direction, low = model.direction[transition], 0.0
    for i in range(1, SAMPLES + 1):
        high = length * i / SAMPLES
        value = sample(model, transition, path, order, clock, start, pace, high, work)
        if value * side < 0.0:
            left, right = low, high
            if low == 0.0 and not is_zero(on_guard):
                first = sample(model, transition, path, order, clock, start, pace, 0.0, work)
                right = 0.0 if first * side <= 0.0 else high
            elif low == 0.0 and on_guard == BY_STEP:
                right = 0.0
            while right - left > 2.0 * EPSILON * right:
                middle = 0.5 * (left + right)
                if not left < middle < right:
                    break
                if sample(model, transition, path, order, clock, start, pace, middle, work) * side > 0.0:
                    left = middle
                else:
                    right = middle
            side = -side
            again = right <= SETTLED * length and has_just_fired(run, transition, on_guard)
            if crosses_towards(direction, side) and not again:
                return right, side, length
        elif side == 0 and value != 0.0:
            side = 1 if value > 0.0 else -1
        low = high
    return NOWHERE, side, length


@njit(**KERNEL)
def rests(model, run, transition, path, order, clock, start, pace, length, work):
    """Whether the state rests on a guard: it started there without speed, and the guard stays zero.

    A guard that is zero at the end of the step may have left zero and come back, so more places are checked.
    """
    if run.on_guard[transition] != BY_STEP:
        return False
    for i in range(1, PLACES_AT_REST + 1):
        place = length * i / PLACES_AT_REST
        value = sample(model, transition, path, order, clock, start, pace, place, work)
        t = time_at(path, order, clock, start, pace, place)
        model.guard_gradient(transition, t, work.state, model.parameters, work.gradient)
        if abs(value) > rounding_band(model, run, transition, t, work.state, work):
            return False
    return True
