"""Numerical derivatives of model functions, as a reference for given and derived ones.

Every derivative has ``n + 1`` columns: one per state, and the last for time.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.system.functions import ModelFunction
from hybrid.system.rows import fires, plain_firing
from hybrid.system.variables import Variables

COMPLEX_STEP = 1e-30
# The central difference is taken with this step and half of it; the change estimates the error.
DIFFERENCE_STEP = 2.0**-16
# States are near 1, and so are those after a reset, whose terms may cancel: a difference is off by so much.
ROUNDING = 8.0 * float(np.finfo(float).eps) / DIFFERENCE_STEP


def check_derivative(variables: Variables, function: ModelFunction) -> None:
    """Compare a given derivative with the complex step of its function, at default parameters.

    The complex step is used where central differences confirm it (``np.abs``, for example, has no complex
    derivative). Elsewhere the central differences are the reference, to their own accuracy. Points where
    the function is not finite are skipped.

    Raises
    ------
    ModelError
        If an entry is wrong, or if the column for time is missing and the function depends on time.
    """
    values = variables.defaults
    for t, x in sample_points(variables.dimension):
        reference = reference_derivative(variables, function, t, x, values)
        # Infinite and nan entries are wrong where the function has a finite slope.
        given = evaluate(variables, function.slopes, t, x, values, finite=False)
        if reference is None or given is None:
            continue
        fault = derivative_fault(variables, function, given.reshape(function.rows, -1), reference)
        if fault is not None:
            raise ModelError(fault)


def complex_step_error(variables: Variables, function: ModelFunction) -> Exception | None:
    """Why the complex step cannot be taken through a function, or None if it can.

    The function must run on complex numbers, and its complex step must agree with central differences.
    """
    values = variables.defaults
    for t, x in sample_points(variables.dimension):
        try:
            found = complex_step(variables, function, t, x, values)
        except ArithmeticError:
            continue
        except Exception as error:
            return error
        reference = _central_difference(variables, function, t, x, values)
        if reference is not None and not reference.confirms(found):
            return ModelError("it runs on complex numbers, but is not differentiable there")
    return None


def sample_points(n: int) -> Iterator[tuple[float, np.ndarray]]:
    """A few fixed points ``(t, x)`` with components of size near 1; all are positive at the first points."""
    rng = np.random.default_rng(20240507)
    for signs in (np.ones(n), np.ones(n), rng.choice([-1.0, 1.0], n), -np.ones(n)):
        yield rng.uniform(0.5, 1.5), signs * rng.uniform(0.5, 1.5, n)


@attrs.frozen(eq=False)
class Reference:
    """Derivative of a model function at a point, with its tolerance.

    Attributes
    ----------
    t, x
        The point.
    values, tolerance
        ``(rows, n + 1)``; the tolerance is infinite where the function has a kink or a jump.
    size
        ``(rows, 1)``: size of a row's values and derivatives, in whose units errors are judged.
    source
        The method, for error texts.
    """

    t: float
    x: np.ndarray
    values: np.ndarray
    tolerance: np.ndarray
    size: np.ndarray
    source: str

    def confirms(self, other: np.ndarray) -> bool:
        """Whether another derivative agrees; entries that are nan are not compared."""
        return not np.any(np.abs(other - self.values) > self.tolerance)


def reference_derivative(
    variables: Variables, function: ModelFunction, t: float, x: np.ndarray, parameters: np.ndarray
) -> Reference | None:
    """The complex step if central differences confirm it, else the central differences.

    None if the function is not finite at the point. ``parameters`` is the vector ``(m,)`` of values.
    """
    difference = _central_difference(variables, function, t, x, parameters)
    if difference is None:
        return None
    try:
        values = complex_step(variables, function, t, x, parameters)
    except Exception:  # whatever the cause, the central difference is the fallback
        return difference
    if not np.all(np.isfinite(values)) or not difference.confirms(values):
        return difference
    # A term such as 1e-8*abs(x), without a complex derivative, makes the two differ by its small factor.
    tolerance = _rounding(function) + 1e-9 * difference.size + 2.0 * np.abs(values - difference.values)
    tolerance[np.isinf(difference.tolerance)] = np.inf
    return Reference(t, x, values, tolerance, difference.size, "complex step")


def evaluate(
    variables: Variables,
    function: Callable[..., Any] | None,
    t: float,
    x: np.ndarray,
    parameters: np.ndarray,
    *,
    finite: bool = True,
    row: int = 0,
) -> Any:
    """Values of a model function as a flat array, or None if the call fails or a value is not finite.

    With ``finite=False`` values that are not finite are returned too. ``row`` of a
    schedule fires.
    """
    assert function is not None
    p = variables.parameter_view(parameters)
    try:
        with np.errstate(all="ignore"), fires(plain_firing(row)):
            values = np.ravel(np.asarray(function(np.float64(t), variables.state_view(x), p), dtype=float))
    except Exception:  # whatever the cause, the function has no value there
        return None
    return values if not finite or np.all(np.isfinite(values)) else None


def derivative_fault(
    variables: Variables, function: ModelFunction, given: np.ndarray, reference: Reference
) -> str | None:
    """Error text for a wrong derivative ``(rows, n)`` or ``(rows, n + 1)``; None if it is right."""
    n = variables.dimension
    missing_time = given.shape[1] == n
    full = np.column_stack([given, np.zeros(function.rows)]) if missing_time else given
    with np.errstate(invalid="ignore"):
        right = np.abs(full - reference.values) <= reference.tolerance
    # Behind these are the rows of held components and of counters.
    right[function.kept :] = True
    wrong = ~right & np.isfinite(reference.tolerance) & np.isfinite(reference.values)
    if not np.any(wrong):
        return None
    # The states come first: a wrong entry there is more informative than a missing column.
    j, i = (int(k) for k in np.argwhere(wrong.T)[0])
    place = f"t = {reference.t:.6g}, x = ({', '.join(f'{value:.6g}' for value in reference.x)})"
    row = "" if function.size is None else f" of {variables.state_names[i]}"
    expected = f"{reference.values[i, j]:.10g}"
    if missing_time and j == n:
        return (
            f"{function.derivative_title} has {n} columns, but the {function.kind} depends on t: D_t{row} is "
            f"{expected} at {place}. Return {n + 1} columns with D_t last."
        )
    column = (*variables.state_names, "t")[j]
    return (
        f"{function.derivative_title}: entry D_{column}{row} is {full[i, j]:.10g} at {place}; the "
        f"{reference.source} of the {function.kind} gives {expected}. Fix it, or omit "
        f"{function.derivative_name}=: the library derives it."
    )


def _central_difference(
    variables: Variables, function: ModelFunction, t: float, x: np.ndarray, parameters: np.ndarray
) -> Reference | None:
    here = evaluate(variables, function.value, t, x, parameters)
    if here is None:
        return None
    coarse = _differences(variables, function, t, x, parameters, here, DIFFERENCE_STEP)
    fine = _differences(variables, function, t, x, parameters, here, DIFFERENCE_STEP / 2)
    if coarse is None or fine is None:
        return None
    (central, bend), (half_central, half_bend) = coarse, fine
    # States and time are near 1, so values and derivatives are of one size.
    size = np.abs(here).reshape(-1, 1) + np.abs(half_central).max(axis=1, keepdims=True)
    tolerance = _rounding(function) + 1e-7 * size + 4.0 * np.abs(half_central - central)
    # One-sided slopes approach each other as the step shrinks, except at a kink.
    kink = (half_bend > 0.75 * bend) & (half_bend > 1e-6 * size)
    tolerance[kink] = np.inf
    return Reference(t, x, (4.0 * half_central - central) / 3.0, tolerance, size, "central difference")


def _rounding(function: ModelFunction) -> float:
    """How far the derivative of a function may be off by the rounding of states."""
    return 0.0 if function.completed is None else ROUNDING


def _differences(
    variables: Variables,
    function: ModelFunction,
    t: float,
    x: np.ndarray,
    parameters: np.ndarray,
    here: np.ndarray,
    h: float,
) -> tuple[np.ndarray, np.ndarray] | None:
    """Central differences, and how much the two one-sided slopes differ."""
    central, bend = [], []
    for shift in h * np.eye(len(x) + 1):
        ahead = evaluate(variables, function.value, t + shift[-1], x + shift[:-1], parameters)
        behind = evaluate(variables, function.value, t - shift[-1], x - shift[:-1], parameters)
        if ahead is None or behind is None:
            return None
        central.append((ahead - behind) / (2.0 * h))
        bend.append(np.abs(ahead - 2.0 * here + behind) / h)
    return np.column_stack(central), np.column_stack(bend)


class _ComplexState(np.ndarray):
    """Gives Python's complex numbers, which have no order, as in compiled code; NumPy's have one."""

    def __getitem__(self, key: Any) -> Any:
        value = super().__getitem__(key)
        return complex(value) if isinstance(value, np.complexfloating) else value


def complex_step(
    variables: Variables, function: ModelFunction, t: float, x: np.ndarray, parameters: np.ndarray
) -> np.ndarray:
    """Derivative ``(rows, n + 1)`` of a model function by the complex step, in plain Python."""
    p = variables.parameter_view(parameters)
    columns = []
    for shift in COMPLEX_STEP * np.eye(len(x) + 1):
        z = x + 1j * shift[:-1]
        z.flags.writeable = False
        state = (
            z.view(_ComplexState) if isinstance(variables.state, int) else variables.state_view(z.tolist())
        )
        with warnings.catch_warnings(), np.errstate(all="ignore"), fires(plain_firing(0)):
            # A complex number stored in a real array loses the derivative, with only a warning.
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            values = np.asarray(function.value(complex(t, shift[-1]), state, p), dtype=complex)
        columns.append(np.ravel(values).imag / COMPLEX_STEP)
    return np.column_stack(columns)
