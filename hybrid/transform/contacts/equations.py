"""Equations of motion ``M a = h`` as expressions, from masses and forces or from energies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError
from hybrid.expression.derivatives import derivative, jacobian_of
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import mentions, replaced
from hybrid.expression.linear import Vector, dot, solved
from hybrid.expression.nodes import ZERO, Expression, Symbol, add, node
from hybrid.expression.tracing import TraceError, model_symbols, trace
from hybrid.system.derivatives import sample_points
from hybrid.system.variables import Variables

# An asymmetry of the mass matrix, or a slope that has to vanish, may be this share of the largest entry.
ROUNDING = 1e-9


@attrs.frozen(eq=False)
class Space:
    """The variables of a mechanical system as symbols: the state is coordinates, then velocities."""

    variables: Variables

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return self.variables.dimension // 2

    @property
    def t(self) -> Symbol:
        """The time."""
        return self._symbols.t

    @property
    def q(self) -> tuple[Symbol, ...]:
        """The coordinates."""
        return tuple(self._symbols.x[: self.size])

    @property
    def u(self) -> tuple[Symbol, ...]:
        """The velocities."""
        return tuple(self._symbols.x[self.size :])

    @property
    def p(self) -> tuple[Symbol, ...]:
        """The parameters."""
        return tuple(self._symbols.p)

    @property
    def _symbols(self) -> Any:
        return model_symbols(self.variables.dimension, len(self.variables.parameter_names))

    def traced(self, what: str, function: Callable[..., Any]) -> list[Expression]:
        """The values of a function as expressions; a ModelError says why there are none."""
        try:
            return trace(function, self.variables.components, self.variables.parameter_names)
        except TraceError as error:
            why = f"{what} cannot be traced, and the modes are derived from it: {error}."
            raise ModelError(why) from error

    def one(self, what: str, function: Callable[..., Any]) -> Expression:
        """The one value of a function."""
        values = self.traced(what, function)
        if len(values) != 1:
            raise ModelError(f"{what} must return one number; got {len(values)}.")
        return values[0]

    def rate(self, expression: Expression) -> Expression:
        """Rate of change, but for the part from accelerations."""
        own = [derivative(expression, each) for each in self.q]
        return add(derivative(expression, self.t), node(dot(own, self.u)))

    def values(self, t: float, x: np.ndarray, parameters: np.ndarray) -> dict[Symbol, float]:
        """Numbers for the symbols."""
        return dict(zip((self.t, *self.q, *self.u, *self.p), (t, *x, *parameters), strict=True))

    def samples(self, expressions: Sequence[Expression]) -> np.ndarray:
        """Values of expressions at sample points, at default parameters ``(points, expressions)``."""
        program, rows = Program(expressions), []
        for t, x in sample_points(self.variables.dimension):
            with np.errstate(all="ignore"):
                rows.append(program.run(self.values(t, x, self.variables.defaults)))
        return np.array(rows, dtype=float)

    def without_velocities(self, what: str, expressions: Sequence[Expression]) -> list[Expression]:
        """Expressions that must not depend on velocities, with these set to zero; else a ModelError."""
        if not any(mentions(each, self.u) for each in expressions):
            return [*expressions]
        slopes = [each for row in jacobian_of(expressions, self.u) for each in row]
        sizes = np.nan_to_num(np.abs(self.samples(slopes)))
        if sizes.max(initial=0.0) > ROUNDING * np.nan_to_num(np.abs(self.samples(expressions))).max():
            raise ModelError(what)
        return [replaced(each, dict.fromkeys(self.u, ZERO)) for each in expressions]


@attrs.frozen(eq=False)
class Equations:
    """``M a = h``: accelerations from masses and from all forces but those of contacts."""

    space: Space
    mass: list[Vector]
    forces: Vector

    def accelerations(self, columns: Sequence[Vector]) -> list[Vector]:
        """``M^-1`` times vectors of forces."""
        size = self.space.size
        if all(self.mass[i][j] is ZERO for i in range(size) for j in range(size) if i != j):
            return [[force / self.mass[i][i] for i, force in enumerate(column)] for column in columns]
        return solved(self.mass, columns, definite=size)


def equations_of(space: Space, mass: Any, forces: Any, kinetic: Any, potential: Any) -> Equations:
    """The equations of motion from what an author gives.

    Raises
    ------
    ModelError
        If neither masses nor kinetic energy is given, or both; if one of the functions has the wrong number
        of values or cannot be traced; if the kinetic energy is not quadratic in the velocities; if the mass
        matrix is not symmetric and positive definite at sample points.
    """
    if mass is None and kinetic is None:
        raise ModelError("mechanics: mass is missing. Give mass=, or kinetic= with potential=.")
    if mass is not None and kinetic is not None:
        raise ModelError("mechanics: kinetic takes the place of mass; got both. Leave one out.")
    if potential is not None and kinetic is None:
        raise ModelError("mechanics: potential= goes with kinetic=; with mass= its forces belong to forces=.")
    n = space.size
    h = [ZERO] * n
    if forces is not None:
        h = space.traced("mechanics: forces", forces)
        if len(h) != n:
            raise ModelError(
                f"mechanics: forces must return {n} values, one for each coordinate; got {len(h)}."
            )
    if mass is not None:
        rows = _rows(space, space.traced("mechanics: mass", mass))
    else:
        rows, own = _lagrange(space, kinetic, potential)
        h = [a + b for a, b in zip(own, h, strict=True)]
    flat = [each for row in rows for each in row]
    flat = space.without_velocities(
        "mechanics: mass must not depend on velocities: the kinetic energy is quadratic in them.", flat
    )
    rows = [flat[i * n : (i + 1) * n] for i in range(n)]
    _check_mass(space, flat)
    # The matrix is symmetric: one half of it tells the other.
    rows = [[rows[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
    return Equations(space, rows, h)


def _rows(space: Space, values: list[Expression]) -> list[Vector]:
    n = space.size
    if len(values) == n:
        return [[values[i] if i == j else ZERO for j in range(n)] for i in range(n)]
    if len(values) == n * n:
        return [values[i * n : (i + 1) * n] for i in range(n)]
    raise ModelError(
        f"mechanics: mass must return {n} numbers, the diagonal of the mass matrix, or {n} rows of {n}; got "
        f"{len(values)} numbers."
    )


def _lagrange(space: Space, kinetic: Any, potential: Any) -> tuple[list[Vector], Vector]:
    """Mass matrix and generalised forces by Lagrange's equations of the second kind."""
    T = space.one("mechanics: kinetic", kinetic)
    V = ZERO
    if potential is not None:
        V = space.one("mechanics: potential", potential)
        [V] = space.without_velocities("mechanics: potential must not depend on velocities.", [V])
    momenta = [derivative(T, each) for each in space.u]
    rows = jacobian_of(momenta, space.u)
    lagrangian = T - V
    own = [
        derivative(lagrangian, q) - space.rate(momentum) for q, momentum in zip(space.q, momenta, strict=True)
    ]
    return rows, own


def _check_mass(space: Space, flat: list[Expression]) -> None:
    n = space.size
    for values in space.samples(flat):
        matrix = values.reshape(n, n)
        if not np.isfinite(matrix).all():
            continue
        size = np.abs(matrix).max()
        if np.abs(matrix - matrix.T).max() > ROUNDING * size:
            raise ModelError(f"mechanics: mass must be symmetric; at a sample point it is {matrix.tolist()}.")
        least = np.linalg.eigvalsh(matrix)[0]
        if not least > 0.0:
            raise ModelError(
                f"mechanics: mass must be positive definite; at a sample point its smallest eigenvalue is "
                f"{least:g}. Give every coordinate a mass, or leave out a coordinate that has none."
            )
