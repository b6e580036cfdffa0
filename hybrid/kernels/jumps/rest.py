"""States that rest on a guard, and the tangent map that takes the states nearby to them."""

from numba import njit

from hybrid.kernels.arithmetic.slopes import whole_jacobian
from hybrid.kernels.events.guards import guard_speed
from hybrid.kernels.types.codes import IMPULSE
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import KERNEL

# Share of a component's size over which a central difference is taken: the cube root of EPSILON makes its
# errors by rounding and by curvature alike, about EPSILON to the power 2/3.
NEARBY = EPSILON ** (1.0 / 3.0)
# The share of a quantity that counts as nothing at a limit: of the time, what is left; of the state, how far
# it may be from the guards, and how far the resets may move it. An extrapolation errs by its square.
RESOLVED = 1e-6
# Share of a number, or of the terms of a sum, that rounding may make up after a few operations.
ROUNDED = 64.0 * EPSILON


@njit(**KERNEL)
def speed_gradient(model, run, transition, mode, t, x, out, work):
    """Derivative of the guard's speed along the flow in the state, ``(n,)``.

    ``D_x g D_x f`` is exact; the curvature of a guard that is not affine is a central difference of its
    gradient. ``work.jacobian`` is left as ``D_x f``.
    """
    n = model.dimension
    model.field(mode, t, x, model.parameters, work.field)
    whole_jacobian(model, mode, t, x, work.jacobian)
    model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    for j in range(n):
        total = 0.0
        for i in range(n):
            total += work.gradient[i] * work.jacobian[i, j]
        out[j] = total
    if model.affine_guard[transition] == 1:
        return
    for j in range(n):
        size = max(abs(x[j]), run.scale[j])
        step = NEARBY * (size if size > 0.0 else 1.0)
        for i in range(n):
            work.state[i] = x[i]
        work.state[j] = x[j] + step
        up = guard_speed(model, transition, t, work.state, work.field, work.gradient)
        work.state[j] = x[j] - step
        down = guard_speed(model, transition, t, work.state, work.field, work.gradient)
        out[j] += (up - down) / (2.0 * step)


@njit(**KERNEL)
def dot(n, a, b):
    """The product of two vectors ``(n,)``; zero if it may be rounding."""
    total, terms = 0.0, 0.0
    for i in range(n):
        total += a[i] * b[i]
        terms += abs(a[i] * b[i])
    return total if abs(total) > ROUNDED * terms else 0.0


@njit(**KERNEL)
def project(n, rows, out):
    """The projection ``I - V (G V)^-1 G`` into ``out (n, n)``; whether there is one.

    The first two ``rows`` are the gradients ``G`` of what vanishes after it, the others the two ways in ``V``
    along which it is taken out.
    """
    a, b = dot(n, rows[0], rows[2]), dot(n, rows[0], rows[3])
    c, d = dot(n, rows[1], rows[2]), dot(n, rows[1], rows[3])
    det = a * d - b * c
    known = abs(det) > RESOLVED * (abs(a * d) + abs(b * c))
    for j in range(n):
        along = (d * rows[0, j] - b * rows[1, j]) / det if known else 0.0
        across = (a * rows[1, j] - c * rows[0, j]) / det if known else 0.0
        for i in range(n):
            kept, one, other = 1.0 if i == j else 0.0, along * rows[2, i], across * rows[3, i]
            left = kept - one - other
            # What is rounding of the terms would look like a direction.
            out[i, j] = left if abs(left) > ROUNDED * (kept + abs(one) + abs(other)) else 0.0
    return known


@njit(**KERNEL)
def motion(model, mode, t, x, way, out, work):
    """The motion ``D_x f d`` that a change ``d`` of the state brings in a mode, into ``out (n,)``."""
    whole_jacobian(model, mode, t, x, work.jacobian)
    for i in range(model.dimension):
        out[i] = dot(model.dimension, work.jacobian[i], way)


@njit(**KERNEL)
def rest_matrix(model, run, transition, work):
    """Projection on the states that rest on the guard that has just fired, into ``work.saltation (n, n)``.

    The speed and the height are taken out along the impulse ``p`` and the motion ``D_x f p`` that it brings.
    The derivative of the speed is left in ``work.error``, ``D_x f`` in ``work.jacobian``.
    """
    n, t, rows = model.dimension, run.phase, work.rounding
    speed_gradient(model, run, transition, run.mode, t, run.y, work.error, work)
    model.guard_gradient(transition, t, run.y, model.parameters, work.gradient)
    for i in range(n):
        rows[0, i], rows[1, i], rows[2, i] = work.gradient[i], work.error[i], run.trail[IMPULSE, i]
    motion(model, run.mode, t, run.y, rows[2], rows[3], work)
    project(n, rows, work.saltation)
