"""What holds at an equilibrium of a mode, and what bounds the mode there."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import attrs
import numpy as np

from hybrid.errors import ArgumentError, ModelError
from hybrid.expression.derivatives import jacobian_of
from hybrid.expression.graph import mentions
from hybrid.expression.nodes import Expression, add, multiply
from hybrid.expression.polynomials import is_zero
from hybrid.expression.tracing import model_symbols, trace
from hybrid.orbits.equilibria.smooth import Known, Smooth
from hybrid.system.elements import Guard, Transition
from hybrid.system.functions import WholeReset, field_function
from hybrid.system.graph import HybridSystem

# A field that is along a surface to this share of its terms, at some points beside it, stays on the surface.
ALONG = 1e-9
# The points beside a state, in units of its components, and how many.
BESIDE, POINTS = 0.1, 4
# A guard is beyond zero if it is by more than this share of its terms.
ON_IT = 1e-10


@attrs.frozen(eq=False)
class Barrier:
    """A guard that leads out of a mode, of one or more transitions.

    Attributes
    ----------
    names
        Those of the transitions.
    height
        The guard.
    beyond
        The sign of the guard where the mode is not allowed; 0 for a guard that is crossed both ways.
    when
        The condition of the guard, if it has one.
    """

    names: tuple[str, ...]
    height: Smooth
    beyond: int
    when: Smooth | None

    def excludes(self, known: Known, sizes: np.ndarray) -> bool:
        """Whether a state is beyond the guard, by more than rounding of unknowns of these ``sizes``."""
        return self.beyond * self.height_beside(known, sizes) > 0.0 and self.counts(known)

    def height_beside(self, known: Known, sizes: np.ndarray) -> float:
        """The guard; zero where it is not more than rounding."""
        value, slopes = float(self.height.value(known)[0]), self.height.jacobian(known)[0]
        blur = ON_IT * (float(np.abs(slopes) @ sizes) + abs(value))
        return 0.0 if abs(value) <= blur else value

    def counts(self, known: Known) -> bool:
        """Whether the condition of the guard holds."""
        return self.when is None or bool(self.when.value(known)[0] > 0.0)


class Equations:
    """The equations of the equilibria of a mode in its state and some parameters.

    The unknowns ``u (n + q,)`` are the components that have a field, then the parameters. A mode that stays
    on surfaces, as a sliding one does, has equilibria on these alone.

    Parameters
    ----------
    system, mode
        The model, and the name of the mode.
    names
        The parameters among the unknowns.
    x
        A state ``(dimension,)``: held components and counters keep its values, and a mode that stays on one
        of several surfaces stays on the nearest.
    vector
        The values of all parameters ``(m,)``.

    Raises
    ------
    ArgumentError
        If the field reads the time or cannot be traced.
    """

    def __init__(
        self, system: HybridSystem, mode: str, names: tuple[str, ...], x: np.ndarray, vector: np.ndarray
    ) -> None:
        self.system, self.mode, self.names, self.x, self.vector = system, mode, names, x, vector
        variables = system.variables
        symbols = self._symbols = model_symbols(system.dimension, len(vector))
        self.n = variables.moving
        own = system.modes[system.mode_index(mode)]
        try:
            field = trace(field_function(own, variables).value, variables.components, system.parameters)
        except ModelError as why:
            raise ArgumentError(
                f"mode {mode!r}: its field cannot be traced, so its derivatives are not known: {why}. Write "
                "it with NumPy functions of the state and the parameters."
            ) from why
        field = field[: self.n]
        if any(mentions(each, [symbols.t]) for each in field):
            raise ArgumentError(
                f"mode {mode!r}: its field reads the time, so it has no equilibria. What stays in a forced "
                "system are orbits of its period: periodic_orbit finds them."
            )
        parameters = [*system.parameters]
        self.places = [parameters.index(name) for name in names]
        self.unknowns = [*symbols.x[: self.n], *(symbols.p[i] for i in self.places)]
        self.rates = Smooth(field, self.unknowns)
        self._base = dict(zip((symbols.t, *symbols.x, *symbols.p), (0.0, *x, *vector), strict=True))
        self.surfaces = Smooth([*self._stays_on()], self.unknowns)

    def known(self, u: np.ndarray) -> Known:
        """A number for each symbol."""
        return {**self._base, **dict(zip(self.unknowns, u, strict=True))}

    def start(self) -> np.ndarray:
        """The unknowns at the given state and parameters."""
        return np.concatenate([self.x[: self.n], self.vector[self.places]])

    def state(self, u: np.ndarray) -> np.ndarray:
        """The whole state ``(dimension,)``."""
        return np.concatenate([u[: self.n], self.x[self.n :]])

    def parameters(self, u: np.ndarray) -> dict[str, float]:
        """The values of all parameters by name."""
        values = dict(zip(self.system.parameters, self.vector.tolist(), strict=True))
        return values | dict(zip(self.names, u[self.n :].tolist(), strict=True))

    def basis(self, u: np.ndarray, like: np.ndarray | None = None) -> np.ndarray:
        """Orthonormal directions ``(n, n - k)`` within the surfaces, turned to those of another place."""
        normals = self.surfaces.jacobian(self.known(u))[:, : self.n]
        if not len(normals):
            return np.eye(self.n)
        _, _, right = np.linalg.svd(normals)
        found = right[len(normals) :].T
        if like is None:
            return found
        left, _, right = np.linalg.svd(found.T @ like)
        return found @ left @ right

    def matrix(self, u: np.ndarray) -> np.ndarray:
        """Derivatives ``(n, n)`` of the rates in the state."""
        return self.rates.jacobian(self.known(u))[:, : self.n]

    def within(self, u: np.ndarray) -> np.ndarray:
        """Derivatives ``(n - k, n - k)`` of the rates within the surfaces."""
        basis = self.basis(u)
        return basis.T @ self.matrix(u) @ basis

    def excluded_by(self, u: np.ndarray, sizes: np.ndarray | None = None) -> tuple[str, ...]:
        """The transitions that take a state out of the mode: those whose guard it lies beyond, and clocks.

        A state is on a guard up to rounding of unknowns of these ``sizes``, by default their own.
        """
        known, sizes = self.known(u), np.abs(u) if sizes is None else sizes
        beyond = (name for each in self.barriers if each.excludes(known, sizes) for name in each.names)
        return *beyond, *self._clocked

    @cached_property
    def barriers(self) -> tuple[Barrier, ...]:
        """The guards that lead out of the mode, each once."""
        found: dict[tuple[Expression, int, Expression | None], list[str]] = {}
        for transition in self._outgoing:
            height, when = self._guard(transition)
            if height is None or mentions(height, [self._symbols.t]) or transition.is_marker:
                continue
            key = height, int(transition.guard.direction), when
            found.setdefault(key, []).append(transition.name)
        return tuple(
            Barrier(
                tuple(names),
                Smooth([height], self.unknowns),
                direction,
                None if when is None else Smooth([when], self.unknowns),
            )
            for (height, direction, when), names in found.items()
        )

    @property
    def _outgoing(self) -> list[Transition]:
        return [each for each in self.system.transitions if each.source == self.mode]

    @cached_property
    def _clocked(self) -> tuple[str, ...]:
        """The transitions that leave the mode at their time, whatever the state."""
        return tuple(
            each.name
            for each in self._outgoing
            if not each.is_marker
            and (each.clock or mentions(self._guard(each)[0] or self._symbols.x[0], [self._symbols.t]))
        )

    def _guard(self, transition: Transition) -> tuple[Expression | None, Expression | None]:
        """The guard of a transition and its condition; None for a clock, and for what cannot be traced."""
        if not isinstance(transition.guard, Guard):
            return None, None
        try:
            [height] = self._traced(transition.guard.function)
            when = None if transition.guard.when is None else self._traced(transition.guard.when)[0]
        except ModelError:
            return None, None
        return height, when

    def _traced(self, function: object) -> list[Expression]:
        return trace(function, self.system.variables.components, self.system.parameters)  # type: ignore[arg-type]

    def _stays_on(self) -> Iterator[Expression]:
        """The surfaces through which the mode is entered and on which its field stays, nearest first."""
        u, known = self.start(), self.known(self.start())
        entering = [
            each
            for each in self.system.transitions
            if (each.target == self.mode != each.source and not self._moves(each))
            or each.accumulates_to == self.mode
        ]
        guards = dict.fromkeys(self._guard(each)[0] for each in entering)
        along = [
            Smooth([each], self.unknowns) for each in guards if each is not None and self._is_along(each, u)
        ]
        rows = np.empty((0, self.n))
        for surface in sorted(along, key=lambda each: abs(float(each.value(known)[0]))):
            more = np.vstack([rows, surface.jacobian(known)[:, : self.n]])
            if np.linalg.matrix_rank(more) > len(rows):
                rows = more
                yield surface.expressions[0]

    def _moves(self, transition: Transition) -> bool:
        """Whether a transition changes the state."""
        if transition.reset is None:
            return False
        reset = WholeReset(transition.reset.function, self.system.variables.components)
        try:
            return self._traced(reset) != [*self._symbols.x]
        except ModelError:
            return True

    def _is_along(self, height: Expression, u: np.ndarray) -> bool:
        """Whether the field of the mode leaves a guard as it is, on it and beside it."""
        if mentions(height, [self._symbols.t]):
            return False
        [slopes] = jacobian_of([height], self.unknowns[: self.n])
        terms = [multiply(slope, rate) for slope, rate in zip(slopes, self.rates.expressions, strict=True)]
        if is_zero(add(*terms)):
            return True
        speed = Smooth(terms, self.unknowns)
        random = np.random.default_rng(0)
        sizes = np.where(u == 0.0, 1.0, np.abs(u))
        for _ in range(POINTS):
            values = speed.value(self.known(u + BESIDE * sizes * random.uniform(-1.0, 1.0, len(u))))
            if not abs(values.sum()) <= ALONG * np.abs(values).sum():
                return False
        return True


def sizes_of(matrix: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Units of the components of a state: at least these, and what others move them by.

    Over the time scale of the field ``matrix (n, n)`` a component moves others by its entries: so a velocity
    that is zero has the unit of its position by that time. What nothing moves has the unit 1.
    """
    found, slopes = np.where(np.isfinite(least), least, 0.0), np.abs(matrix)
    fastest = float(np.abs(np.linalg.eigvals(slopes)).max(initial=0.0)) if np.isfinite(slopes).all() else 0.0
    for _ in range(len(found) if fastest > 0.0 else 0):
        found = np.maximum(found, slopes @ found / fastest)
    found[found == 0.0] = 1.0
    return found


@attrs.frozen(eq=False)
class Reduced:
    """As many equations as the state has components: the rates within the surfaces, and the surfaces."""

    equations: Equations
    basis: np.ndarray

    def residual(self, u: np.ndarray) -> np.ndarray:
        """Values ``(n,)``."""
        known = self.equations.known(u)
        return np.concatenate(
            [self.basis.T @ self.equations.rates.value(known), self.equations.surfaces.value(known)]
        )

    def jacobian(self, u: np.ndarray) -> np.ndarray:
        """Derivatives ``(n, n + q)`` in the unknowns."""
        return self._rows(u, lambda each, known: each.jacobian(known))

    def second_along(self, u: np.ndarray, vector: np.ndarray) -> np.ndarray:
        """Derivatives ``(n, n + q)`` of the derivative along a vector ``(n + q,)``."""
        return self._rows(u, lambda each, known: each.second_along(known, vector))

    def _rows(self, u: np.ndarray, part: object) -> np.ndarray:
        known = self.equations.known(u)
        rates, surfaces = (part(each, known) for each in (self.equations.rates, self.equations.surfaces))  # type: ignore[operator]
        return np.vstack([self.basis.T @ rates, surfaces])


def reduced(equations: Equations, u: np.ndarray, like: np.ndarray | None = None) -> Reduced:
    """The equations with the directions within the surfaces at a place, turned to those of another one."""
    return Reduced(equations, equations.basis(u, like))
