"""The saltation matrix of one transition at one point."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.errors import ArgumentError
from hybrid.simulation.memory import workspace
from hybrid.simulation.periods import check_time, split_time
from hybrid.simulation.plan import kernel_method
from hybrid.solvers import Tsit5
from hybrid.system.clocks import ticks_of
from hybrid.system.elements import Transition
from hybrid.system.graph import HybridSystem


def saltation_matrix(
    system: HybridSystem,
    transition: str | Transition,
    t: float,
    x: ArrayLike,
    *,
    parameters: Mapping[str, float] | None = None,
) -> np.ndarray:
    """Saltation matrix ``Xi = D_x R + (f_plus - D_x R f_minus - D_t R) D_x g / (D_t g + D_x g f_minus)``.

    The matrix maps a perturbation of the state just before the jump to the perturbation just after it, both
    at the time of the unperturbed jump. The terms in time are for moving guards and time-dependent resets. A
    jump that another jump triggers, by landing beyond its guard, happens at the time of that other jump: its
    ``saltation`` in a run is a different matrix.

    Parameters
    ----------
    system, transition
        The model, and the transition or its name.
    t, x
        Time and state ``(n,)`` before the jump, on the guard.
    parameters
        Values that override the system's.

    Returns
    -------
    numpy.ndarray
        ``(n, n)``, without rows and columns for counters.

    Raises
    ------
    ArgumentError
        If the crossing is not transverse (``D_t g + D_x g f_minus`` is zero), so that the matrix does not
        exist.
    ModelError
        If the transition does not exist.

    References
    ----------
    N. J. Kong, J. J. Payne, J. Zhu, A. M. Johnson, Saltation matrices: the essential tool for linearizing
    hybrid dynamical systems, Proceedings of the IEEE, 2024, arXiv:2306.06862.

    Examples
    --------
    >>> import models
    >>> from hybrid import saltation_matrix
    >>> matrix = saltation_matrix(models.bouncing_ball(), "bounce", 0.0, (0.0, -2.0), parameters={"e": 0.5})
    >>> matrix.diagonal().round(9).tolist()
    [-0.5, -0.5]
    """
    compiled = compile_system(system)
    index = system.transition_index(transition)
    state = system.variables.state_values("x", x)
    model = compiled.model(parameters)
    t = arguments.number("t", t)
    check_time("t", t, model.period)
    phase = split_time(t, model.period)[1]
    rows = [_row_at(system, index, t, state, model)]
    matrices, (transversality,) = matrices_at(system, model, [index], [phase], state[None], rows)
    if not np.all(np.isfinite(matrices)):
        raise ArgumentError(
            f"Transition {system.transitions[index].name!r}: the saltation matrix does not exist at t = {t}, "
            f"x = {tuple(float(v) for v in state)}; the transversality is {transversality}. "
            "A grazing crossing has no linear tangent map."
        )
    return matrices[0]


def _row_at(system: HybridSystem, transition: int, t: float, x: np.ndarray, model: Any) -> int:
    """The row of a schedule whose time is nearest, the first of equal ones; 0 for what has no rows."""
    clock = system.transitions[transition].clock
    if clock is None:
        return 0
    values = model.parameters[: len(system.parameters)]
    ticks, rows = ticks_of(clock, system.variables.state_view(x), system.variables.parameter_view(values))
    return 0 if rows is None else int(rows[np.argmin(np.abs(np.subtract(ticks, t)))])


def matrices_at(
    system: HybridSystem,
    model: Any,
    transitions: list[int],
    phases: list[float],
    states: np.ndarray,
    rows: list[int],
) -> tuple[np.ndarray, np.ndarray]:
    """Saltation matrices ``(J, k, k)`` and transversalities ``(J,)`` of transitions at states ``(J, n)``.

    The model is that of this thread alone. ``rows`` are those of schedules that fire.
    """
    n = system.dimension
    matrices, transversalities = np.empty((len(states), n, n)), np.empty(len(states))
    kernel = load_kernels("hybrid.kernels.jumps.jump").saltation
    work, x_plus = workspace(kernel_method(Tsit5(), False), n), np.empty(n)
    for i, (fired, phase, state) in enumerate(zip(transitions, phases, states, strict=True)):
        if model.row >= 0:
            model.parameters[model.row] = rows[i]
        transversalities[i] = kernel(model, fired, phase, state, x_plus, work)
        matrices[i] = work.saltation
    k = system.tangent_dimension
    return matrices[:, :k, :k], transversalities
