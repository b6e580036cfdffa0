"""Tangent vectors and states in a mode that holds quantities at zero: none of them leads off."""

from __future__ import annotations

import numpy as np

from hybrid.compiler.compiled import compile_system
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function, Mode
from hybrid.system.graph import HybridSystem
from hybrid.system.variables import Variables

# Gradients that are smaller than this share of the largest, in units of their own length, depend on others.
DEPENDENT = 1e-10
STEP = float(np.finfo(float).eps) ** (1 / 3)
# Newton's steps back onto what a mode holds: from nearby a few are enough.
MOST_STEPS = 6


def tangent_projection(
    system: HybridSystem, mode: Mode, t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """The projection ``(n, n)`` onto the directions along which all that a mode holds stays zero.

    ``n`` is the number of components with tangent vectors. Held components, and parameters that count as
    such, stay as they are: the others follow what the mode holds.
    """
    gradients, moving = _gradients(system, mode, t, x, parameters), system.variables.moving
    back, along = _back_and_along(gradients, moving)
    projection = np.eye(gradients.shape[1])
    projection[:moving, :moving], projection[:moving, moving:] = along, -back @ gradients[:, moving:]
    return projection


def drawn_back(
    system: HybridSystem, mode: str | None, t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """The state ``(n,)`` nearby at which all that a mode holds is zero; ``x`` itself if it holds nothing.

    A run would come there by itself, but only at the pace of the motion, while `tangent_projection` says
    that it forgets at once how far it has been. Iterates of Newton's method, which leave a curved surface,
    are drawn back so that their runs do what their tangent vectors say.
    """
    held = None if mode is None else system.modes[system.mode_index(mode)]
    if held is None or held.holds is None:
        return x
    variables, found, before = system.variables, x, np.inf
    for _ in range(MOST_STEPS):
        off = evaluate(variables, held.holds, t, found, parameters)
        if off is None:
            return x
        back, _ = _back_and_along(_gradients(system, held, t, found, parameters), variables.moving)
        step = back @ off
        length = float(np.abs(step).max())
        if length >= before or length == 0.0:
            break
        found, before = found.copy(), length
        found[: variables.moving] -= step
    return found


def _back_and_along(gradients: np.ndarray, moving: int) -> tuple[np.ndarray, np.ndarray]:
    """The shortest changes ``(moving, h)`` that take one unit of each held quantity away; what stays.

    What stays is the projection ``(moving, moving)`` onto the directions that change none: exactly zero
    where there is none.
    """
    rows = gradients[:, :moving]
    sizes = np.linalg.norm(rows, axis=1)
    units = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0.0)
    left, values, right = np.linalg.svd(rows * units[:, None])
    rank = int(np.sum(values > DEPENDENT * values[0])) if values[0] > 0.0 else 0
    back = (right[:rank].T / values[:rank]) @ left[:, :rank].T * units
    return back, right[rank:].T @ right[rank:]


def _gradients(
    system: HybridSystem, mode: Mode, t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Derivatives of what a mode holds, from the expressions, by central differences if there are none."""
    assert mode.holds is not None, "this is asked of modes that hold something"
    variables, known = system.variables, compile_system(system).plans
    n, key = variables.tangent_dimension, ("slopes of what is held", mode.name)
    if key not in known:
        known[key] = _slopes(mode.holds, variables)
    if known[key] is not None:
        return np.asarray(evaluate(variables, known[key], t, x, parameters)).reshape(-1, n)
    columns = []
    for i in range(n):
        step = STEP * max(abs(x[i]), 1.0) * np.eye(len(x))[i]
        ends = [evaluate(variables, mode.holds, t, x + sign * step, parameters) for sign in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / (2.0 * step[i]))
    return np.array(columns).T


def _slopes(holds: Function, variables: Variables) -> Function | None:
    """The derivatives of what is held, row by row, as a model function; None if it cannot be traced."""
    from hybrid.expression.derivatives import jacobian_of
    from hybrid.expression.evaluation import expressed
    from hybrid.expression.tracing import TraceError, model_symbols, trace

    try:
        traced = trace(holds, variables.components, variables.parameter_names)
    except TraceError:
        return None
    x = model_symbols(variables.dimension, len(variables.parameter_names)).x
    rows = jacobian_of(traced, x[: variables.tangent_dimension])
    return expressed([each for row in rows for each in row])
