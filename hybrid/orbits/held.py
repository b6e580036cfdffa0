"""Conserved quantities that orbits hold: in the search for one, and along a branch.

A conserved quantity makes a family of orbits, one per value: the end of a period says nothing of the value.
Its gradient borders Newton's matrix, which is regular then, and one orbit of the family is left.
"""

from __future__ import annotations

from collections.abc import Collection

import attrs
import numpy as np

from hybrid.orbits.newton import Departure, Shot
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function
from hybrid.system.graph import HybridSystem, laws_of

# Step of the central differences for gradients, as a share of the state: their two errors are equal there.
STEP = float(np.finfo(float).eps) ** (1 / 3)


@attrs.frozen(eq=False)
class Quantity:
    """A conserved quantity with its gradient ``(n + m + 1,)``, of which None is known if it is not traced."""

    name: str
    function: Function
    gradient: Function | None


@attrs.frozen(eq=False)
class Held:
    """Conserved quantities of one mode, with the values ``(h,)`` that they are held at.

    Points have the ``parameters (m,)`` and the ``counters``. On a branch the quantities are taken at the
    start of a ``stretch``.
    """

    system: HybridSystem
    parameters: np.ndarray
    quantities: tuple[Quantity, ...]
    values: np.ndarray
    counters: np.ndarray
    stretch: int = 0

    def departure(self, t: float, x: np.ndarray, magnitude: np.ndarray) -> Departure | None:
        """How far a point is from the held values; None if a quantity has no value or slope there."""
        off, slopes = self.off(t, x), self.slopes(t, x, magnitude)[:, : len(x)]
        if not (np.all(np.isfinite(off)) and np.all(np.isfinite(slopes))):
            return None
        return Departure(off, slopes)

    @property
    def told(self) -> str:
        """What is held, in words."""
        pairs = zip(self.names, self.values, strict=True)
        return ", ".join(f"{name} = {value:.9g}" for name, value in pairs)

    @property
    def names(self) -> list[str]:
        """The names of the quantities."""
        return [each.name for each in self.quantities]

    def in_mode(self, mode: str) -> Held | None:
        """The same quantities by the formulas of another mode; None if no one has any there."""
        known = dict(zip(self.names, self.values, strict=True))
        found = _quantities(self.system, mode, known)
        values = np.array([known[each.name] for each in found])
        return attrs.evolve(self, quantities=found, values=values) if found else None

    def kept(
        self, before: np.ndarray, after: np.ndarray, tangent: np.ndarray, magnitude: np.ndarray, share: float
    ) -> Held | None:
        """Those of the quantities that a map keeps to first order; None if it keeps none.

        A quantity of one mode may change in another one, or at a jump. Of quantities whose gradients depend
        on each other, as those of energy and angular momentum do on a circle, the first ones are kept: their
        values decide the others. ``before`` and ``after`` are gradients ``(h, n)`` at the two ends, ``tangent
        (n, n)`` is the derivative of the map, ``share`` its accuracy.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            apart = np.abs(after @ tangent - before) @ magnitude
            terms = (np.abs(after) @ np.abs(tangent) + np.abs(before)) @ magnitude
            same = (apart <= share * terms) & (terms > 0.0) & np.isfinite(self.values)
        chosen, rows = list[int](), np.zeros((0, len(magnitude)))
        for i in np.flatnonzero(same).tolist():
            row = before[i] * magnitude
            more = np.vstack([rows, row / np.linalg.norm(row)])
            if np.linalg.svd(more, compute_uv=False)[-1] > share:
                chosen, rows = [*chosen, i], more
        quantities = tuple(self.quantities[i] for i in chosen)
        return attrs.evolve(self, quantities=quantities, values=self.values[chosen]) if chosen else None

    def off(self, t: float, x: np.ndarray) -> np.ndarray:
        """Distances ``(h,)`` of a point from the held values."""
        return self._at(t, x, self.parameters) - self.values

    def slopes(self, t: float, x: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
        """Gradients ``(h, n + m + 1)`` in the state, without counters, the parameters and the time.

        Central differences stand for those that cannot be traced; ``magnitude (n,)`` are sizes of the states.
        """
        n, whole = len(x), np.append(x, self.counters)
        found = np.full((len(self.quantities), n + len(self.parameters) + 1), np.nan)
        for row, each in zip(found, self.quantities, strict=True):
            if each.gradient is None:
                row[:] = self._differences(each, t, x, magnitude)
                continue
            exact = evaluate(self.system.variables, each.gradient, t, whole, self.parameters, finite=False)
            if exact is not None:
                row[:] = np.delete(exact, np.s_[n : len(whole)])
        return found

    def _at(self, t: float, x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        whole, variables = np.append(x, self.counters), self.system.variables
        found = [
            evaluate(variables, each.function, t, whole, parameters, finite=False) for each in self.quantities
        ]
        return np.array([np.nan if each is None else each[0] for each in found])

    def _differences(self, quantity: Quantity, t: float, x: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
        """The gradient ``(n + m + 1,)`` of one quantity by central differences."""
        n, alone = len(x), attrs.evolve(self, quantities=(quantity,))
        sizes = np.concatenate([magnitude, np.abs(self.parameters), [abs(t)]])
        point = np.concatenate([x, self.parameters, [t]])

        def at(point: np.ndarray) -> float:
            return float(alone._at(float(point[-1]), point[:n], point[n:-1])[0])

        steps = np.diag(STEP * np.where(sizes > 0.0, sizes, 1.0))
        return np.array([(at(point + h) - at(point - h)) / (2.0 * h.sum()) for h in steps])


def conserved_at(
    system: HybridSystem, parameters: np.ndarray, mode: str, t: float, x: np.ndarray
) -> Held | None:
    """The conserved quantities of a mode at their values at a whole state; None if there are none."""
    quantities = _quantities(system, mode)
    if not quantities:
        return None
    state, counters = np.split(x, [system.tangent_dimension])
    found = Held(system, parameters, quantities, np.zeros(len(quantities)), counters)
    return attrs.evolve(found, values=found.off(t, state))


def held_by(
    system: HybridSystem, parameters: np.ndarray, shot: Shot, share: float, x: np.ndarray
) -> Held | None:
    """The conserved quantities that a shot from a whole state keeps, at their values there; None without any.

    ``share`` is the accuracy of the shot.
    """
    start, n = shot.point, len(shot.end)
    found = conserved_at(system, parameters, shot.mode, start.t, x) if shot.whole else None
    if found is None:
        return None
    before = found.slopes(start.t, start.x, shot.magnitude)[:, :n]
    after = found.slopes(start.t + start.period, shot.end, shot.magnitude)[:, :n]
    return found.kept(before, after, shot.fundamental, shot.magnitude, share)


def _quantities(
    system: HybridSystem, mode: str, names: Collection[str] | None = None
) -> tuple[Quantity, ...]:
    """The conserved quantities of a mode, those of some names alone if they are given."""
    if not system.laws.conserved:
        return ()
    within = system.modes[system.mode_index(mode)]
    return tuple(
        Quantity(law.name, function, _gradient(system, function))
        for law in laws_of(system).conserved
        if (function := law.in_mode(within.name, within.part_of)) is not None
        and (names is None or law.name in names)
    )


def _gradient(system: HybridSystem, function: Function) -> Function | None:
    """The derivatives of a quantity in the state, the parameters and the time, if it can be traced."""
    from hybrid.expression.derivatives import jacobian_of
    from hybrid.expression.evaluation import expressed
    from hybrid.expression.tracing import TraceError, model_symbols, trace

    names = system.variables.parameter_names
    symbols = model_symbols(system.dimension, len(names))
    try:
        expressions = trace(function, system.variables.components, names)
    except TraceError:
        return None
    [row] = jacobian_of(expressions, [*symbols.x, *symbols.p, symbols.t])
    return expressed(row)
