"""Whether the series of a step has the field as its derivative at a few places of the step.

The order of a series may not know yet what the field does later: a gap among its terms, a pulse, a function
that is flat at first. The comparison is the same for every series, in time or on the clock of a
desingularised mode, with tangent vectors or without.
"""

import math

from numba import njit

from hybrid.kernels.events.path import up_to
from hybrid.kernels.steps.step import rates_by_jacobian
from hybrid.kernels.types.codes import NARROW
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Tolerances by which the integrals of both may differ over a step: what a series leaves out is one of them.
MARGIN = 2.0
# Rounding of a state, in shares of it, by which the noise of its field is measured.
ROUNDING = 8.0 * EPSILON
# Halvings until a step is nothing, whatever its length was.
MOST_HALVINGS = 1000


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
    """State and tangent vectors of a series into ``work.trial``, their derivatives into ``work.new``."""
    n, series, order = model.dimension, path.powers, path.degree
    for i in range(n):
        work.trial[i], work.new[i] = _value_and_slope(series, i, order, s)
    for vector in range(tangents):
        column = model.tangent_start + vector // NARROW * model.tangent_columns[mode] + vector % NARROW
        for i in range(n):
            place = n * (1 + vector) + i
            work.trial[place], work.new[place] = _value_and_slope(series, column + NARROW * i, order, s)


@njit(**KERNEL)
def is_finite(model, mode, tangents, path, work):
    """Whether a series has values at its end, of the state and of the tangent vectors: no term overflows."""
    _along_series(model, mode, tangents, path, path.length, work)
    total = 0.0
    for i in range(model.dimension * (1 + tangents)):
        total += abs(work.trial[i])
    return total < math.inf


@njit(**KERNEL)
def _add_residual(model, run, tangents, path, s, weight, noisy, work):
    """Add to ``work.error`` what the field and the slope of a series differ by at ``s``.

    With ``noisy``, what the rounding of the state makes of the field there does not count. Nothing is added
    where the clock of a mode runs backwards: the mode ends before.
    """
    mode, length, t, pace = run.mode, model.dimension * (1 + tangents), path.start + s, 1.0
    field, other = work.stages[0], work.stages[1]
    if path.clock >= 0:
        passed, pace = _value_and_slope(path.powers, path.clock, path.degree, s)
        t = path.start + passed
        if pace < 0.0:
            return
    _along_series(model, mode, tangents, path, s, work)
    rates_by_jacobian(model, mode, t, work.trial, tangents, work.jacobian, field)
    if noisy:
        for i in range(length):
            work.trial[i] *= 1.0 + (ROUNDING if (i + 1) // 2 % 2 == 0 else -ROUNDING)
        rates_by_jacobian(model, mode, t, work.trial, tangents, work.jacobian, other)
    for i in range(length):
        noise = abs(pace * (other[i] - field[i])) if noisy else 0.0
        residual = abs(pace * field[i] - work.new[i]) - noise
        if not residual <= 0.0:
            work.error[i] += weight * residual


@njit(**KERNEL)
def _is_small(model, method, run, tangents, work):
    """Whether the integrals of a residual in ``work.error`` are within the tolerances at the step's end."""
    n = model.dimension
    for first in range(0, n * (1 + tangents), n):
        floor, square = method.atol, 0.0
        for i in range(first, first + n if first > 0 else 0):
            square += run.y[i] * run.y[i]
        if first > 0:
            floor = method.rtol * math.sqrt(square / n) + 1e-300
        for i in range(first, first + n):
            size = max(abs(run.y[i]), abs(work.trial[i]))
            if not work.error[i] <= MARGIN * (floor + (method.rtol + ROUNDING) * size):
                return False
    return True


@njit(**KERNEL)
def follows_field(model, method, run, tangents, path, work):
    """Whether the integral of the residual over a path of series is within the tolerances.

    Only if it is not, the noise of the field is asked for.
    """
    for noisy in (False, True):
        for i in range(model.dimension * (1 + tangents)):
            work.error[i] = 0.0
        for j in range(1, len(method.series_nodes)):
            s, weight = method.series_nodes[j] * path.length, method.series_weights[j] * path.length
            _add_residual(model, run, tangents, path, s, weight, noisy, work)
        if _is_small(model, method, run, tangents, work):
            return True
    return False


@njit(**KERNEL)
def followed(model, method, run, tangents, path, work):
    """The length of a path, halved until its series has the field as its derivative."""
    h = path.length
    for _ in range(MOST_HALVINGS):
        if follows_field(model, method, run, tangents, up_to(path, h), work):
            break
        h *= 0.5
    return h
