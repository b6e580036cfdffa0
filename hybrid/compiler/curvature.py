"""The curvature of guards along the flow: their second derivative along a vector and time."""

from __future__ import annotations

import sympy

from hybrid.errors import ModelError
from hybrid.symbolic.derivatives import directional
from hybrid.symbolic.expressions import ONE, close_gates
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
    vector = {x: sympy.Symbol(f"out[{i}]", real=True) for i, x in enumerate(symbols.x)}
    try:
        [second] = directional(directional([guard], vector | {symbols.t: ONE}), vector | {symbols.t: ONE})
        second = close_gates(second)
    except (ModelError, RecursionError, NotImplementedError):
        return UNKNOWN
    if unprintable([second]) is not None:
        return UNKNOWN
    return assignments(["out[0]"], [second], thorough=False)
