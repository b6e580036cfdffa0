"""The curvature of guards along the flow: their second derivative along a vector and time."""

from __future__ import annotations

from hybrid.expression.code import assignments, unprintable
from hybrid.expression.derivatives import close_gates, partial_derivatives
from hybrid.expression.nodes import ONE, Expression, Symbol, add
from hybrid.expression.tracing import Symbols

# Not every guard has a compiled curvature; then kernels take a difference quotient.
UNKNOWN = ["out[0] = nan"]


def curvature(guard: Expression | None, is_affine: bool, symbols: Symbols) -> list[str]:
    """Statements for ``d^2/ds^2 g(t + s, x + s v)`` at ``s = 0``, which read ``v`` from ``out (n,)``."""
    if is_affine:
        return ["out[0] = 0.0"]
    if guard is None:
        return UNKNOWN
    vector = [*(Symbol(f"out[{i}]") for i in range(len(symbols.x))), ONE]

    def along(expression: Expression) -> Expression:
        [slopes] = partial_derivatives([expression], symbols.variables)
        return add(*(own * slope for own, slope in zip(vector, slopes, strict=True)))

    second = close_gates(along(along(guard)))
    if unprintable([second]) is not None:
        return UNKNOWN
    return assignments(["out[0]"], [second])
