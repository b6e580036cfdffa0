"""Where a run may start: on the near side of all guards, where the laws of the mode allow it."""

from __future__ import annotations

import numpy as np

from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function
from hybrid.testing.case import Case, guard_beyond

# Newton's method ends where no quantity is larger than this share of its terms, or after so many steps; what
# it has found then must be within the other share.
ON_SURFACE = 1e-14
NEAR_SURFACE = 1e-9
MOST_STEPS = 30
# Step of the differences.
NUDGE = 2.0**-26


def start_in(case: Case, mode: str) -> tuple[float, ...] | None:
    """The state nearest to that of a case from which a run may start in a mode; None if there is none near.

    It lies on the surfaces of the ``equal`` of the mode, on the near side of its guards, where its field has
    a value and no invariant is negative.
    """
    names = case.names_of_mode(mode)
    functions = [each for law in case.laws.equal if (each := law.in_mode(*names)) is not None]
    x = nearest_zero(case, functions, case.t0, np.array(case.x0, dtype=float))
    if x is None or evaluate(case.system.variables, case.rates_of(mode), case.t0, x, case.values) is None:
        return None
    walls = (each for each in case.system.transitions if each.source == mode)
    if not all(guard_beyond(case, each, case.t0, x) < 0.0 for each in walls):
        return None
    for law in case.laws.invariant:
        function = law.in_mode(*names)
        value = 0.0 if function is None else _value(case, function, case.t0, x)
        if value is None or value < 0.0:
            return None
    return tuple(float(each) for each in x)


def nearest_zero(case: Case, functions: list[Function], t: float, x: np.ndarray) -> np.ndarray | None:
    """A state near ``x`` where scalar functions of ``(t, x, p)`` are zero, by Newton's method; or None."""
    if not functions:
        return x
    for _ in range(MOST_STEPS):
        found = [_value_and_slope(case, function, t, x) for function in functions]
        pairs = [pair for pair in found if pair is not None]
        if len(pairs) < len(found):
            return None
        residual, jacobian = (np.array(each) for each in zip(*pairs, strict=True))
        if np.all(np.abs(residual) <= ON_SURFACE * (np.abs(jacobian) @ np.abs(x))):
            return x
        # A counter stays what it is.
        free = case.system.tangent_dimension
        x = x - np.append(np.linalg.pinv(jacobian[:, :free]) @ residual, np.zeros(len(x) - free))
        if not np.all(np.isfinite(x)):
            return None
    return x if np.all(np.abs(residual) <= NEAR_SURFACE * (np.abs(jacobian) @ np.abs(x))) else None


def _value_and_slope(
    case: Case, function: Function, t: float, x: np.ndarray
) -> tuple[float, list[float]] | None:
    value, slopes = _value(case, function, t, x), []
    for i in range(len(x)):
        aside = x.copy()
        aside[i] += NUDGE * max(1.0, abs(x[i]))
        there = _value(case, function, t, aside)
        if value is None or there is None:
            return None
        slopes.append((there - value) / (aside[i] - x[i]))
    return None if value is None else (value, slopes)


def _value(case: Case, function: Function, t: float, x: np.ndarray) -> float | None:
    found = evaluate(case.system.variables, function, t, x, case.values)
    return None if found is None else float(found[0])
