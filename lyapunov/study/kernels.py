"""The compiled loops of the paper's method: ode23s straight through the contacts, and Benettin's means.

A field is a function ``f(t, y, p, out)``. ``thresholds (n,)`` of the difference quotients are those of
``numjac``: a component is not significant below its threshold.
"""

import math

from numba import njit

from hybrid.kernels.arithmetic.linear import factorise, substitute
from hybrid.kernels.arithmetic.tangent import orthonormalise
from hybrid.kernels.types.kinds import INDICES, INTEGER, MATRIX, REAL, VECTOR, function
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL, exported
from lyapunov.study.places import (
    ACCEPTED,
    COUNTERS,
    DFDT,
    DONE,
    EVALUATIONS,
    F0,
    F1,
    F2,
    FAR,
    INCREMENTS,
    K1,
    K2,
    K3,
    NEW,
    PROBE,
    RECORD_FULL,
    REJECTED,
    SCRATCH_ROWS,
    STEP_TOO_SMALL,
    THRESHOLDS,
)

FIELD = function(None, REAL, VECTOR, VECTOR, VECTOR)

# Constants of the formulas and of the step control (Shampine and Reichelt 1997, sections 3 and 4).
D = 1.0 / (2.0 + math.sqrt(2.0))
E32 = 6.0 + math.sqrt(2.0)
SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.8, 0.1, 5.0
POWER = 1.0 / 3.0
LARGEST_SHARE = 0.1
STRETCH = 1.1
ROOT_EPSILON = math.sqrt(EPSILON)

# Increments of the difference quotients: their range, and the differences that are too small or too large
# (Salane 1986, as used by numjac).
LEAST_INCREMENT, LARGEST_INCREMENT = EPSILON**0.78, 0.1
ROUNDOFF, SMALL, LARGE = EPSILON**0.875, EPSILON**0.75, EPSILON**0.25

STATES = 4
M1, OMEGA1, XI1, M2, OMEGA2, XI2, P, PHI0, OMEGA, GAP, STIFFNESS = range(11)


@exported(None, REAL, VECTOR, VECTOR, VECTOR)
def founding_field(t, y, p, out):
    """Vibro-impact system ``x1, x2, v1, v2`` without events, and its linearisation along tangent vectors."""
    chi, square = p[M2] / p[M1], p[OMEGA2] ** 2
    damping, main = 2.0 * p[XI2] * p[OMEGA2], 2.0 * p[XI1] * p[OMEGA1]
    depth = max(y[0] - y[1], 0.0)
    force, stiffness = p[STIFFNESS] * depth * math.sqrt(depth), 1.5 * p[STIFFNESS] * math.sqrt(depth)
    coupling = damping * (y[2] - y[3]) + square * (y[0] - y[1] + p[GAP])
    drive = p[P] * math.cos(p[OMEGA] * t + p[PHI0])
    out[0], out[1] = y[2], y[3]
    out[2] = -main * y[2] - p[OMEGA1] ** 2 * y[0] - chi * coupling + (drive - force) / p[M1]
    out[3] = coupling + force / p[M2]
    for i in range(STATES, y.shape[0], STATES):
        pull = damping * (y[i + 2] - y[i + 3]) + square * (y[i] - y[i + 1])
        push = stiffness * (y[i] - y[i + 1])
        out[i], out[i + 1] = y[i + 2], y[i + 3]
        out[i + 2] = -main * y[i + 2] - p[OMEGA1] ** 2 * y[i] - chi * pull - push / p[M1]
        out[i + 3] = pull + push / p[M2]


@njit(**KERNEL)
def difference(field, t, y, p, work, increment, j):
    """Put ``f`` at ``y`` with component ``j`` moved into ``work[FAR]``; return the move and two magnitudes.

    The magnitudes are the largest difference of ``f``, and the larger of both values of ``f`` there; the
    latter is zero if one of the two is zero. The move points the way in which the component is going.
    """
    f, far, probe, n = work[F0], work[FAR], work[PROBE], y.shape[0]
    scale = max(abs(y[j]), work[THRESHOLDS, j])
    move = (y[j] + increment * scale) - y[j]
    while move == 0.0 and increment < LARGEST_INCREMENT:
        increment = min(100.0 * increment, LARGEST_INCREMENT)
        move = (y[j] + increment * scale) - y[j]
    if move == 0.0:
        move = work[THRESHOLDS, j]
    move = abs(move) if f[j] >= 0.0 else -abs(move)
    for i in range(n):
        probe[i] = y[i]
    probe[j] += move
    field(t, probe, p, far)
    largest, where = -1.0, 0
    for i in range(n):
        if abs(far[i] - f[i]) > largest:
            largest, where = abs(far[i] - f[i]), i
    magnitude = max(abs(far[where]), abs(f[where])) if far[where] != 0.0 and f[where] != 0.0 else 0.0
    return move, largest, magnitude, increment


@njit(**KERNEL)
def adapted(increment, largest, magnitude):
    """The relative increment for the next Jacobian: larger if rounding is near, smaller if terms are lost."""
    if largest <= SMALL * magnitude:
        return min(10.0 * increment, LARGEST_INCREMENT)
    if largest > LARGE * magnitude:
        return max(0.1 * increment, LEAST_INCREMENT)
    return increment


@njit(**KERNEL)
def difference_quotients(field, t, y, p, work, jacobian, counters):
    """Jacobian ``(n, n)`` of the field at ``y`` by one-sided differences with increments that adapt."""
    f, far, n = work[F0], work[FAR], y.shape[0]
    for j in range(n):
        increment = work[INCREMENTS, j]
        move, largest, magnitude, increment = difference(field, t, y, p, work, increment, j)
        counters[EVALUATIONS] += 1
        column = 0.0
        for i in range(n):
            jacobian[i, j] = (far[i] - f[i]) / move
            column = max(column, abs(jacobian[i, j]))
        if magnitude > 0.0 or largest == 0.0:
            wider = min(math.sqrt(increment), LARGEST_INCREMENT)
            if largest > ROUNDOFF * magnitude:
                increment = adapted(increment, largest, magnitude)
            elif wider != increment:
                # The column may be rounding only: take the wider difference if it says more.
                move, largest, magnitude, wider = difference(field, t, y, p, work, wider, j)
                counters[EVALUATIONS] += 1
                if wider * largest / abs(move) >= column:
                    for i in range(n):
                        jacobian[i, j] = (far[i] - f[i]) / move
                    increment = adapted(wider, largest, magnitude)
        work[INCREMENTS, j] = increment


@njit(**KERNEL)
def time_derivative(field, t, y, p, h, work):
    """Put the partial derivative of the field in time into ``work[DFDT]``."""
    ahead = (t + min(ROOT_EPSILON * max(abs(t), abs(t + h)), h)) - t
    field(t + ahead, y, p, work[FAR])
    for i in range(y.shape[0]):
        work[DFDT, i] = (work[FAR, i] - work[F0, i]) / ahead


@njit(**KERNEL)
def first_step(field, t, y, p, span, rtol, work, jacobian, counters):
    """First step, from the first and the second derivative of the solution."""
    n, rate, bend = y.shape[0], 0.0, 0.0
    for i in range(n):
        rate = max(rate, abs(work[F0, i]) / max(abs(y[i]), work[NEW, i]))
    h = LARGEST_SHARE * span
    if h * rate > SAFETY * rtol**POWER:
        h = SAFETY * rtol**POWER / rate
    time_derivative(field, t, y, p, h, work)
    counters[EVALUATIONS] += 1
    for i in range(n):
        second = work[DFDT, i]
        for j in range(n):
            second += jacobian[i, j] * work[F0, j]
        bend = max(bend, abs(second) / max(abs(y[i]), work[NEW, i]))
    bend = math.sqrt(0.5 * bend)
    h = LARGEST_SHARE * span
    return SAFETY * rtol**POWER / bend if h * bend > SAFETY * rtol**POWER else h


@njit(**KERNEL)
def attempt(field, t, y, p, h, rtol, atol, work, matrix, pivots, jacobian):
    """One step of the pair: the solution of order 2 into ``work[NEW]``, its error relative to the state.

    With ``W = 1 - h d J`` and ``T = df/dt``:
    ``W k1 = f0 + h d T``, ``W (k2 - k1) = f(t + h/2, y + h k1 / 2) - k1``, ``y_new = y + h k2``,
    ``W k3 = f2 - e32 (k2 - f1) - 2 (k1 - f0) + h d T``, error ``h (k1 - 2 k2 + k3) / 6``.
    """
    n = y.shape[0]
    for i in range(n):
        for j in range(n):
            matrix[i, j] = -h * D * jacobian[i, j]
        matrix[i, i] += 1.0
    if not factorise(matrix, pivots, n):
        return math.inf
    f0, f1, f2, k1, k2, k3, new = work[F0], work[F1], work[F2], work[K1], work[K2], work[K3], work[NEW]
    for i in range(n):
        k1[i] = f0[i] + h * D * work[DFDT, i]
    substitute(matrix, pivots, n, k1)
    for i in range(n):
        work[PROBE, i] = y[i] + 0.5 * h * k1[i]
    field(t + 0.5 * h, work[PROBE], p, f1)
    for i in range(n):
        k2[i] = f1[i] - k1[i]
    substitute(matrix, pivots, n, k2)
    for i in range(n):
        k2[i] += k1[i]
        new[i] = y[i] + h * k2[i]
    field(t + h, new, p, f2)
    for i in range(n):
        k3[i] = f2[i] - E32 * (k2[i] - f1[i]) - 2.0 * (k1[i] - f0[i]) + h * D * work[DFDT, i]
    substitute(matrix, pivots, n, k3)
    error = 0.0
    for i in range(n):
        weight = max(abs(y[i]), abs(new[i]), atol / rtol)
        each = abs(k1[i] - 2.0 * k2[i] + k3[i]) / weight
        if not each <= error:
            error = each
    return error * h / 6.0


@exported(INTEGER, FIELD, VECTOR, REAL, REAL, VECTOR, REAL, REAL, MATRIX, MATRIX, INDICES)
def integrate(field, p, t, end, y, rtol, atol, record, work, counters):
    """Take ``y (n,)`` from ``t`` to ``end`` in place; return a code.

    ``record (N, 1 + n)`` receives time and state after each accepted step, unless it has no rows. ``work``
    ``(SCRATCH_ROWS + 2 n, n)`` is scratch memory. ``counters (COUNTERS + n,)`` has accepted and rejected
    steps and evaluations of the field added to it; its end holds row exchanges.
    """
    n, span, rows = y.shape[0], end - t, 0
    jacobian, matrix = work[SCRATCH_ROWS : SCRATCH_ROWS + n], work[SCRATCH_ROWS + n : SCRATCH_ROWS + 2 * n]
    pivots = counters[COUNTERS : COUNTERS + n]
    for i in range(n):
        work[THRESHOLDS, i], work[INCREMENTS, i], work[NEW, i] = atol, ROOT_EPSILON, atol / rtol
    field(t, y, p, work[F0])
    counters[EVALUATIONS] += 1
    difference_quotients(field, t, y, p, work, jacobian, counters)
    h = first_step(field, t, y, p, span, rtol, work, jacobian, counters)
    fresh = True
    while t < end:
        least = 16.0 * EPSILON * abs(t)
        h = min(LARGEST_SHARE * span, max(least, h))
        last = STRETCH * h >= end - t
        h = end - t if last else (t + h) - t
        if not fresh:
            difference_quotients(field, t, y, p, work, jacobian, counters)
        fresh = False
        time_derivative(field, t, y, p, h, work)
        counters[EVALUATIONS] += 1
        failed = False
        while True:
            error = attempt(field, t, y, p, h, rtol, atol, work, matrix, pivots, jacobian)
            counters[EVALUATIONS] += 2
            if error <= rtol:
                break
            counters[REJECTED] += 1
            if h <= least:
                return STEP_TOO_SMALL
            shrink = SAFETY * (rtol / error) ** POWER
            h = max(least, h * (shrink if shrink > LEAST_FACTOR else LEAST_FACTOR))
            failed, last = True, False
        counters[ACCEPTED] += 1
        t = end if last else t + h
        for i in range(n):
            y[i], work[F0, i] = work[NEW, i], work[F2, i]
        if record.shape[0] > 0:
            if rows == record.shape[0]:
                return RECORD_FULL
            record[rows, 0] = t
            for i in range(n):
                record[rows, 1 + i] = y[i]
            rows += 1
        if not failed:
            stretch = (error / rtol) ** POWER / SAFETY
            h = h / stretch if stretch > 1.0 / LARGEST_FACTOR else LARGEST_FACTOR * h
    return DONE


@exported(INTEGER, FIELD, VECTOR, REAL, REAL, VECTOR, REAL, REAL, MATRIX, MATRIX, INDICES)
def growth_rates(field, p, t, period, y, rtol, atol, rates, work, counters):
    """Growth rates ``(M, k)`` of tangent vectors in ``y (n (1 + k),)`` over ``M`` periods from phase ``t``.

    State and vectors are one system of ordinary differential equations. The vectors are orthonormalised
    after each period, where the method starts anew, and so does the clock: the drive has this period.
    ``work`` and ``counters`` are those of ``integrate``. Returns the number of completed periods.
    """
    k = rates.shape[1]
    n = y.shape[0] // (1 + k)
    for done in range(rates.shape[0]):
        if integrate(field, p, t, t + period, y, rtol, atol, work[:0], work, counters) != DONE:
            return done
        for c in range(k):
            rates[done, c] = 0.0
        orthonormalise(y, n, k, rates[done], work, False, 0)
        for c in range(k):
            rates[done, c] /= period
    return rates.shape[0]
