"""Compiled functions equal the model's Python functions and have the declared period."""

from __future__ import annotations

import math
from collections.abc import Sequence

import attrs
import numpy as np

from hybrid.compiler.agreement import disagreement
from hybrid.compiler.compiled import compile_system
from hybrid.expression.reads import TIME, names_read
from hybrid.expression.values import TraceError
from hybrid.system.graph import HybridSystem, functions_of
from hybrid.system.periodicity import angle_fault_at, period_at, period_fault_at
from hybrid.system.watched import is_of_library
from hybrid.testing.case import Case, as_case
from hybrid.testing.errors import PropertyError, discard

COMPILED = "The compiled functions equal the Python functions"
ANGLES = "A turn of an angle changes no function"
PERIOD = "The declared period is a period of every function"
SHORTEST = "No part of the declared period is a period of every function"
# Parts of the period, numbers of cases and of phases at which they are tried.
PARTS = (2, 3)
MOST_CASES = 10
PHASES = 32
# A share of the period that is no simple part of it.
GOLDEN = 0.6180339887498949


def check_compiled(case: Case) -> None:
    """Every compiled function equals its Python function at the start of the case, up to rounding.

    Raises
    ------
    PropertyError
        If a value of a field, guard, condition, reset or given derivative differs.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_compiled
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> check_compiled(case)
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

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case, check_period
    >>> system = models.impact_oscillator()
    >>> case = Case(system, system.parameters, "flight", (0.0, 0.0), 0.0, 20.0)
    >>> check_period(case)
    """
    as_case(case)
    system, x = case.system, np.array(case.x0)
    period = system.forcing_period(case.parameters)
    if period is None:
        discard("no period is declared")
    phase = case.t0 % period
    for _, function in functions_of(system):
        if is_of_library(function.function):
            # Made from functions that are checked, and zero but for rounding where these cancel.
            continue
        fault = period_fault_at(system.variables, function, phase, x, case.values, period)
        if fault is not None:
            case.fail(
                PERIOD,
                fault,
                hint="a number in the period where a function has a parameter, or time that enters a "
                "function outside its forcing.",
            )


def check_angles(case: Case) -> None:
    """Every function has the same values a turn of an angle further, at the start of the case.

    A reset may add whole turns.

    Raises
    ------
    PropertyError
        If a value differs.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid import HybridSystem, Mode
    >>> from hybrid.testing import Case, check_angles
    >>> turning = Mode("turning", lambda t, x, p: (1.0 + 0.5 * np.sin(x.phi),))
    >>> system = HybridSystem(state=("phi",), modes=[turning], angles={"phi": 2 * np.pi})
    >>> check_angles(Case(system, {}, "turning", (0.3,), 0.0, 1.0))
    """
    as_case(case)
    system, x = case.system, np.array(case.x0)
    if not system.angles:
        discard("no angle is declared")
    for _, function in functions_of(system):
        if is_of_library(function.function):
            continue
        fault = angle_fault_at(system.variables, function, case.t0, x, case.values, system.turn_lengths)
        if fault is not None:
            case.fail(ANGLES, fault, hint="an angle outside of sine and cosine, or a turn of another length.")


def check_shortest_period(system: HybridSystem, cases: Sequence[Case]) -> None:
    """Half the declared period is not a period, nor a third of it, at the starts of the cases.

    It finds ``4 * np.pi / p.w`` where ``2 * np.pi / p.w`` is meant, which leaves out every other point of a
    section, and a period of a system that does not depend on time.

    Raises
    ------
    PropertyError
        If a part of the period is a period.
    """
    if system.period is None:
        discard("no period is declared")
    name = system.name or "the system"
    told = f"{SHORTEST}: this does not hold for {name}."
    if not _reads_time(system):
        raise PropertyError(
            f"{told}\n  a period is declared, and no function reads t\n  likely: forcing that is missing, or "
            "a period to be removed."
        )
    rng = np.random.default_rng(20240507)
    # What is forced by an amplitude of zero is forced with another one.
    forced = [
        attrs.evolve(case, parameters={name: value or GOLDEN for name, value in case.parameters.items()})
        for case in cases[:MOST_CASES]
    ]
    places = [
        (case, np.array(case.x0), float(phase)) for case in forced for phase in rng.uniform(0.0, 1.0, PHASES)
    ]
    if not any(_differ(place, GOLDEN) for place in places):
        discard("no function changes in time")
    for part in PARTS:
        if not any(_differ(place, 1.0 / part) for place in places):
            period = period_at(system.period, system.variables, cases[0].values) or math.nan
            raise PropertyError(
                f"{told}\n  period = {period:.10g}, and every function has the period {period / part:.10g}, "
                f"too\n  likely: a factor {part} in period=. Declare the shortest period: sections and "
                "orbits count in it."
            )


def _differ(place: tuple[Case, np.ndarray, float], share: float) -> bool:
    """Whether a function has another value a share of the period later."""
    case, x, phase = place
    system = case.system
    period = period_at(system.period, system.variables, case.values) or math.nan
    return any(
        period_fault_at(system.variables, function, phase * period, x, case.values, share * period)
        is not None
        for _, function in functions_of(system)
    )


def _reads_time(system: HybridSystem) -> bool:
    """Whether a function reads the time, or cannot be followed."""
    try:
        return any(TIME in names_read(system, function.value) for _, function in functions_of(system))
    except TraceError:
        return True
