"""Outputs: the values and derivatives that results give are those of the functions."""

from __future__ import annotations

import numpy as np

from hybrid.errors import ArgumentError
from hybrid.simulation.quantities import slopes_of, values_of
from hybrid.system.derivatives import Reference, evaluate, reference_derivative
from hybrid.system.functions import ModelFunction
from hybrid.system.outputs import Formula, Output
from hybrid.system.variables import Variables
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import discard

OUTPUTS = "Outputs and their derivatives are those of their functions"
# Points of the run at which outputs are compared, spread over it, and the error of a sum in another order.
MOST_POINTS = 20
ROUNDING = 1e-9


def check_outputs(case: Case) -> None:
    """Outputs of the run equal their functions, and the derivatives that they get equal differences of them.

    Derivatives are those in the state and in the parameters. Kinks, and points where an output is not finite,
    are skipped.

    Raises
    ------
    PropertyError
        If a value or a derivative differs.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_outputs
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_outputs(case)
    """
    as_case(case)
    system, arc = case.system, case.run.arc
    rows = np.unique(np.linspace(0, len(arc.t) - 1, MOST_POINTS).astype(int))
    names = arc.mode[rows]
    places = arc.t[rows], arc.x[rows], np.array([system.mode_index(str(name)) for name in names])
    seen = 0
    for name, output in system.outputs.items():
        values = values_of(system, name, *places, case.values)
        slopes = _slopes(case, name, places)
        for i, (row, mode) in enumerate(zip(rows.tolist(), names, strict=True)):
            formula = _formula(output, case.names_of_mode(str(mode)))
            if formula is not None:
                seen += _check_point(case, output, formula, row, float(values[i]), slopes[i])
    if not seen:
        discard("no output has a value on the run")


def _slopes(case: Case, name: str, places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """Derivatives ``(N, n + m)`` at the points; nan for an output that has none."""
    try:
        return slopes_of(case.system, name, *places, case.values)
    except ArgumentError:
        return np.full((len(places[0]), case.system.dimension + len(case.values)), np.nan)


def _formula(output: Output, names: tuple[str | None, ...]) -> Formula | None:
    return next((each for each in output.formulas if each.of is None or each.of in names), None)


def _check_point(
    case: Case, output: Output, formula: Formula, row: int, value: float, slopes: np.ndarray
) -> bool:
    """Compare an output at one point of the run; whether there was anything to compare."""
    arc, variables = case.run.arc, case.system.variables
    t, x = float(arc.t[row]), arc.x[row]
    own = evaluate(variables, formula.function, t, x, case.values)
    if own is None:
        return False
    reference = _reference(case, output, formula, t, x)
    scale = abs(float(own[0])) if reference is None else float(reference.size[0, 0])
    if abs(value - float(own[0])) > ROUNDING * scale:
        case.fail(
            OUTPUTS,
            f"{output.title(formula)} is {value:.10g} in results and {float(own[0]):.10g} by its function",
            f"t = {t:.10g}, {case.state_told(x)}",
            hint="a function whose result depends on more than its arguments.",
            time=t,
        )
    if reference is None:
        return True
    # The last column of the reference is that of the time.
    for i, label in enumerate((*variables.state_names, *variables.parameter_names)):
        known, allowed = float(reference.values[0, i]), float(reference.tolerance[0, i])
        # Where a derivative is not known, results refuse it.
        if np.isfinite(known) and abs(float(slopes[i]) - known) > allowed:
            case.fail(
                OUTPUTS,
                f"the derivative of {output.title(formula)} in {label} is {float(slopes[i]):.10g}, and the "
                f"{reference.source} is {known:.10g}",
                f"t = {t:.10g}, {case.state_told(x)}",
                hint="a function that is not differentiable there in complex numbers, as one with abs() that "
                "cannot be traced.",
                time=t,
            )
    return True


def _reference(case: Case, output: Output, formula: Formula, t: float, x: np.ndarray) -> Reference | None:
    """Derivatives by differences, in components and parameters measured in units of their own size."""
    variables, n = case.system.variables, len(x)
    point = np.concatenate([x, case.values])
    units = np.where(point == 0.0, 1.0, np.abs(point))

    def measured(t: float, y: np.ndarray, p: object) -> object:
        z = [each * unit for each, unit in zip(y, units, strict=True)]
        return formula.function(t, variables.state_view(z[:n]), variables.parameter_view(z[n:]))

    called = ModelFunction(output.title(formula), "function", measured, "", None, None)
    found = reference_derivative(Variables(len(point), {}), called, t, point / units, np.empty(0))
    if found is None:
        return None
    scale = np.append(units, 1.0)
    return Reference(t, x, found.values / scale, found.tolerance / scale, found.size, found.source)
