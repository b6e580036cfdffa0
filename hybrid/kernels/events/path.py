"""The state along a step: polynomials in the step's variable, one column per component."""

from numba import njit

from hybrid.kernels.types.layout import EPSILON
from hybrid.kernels.types.options import INLINE, KERNEL

# Rounding error of a state or a time, as a multiple of EPSILON times its size.
ROUNDING = 16.0


@njit(**INLINE)
def value_at(path, column, order, s):
    """Value of one column at ``s``."""
    total = path[order, column]
    for o in range(order - 1, -1, -1):
        total = total * s + path[o, column]
    return total


@njit(**KERNEL)
def state_at(path, order, n, s, out):
    """Write the state at ``s`` into ``out (n,)``."""
    for i in range(n):
        out[i] = value_at(path, i, order, s)


@njit(**INLINE)
def time_at(path, order, clock, start, pace, s):
    """Time at ``s``: ``start`` plus ``pace * s``, or plus the column ``clock`` if that is not negative."""
    if clock < 0:
        return start + pace * s
    return start + value_at(path, clock, order, s)


@njit(**KERNEL)
def rounding_of_start(path, n, scale, clock, time_scale, pace):
    """How far along a step its start may lie by the rounding of its state and time.

    ``scale (n,)`` and ``time_scale`` are the sizes of state and time.
    """
    size, speed = 0.0, 0.0
    for i in range(n):
        if path[1, i] != 0.0:
            size, speed = max(size, scale[i]), max(speed, abs(path[1, i]))
    place = size / speed if speed > 0.0 else 0.0
    rate = path[1, clock] if clock >= 0 else pace
    if rate > 0.0:
        place = max(place, time_scale / rate)
    return ROUNDING * EPSILON * place
