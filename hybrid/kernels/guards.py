"""Guards along a step: their polynomials, the earliest crossing, and landing on it."""

import math

from numba import float64, int64, njit, types, void

from hybrid.kernels.attempt import attempt
from hybrid.kernels.bernstein import NO_ROOT, divide_by_theta, first_crossing, stays
from hybrid.kernels.codes import MODE, NO_TRANSITION
from hybrid.kernels.layout import ENTRY, INLINE, KERNEL, METHOD, MODEL, RUN, VECTOR, WORK

# A fitted guard polynomial is believed where it misses the guard by less than this, relative to its size;
# its root is only a first guess for the landing.
FIT_TOLERANCE = 1e-9
# Guards with a kink on the step are cut around it down to this share of the step.
SHORTEST_CUT = 1e-12
# A correction this small, relative to the step, is finished by one Euler step: the error left is its square.
EULER_IS_ENOUGH = 1e-8


@njit(float64(MODEL, int64, float64, VECTOR, VECTOR), **INLINE)
def guard_value(model, transition, t, x, scalar):
    """``g(t, x, p)``; ``scalar (1,)`` is scratch."""
    model.guard(transition, t, x, model.parameters, scalar)
    return scalar[0]


@njit(void(MODEL, float64, VECTOR, VECTOR), **ENTRY)
def guard_values(model, t, x, out):
    """Value of every guard of the system, in whichever mode, into ``out (transitions,)``."""
    for transition in range(out.shape[0]):
        model.guard(transition, t, x, model.parameters, out[transition : transition + 1])


@njit(float64(MODEL, int64, float64, VECTOR, VECTOR, VECTOR), **INLINE)
def guard_speed(model, transition, t, x, field, gradient):
    """Transversality ``D_t g + D_x g f``; leaves ``(D_x g, D_t g)`` in ``gradient (n + 1,)``."""
    model.guard_gradient(transition, t, x, model.parameters, gradient)
    speed = gradient[model.dimension]
    for i in range(model.dimension):
        speed += gradient[i] * field[i]
    return speed


@njit(int64(MODEL, METHOD, int64, float64, float64, VECTOR, float64, WORK), **INLINE)
def affine_polynomial(model, method, transition, t, h, x, value, work):
    """Bernstein coefficients of an affine guard on the interpolant, exactly; returns their degree."""
    n = model.dimension
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    degree, count = method.interpolant.shape[0] - 1, method.a.shape[0]
    for j in range(count):
        speed = 0.0
        for i in range(n):
            speed += work.gradient[i] * work.stages[j, i]
        work.speeds[j] = h * speed
    for i in range(degree + 1):
        total = value + h * work.gradient[n] * i / degree
        for j in range(count):
            total += method.interpolant[i, j] * work.speeds[j]
        work.polynomial[i] = total
    return degree


@njit(float64(MODEL, int64, float64, float64, float64, WORK), **KERNEL)
def value_on_interpolant(model, transition, t, h, theta, work):
    """The guard on the interpolant at ``t + theta h``; ``work.coefficients`` holds the interpolant."""
    degree = work.coefficients.shape[0] - 1
    for i in range(model.dimension):
        work.state[i] = 0.0
    weight = 1.0
    for j in range(degree + 1):
        basis = weight * theta**j * (1.0 - theta) ** (degree - j)
        for i in range(model.dimension):
            work.state[i] += basis * work.coefficients[j, i]
        weight *= (degree - j) / (j + 1.0)
    return guard_value(model, transition, t + theta * h, work.state, work.scalar)


@njit(float64(MODEL, int64, float64, float64, float64, float64, float64, WORK), **KERNEL)
def fit_polynomial(model, transition, t, h, start, end, offset, work):
    """Fit a polynomial to ``g - offset`` over ``[start, end]`` of the step; returns its misfit between nodes.

    The values at ``work.nodes`` determine it; it is checked half-way between each pair of nodes.
    """
    degree = work.nodes.shape[0] - 1
    values = work.stack[work.stack.shape[0] - 1]
    for i in range(degree + 1):
        theta = start + (end - start) * work.nodes[i]
        values[i] = value_on_interpolant(model, transition, t, h, theta, work) - offset
    for i in range(degree + 1):
        total = 0.0
        for j in range(degree + 1):
            total += work.fit[i, j] * values[j]
        work.polynomial[i] = total
    misfit = 0.0
    for i in range(degree):
        theta = 0.5 * (work.nodes[i] + work.nodes[i + 1])
        fitted, weight = 0.0, 1.0
        for j in range(degree + 1):
            fitted += weight * theta**j * (1.0 - theta) ** (degree - j) * work.polynomial[j]
            weight *= (degree - j) / (j + 1.0)
        value = value_on_interpolant(model, transition, t, h, start + (end - start) * theta, work) - offset
        misfit = max(misfit, abs(fitted - value))
        if not math.isfinite(value):
            return math.inf
    return misfit


@njit(types.Tuple((float64, int64))(MODEL, int64, float64, float64, float64, int64, int64, WORK), **KERNEL)
def composed_crossing(model, transition, t, h, offset, on_guard, side, work):
    """First crossing of a guard that is not affine, by polynomials fitted piecewise along the interpolant.

    Only where a fit neither excludes a zero nor follows the guard is the interval cut, so a kink away from
    zero costs nothing. Returns the place on [0, 1] (or ``NO_ROOT``) and the side after it.
    """
    direction = model.direction[transition]
    top = 0
    work.intervals[0, 0], work.intervals[0, 1] = 0.0, 1.0
    while top >= 0:
        start, end = work.intervals[top, 0], work.intervals[top, 1]
        misfit = fit_polynomial(model, transition, t, h, start, end, offset, work)
        degree = work.nodes.shape[0] - 1
        largest, smallest = 0.0, math.inf
        for i in range(degree + 1):
            largest = max(largest, abs(work.polynomial[i]))
            smallest = min(smallest, abs(work.polynomial[i]))
        short = end - start <= SHORTEST_CUT
        if misfit > FIT_TOLERANCE * largest and misfit >= smallest and not short:
            middle = 0.5 * (start + end)
            work.intervals[top, 0] = middle
            top += 1
            work.intervals[top, 0], work.intervals[top, 1] = start, middle
            continue
        top -= 1
        if not math.isfinite(largest):
            continue
        for _ in range(on_guard if start == 0.0 else 0):
            degree = divide_by_theta(work.polynomial, degree)
        theta, side = first_crossing(work.polynomial, degree, side, direction, work.stack)
        if theta <= 1.0:
            return start + (end - start) * theta, side
    return NO_ROOT, side


@njit(types.Tuple((float64, int64))(MODEL, METHOD, RUN, float64, float64, WORK), **INLINE)
def earliest_crossing(model, method, run, t, h, work):
    """Earliest crossing on the attempted step over all guards of the mode, and its transition.

    Returns ``(theta, transition)``, or ``(NO_ROOT, NO_TRANSITION)``; the sides of the guards are brought up
    to date. ``work.coefficients`` must hold the interpolant if any guard of the mode is not affine.
    """
    mode = run.count[MODE]
    earliest, fired = NO_ROOT, NO_TRANSITION
    for slot in range(model.first_outgoing[mode], model.first_outgoing[mode + 1]):
        transition = model.outgoing[slot]
        value = guard_value(model, transition, t, run.y, work.scalar)
        on_guard = run.on_guard[transition]
        side = run.side[transition]
        if model.affine_guard[transition] == 1:
            start = 0.0 if on_guard > 0 else value
            degree = affine_polynomial(model, method, transition, t, h, run.y, start, work)
            for _ in range(on_guard):
                degree = divide_by_theta(work.polynomial, degree)
            if stays(work.polynomial, degree, side):
                continue
            theta, side = first_crossing(
                work.polynomial, degree, side, model.direction[transition], work.stack
            )
        else:
            offset = value if on_guard > 0 else 0.0
            theta, side = composed_crossing(model, transition, t, h, offset, on_guard, side, work)
        run.side[transition] = side
        if theta < earliest:
            earliest, fired = theta, transition
    return earliest, fired


@njit(
    types.UniTuple(float64, 2)(MODEL, METHOD, int64, int64, float64, float64, float64, VECTOR, int64, WORK),
    **KERNEL,
)
def land(model, method, transition, mode, t, h, theta, y, tangents, work):
    """Shorten the step so that it ends on the guard, with the end in ``work.new``.

    The step is taken again up to the root of the interpolant and corrected by Newton's method on the guard,
    so that the state and the tangents at the event carry the error of the method, not that of its
    interpolant. Returns the length of the step last taken and the small Euler step that completed it.
    """
    length = theta * h
    for _ in range(6):
        attempt(model, method, mode, t, length, y, tangents, work)
        s = method.b.shape[0]
        value = guard_value(model, transition, t + length, work.new, work.scalar)
        speed = guard_speed(model, transition, t + length, work.new, work.stages[s], work.gradient)
        correction = -value / speed
        if not math.isfinite(correction):
            break
        if abs(correction) <= EULER_IS_ENOUGH * length:
            for i in range(model.dimension * (1 + tangents)):
                work.new[i] += correction * work.stages[s, i]
            return length, correction
        corrected = length + correction
        if corrected <= 0.0 or corrected > h:
            break
        length = corrected
    return length, 0.0


@njit(float64(MODEL, RUN, float64, VECTOR), **KERNEL)
def rounding_band(model, run, t, gradient):
    """How far from zero rounding alone can leave a guard whose state has the sizes in ``run.scale``."""
    n = model.dimension
    size = abs(gradient[n] * t)
    for i in range(n):
        size += abs(gradient[i]) * run.scale[i]
    return 16 * 2.220446049250313e-16 * size


@njit(float64(MODEL, int64, int64, float64, VECTOR, WORK), **KERNEL)
def guard_acceleration(model, transition, mode, t, x, work):
    """Second Lie derivative of a guard along the flow; ``work.field`` and ``work.gradient`` are current.

    ``D_x g (D_x f f + D_t f)`` is exact; the curvature of the guard itself is a difference of its gradient
    along the flow.
    """
    n = model.dimension
    model.flow_jacobian(mode, t, x, model.parameters, work.jacobian)
    total = 0.0
    for i in range(n):
        bend = work.jacobian[i, n]
        for j in range(n):
            bend += work.jacobian[i, j] * work.field[j]
        total += work.gradient[i] * bend
    if model.affine_guard[transition] == 1:
        return total
    size, speed = 1e-3, 0.0
    for i in range(n):
        size = max(size, abs(x[i]))
        speed = max(speed, abs(work.field[i]))
    epsilon = 1e-7 * size / speed if speed > 0.0 else 1e-7
    for i in range(n):
        work.state[i] = x[i] + epsilon * work.field[i]
    before = guard_speed(model, transition, t, x, work.field, work.gradient)
    after = guard_speed(model, transition, t + epsilon, work.state, work.field, work.gradient)
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return total + (after - before) / epsilon
