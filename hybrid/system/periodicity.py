"""Check that periods, turns of angles and shifts along cyclic components change no model function."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.system.derivatives import evaluate, sample_points
from hybrid.system.functions import CLOCK, ModelFunction
from hybrid.system.variables import Variables

Period = float | Callable[..., Any] | None
# Functions are compared at these fractions of the period, with the sample states scaled by these sizes.
PHASES = (0.1180, 0.3651, 0.7487)
SIZES = (1.0, 1e-2, 1.0, 10.0)
# A cyclic component is moved by these; the second one changes the sign of a sample state.
SHIFTS = (0.7390851, -137.035999)
# Relative error allowed in a period.
LOOSE = 1e-12
# Number of evaluations with arguments moved by rounding.
SHAKES = 4
# Spacing of floats near one.
EPSILON = float(np.finfo(float).eps)


def period_at(period: Period, variables: Variables, values: np.ndarray) -> float | None:
    """Forcing period at a parameter vector ``(m,)``, or None if none is declared.

    Raises
    ------
    ArgumentError
        If the period is not a positive number.
    """
    if period is None:
        return None
    try:
        with np.errstate(all="ignore"):
            found = period(variables.parameter_view(values)) if callable(period) else period
    except ArithmeticError as error:
        raise ArgumentError(f"HybridSystem: period fails: {error}. Check the parameters.") from error
    number = arguments.number("HybridSystem: period", found)
    if number <= 0:
        raise ArgumentError(f"HybridSystem: period must be positive; got {number}. Check the parameters.")
    return number


def period_fault(
    variables: Variables, functions: Iterable[ModelFunction], values: np.ndarray, period: float
) -> str | None:
    """Error text for the first function without the declared period, or None if all have it."""
    points = [x for _, x in sample_points(variables.dimension)]
    states = [size * x for size, x in zip(SIZES, points, strict=True)]
    for function in functions:
        # The ticks of a clock are counted, whatever the period.
        if function.kind == CLOCK:
            continue
        for fraction in PHASES:
            for x in states:
                fault = period_fault_at(variables, function, fraction * period, x, values, period)
                if fault is not None:
                    return fault
    return None


def rounding(
    variables: Variables,
    function: ModelFunction,
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    here: np.ndarray,
) -> np.ndarray:
    """How far rounding may move the values of a function: large terms that cancel leave nothing else."""
    rng = np.random.default_rng(0)
    largest = np.zeros_like(here)
    for _ in range(SHAKES):
        moved = [each * (1.0 + EPSILON * rng.uniform(-2.0, 2.0, np.shape(each))) for each in (t, x, values)]
        near = evaluate(variables, function.value, float(moved[0]), *moved[1:])
        if near is not None:
            largest = np.maximum(largest, np.abs(near - here))
    return 16.0 * largest


@attrs.frozen(eq=False)
class Shift:
    """A change of the time and of the state that no function may see.

    ``lengths (n,)`` are those of a turn. A reset takes the change of the state along, up to whole turns.
    """

    t: float
    x: np.ndarray
    lengths: np.ndarray

    def apart(
        self, function: ModelFunction, here: np.ndarray, there: np.ndarray, share: float = 1.0
    ) -> np.ndarray:
        """How far two values of a function are apart, whose arguments differ by a share of the shift."""
        change = there - here
        if function.completed is not None:
            change = closed_change(change - share * self.x, self.lengths)
        return np.abs(change)


def whole_turns(change: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Whole turns ``(..., n)`` in changes of the state; 0 for components whose length is 0: no angles."""
    turns = np.divide(change, lengths, out=np.zeros(np.shape(change)), where=lengths > 0.0)
    return np.asarray(np.round(turns))


def closed_change(change: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Changes of the state ``(..., n)`` without whole turns of its angles."""
    return np.asarray(change - lengths * whole_turns(change, lengths))


def unclosed(system: Any, change: np.ndarray) -> np.ndarray:
    """Changes ``(..., k)`` of the first components, without whole turns and shifts along cyclic ones."""
    k = change.shape[-1]
    closed = closed_change(change, system.turn_lengths[:k])
    return np.where(system.is_cyclic[:k], 0.0, closed) if system.cyclic else closed


def _fault(
    variables: Variables, function: ModelFunction, t: float, x: np.ndarray, values: np.ndarray, shift: Shift
) -> tuple[float, float] | None:
    """Two values that differ after a shift by more than rounding, if there are any."""
    here = evaluate(variables, function.value, t, x, values)
    there = evaluate(variables, function.value, t + shift.t, x + shift.x, values)
    if here is None or there is None:
        return None
    apart = shift.apart(function, here, there)
    if np.all(apart <= 16 * EPSILON * np.abs(here)):
        return None
    band = 64 * EPSILON * np.maximum(np.abs(here), np.abs(there))
    for share in (1.0 - LOOSE, 1.0 + LOOSE):
        near = evaluate(variables, function.value, t + share * shift.t, x + share * shift.x, values)
        if near is None:
            return None
        band = band + 2.0 * shift.apart(function, there, near, share - 1.0)
    wrong = apart > band + rounding(variables, function, t, x, values, here)
    if not np.any(wrong):
        return None
    i = int(np.argmax(wrong))
    return float(here[i]), float(there[i])


def period_fault_at(
    variables: Variables, function: ModelFunction, t: float, x: np.ndarray, values: np.ndarray, period: float
) -> str | None:
    """Error text if a function differs one period later by more than rounding, else None."""
    still = np.zeros(len(x))
    found = _fault(variables, function, t, x, values, Shift(period, still, still))
    if found is None:
        return None
    here, there = found
    return (
        f"HybridSystem: period = {period:.10g} is not a period of the functions. {function.title} is "
        f"{here:.10g} {variables.described(t, x, values)}, and {there:.10g} one period later. Give the "
        "period as a function of the parameters, for example period=lambda p: 2*np.pi/p.omega, or omit it."
    )


def angle_fault_at(
    variables: Variables,
    function: ModelFunction,
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    lengths: np.ndarray,
) -> str | None:
    """Error text if a function differs by more than rounding a turn of an angle further, else None."""
    for i in np.flatnonzero(lengths):
        turn = lengths * (np.arange(len(lengths)) == i)
        found = _fault(variables, function, t, x, values, Shift(0.0, turn, lengths))
        if found is not None:
            name, (here, there) = variables.state_names[i], found
            return (
                f"HybridSystem: angles: {name!r} is no angle with a turn of {lengths[i]:.10g}. "
                f"{function.title} is {here:.10g} {variables.described(t, x, values)}, and {there:.10g} a "
                "turn further. Correct the length of the turn, or leave the component out of angles=."
            )
    return None


def cyclic_fault_at(
    variables: Variables,
    function: ModelFunction,
    t: float,
    x: np.ndarray,
    values: np.ndarray,
    cyclic: np.ndarray,
) -> str | None:
    """Error text if a function differs by more than rounding after a shift of a component, else None.

    ``cyclic (n,)`` tells the components that are shifted, one after the other. A reset shifts with them.
    """
    for i in np.flatnonzero(cyclic):
        for size in SHIFTS:
            moved = size * (np.arange(len(x)) == i)
            found = _fault(variables, function, t, x, values, Shift(0.0, moved, np.zeros(len(x))))
            if found is None:
                continue
            name, (here, there) = variables.state_names[i], found
            return (
                f"HybridSystem: cyclic: {name!r} is not cyclic. {function.title} is {here:.10g} "
                f"{variables.described(t, x, values)}, and {there:.10g} where {name!r} alone is larger by "
                f"{size:.6g}; fields, guards and conditions must not depend on a cyclic component, and "
                f"a reset must shift with it. Leave {name!r} out of cyclic=, or take differences of "
                "positions as components of the state."
            )
    return None
