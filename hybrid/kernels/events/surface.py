"""The tangent plane of a guard's surface, where the gradient of the guard does not show it.

A saltation matrix needs the surface on which a guard changes its sign. The gradient vanishes on the surface
of ``e**3`` and is infinite on that of ``cbrt(e)``: a little before and behind, it has the direction of that
of ``e``. Where a guard jumps across zero, as ``sign(e)`` or ``where(e > 0, a, b)``, it says nothing of the
surface at all. Then the jump is looked for on parallels to the path.
"""

import math

from numba import njit

from hybrid.kernels.events.guards import guard_speed, guard_value
from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# A guard is looked at so far before and behind its crossing, as shares of a unit of time: the longest tells
# of flat roots and jumps, the others of smooth guards that bend.
BESIDE_SURFACE = 1e-7
CLOSER = 1e-3
LOOKS = 3
# The speeds of a smooth guard beside the crossing are as far above that there as below it, up to this share,
# and directions agree up to it.
SMOOTH = 1e-3
# A guard jumps if it changes by so many times what its speeds and rounding explain, and by more than a share
# of that over a smaller time.
UNEXPLAINED_JUMP = 1e3
JUMPS = 0.5
SHAKEN_BY = 8.0 * EPSILON
# Parallels to the path have this distance, as a share of the state. The jump on them is looked for up to this
# share of the unit of time.
PARALLELS_APART = 1e-5
FARTHEST_JUMP = 0.1
HALVINGS_OF_PARALLEL = 60


@njit(**INLINE)
def weight(x, unit, i, work):
    """The size of a component, or its change during the ``unit`` of time."""
    return max(abs(x[i]), unit * abs(work.field[i]))


@njit(**KERNEL)
def move_along_path(model, x, s, work):
    """The state at the time ``s`` after ``x (n,)`` into ``work.state``."""
    for i in range(model.dimension):
        work.state[i] = x[i] + s * work.field[i]


@njit(**KERNEL)
def value_on_parallel(model, transition, t, x, s, i, shift, work):
    """The guard at the time ``s`` on the path whose component ``i`` is moved by a ``shift``."""
    move_along_path(model, x, s, work)
    work.state[i] += shift
    return guard_value(model, transition, t + s, work.state, work.scalar)


@njit(**KERNEL)
def speed_on_path(model, transition, t, x, s, work):
    """The speed of a guard at the time ``s`` on the path; its gradient there into ``work.gradient``."""
    move_along_path(model, x, s, work)
    return guard_speed(model, transition, t + s, work.state, work.field, work.gradient)


@njit(**KERNEL)
def direction_on_path(model, transition, t, x, s, out, work):
    """The gradient of a guard at the time ``s`` on the path, divided by its speed there, into ``out``."""
    speed = speed_on_path(model, transition, t, x, s, work)
    for i in range(model.dimension):
        out[i] = work.gradient[i] / speed


@njit(**KERNEL)
def time_of_jump(model, transition, t, x, parallel, reach, rises, work):
    """When a guard changes its sign on a parallel to the path, from the crossing on; nan if it does not.

    The ``parallel`` is a component and its shift; ``reach`` the shortest and the longest time that is tried.
    """
    i, shift = parallel
    reach, longest = reach
    while reach <= longest:
        low, high = -reach, reach
        if (
            value_on_parallel(model, transition, t, x, low, i, shift, work) * rises < 0.0
            and value_on_parallel(model, transition, t, x, high, i, shift, work) * rises > 0.0
        ):
            for _ in range(HALVINGS_OF_PARALLEL):
                middle = 0.5 * (low + high)
                if value_on_parallel(model, transition, t, x, middle, i, shift, work) * rises < 0.0:
                    low = middle
                else:
                    high = middle
            return 0.5 * (low + high)
        reach *= 4.0
    return math.nan


@njit(**KERNEL)
def plane_of_jump(model, transition, t, x, unit, shortest, rises, work):
    """Whether the surface of a jump has a tangent plane; a gradient of speed 1 into ``work.gradient``."""
    n, gradient = model.dimension, work.stages[0]
    longest, total = FARTHEST_JUMP * unit, 1.0
    for i in range(n):
        shift = PARALLELS_APART * weight(x, unit, i, work)
        if shift == 0.0:
            shift = PARALLELS_APART
        before = time_of_jump(model, transition, t, x, (i, -shift), (shortest, longest), rises, work)
        after = time_of_jump(model, transition, t, x, (i, shift), (shortest, longest), rises, work)
        gradient[i] = 0.5 * (before - after) / shift
        total -= gradient[i] * work.field[i]
    if math.isnan(total):
        return False
    for i in range(n):
        work.gradient[i] = gradient[i]
    work.gradient[n] = total
    return True


@njit(**KERNEL)
def plane_beside(model, transition, t, x, unit, s, work):
    """Whether a guard has one direction on both sides of its surface, which goes to ``work.gradient``."""
    n, before, behind = model.dimension, work.stages[0], work.stages[1]
    direction_on_path(model, transition, t, x, -s, before, work)
    direction_on_path(model, transition, t, x, s, behind, work)
    apart, size, total = 0.0, 0.0, 1.0
    for i in range(n):
        scale = weight(x, unit, i, work)
        apart = max(apart, abs(behind[i] - before[i]) * scale)
        size += abs(behind[i] + before[i]) * scale
    if not apart <= SMOOTH * size < math.inf:
        return False
    for i in range(n):
        work.gradient[i] = 0.5 * (before[i] + behind[i])
        total -= work.gradient[i] * work.field[i]
    work.gradient[n] = total
    return True


@njit(**KERNEL)
def value_and_noise(model, transition, t, x, s, work):
    """The guard at the time ``s`` on the path, and what rounding of the state makes of it."""
    value = value_on_parallel(model, transition, t, x, s, 0, 0.0, work)
    for i in range(model.dimension):
        work.state[i] *= 1.0 + (SHAKEN_BY if i % 2 == 0 else -SHAKEN_BY)
    return value, abs(guard_value(model, transition, t + s, work.state, work.scalar) - value)


@njit(**KERNEL)
def jumps_across(model, transition, t, x, s, explained, work):
    """1 if a guard jumps upwards across zero at the crossing, -1 if downwards, else 0.

    ``explained`` is how far its speeds at ``s`` before and behind let it move.
    """
    before, noise_before = value_and_noise(model, transition, t, x, -s, work)
    behind, noise_behind = value_and_noise(model, transition, t, x, s, work)
    change = behind - before
    explained += noise_before + noise_behind
    if not before * behind < 0.0 or not abs(change) > UNEXPLAINED_JUMP * explained:
        return 0
    close = CLOSER * s
    near = value_on_parallel(model, transition, t, x, close, 0, 0.0, work)
    near -= value_on_parallel(model, transition, t, x, -close, 0, 0.0, work)
    if not near / change > JUMPS:
        return 0
    return 1 if change > 0.0 else -1


@njit(**KERNEL)
def unit_of_path(model, x, work):
    """The time in which the state changes by its size; components at rest have no say."""
    size, pace = 0.0, 0.0
    for i in range(model.dimension):
        if work.field[i] != 0.0:
            size, pace = max(size, abs(x[i])), max(pace, abs(work.field[i]))
    return size / pace if size * pace > 0.0 else 1.0


@njit(**KERNEL)
def finds_surface(model, transition, t, x, speed, work):
    """Whether a surface is found at ``(t, x)`` that the gradient of the guard there does not show.

    ``work.gradient (n + 1,)`` then becomes that of another guard of this surface, whose speed is 1. It stays
    that of the guard, with the given ``speed``, if that is smooth, or has no tangent plane. ``work.field`` is
    the field before the crossing.
    """
    if model.affine_guard[transition] == 1:
        return False
    unit, finest = unit_of_path(model, x, work), EPSILON / CLOSER * abs(t)
    s, found, smooth = BESIDE_SURFACE * unit, False, False
    for _ in range(LOOKS):
        s = max(s, finest)
        before = speed_on_path(model, transition, t, x, -s, work)
        behind = speed_on_path(model, transition, t, x, s, work)
        turn = jumps_across(model, transition, t, x, s, s * (abs(before) + abs(behind)), work)
        if turn != 0:
            found = plane_of_jump(model, transition, t, x, unit, s, float(turn), work)
            break
        sizes = abs(before) + abs(behind)
        smooth = sizes > 0.0 and abs(before + behind - 2.0 * speed) <= SMOOTH * sizes
        if smooth:
            break
        s *= CLOSER
    if not smooth and not found:
        found = plane_beside(model, transition, t, x, unit, max(BESIDE_SURFACE * unit, finest), work)
    if not found:
        model.guard_gradient(transition, t, x, model.parameters, work.gradient)
    return found
