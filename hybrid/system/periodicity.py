"""Whether a declared forcing period is a period of the functions of a model."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from hybrid.compiler.agreement import EPSILON, place_told
from hybrid.system.derivatives import evaluate, sample_points
from hybrid.system.functions import Role, roles

if TYPE_CHECKING:
    import sympy

    from hybrid.system.graph import HybridSystem

# Where in the period functions are compared, and with which sizes of the state.
PHASES = (0.1180, 0.3651, 0.7487)
SIZES = (1.0, 1e-2, 1.0, 10.0)
# A period may be off by this much, relative to it.
LOOSE = 1e-12
# A number of periods this close to a whole one is whole: it has been rounded a few times.
WHOLE = 1e-13


def period_fault(system: HybridSystem, values: np.ndarray, period: float) -> str | None:
    """Which function does not have the declared period at the parameter vector ``(m,)``, in words."""
    points = [x for _, x in sample_points(system.dimension)]
    states = [size * x for size, x in zip(SIZES, points, strict=True)]
    for role in roles(system):
        for fraction in PHASES:
            for x in states:
                fault = period_fault_at(system, role, fraction * period, x, values, period)
                if fault is not None:
                    return fault
    return None


def period_fault_at(
    system: HybridSystem, role: Role, t: float, x: np.ndarray, values: np.ndarray, period: float
) -> str | None:
    """How a function differs a period later, in words; None if it does not by more than rounding."""
    here = evaluate(system, role.function, t, x, values)
    there = evaluate(system, role.function, t + period, x, values)
    if here is None or there is None:
        return None
    apart = np.abs(there - here)
    if np.all(apart <= 16 * EPSILON * np.abs(here)):
        return None
    band = 64 * EPSILON * np.abs(here)
    for shift in (1.0 - LOOSE, 1.0 + LOOSE):
        near = evaluate(system, role.function, t + shift * period, x, values)
        if near is None:
            return None
        band = band + 2.0 * np.abs(near - there)
    wrong = apart > band
    if not np.any(wrong):
        return None
    i = int(np.argmax(wrong))
    return (
        f"HybridSystem: period = {period:.10g} is no period of the functions. {role.title} is {here[i]:.10g} "
        f"{place_told(system, t, x, values)}, and {there[i]:.10g} one period later. Give the period as a "
        "function of the parameters, period=lambda p: 2*np.pi/p.omega say, or leave it out."
    )


def is_periodic(expressions: Iterable[sympy.Expr], t: sympy.Symbol, period: sympy.Expr) -> bool:
    """Whether expressions are proved to have a period in ``t``, an expression of the parameters.

    Each harmonic or remainder that time enters has it; what else has it is left to numbers.
    """
    return all(_proved(expression, t, period) for expression in expressions)


def _proved(expression: sympy.Expr, t: sympy.Symbol, period: sympy.Expr) -> bool:
    import sympy

    from hybrid.symbolic.expressions import Remainder
    from hybrid.symbolic.nodes import mentions

    if not mentions(expression, (t,)):
        return True
    if expression.is_Symbol:
        return False
    turn = None
    if isinstance(expression, sympy.sin | sympy.cos):
        turn = 2 * sympy.pi
    elif isinstance(expression, sympy.tan):
        turn = sympy.pi
    elif isinstance(expression, Remainder) and not mentions(expression.args[1], (t,)):
        turn = expression.args[1]
    if turn is not None:
        slope = expression.args[0].diff(t)
        if not mentions(slope, (t,)) and _is_whole(sympy.cancel(slope * period / turn)):
            return True
    return all(_proved(argument, t, period) for argument in expression.args)


def _is_whole(turns: sympy.Expr) -> bool:
    if not turns.is_number:
        return False
    number = float(turns)
    return abs(number - round(number)) <= WHOLE * abs(number)
