"""The shares of the sides of two surfaces along which a state slides, where their jumps do not add up."""

from __future__ import annotations

from collections.abc import Sequence

from hybrid.expression.nodes import HALF, Expression, power
from hybrid.expression.polynomials import is_zero
from hybrid.transform.rounding import combined

# Two solutions for the shares on an intersection count as one if their relative difference is less than the
# square root of this number.
FOLD = 1e-8


def stable_shares(
    one: Sequence[Expression], other: Sequence[Expression]
) -> tuple[Expression, Expression, Expression]:
    """Shares ``a`` and ``b`` at which two heights stand still, and what is positive if they are known.

    With the rates ``g = p0 + p1 a + p2 b + p3 a b`` and ``h = q0 + q1 a + q2 b + q3 a b`` of the heights,
    ``-1 <= a, b <= 1``, the stable one of the two solutions of ``g = h = 0`` is that where the determinant of
    the derivatives in ``a`` and ``b`` is positive.
    """
    (p0, p1, p2, p3), (q0, q1, q2, q3) = one, other
    square, linear, constant = (
        q2 * p3 - q3 * p2,
        q0 * p3 + q2 * p1 - q1 * p2 - q3 * p0,
        q0 * p1 - q1 * p0,
    )
    if is_zero(square):
        b, unique = -constant / linear, linear
    else:
        root = power(linear**2 - 4 * square * constant, HALF)
        # Both quotients of the quadratic formula, each weighted with its denominator: no sign of a
        # coefficient makes terms cancel, and the square may vanish.
        b = (2 * square * (root - linear) - 2 * constant * (root + linear)) / (
            4 * square**2 + (root + linear) ** 2
        )
        unique = root**2 - FOLD * (linear**2 + square**2)
    # Both rates give the same share; one of them may not depend on it.
    p, q = p1 + p3 * b, q1 + q3 * b
    a = -((p0 + p2 * b) * p + (q0 + q2 * b) * q) / (p**2 + q**2)
    return a, b, unique


def bilinear(mm: Expression, mp: Expression, pm: Expression, pp: Expression) -> tuple[Expression, ...]:
    """Coefficients of 1, a, b and ab of the bilinear function with these values where a, b are -1 or 1."""
    signs = (-1, -1, 1, 1), (-1, 1, -1, 1), (1, -1, -1, 1)
    by_a, by_b, by_both = (combined(*zip(each, (mm, mp, pm, pp), strict=True)) / 4 for each in signs)
    return pp - by_a - by_b - by_both, by_a, by_b, by_both
