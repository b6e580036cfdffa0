"""One step of a Radau IIA collocation method for the state and its tangent vectors.

The unknowns are the ``s`` collocation derivatives ``K_i = f(t + c_i h, y + h sum_j a_ij K_j)``, which are the
stages 1 to s; stage 0 is the derivative at the start, which only the error estimate needs. The last node is
the end of the step, so the last of them is the derivative there.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.linear import factorise, substitute
from hybrid.kernels.arithmetic.slopes import whole_jacobian
from hybrid.kernels.steps.step import combine, error_ratio, estimate_error
from hybrid.kernels.types.kinds import INTEGER, REAL, VECTOR
from hybrid.kernels.types.layout import Method, Model, Work
from hybrid.kernels.types.options import KERNEL, exported

MOST_ITERATIONS = 10
# An iteration that no longer contracts has reached rounding if its last change is below this share of the
# tolerance.
STALLED = 1e-2
# Error ratio of a step whose equations could not be solved: the driver then tries about half the step.
NOT_SOLVED = 10.0
# Slots of the last row of Work.systems.
LAST_LENGTH, LAST_MODE = 0, 1


@njit(**KERNEL)
def fill_rows(method, h, jacobian, n, stage, matrix):
    """The ``n`` rows of collocation stage ``stage`` in ``I - h A (x) J``, with the Jacobian of that stage."""
    s = method.b.shape[0]
    row = (stage - 1) * n
    for j in range(1, s + 1):
        weight, column = h * method.a[stage, j], (j - 1) * n
        for i in range(n):
            for k in range(n):
                matrix[row + i, column + k] = -weight * jacobian[i, k]
    for i in range(n):
        matrix[row + i, row + i] += 1.0


@njit(**KERNEL)
def predict(method, mode, h, y, n, work):
    """First guess of the collocation derivatives: those of the last step's polynomial, or zero.

    The polynomial serves where this step starts where that one ended, or where it started (the same step,
    taken again shorter); elsewhere a jump lies between them.
    """
    s = method.b.shape[0]
    last = work.systems[(s + 1) * n + 1 :]
    # In memory that is new the length is zero.
    again = last[s + 2, LAST_LENGTH] > 0.0 and last[s + 2, LAST_MODE] == mode
    onwards = again
    for i in range(n):
        again = again and y[i] == last[s, i]
        onwards = onwards and y[i] == last[s + 1, i]
    for stage in range(1, s + 1):
        for i in range(n):
            work.stages[stage, i] = 0.0
        if again or onwards:
            theta = method.c[stage] * h / last[s + 2, LAST_LENGTH] + (0.0 if again else 1.0)
            for j in range(1, s + 1):
                weight = 1.0
                for other in range(1, s + 1):
                    if other != j:
                        weight *= (theta - method.c[other]) / (method.c[j] - method.c[other])
                for i in range(n):
                    work.stages[stage, i] += weight * last[j - 1, i]


@njit(**KERNEL)
def remember(method, mode, h, y, n, work):
    """Store the polynomial of this step for the next guess."""
    s = method.b.shape[0]
    last = work.systems[(s + 1) * n + 1 :]
    for i in range(n):
        for stage in range(1, s + 1):
            last[stage - 1, i] = work.stages[stage, i]
        last[s, i] = y[i]
        last[s + 1, i] = work.new[i]
    last[s + 2, LAST_LENGTH], last[s + 2, LAST_MODE] = h, mode


@njit(**KERNEL)
def solve_stages(model, method, mode, t, h, y, work):
    """Simplified Newton iteration for the state's stages; their system is factored. False if it fails.

    With the contraction ``theta`` of the last two changes, the error left is ``theta / (1 - theta)`` times
    the last change; that is kept far below the tolerance of the step (Hairer and Wanner 1996, eqs. IV.8.10
    and IV.8.11).
    """
    n, s = model.dimension, method.b.shape[0]
    change_of_stages = work.systems[(s + 1) * n]
    enough = max(10.0 * 2.220446049250313e-16 / method.rtol, min(0.03, math.sqrt(method.rtol)))
    stalled = max(enough, STALLED)
    change, before = 0.0, 0.0
    for iteration in range(MOST_ITERATIONS):
        for stage in range(1, s + 1):
            combine(y, h, method.a[stage], work.stages, s + 1, n, work.trial)
            residual = change_of_stages[(stage - 1) * n : stage * n]
            model.field(mode, t + method.c[stage] * h, work.trial, model.parameters, residual)
            for i in range(n):
                residual[i] -= work.stages[stage, i]
        substitute(work.systems, work.pivots, s * n, change_of_stages)
        for stage in range(1, s + 1):
            for i in range(n):
                work.stages[stage, i] += change_of_stages[(stage - 1) * n + i]
        combine(y, h, method.a[s], work.stages, s + 1, n, work.new)
        square = 0.0
        for i in range(model.controlled):
            size = max(abs(y[i]), abs(work.new[i]))
            for stage in range(1, s + 1):
                # A component may begin and end at zero, as that of a flight from a guard back to it.
                size = max(size, abs(h * work.stages[stage, i]))
            scale = method.atol + method.rtol * size
            for stage in range(1, s + 1):
                shift = 0.0
                for j in range(1, s + 1):
                    shift += method.a[stage, j] * change_of_stages[(j - 1) * n + i]
                square += (h * shift / scale) ** 2
        change = math.sqrt(square / (model.controlled * s))
        if not abs(change) < math.inf:
            return False
        if change <= enough:
            return True
        if iteration > 0:
            theta = change / before
            if theta >= 1.0:
                return change <= stalled
            left = theta / (1.0 - theta) * change
            if left <= enough:
                return True
            if left * theta ** (MOST_ITERATIONS - 2 - iteration) > stalled:
                return False
        before = change
    return change <= stalled


@njit(**KERNEL)
def solve_tangents(model, method, mode, t, h, y, tangents, work):
    """Stages of the tangent vectors, exactly: ``K_i = J_i (v + h sum_j a_ij K_j)`` is linear in them.

    With ``J_i`` the Jacobian at the state's stage ``i``, so that the result is the derivative of the step.
    Leaves div f at the stages in their last place; false if the step's matrix is singular.
    """
    n, s = model.dimension, method.b.shape[0]
    length = n * (1 + tangents)
    vector = work.systems[(s + 1) * n]
    for stage in range(1, s + 1):
        combine(y, h, method.a[stage], work.stages, s + 1, n, work.trial)
        whole_jacobian(model, mode, t + method.c[stage] * h, work.trial, work.jacobian)
        fill_rows(method, h, work.jacobian, n, stage, work.systems)
        trace = 0.0
        for i in range(n):
            trace += work.jacobian[i, i]
        work.stages[stage, length] = trace
        for start in range(n, length, n):
            for i in range(n):
                total = 0.0
                for j in range(n):
                    total += work.jacobian[i, j] * y[start + j]
                work.stages[stage, start + i] = total
    if not factorise(work.systems, work.pivots, s * n):
        return False
    for start in range(n, length, n):
        for stage in range(1, s + 1):
            for i in range(n):
                vector[(stage - 1) * n + i] = work.stages[stage, start + i]
        substitute(work.systems, work.pivots, s * n, vector)
        for stage in range(1, s + 1):
            for i in range(n):
                work.stages[stage, start + i] = vector[(stage - 1) * n + i]
    return True


@exported(REAL, Model, Method, INTEGER, REAL, REAL, VECTOR, INTEGER, Work)
def attempt_radau(model, method, mode, t, h, y, tangents, work):
    """Try a step of length ``h`` from ``y``; its result is ``work.new``. Returns the error ratio.

    ``work.stages[0]`` holds the rates at ``(t, y)``; those at the new point are left in ``work.stages[s]``.
    The estimate of the new point's error is filtered by ``(I - h gamma_0 J)^-1`` (Hairer and Wanner 1996, eq.
    IV.8.19). Unfiltered it is ``h gamma_0`` times the jump of the derivative at the start of the step, which
    is the size of the interpolant's error: that is controlled for the state too, because guards follow the
    interpolant, and a stiff component, right at the steps' ends, may be anything between.
    """
    n, s = model.dimension, method.b.shape[0]
    length = n * (1 + tangents)
    whole_jacobian(model, mode, t, y, work.jacobian)
    for stage in range(1, s + 1):
        fill_rows(method, h, work.jacobian, n, stage, work.systems)
    gamma = method.error[0]
    estimate_filter, filter_pivots = work.systems[s * n :], work.pivots[s * n :]
    for i in range(n):
        for j in range(n):
            estimate_filter[i, j] = -h * gamma * work.jacobian[i, j]
        estimate_filter[i, i] += 1.0
    if not (factorise(work.systems, work.pivots, s * n) and factorise(estimate_filter, filter_pivots, n)):
        return math.nan
    predict(method, mode, h, y, n, work)
    if not solve_stages(model, method, mode, t, h, y, work):
        work.systems[work.systems.shape[0] - 1, LAST_LENGTH] = 0.0
        # Whoever repeats a step up to an event does not ask for its error: what is left here is no step.
        for i in range(length):
            work.new[i] = math.nan
        return NOT_SOLVED
    remember(method, mode, h, y, n, work)
    if tangents > 0 and not solve_tangents(model, method, mode, t, h, y, tangents, work):
        return math.nan
    combine(y, h, method.quadrature, work.stages, s + 1, length, work.new)
    estimate_error(method, length, work)
    between = error_ratio(model, method, h, y, 0, work)
    for start in range(0, length, n):
        substitute(estimate_filter, filter_pivots, n, work.error[start : start + n])
    ratio = error_ratio(model, method, h, y, tangents, work)
    return between if between > ratio else ratio
