"""Sign of a guard's acceleration soon after a place where rounding hides its speed and its acceleration.

The guard leaves zero by its third derivative, or by the fourth. Its acceleration then grows like the time, or
like its square, however small the factor is. Higher terms may be larger after a short time already, and much
larger at the end of a step: the step alone would show their sign.
"""

from numba import njit

from hybrid.kernels.events.derivatives import SHARE, acceleration_sign
from hybrid.kernels.events.guards import guard_acceleration, guard_speed, size_of_time
from hybrid.kernels.types.options import KERNEL

# Each moment after the start is this share of the one before it; the first is this share of the run.
SHORTER = 1.0 / 16.0
MOST_MOMENTS = 12
# The acceleration of a shorter moment is so many times as small, at least and at most.
LEAST, MOST = 0.5 / SHORTER, 2.0 / SHORTER**2


@njit(**KERNEL)
def move_for(model, mode, t, x, moment, work):
    """Take the state at ``x (n,)`` a ``moment`` farther, into ``work.settled``, and ``work.field`` with it.

    The midpoint rule has the accelerations right that grow like the time or its square. ``work.field`` is
    current at ``x``.
    """
    n, place = model.dimension, work.settled
    for i in range(n):
        place[i] = x[i] + 0.5 * moment * work.field[i]
    model.field(mode, t + 0.5 * moment, place, model.parameters, work.field_after)
    for i in range(n):
        place[i] = x[i] + moment * work.field_after[i]
    model.field(mode, t + moment, place, model.parameters, work.field)


@njit(**KERNEL)
def acceleration_soon(model, run, transition, mode, t, x, work):
    """Sign of a guard's acceleration soon after ``(t, x)``, where rounding hides it; 0 if not certain.

    It is that of the shortest moments at which the acceleration is certain and grows like the time or its
    square. ``work.field`` and ``work.gradient`` are current, and are on return.
    """
    sign, moment, before, sign_before = 0, run.horizon, 0.0, 0
    for trial in range(MOST_MOMENTS):
        moment *= SHORTER
        if not moment > SHARE * size_of_time(model, t):
            break
        move_for(model, mode, t, x, moment, work)
        guard_speed(model, transition, t + moment, work.settled, work.field, work.gradient)
        now = acceleration_sign(model, run, transition, mode, t + moment, work.settled, work)
        size = abs(guard_acceleration(model, run, transition, mode, t + moment, work.settled, work))
        if now != 0 and now == sign_before and LEAST * size <= before <= MOST * size:
            sign = now
        model.field(mode, t, x, model.parameters, work.field)
        if trial > 0 and size == 0.0 and before == 0.0:
            break
        before, sign_before = size, now
    guard_speed(model, transition, t, x, work.field, work.gradient)
    return sign
