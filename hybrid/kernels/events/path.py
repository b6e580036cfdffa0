"""The state along a step: polynomials in the step's variable, one column per component."""

from numba import njit

from hybrid.kernels.types.options import INLINE, KERNEL


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
