"""Given, traced and numerical derivatives agree."""

from __future__ import annotations

import numpy as np

from hybrid.compiler.compiled import compile_system
from hybrid.system.derivatives import complex_step, derivative_fault, evaluate, reference_derivative
from hybrid.system.functions import GUARD, VALUES_ALONE, ModelFunction
from hybrid.system.graph import functions_of
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard

# The complex step has no error but rounding.
AGREES = 1e-12
DERIVATIVES = "Given, traced and numerical derivatives agree"


def check_derivatives(case: Case) -> None:
    """Given and traced derivatives equal the complex step, or central differences where it is unavailable.

    Every field, guard and reset is checked at the start of the case. Kinks, and points where a function is
    not finite, are skipped.

    Raises
    ------
    PropertyError
        If an entry is wrong.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_derivatives
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_derivatives(case)
    """
    as_case(case)
    emitted = compile_system(case.system).emitted
    x, seen = np.array(case.x0), 0
    for index, function in functions_of(case.system):
        if function.kind in VALUES_ALONE:
            continue
        reference = reference_derivative(case.system.variables, function, case.t0, x, case.values)
        if reference is None:
            continue
        seen += 1
        used = case.engine.derivative(case.system, function, index, case.t0, x, case.values)
        found = {"the library's derivative": np.where(np.isfinite(used), used, np.inf)}
        if function.kind == GUARD and emitted.plain_guard[index]:
            # Runs use another guard of the same sign.
            found = {}
        if function.derivative is not None:
            given = evaluate(case.system.variables, function.derivative, case.t0, x, case.values)
            if given is not None:
                found = {"the derivative given": given.reshape(function.rows, -1), **found}
        for whose, matrix in found.items():
            fault = derivative_fault(case.system.variables, function, matrix, reference)
            if fault is not None and not _is_complex_step(case, function, matrix, x):
                case.fail(
                    DERIVATIVES,
                    f"{whose}: {fault}",
                    hint="a slip in the derivative; or a number in it where the function has a parameter. "
                    "Omit the derivative: the library computes it.",
                )
    if not seen:
        discard("no model function is finite at the start")


def _is_complex_step(case: Case, function: ModelFunction, matrix: np.ndarray, x: np.ndarray) -> bool:
    """Whether a derivative is the complex step, which knows more than differences where time runs fast."""
    try:
        exact = complex_step(case.system.variables, function, case.t0, x, case.values)
    except Exception:  # whatever the cause, there is none
        return False
    given = matrix if matrix.shape == exact.shape else np.column_stack([matrix, exact[:, -1:]])
    return bool(np.allclose(given, exact, rtol=AGREES, atol=0.0))
