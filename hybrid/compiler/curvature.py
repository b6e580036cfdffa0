"""The curvature of guards along the flow: their second derivative along a vector and time."""

from __future__ import annotations

import sympy
from sympy.core.parameters import distribute

from hybrid.symbolic.derivatives import partial_derivatives
from hybrid.symbolic.expressions import ONE, close_gates, product
from hybrid.symbolic.printer import assignments, unprintable
from hybrid.symbolic.tracing import Symbols

# Not every guard has a compiled curvature; then kernels take a difference quotient.
UNKNOWN = ["out[0] = nan"]


def curvature(guard: sympy.Expr | None, is_affine: bool, symbols: Symbols) -> list[str]:
    """Statements for ``d^2/ds^2 g(t + s, x + s v)`` at ``s = 0``, which read ``v`` from ``out (n,)``."""
    if is_affine:
        return ["out[0] = 0.0"]
    if guard is None:
        return UNKNOWN
    vector = [*(sympy.Symbol(f"out[{i}]", real=True) for i in range(len(symbols.x))), ONE]

    def along(expression: sympy.Expr) -> sympy.Expr:
        [slopes] = partial_derivatives([expression], symbols.variables)
        return sympy.Add(*(product(own, slope) for own, slope in zip(vector, slopes, strict=True)))

    try:
        with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
            second = close_gates(along(along(guard)))
    except RecursionError:
        return UNKNOWN
    if unprintable([second]) is not None:
        return UNKNOWN
    return assignments(["out[0]"], [second], thorough=False)
