"""The curvature of guards along the flow: their second derivative along a vector and time."""

from __future__ import annotations

import math

from hybrid.compiler.statements.code import Statement, at, put
from hybrid.compiler.statements.values import assignments, unprintable
from hybrid.expression.derivatives import close_gates, directional
from hybrid.expression.nodes import ONE, Expression, Symbol
from hybrid.expression.tracing import Symbols

# Not every guard has a compiled curvature; then kernels take a difference quotient.
UNKNOWN = [put(at("out", 0), math.nan)]


def curvature(guard: Expression | None, is_affine: bool, symbols: Symbols) -> list[Statement]:
    """Statements for ``d^2/ds^2 g(t + s, x + s v)`` at ``s = 0``, which read ``v`` from ``out (n,)``."""
    if is_affine:
        return [put(at("out", 0), 0.0)]
    if guard is None:
        return UNKNOWN
    vector: dict[Symbol, Expression] = {each: Symbol(f"out[{i}]") for i, each in enumerate(symbols.x)}
    vector[symbols.t] = ONE
    [second] = directional(directional([guard], vector), vector)
    second = close_gates(second)
    if unprintable([second]) is not None:
        return UNKNOWN
    return assignments([at("out", 0)], [second])
