"""Real roots of a polynomial in Bernstein form by Descartes' rule: none missed, none counted twice.

The number of sign variations of the Bernstein coefficients bounds the number of roots in the open interval
and has the same parity (Lane and Riesenfeld 1981, doi:10.1007/BF01934081). So 0 or 1 variations prove 0 or 1
roots, and an interval with more is halved. The hull of the coefficients makes "no root" cheap to prove, and
nearly every step has no root.
"""

from numba import njit

from hybrid.kernels.types.options import INLINE, KERNEL

NO_ROOT = 2.0
# Roots closer than this on the unit interval count as one root: rounding of the coefficients merges them.
CLUSTER = 1e-14
# A relative Newton step below this is in the range of quadratic convergence to a numerically simple root.
SETTLED = 1e-8
# A root closer to an end than this share of an interval may be one at the end itself, moved by rounding.
AT_END = 1e-8


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


@njit(**KERNEL)
def divide_by_theta(coefficients, degree):
    """Divide, in place, a polynomial that vanishes at 0 by its variable; returns the new degree.

    This removes a known root at the start of a step exactly: the root cannot be found again, nor hide a
    second root near it.
    """
    for i in range(degree):
        coefficients[i] = coefficients[i + 1] * degree / (i + 1)
    return degree - 1
