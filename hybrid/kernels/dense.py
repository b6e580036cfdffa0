"""States between the ends of steps: the polynomials of a record, evaluated."""

from numba import int64, njit, void

from hybrid.kernels.layout import CUBE, ENTRY, EPSILON, INDICES, KERNEL, MATRIX, VECTOR
from hybrid.kernels.series_guards import expanded_at, value_at

# Where Newton's method moves by less than this share, its next step would be below rounding.
SETTLED = 1e-9


@njit(**KERNEL)
def step_at(start, time, step):
    """The last step that starts no later than ``time``, looked for from ``step`` on; the first if none."""
    count = start.shape[0]
    low, high = 0, count
    if start[step] <= time:
        # Most times fall into the step of the time before or into the next one.
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


@njit(**KERNEL)
def place_at(polynomials, clock, degree, since, span):
    """Place on ``[0, 1]`` where the polynomial of time shows ``since``; of degree 1 unless on another clock.

    Time only grows along it, but may start without speed: Newton's method is kept in a bracket.
    """
    place = min(max(since / span, 0.0), 1.0)
    if degree == 1:
        return place
    low, high = 0.0, 1.0
    for _ in range(100):
        value, slope, _ = expanded_at(polynomials, clock, 0, degree, place)
        misfit = value - since
        if misfit > 0.0:
            high = place
        else:
            low = place
        newton = place - misfit / slope if slope > 0.0 else low
        if not low <= newton <= high or not slope > 0.0:
            newton = 0.5 * (low + high)
        change = abs(newton - place)
        place = newton
        if change <= SETTLED * place or high - low <= EPSILON:
            break
    return place


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


@njit(void(VECTOR, VECTOR, VECTOR, CUBE, MATRIX, INDICES), **ENTRY)
def states_at(times, start, span, coefficients, states, steps):
    """States ``(N, n)`` at times ``(N,)`` and the step that each was taken from; at a jump, after it.

    ``coefficients (S, d + 1, n + 1)`` are those of the powers of a place on ``[0, 1]``, of the state and of
    the time since the ``start`` of each step.
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
        place = place_at(polynomials, n, degree, times[i] - start[step], span[step])
        for k in range(n):
            states[i, k] = value_at(polynomials, k, top, place)
        steps[i] = step
