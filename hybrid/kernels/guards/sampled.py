"""Guards that could not be traced: they are evaluated at some places of a step."""

from numba import njit

from hybrid.kernels.arithmetic.bernstein import crosses_towards
from hybrid.kernels.events.onset import AT_REST, LATER, has_just_fired
from hybrid.kernels.guards.pieces import NOWHERE, sample
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# A guard that is zero at the start of the step is searched from this share of the step on.
AT_START = 64.0 * EPSILON
# Number of parts of a step; a guard that could not be traced is evaluated at their ends.
SAMPLES = 32


@njit(**KERNEL)
def sampled_change(model, run, path, guard, hidden, work):
    """As ``first_change``, for a guard that could not be traced: it is evaluated at some places only."""
    transition, side, on_guard = guard.transition, guard.side, guard.on_guard
    run.unproved[transition] += 1
    direction, length, low = model.direction[transition], path.length, hidden
    for i in range(1, SAMPLES + 1):
        high = hidden + (length - hidden) * i / SAMPLES
        value = sample(model, transition, path, high, work)
        if value * side < 0.0:
            left, right = low, high
            if i == 1 and on_guard in (0, LATER) and hidden == 0.0:
                first = sample(model, transition, path, 0.0, work)
                right = 0.0 if first * side <= 0.0 else high
            elif i == 1 and on_guard == AT_REST:
                right = 0.0
            while right - left > 2.0 * EPSILON * right:
                middle = 0.5 * (left + right)
                if not left < middle < right:
                    break
                if sample(model, transition, path, middle, work) * side > 0.0:
                    left = middle
                else:
                    right = middle
            side = -side
            again = right <= AT_START * length and has_just_fired(run, transition, on_guard)
            if crosses_towards(direction, side) and not again:
                return right, side, length
            if not again:
                run.passed[transition] = right / length
        elif side == 0 and value != 0.0:
            side = 1 if value > 0.0 else -1
        low = high
    return NOWHERE, side, length
