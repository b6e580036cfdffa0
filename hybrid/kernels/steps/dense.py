"""States between the ends of steps: the polynomials of a record, evaluated."""

from numba import int64, njit

from hybrid.kernels.arithmetic.clock import IN_ORDER
from hybrid.kernels.events.path import value_at
from hybrid.kernels.guards.roots import time_of
from hybrid.kernels.types.kinds import CUBE, INDICES, MATRIX, VECTOR
from hybrid.kernels.types.options import KERNEL, exported


@njit(**KERNEL)
def step_at(start, time, step):
    """The last step that starts no later than ``time``, searched from ``step`` on; the first step if none."""
    count = start.shape[0]
    low, high = 0, count
    if start[step] <= time:
        # Most times fall into the same step as the previous time, or into the next step.
        low = step
        for _ in range(2):
            if low + 1 == count or start[low + 1] > time:
                return low
            low += 1
    while high - low > 1:
        middle = (low + high) // 2
        if start[middle] <= time:
            low = middle
        else:
            high = middle
    return low


@njit(**IN_ORDER)
def time_since(time, start, low):
    """Time since a start in two parts."""
    return (time - start) - low


@njit(**KERNEL)
def degree_of_all(polynomials):
    """The largest degree of the polynomials in the columns, at least 1."""
    degree = polynomials.shape[0] - 1
    while degree > 1:
        for k in range(polynomials.shape[1]):
            if polynomials[degree, k] != 0.0:
                return degree
        degree -= 1
    return degree


@exported(None, VECTOR, VECTOR, VECTOR, VECTOR, CUBE, MATRIX, INDICES)
def states_at(times, start, low, span, coefficients, states, steps):
    """States ``(N, n)`` at times ``(N,)`` and the step that each was taken from; at a jump, after it.

    ``coefficients (S, d + 1, n + 1)`` are those of the powers of a place on ``[0, 1]``, of the state and of
    the time since the start of each step, which is ``start`` and what that has lost in rounding, ``low``.
    """
    step, last, top, degree = int64(0), int64(-1), 0, 0
    n = states.shape[1]
    for i in range(times.shape[0]):
        step = step_at(start, times[i], step)
        polynomials = coefficients[step]
        if step != last:
            last, top = step, degree_of_all(polynomials)
            degree = top
            while degree > 1 and polynomials[degree, n] == 0.0:
                degree -= 1
        since = time_since(times[i], start[step], low[step])
        if degree == 1:
            place = min(max(since / span[step], 0.0), 1.0)
        else:
            place = time_of(polynomials, n, degree, 1.0, since)
        for k in range(n):
            states[i, k] = value_at(polynomials, k, top, place)
        steps[i] = step
