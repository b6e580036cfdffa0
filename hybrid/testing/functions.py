"""Compiled functions equal the model's Python functions and have the declared period."""

from __future__ import annotations

import numpy as np

from hybrid.compiler.agreement import disagreement
from hybrid.compiler.compiled import compile_system
from hybrid.system.graph import functions_of
from hybrid.system.periodicity import period_fault_at
from hybrid.testing.case import Case, as_case, discard

COMPILED = "The compiled functions equal the Python functions"
PERIOD = "The declared period is a period of every function"


def check_compiled(case: Case) -> None:
    """Every compiled function equals its Python function at the start of the case, up to rounding.

    Raises
    ------
    PropertyError
        If a value of a field, guard, condition, reset or given derivative differs.
    """
    as_case(case)
    compiled = compile_system(case.system)
    x = np.array(case.x0)
    for index, function in functions_of(case.system):
        value = case.engine.value
        fault = disagreement(compiled, function, index, case.t0, x, case.values, value)
        if fault is not None:
            case.fail(
                COMPILED,
                fault,
                hint="a function whose result depends on more than its arguments.",
            )


def check_period(case: Case) -> None:
    """Every function has the same values one declared period later, at the start of the case.

    Raises
    ------
    PropertyError
        If a value differs.
    """
    as_case(case)
    system, x = case.system, np.array(case.x0)
    period = system.forcing_period(case.parameters)
    if period is None:
        discard("no period is declared")
    phase = case.t0 % period
    for _, function in functions_of(system):
        fault = period_fault_at(system.variables, function, phase, x, case.values, period)
        if fault is not None:
            case.fail(
                PERIOD,
                fault,
                hint="a number in the period where a function has a parameter, or time that enters a "
                "function outside its forcing.",
            )
