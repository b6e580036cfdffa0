"""Tangent vectors in a mode that holds quantities at zero: none of them leads off."""

from __future__ import annotations

import numpy as np

from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Mode
from hybrid.system.variables import Variables

# Gradients that are smaller than this share of the largest, in units of their own length, depend on others.
DEPENDENT = 1e-10
STEP = float(np.finfo(float).eps) ** (1 / 3)


def tangent_projection(
    mode: Mode, variables: Variables, t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """The projection ``(n, n)`` onto the directions along which all that a mode holds stays zero.

    ``n`` is the number of components with tangent vectors.
    """
    gradients = _gradients(mode, variables, t, x, parameters)
    sizes = np.linalg.norm(gradients, axis=1)
    _, values, rows = np.linalg.svd(gradients[sizes > 0.0] / sizes[sizes > 0.0, None])
    across = rows[: np.count_nonzero(values > DEPENDENT)]
    return np.asarray(np.eye(gradients.shape[1]) - across.T @ across)


def _gradients(
    mode: Mode, variables: Variables, t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Derivatives of what a mode holds, from the expressions, by central differences if there are none."""
    from hybrid.expression.derivatives import jacobian_of
    from hybrid.expression.evaluation import expressed
    from hybrid.expression.tracing import TraceError, model_symbols, trace

    assert mode.holds is not None, "this is asked of modes that hold something"
    n = variables.tangent_dimension
    try:
        traced = trace(mode.holds, variables.components, variables.parameter_names)
    except TraceError:
        columns = []
        for i in range(n):
            step = STEP * max(abs(x[i]), 1.0) * np.eye(len(x))[i]
            ends = [evaluate(variables, mode.holds, t, x + sign * step, parameters) for sign in (1.0, -1.0)]
            columns.append((ends[0] - ends[1]) / (2.0 * step[i]))
        return np.array(columns).T
    symbols = model_symbols(variables.dimension, len(variables.parameter_names))
    flat = [each for row in jacobian_of(traced, symbols.x[:n]) for each in row]
    return np.asarray(evaluate(variables, expressed(flat), t, x, parameters)).reshape(len(traced), n)
