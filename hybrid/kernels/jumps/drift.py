"""What the rest of a chatter, from the last jump that is made to its limit, does to tangent vectors."""

import math

from numba import njit

from hybrid.kernels.arithmetic.slopes import whole_jacobian
from hybrid.kernels.events.guards import rounding_band
from hybrid.kernels.jumps.chatter import BEFORE
from hybrid.kernels.types.options import KERNEL

# Change of the Jacobian over the remaining time that counts as none: what it adds to a state, as a share.
SHORT = 1e-10
# Longest remaining time, in units of the field's own time, over which the drift is an exponential.
LONG = 1.0
# The same where the drift is that of the mean field, which is followed to second order.
BRIEF = 1e-4


@njit(**KERNEL)
def feedback(matrix, n):
    """Upper bound of how fast components act back on themselves, over at most two others, in any units."""
    most = 0.0
    for i in range(n):
        for j in range(n):
            there = abs(matrix[i, j])
            most = max(most, math.sqrt(there * abs(matrix[j, i])))
            for k in range(n if there > 0.0 else 0):
                most = max(most, (there * abs(matrix[j, k]) * abs(matrix[k, i])) ** (1.0 / 3.0))
    return n * most


@njit(**KERNEL)
def rounding_of_tangents(model, run, transition, span, work):
    """The share of tangent vectors that is rounding: that of the height of the flight which begins here."""
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    band = rounding_band(model, run, transition, run.phase, run.y, work)
    return band / (0.25 * run.trail[BEFORE, model.dimension] * span * (1.0 - run.restitution))


@njit(**KERNEL)
def is_straight(model, run, mode, span, noise, work):
    """Whether the Jacobian of a mode is the same now and at the limit in ``work.settled``, after ``span``.

    A change counts if it adds more to a state than a share ``noise`` of rounding. The Jacobian at the limit
    is left in ``work.jacobian``.
    """
    n, t = model.dimension, run.phase
    whole_jacobian(model, mode, t, run.y, work.reset_jacobian)
    whole_jacobian(model, mode, t + span, work.settled, work.jacobian)
    for i in range(n):
        change = 0.0
        for j in range(n):
            change += abs(work.jacobian[i, j] - work.reset_jacobian[i, j]) * run.scale[j]
        if change * span > max(SHORT, noise) * run.scale[i]:
            return False
    return True


@njit(**KERNEL)
def drift_is_known(model, run, target, span, noise, work):
    """Whether the tangents' drift to the limit follows from the Jacobians of the flights and of the limit.

    They must not change until then. The Jacobian at the limit is left in ``work.jacobian``.
    """
    flights = is_straight(model, run, run.mode, span, noise, work)
    rests = is_straight(model, run, target, span, noise, work)
    return flights and rests and feedback(work.jacobian, model.dimension) * span <= LONG


@njit(**KERNEL)
def drift(y, n, tangents, matrix, span, term, image):
    """Multiply the tangent vectors in ``y`` by ``exp(matrix span)``, by its series; scratch ``(n,)``."""
    for start in range(n, n * (1 + tangents), n):
        for i in range(n):
            term[i] = y[start + i]
        for order in range(1, 25):
            for i in range(n):
                image[i] = 0.0
                for j in range(n):
                    image[i] += matrix[i, j] * term[j]
            for i in range(n):
                term[i] = image[i] * span / order
                y[start + i] += term[i]
