"""Polynomials in Bernstein form: their coefficients bound them, a cheap proof that a step has no root."""

from numba import njit

from hybrid.kernels.types.options import INLINE

# Returned instead of a share of a step if there is none: beyond the end of every step.
NO_ROOT = 2.0


@njit(**INLINE)
def crosses_towards(direction, side):
    """Whether a transition with this ``direction`` fires on a crossing to ``side``."""
    return direction == 0 or direction == side


@njit(**INLINE)
def halve(stack, top, degree):
    """Halve the interval in row ``top`` of the stack; the left half, searched first, goes on top."""
    row, left = stack[top], stack[top + 1]
    middle = 0.5 * (row[0] + row[1])
    left[0], left[1] = row[0], middle
    row[0] = middle
    for level in range(degree, -1, -1):
        left[2 + degree - level] = row[2]
        for i in range(2, level + 2):
            row[i] = 0.5 * (row[i] + row[i + 1])


@njit(**INLINE)
def stays(coefficients, degree, side, band):
    """Whether all coefficients lie beyond ``band`` on ``side``: enough to prove nearly every step."""
    for i in range(degree + 1):  # noqa: SIM110 (no generators in kernels)
        if not coefficients[i] * side > band:
            return False
    return True
