"""One step of an explicit Runge-Kutta pair, and what all methods share: rates, error ratio, interpolant."""

import math

from numba import njit

from hybrid.kernels.arithmetic.clock import measured_time
from hybrid.kernels.arithmetic.slopes import change_of_rate, whole_jacobian
from hybrid.kernels.types.kinds import INTEGER, MATRIX, REAL, VECTOR, Pair
from hybrid.kernels.types.layout import EPSILON, Method, Model, Path, Task, Work
from hybrid.kernels.types.options import INLINE, KERNEL, exported
from hybrid.kernels.types.task import task_of

# At the start of a run, a state below this many tolerances counts as this large.
MANY_TOLERANCES = 1e4
# Shortest step, in units of the rounding of time.
FINEST = 4.0 * EPSILON
# Unit of time of a state at rest, as a share of the run or of the forcing period.
SHARE_AT_REST = 1e-4


@njit(**INLINE)
def rates(model, mode, t, y, tangents, out):
    """Time derivative of ``y (n (1 + k),)`` into ``out``; with tangents, div f in the place after it."""
    if tangents == 0:
        model.field(mode, t, y, model.parameters, out)
    else:
        model.variational_field(mode, t, y, model.parameters, out)


@njit(**KERNEL)
def rates_by_jacobian(model, mode, t, y, tangents, jacobian, out):
    """The same, without the divergence, by the Jacobian, for which ``jacobian (n, n + 1)`` is scratch.

    Runs by series have no variational field: it is compiled for explicit and implicit methods alone.
    """
    n = model.dimension
    model.field(mode, t, y, model.parameters, out)
    if tangents > 0:
        model.field_jacobian(mode, t, y, model.parameters, jacobian)
    for first in range(n, n * (1 + tangents), n):
        for i in range(n):
            out[first + i] = change_of_rate(model, mode, i, jacobian, y[first:])


@exported(None, Model, INTEGER, REAL, VECTOR, VECTOR)
def field_at(model, mode, t, x, out):
    """``f`` into ``out (n,)``."""
    model.field(mode, t, x, model.parameters, out)


@exported(None, Model, INTEGER, REAL, VECTOR, MATRIX)
def jacobian_at(model, mode, t, x, out):
    """``(D_x f, D_t f)`` into ``out (n, n + 1)``."""
    whole_jacobian(model, mode, t, x, out)


@njit(**INLINE)
def combine(y, h, weights, stages, count, length, out):
    """``out = y + h * weights @ stages`` over the first ``count`` stages and ``length`` components."""
    for i in range(length):
        out[i] = y[i]
    for j in range(count):
        weight = h * weights[j]
        if weight != 0.0:
            stage = stages[j]
            for i in range(length):
                out[i] += weight * stage[i]


@njit(**INLINE)
def estimate_error(method, length, work):
    """The two embedded error estimates over the step's length, from its stages."""
    error, second_error = work.error, work.second_error
    for i in range(length):
        error[i] = 0.0
        second_error[i] = 0.0
    for j in range(method.error.shape[0]):
        weight, second_weight = method.error[j], method.second_error[j]
        stage = work.stages[j]
        if weight != 0.0 or second_weight != 0.0:
            for i in range(length):
                error[i] += weight * stage[i]
                second_error[i] += second_weight * stage[i]


@njit(**INLINE)
def error_ratio(model, method, h, y, tangents, work):
    """Largest ratio of estimated error to tolerance over the state and each tangent vector.

    A tangent vector has no absolute size, so its components are weighed against themselves and against the
    vector's root mean square. The two estimates are combined as in Hairer, Norsett and Wanner 1993, section
    II.10.
    """
    n, controlled = model.dimension, model.controlled
    length = n * (1 + tangents)
    error, second_error, new = work.error, work.second_error, work.new
    worst = 0.0
    for start in range(0, length, n):
        floor = method.atol
        if start > 0:
            square = 0.0
            for i in range(start, start + controlled):
                square += new[i] * new[i]
            floor = method.rtol * math.sqrt(square / controlled) + 1e-300
        first, second = 0.0, 0.0
        for i in range(start, start + controlled):
            scale = floor + method.rtol * max(abs(y[i]), abs(new[i]))
            first += (error[i] / scale) ** 2
            second += (second_error[i] / scale) ** 2
        if not first < math.inf:
            return math.nan
        if first > 0.0:
            worst = max(worst, h * first / math.sqrt((first + 0.01 * second) * controlled))
    return worst


@njit(**INLINE)
def attempt_explicit(model, method, mode, t, h, y, tangents, work):
    """Try a step of length ``h`` from ``y``; its result is ``work.new``. Returns the error ratio.

    ``work.stages[0]`` holds the rates at ``(t, y)``; the rates at the new point are left in
    ``work.stages[s]``.
    """
    length = model.dimension * (1 + tangents)
    s = method.b.shape[0]
    for i in range(1, s):
        combine(y, h, method.a[i], work.stages, i, length, work.trial)
        rates(model, mode, t + method.c[i] * h, work.trial, tangents, work.stages[i])
    combine(y, h, method.b, work.stages, s, length, work.new)
    rates(model, mode, t + h, work.new, tangents, work.stages[s])
    estimate_error(method, length, work)
    return error_ratio(model, method, h, y, tangents, work)


@njit(**INLINE)
def interpolation_stages(model, method, mode, t, h, y, work):
    """Evaluate the stages that only the interpolant of the last attempted step needs, for the state alone."""
    n = model.dimension
    for i in range(method.b.shape[0] + 1, method.a.shape[0]):
        combine(y, h, method.a[i], work.stages, i, n, work.trial)
        model.field(mode, t + method.c[i] * h, work.trial, model.parameters, work.stages[i])


@njit(**KERNEL)
def interpolant_path(method, h, y, dimension, work):
    """The state over the last step as powers of a place on [0, 1], into ``work.path (d + 1, n)``."""
    count = method.a.shape[0]
    for i in range(dimension):
        work.path[0, i] = y[i]
    for k in range(1, method.powers.shape[0]):
        for i in range(dimension):
            total = 0.0
            for j in range(count):
                total += method.powers[k, j] * work.stages[j, i]
            work.path[k, i] = h * total


@njit(**INLINE)
def path_of_step(method, t, h, work):
    """The path that ``interpolant_path`` writes, for a step from ``t``."""
    return Path(work.path, method.powers.shape[0] - 1, -1, t, h, 1.0, False, 1)


@njit(**KERNEL)
def starting_step(model, method, mode, t, y, tangents, remaining, work):
    """A first step length from the sizes of ``y``, ``y'`` and ``y''`` (Hairer, Norsett, Wanner 1993, II.4).

    The unit of time is that in which the state changes by its size, or by many tolerances where it is zero:
    no unit of the model matters. A state at rest has none, and the end of the run or the forcing period
    stands in. ``work.stages[0]`` holds the rates at ``(t, y)``; uses ``work.stages[1]`` as scratch.
    """
    n, length = model.dimension, model.dimension * (1 + tangents)
    count = model.controlled * (1 + tangents)
    size, speed = 0.0, 0.0
    for start in range(0, length, n):
        for i in range(start, start + model.controlled):
            scale = method.rtol * abs(y[i]) + (method.atol if i < n else method.rtol)
            size += (y[i] / scale) ** 2
            speed += (work.stages[0, i] / scale) ** 2
    size, speed = math.sqrt(size / count), math.sqrt(speed / count)
    horizon = min(model.period, remaining) if model.period > 0.0 else remaining
    unit = max(size, MANY_TOLERANCES) / speed if speed > 0.0 else math.inf
    unit = min(unit, (1.0 if speed > 0.0 else SHARE_AT_REST) * horizon)
    h = min(0.01 * unit, method.max_step)
    for i in range(length):
        work.trial[i] = y[i] + h * work.stages[0, i]
    rates(model, mode, t + h, work.trial, tangents, work.stages[1])
    bend = 0.0
    for i in range(length):
        scale = method.rtol * abs(y[i]) + (method.atol if i < n else method.rtol)
        bend += ((work.stages[1, i] - work.stages[0, i]) / scale) ** 2
    bend = math.sqrt(bend / count) / h
    steepest = max(speed * unit, bend * unit * unit)
    if not steepest > 1e-15:
        return h
    return min(100.0 * h, unit * (0.01 / steepest) ** method.exponent, method.max_step)


@njit(**INLINE)
def attempt(task, h):
    """Try a step of length ``h`` from the state; its result is ``work.new``. Returns the error ratio.

    ``work.stages[0]`` holds the rates at the start; the rates at the new point are left in
    ``work.stages[s]``. A ratio above 1, or nan, rejects the step.
    """
    attempts, model, method, run, _, work = task_of(task)
    mode, t, tangents = run.mode, run.phase, task.tangents
    if method.implicit != 0:
        return attempts.attempt_implicit(model, method, mode, t, h, run.y, tangents, work)
    return attempt_explicit(model, method, mode, t, h, run.y, tangents, work)


@njit(**KERNEL)
def attempt_again(task, h):
    """``attempt`` as a function that is compiled once, for steps that are repeated."""
    return attempt(task, h)


@exported(Pair(REAL), Task, REAL)
def no_step(task, remaining):
    """Stands in for the step of a Runge-Kutta method where every mode has a series."""
    return math.nan, 0.0


@exported(REAL, Model, Method, INTEGER, REAL, REAL, VECTOR, INTEGER, Work)
def no_attempt(model, method, mode, t, h, y, tangents, work):
    """Stands in for the implicit step where the method is explicit."""
    return math.nan


@njit(**KERNEL)
def moves_nothing(model, run, slopes, h):
    """Whether a step along ``slopes (n,)`` moves neither the state nor the time by their rounding.

    Terms near overflow make steps so short, and places where the field is not defined.
    """
    if model.timed[run.mode] == 1 and h > EPSILON * measured_time(model, run, run.mode):
        return False
    for i in range(model.dimension):  # noqa: SIM110 (no generators in kernels)
        if abs(slopes[i]) * h > EPSILON * abs(run.y[i]):
            return False
    return True
