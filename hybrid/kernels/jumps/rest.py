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
def rest_matrix(model, run, transition, work):
    """Projection on the states that rest on the guard that has just fired, into ``work.saltation (n, n)``.

    The speed is taken out along the impulse ``p`` and the height along ``D_x f p``, the motion it brings,
    ``Xi = I - p (D_x v - (D_x v D_x f p) D_x g) - (D_x f p) D_x g`` with ``v`` the guard's speed. ``D_x v``
    is left in ``work.error``, ``D_x f`` in ``work.jacobian``.
    """
    n, impulse = model.dimension, run.trail[IMPULSE]
    slope, carried = work.error, work.second_error
    speed_gradient(model, run, transition, run.mode, run.phase, run.y, slope, work)
    model.guard_gradient(transition, run.phase, run.y, model.parameters, work.gradient)
    coupling = 0.0
    for i in range(n):
        carried[i] = 0.0
        for j in range(n):
            carried[i] += work.jacobian[i, j] * impulse[j]
        coupling += slope[i] * carried[i]
    for i in range(n):
        for j in range(n):
            kept = 1.0 if i == j else 0.0
            taken = impulse[i] * (slope[j] - coupling * work.gradient[j]) + carried[i] * work.gradient[j]
            terms = abs(slope[j]) + abs(coupling * work.gradient[j])
            terms = kept + abs(impulse[i]) * terms + abs(carried[i] * work.gradient[j])
            # What is rounding of the terms would look like a direction.
            work.saltation[i, j] = kept - taken if abs(kept - taken) > ROUNDED * terms else 0.0
