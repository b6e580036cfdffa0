"""Whether the path of a step has the field as its derivative at a few places of the step.

The order of a series may not know yet what the field does later: a gap among its terms, a pulse, a function
that is flat at first. The error estimate of a Runge-Kutta method is the difference of two methods, and a kink
or jump may lie where both are off by the same. The comparison is the same for every path: a series in time or
on the clock of a desingularised mode, with tangent vectors or without, and an interpolant.
"""

import math

from numba import njit

from hybrid.kernels.events.path import up_to
from hybrid.kernels.steps.step import rates_by_jacobian
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Tolerances by which the integrals of both may differ over a step: what a series leaves out is one of them.
MARGIN_OF_FIELD = 2.0
# The same for an interpolant. Its order is that of the error estimate: up to a hundred tolerances are what it
# leaves out of a smooth field.
MARGIN_OF_INTERPOLANT = 1e3
# Rounding of a state, in shares of it, by which the noise of its field is measured.
SHAKEN = 8.0 * EPSILON


@njit(**INLINE)
def _value_and_slope(series, column, order, s):
    """One column and its derivative."""
    value, slope = series[order, column], 0.0
    for o in range(order - 1, -1, -1):
        slope = slope * s + value
        value = value * s + series[o, column]
    return value, slope


@njit(**KERNEL)
def _along_series(model, mode, tangents, path, s, work):
    """State and tangent vectors into ``work.trial``, their derivatives into ``work.second_error``."""
    n, series, order = model.dimension, path.powers, path.degree
    for i in range(n):
        work.trial[i], work.second_error[i] = _value_and_slope(series, i, order, s)
    for vector in range(tangents):
        column = model.tangent_start + vector // NARROW * model.tangent_columns[mode] + vector % NARROW
        for i in range(n):
            place = n * (1 + vector) + i
            value, slope = _value_and_slope(series, column + NARROW * i, order, s)
            work.trial[place], work.second_error[place] = value, slope


@njit(**KERNEL)
def has_finite_terms(model, mode, tangents, path, work):
    """Whether a series has values at its end, of the state and of the tangent vectors: no term overflows."""
    _along_series(model, mode, tangents, path, path.length, work)
    total = 0.0
    for i in range(model.dimension * (1 + tangents)):
        total += abs(work.trial[i])
    return total < math.inf


@njit(**KERNEL)
def _add_residual(model, run, tangents, path, s, weight, noisy, work):
    """Add to ``work.error`` what the field and the slope of a path differ by at ``s``.

    With ``noisy``, what the rounding of the state makes of the field there does not count. Nothing is added
    where the clock of a mode runs backwards: the mode ends before.
    """
    mode, length, pace = run.mode, model.dimension * (1 + tangents), path.pace
    t, field, other = path.start + pace * s, work.rates[0], work.rates[1]
    if path.clock >= 0:
        passed, pace = _value_and_slope(path.powers, path.clock, path.degree, s)
        t = path.start + passed
        if pace < 0.0:
            return
    _along_series(model, mode, tangents, path, s, work)
    rates_by_jacobian(model, mode, t, work.trial, tangents, work.jacobian, field)
    if noisy:
        for i in range(length):
            work.trial[i] *= 1.0 + (SHAKEN if (i + 1) // 2 % 2 == 0 else -SHAKEN)
        rates_by_jacobian(model, mode, t, work.trial, tangents, work.jacobian, other)
    for i in range(length):
        noise = abs(pace * (other[i] - field[i])) if noisy else 0.0
        residual = abs(pace * field[i] - work.second_error[i]) - noise
        if not residual <= 0.0:
            work.error[i] += weight * residual


@njit(**KERNEL)
def _is_small(model, method, run, tangents, margin, work):
    """Whether the integrals of a residual in ``work.error`` are within a margin of tolerances at the end."""
    n, controlled = model.dimension, model.controlled
    for first in range(0, n * (1 + tangents), n):
        floor, square = method.atol, 0.0
        for i in range(first, first + controlled if first > 0 else 0):
            square += run.y[i] * run.y[i]
        if first > 0:
            floor = method.rtol * math.sqrt(square / controlled) + 1e-300
        for i in range(first, first + n):
            size = max(abs(run.y[i]), abs(work.trial[i]))
            if not work.error[i] <= margin * (floor + (method.rtol + SHAKEN) * size):
                return False
    return True


@njit(**KERNEL)
def follows_field(model, method, run, tangents, path, margin, work):
    """Whether the integral of the residual over a path is within a margin of tolerances.

    Only if it is not, the noise of the field is asked for.
    """
    for noisy in (False, True):
        for i in range(model.dimension * (1 + tangents)):
            work.error[i] = 0.0
        for j in range(1, len(method.series_nodes)):
            s, weight = method.series_nodes[j] * path.length, method.series_weights[j] * path.length
            _add_residual(model, run, tangents, path, s, weight, noisy, work)
        if _is_small(model, method, run, tangents, margin, work):
            return True
    return False


@njit(**KERNEL)
def followed(model, method, run, tangents, path, work):
    """The length of a path, halved until its series has the field as its derivative; zero if it never has."""
    h = path.length
    while h > 0.0 and not follows_field(model, method, run, tangents, up_to(path, h), MARGIN_OF_FIELD, work):
        h *= 0.5
    return h
