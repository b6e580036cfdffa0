"""Derivatives of model functions: symbolic ones of traced functions, and numerical ones to check against.

Every derivative has ``n + 1`` columns, one per state and the one for time last.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.names import parameter_view, state_values
from hybrid.roles import Role

if TYPE_CHECKING:
    import sympy

    from hybrid.system import HybridSystem

COMPLEX_STEP = 1e-30
# A central difference carried twice, so that its own convergence gives its error.
DIFFERENCE_STEP = 2.0**-16


def symbolic_jacobian(
    expressions: Iterable[sympy.Expr], variables: Iterable[sympy.Symbol]
) -> list[list[sympy.Expr]]:
    """Rows of the derivatives of ``expressions`` with respect to ``variables`` (states, then time).

    At a kink ``np.maximum`` and ``np.minimum`` pass half of either slope, ``np.abs`` none; piecewise
    constant functions have slope zero.
    """
    from sympy.core.parameters import distribute

    from hybrid.symbolic import ZERO, close_gates

    columns = list(variables)
    with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
        return [
            [close_gates(row.diff(variable)) if row.has(variable) else ZERO for variable in columns]
            for row in expressions
        ]


def check_derivative(system: HybridSystem, role: Role) -> None:
    """Compare the derivative a user gives with the complex step of the function, at default parameters.

    The complex step is believed where central differences confirm it (``np.abs`` of a complex number,
    for one, has no complex derivative); elsewhere the central differences themselves are the measure,
    to their own accuracy. Points where the function is not finite are passed over.

    Raises
    ------
    ModelError
        If an entry is wrong, or if the column for time is missing and the function depends on time.
    """
    for t, x in sample_points(system.dimension):
        reference = _reference(system, role, t, x)
        given = _evaluate(system, role.derivative, t, x)
        if reference is None or given is None:
            continue
        _compare(system, role, given.reshape(role.rows, -1), reference)


def complex_step_error(system: HybridSystem, role: Role) -> Exception | None:
    """Why the complex step cannot be taken through a function, or None if it can.

    It must run on complex numbers, and agree with central differences.
    """
    for t, x in sample_points(system.dimension):
        try:
            complex_step = _complex_step(system, role, t, x)
        except ArithmeticError:
            continue
        except Exception as error:
            return error
        reference = _central_difference(system, role, t, x)
        if reference is not None and not reference.confirms(complex_step):
            return ModelError("it runs on complex numbers, but is not differentiable there")
    return None


def sample_points(n: int) -> Iterator[tuple[float, np.ndarray]]:
    """A few fixed points ``(t, x)`` of size near 1, in the positive orthant first."""
    rng = np.random.default_rng(20240507)
    for signs in (np.ones(n), np.ones(n), rng.choice([-1.0, 1.0], n), -np.ones(n)):
        yield rng.uniform(0.5, 1.5), signs * rng.uniform(0.5, 1.5, n)


@attrs.frozen(eq=False)
class _Reference:
    t: float
    x: np.ndarray
    values: np.ndarray
    tolerance: np.ndarray
    source: str

    def confirms(self, other: np.ndarray) -> bool:
        # `not (a > b)` rather than `a <= b`: an entry that is nan says nothing against the other.
        return not np.any(np.abs(other - self.values) > self.tolerance)


def _reference(system: HybridSystem, role: Role, t: float, x: np.ndarray) -> _Reference | None:
    difference = _central_difference(system, role, t, x)
    if difference is None:
        return None
    try:
        values = _complex_step(system, role, t, x)
    except Exception:  # whatever stops it, the central difference stands in
        return difference
    if not np.all(np.isfinite(values)) or not difference.confirms(values):
        return difference
    return _Reference(t, x, values, 1e-9 * (1.0 + np.abs(values)), "complex step")


def _central_difference(system: HybridSystem, role: Role, t: float, x: np.ndarray) -> _Reference | None:
    coarse, fine = (_difference(system, role, t, x, h) for h in (DIFFERENCE_STEP, DIFFERENCE_STEP / 2))
    size = _evaluate(system, role.function, t, x)
    if coarse is None or fine is None or size is None:
        return None
    rounding = 1e-10 * np.abs(size).reshape(-1, 1)
    tolerance = 1e-6 * (1.0 + np.abs(fine)) + rounding + 4.0 * np.abs(fine - coarse)
    return _Reference(t, x, (4.0 * fine - coarse) / 3.0, tolerance, "central difference")


def _difference(system: HybridSystem, role: Role, t: float, x: np.ndarray, h: float) -> np.ndarray | None:
    columns = []
    for shift in h * np.eye(len(x) + 1):
        ahead = _evaluate(system, role.function, t + shift[-1], x + shift[:-1])
        behind = _evaluate(system, role.function, t - shift[-1], x - shift[:-1])
        if ahead is None or behind is None:
            return None
        columns.append((ahead - behind) / (2.0 * h))
    return np.column_stack(columns)


def _evaluate(system: HybridSystem, function: Callable[..., Any] | None, t: float, x: np.ndarray) -> Any:
    """Values as a flat array, or None where they do not exist or are not finite."""
    assert function is not None
    p = parameter_view(system, system.parameter_values())
    try:
        with np.errstate(all="ignore"):
            values = np.ravel(np.asarray(function(np.float64(t), state_values(system, x), p), dtype=float))
    except (ArithmeticError, ValueError):
        return None
    return values if np.all(np.isfinite(values)) else None


class _ComplexState(np.ndarray):
    """Gives out Python's complex numbers, which have no order, as in compiled code; NumPy's have one."""

    def __getitem__(self, key: Any) -> Any:
        value = super().__getitem__(key)
        return complex(value) if isinstance(value, np.complexfloating) else value


def _complex_step(system: HybridSystem, role: Role, t: float, x: np.ndarray) -> np.ndarray:
    p = parameter_view(system, system.parameter_values())
    columns = []
    for shift in COMPLEX_STEP * np.eye(len(x) + 1):
        z = x + 1j * shift[:-1]
        state = z.view(_ComplexState) if isinstance(system.state, int) else state_values(system, z.tolist())
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            # Storing a complex number in a real array drops the derivative, with a mere warning.
            warnings.simplefilter("error", np.exceptions.ComplexWarning)
            values = np.asarray(role.function(complex(t, shift[-1]), state, p), dtype=complex)
        columns.append(np.ravel(values).imag / COMPLEX_STEP)
    return np.column_stack(columns)


def _compare(system: HybridSystem, role: Role, given: np.ndarray, reference: _Reference) -> None:
    n = system.dimension
    missing_time = given.shape[1] == n
    full = np.column_stack([given, np.zeros(role.rows)]) if missing_time else given
    wrong = np.abs(full - reference.values) > reference.tolerance
    if not np.any(wrong):
        return
    # Look at the states first: a wrong entry there tells more than a missing column.
    j, i = (int(k) for k in np.argwhere(wrong.T)[0])
    place = f"t = {reference.t:.6g}, x = ({', '.join(f'{value:.6g}' for value in reference.x)})"
    row = "" if role.size is None else f" of {system.state_names[i]}"
    expected = f"{reference.values[i, j]:.10g}"
    if missing_time and j == n:
        raise ModelError(
            f"{role.derivative_title} has {n} columns, but the {role.name} depends on t: D_t{row} is "
            f"{expected} at {place}. Return {n + 1} columns with D_t last."
        )
    column = (*system.state_names, "t")[j]
    raise ModelError(
        f"{role.derivative_title}: entry D_{column}{row} is {full[i, j]:.10g} at {place}; the "
        f"{reference.source} of the {role.name} gives {expected}. Mend it, or leave it out: it is derived."
    )
