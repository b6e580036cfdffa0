"""The state and the time along a step, evaluated (``layout.Path``)."""

from numba import njit

from hybrid.kernels.types.layout import EPSILON, Path
from hybrid.kernels.types.options import INLINE, KERNEL

# Rounding error of a state or a time, as a multiple of EPSILON times its size.
ROUNDING_OF_START = 16.0


@njit(**INLINE)
def up_to(path, length):
    """The path up to another value of its variable."""
    return Path(path.powers, path.degree, path.clock, path.start, path.pace, length, path.exact, path.root)


@njit(**INLINE)
def value_at(powers, column, degree, s):
    """Value of one polynomial at ``s``."""
    total = powers[degree, column]
    for o in range(degree - 1, -1, -1):
        total = total * s + powers[o, column]
    return total


@njit(**KERNEL)
def state_at(path, n, s, out):
    """Write the state at ``s`` into ``out (n,)``."""
    for i in range(n):
        out[i] = value_at(path.powers, i, path.degree, s)


@njit(**INLINE)
def end_of(path, n, out):
    """Write the state at the end of a path, which stands behind its powers, into ``out (n,)``."""
    for i in range(n):
        out[i] = path.powers[path.degree + 1, i]


@njit(**INLINE)
def time_along(path, s):
    """The time since the start at ``s``."""
    return path.pace * s if path.clock < 0 else value_at(path.powers, path.clock, path.degree, s)


@njit(**INLINE)
def time_at(path, s):
    """Time at ``s``."""
    return path.start + time_along(path, s)


@njit(**INLINE)
def pace_at_start(path):
    """How fast time passes at the start, by the variable."""
    return path.powers[1, path.clock] if path.clock >= 0 else path.pace


@njit(**KERNEL)
def rounding_of_start(path, n, scale, time_scale):
    """How far along a step its start may lie by the rounding of its state and time.

    ``scale (n,)`` and ``time_scale`` are the sizes of state and time.
    """
    size, speed = 0.0, 0.0
    for i in range(n):
        if path.powers[1, i] != 0.0:
            size, speed = max(size, scale[i]), max(speed, abs(path.powers[1, i]))
    place = size / speed if speed > 0.0 else 0.0
    rate = pace_at_start(path)
    if rate > 0.0:
        place = max(place, time_scale / rate)
    return ROUNDING_OF_START * EPSILON * place
