"""One pass around an orbit of a family: where it ends, and the derivatives of that in all unknowns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Solver
from hybrid.system.derivatives import evaluate
from hybrid.system.graph import HybridSystem
from hybrid.transform.extended import extended

# A section is moved if a jump comes nearer to it than this share of the period.
NEAR_SECTION = 0.02
# A gap counts as closed at this share of the sizes; the corrections stop when they are this small.
CLOSED = 1e-10
CONVERGED = 1e-12
MOST_CORRECTIONS = 8
# Relative step of the difference that gives the slope of a period that cannot be traced.
STEP = 1e-5


@attrs.frozen(eq=False)
class Point:
    """A point of the family: a state ``x (n,)`` at a time in a mode, the period, and the parameter."""

    x: np.ndarray
    t: float
    mode: str
    period: float
    value: float


@attrs.frozen(eq=False)
class Shot:
    """What one pass around an orbit gives.

    Attributes
    ----------
    point
        Where it begins.
    arc
        The run of the extended system, whose last component is the parameter.
    slopes
        Derivatives ``(n, n + 2)`` of the end in the start, the period and the parameter.
    field
        The field ``(n,)`` at the start.
    """

    point: Point
    arc: HybridArc
    slopes: np.ndarray
    field: np.ndarray

    @property
    def gap(self) -> np.ndarray:
        """Distance ``(n,)`` from the start to the end."""
        return np.asarray(self.arc.x[-1, :-1] - self.point.x)

    @property
    def fundamental(self) -> np.ndarray:
        """The saltated fundamental matrix over the period, ``(n, n)``."""
        return self.slopes[:, :-2]

    @property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers ``(n,)``, largest first."""
        values = np.linalg.eigvals(self.fundamental)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def transitions(self) -> tuple[str, ...]:
        """Names of the transitions in the order in which they fire."""
        return tuple(map(str, self.arc.jumps.transition))

    @property
    def whole(self) -> bool:
        """Whether the run reached its end, in the mode where it began, with finite derivatives."""
        ends = str(self.arc.mode[-1]) == self.point.mode
        return self.arc.status.ok and ends and bool(np.all(np.isfinite(self.slopes)))

    @property
    def scale(self) -> np.ndarray:
        """Largest absolute values ``(n,)`` of the components along the orbit."""
        sizes = np.abs(self.arc.x[:, :-1]).max(axis=0)
        return np.where(sizes > 0.0, sizes, 1.0)


@attrs.frozen(eq=False)
class Family:
    """The orbits of a system over one parameter, with the same sequence of transitions.

    ``periods`` is the number of forcing periods, 0 for an autonomous system.
    """

    system: HybridSystem
    name: str
    parameters: Mapping[str, float]
    periods: int
    solver: Solver

    @property
    def forced(self) -> bool:
        """Whether the period is given by the forcing."""
        return self.periods > 0

    def period(self, value: float) -> float:
        """The period of a forced orbit."""
        forcing = self.system.forcing_period({**self.parameters, self.name: value})
        assert forcing is not None
        return self.periods * forcing

    def slope_of_period(self, value: float) -> float:
        """Derivative of the period of a forced orbit in the parameter."""
        if not self.forced or not callable(self.system.period):
            return 0.0
        if self._slope is None:
            h = STEP * (abs(value) or 1.0)
            return (self.period(value + h) - self.period(value - h)) / (2.0 * h)
        return self.periods * float(self._slope(*self.values(value)))

    @cached_property
    def _slope(self) -> Callable[..., float] | None:
        """The derivative of the forcing period, if it can be traced."""
        import sympy

        from hybrid.symbolic.tracing import TraceError, model_symbols, trace

        period: Any = self.system.period
        names = tuple(self.system.parameters)
        try:
            (expression,) = trace(lambda t, x, p: period(p), self.system.state, names)
        except TraceError:
            return None
        symbols = model_symbols(self.system.dimension, len(names)).p
        return sympy.lambdify(symbols, sympy.diff(expression, symbols[names.index(self.name)]), "math")

    def values(self, value: float) -> np.ndarray:
        """All parameters ``(m,)`` of the original system."""
        return self.system.parameter_values({**self.parameters, self.name: value})

    def shoot(self, point: Point) -> Shot:
        """Once around from a point."""
        system, n = extended(self.system, (self.name,)), self.system.dimension
        arc = self._run(point, point.t + point.period, np.eye(n + 1))
        assert arc.fundamental is not None
        end = self._field(str(arc.mode[-1]), arc.t[-1], arc.x[-1], system)
        slopes = np.empty((n, n + 2))
        slopes[:, :n], slopes[:, n] = arc.fundamental[:n, :n], end
        slopes[:, n + 1] = arc.fundamental[:n, n] + end * self.slope_of_period(point.value)
        start = self._field(point.mode, point.t, np.append(point.x, point.value), system)
        return Shot(point, arc, slopes, start)

    def along(self, point: Point, change: np.ndarray) -> Point | None:
        """The point after a change ``(n + 2,)`` of state, period and parameter; None if there is none."""
        value = point.value + change[-1]
        try:
            period = self.period(value) if self.forced else point.period + change[-2]
        except ArgumentError:
            return None
        if not period > 0.0:
            return None
        return attrs.evolve(point, x=point.x + change[:-2], period=period, value=value)

    def corrected(
        self, point: Point, anchor: Shot, units: np.ndarray, across: np.ndarray | None = None
    ) -> tuple[Shot, int] | None:
        """The orbit nearest to a point, by the shortest Newton steps, and how many; None if there is none.

        With ``across (n + 2,)``, a direction of the scaled unknowns, no step has a part along it.
        """
        wanted = anchor.transitions
        for corrections in range(MOST_CORRECTIONS + 1):
            try:
                shot = self.shoot(point)
            except ArgumentError:
                return None
            if not shot.whole or shot.transitions != wanted:
                return None
            matrix, right = self.equations(shot, anchor, units)
            if across is not None:
                matrix, right = np.vstack([matrix, across]), np.append(right, 0.0)
            change = np.linalg.lstsq(matrix, right, rcond=1e-14)[0]
            closed = np.all(np.abs(shot.gap) <= CLOSED * shot.scale)
            if closed and (np.abs(change).max() <= CONVERGED or corrections == MOST_CORRECTIONS):
                return shot, corrections
            moved = self.along(shot.point, units * change)
            if moved is None or np.abs(change).max() > 1.0:
                return None
            point = moved
        return None

    def at_value(self, point: Point, anchor: Shot, units: np.ndarray) -> Shot | None:
        """The orbit near a point at the same value of the parameter; None if there is none."""
        made = self.corrected(point, anchor, units, np.eye(len(units))[-1])
        return None if made is None else made[0]

    def equations(self, shot: Shot, anchor: Shot, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Scaled derivatives of the gap, a phase condition for an autonomous orbit, and the right side."""
        n = len(shot.gap)
        matrix = shot.slopes.copy()
        matrix[:, :n] -= np.eye(n)
        matrix = matrix * units / units[:n, None]
        right = -shot.gap / units[:n]
        if self.forced:
            # The period is given by the parameter.
            matrix[:, n] = 0.0
            row, rest = np.eye(n + 2)[n], 0.0
        else:
            across = anchor.field / units[:n]
            across = across / np.linalg.norm(across)
            row = np.append(across, [0.0, 0.0])
            rest = float(-across @ ((shot.point.x - anchor.point.x) / units[:n]))
        return np.vstack([matrix, row]), np.append(right, rest)

    def moved(self, shot: Shot, tangent: np.ndarray) -> tuple[Point, np.ndarray]:
        """The point of an orbit farthest from its jumps, and the tangent ``(n + 2,)`` of the family there."""
        point, n = shot.point, self.system.dimension
        times = np.concatenate([[point.t], shot.arc.jumps.t, [point.t + point.period]])
        gaps = np.diff(times)
        longest = int(np.argmax(gaps))
        t = float(times[longest] + 0.5 * gaps[longest])
        part = self._run(point, t, np.eye(n + 1))
        assert part.fundamental is not None
        x, mode = part.x[-1, :-1], str(part.mode[-1])
        turned = np.append(part.fundamental[:n] @ tangent[[*range(n), n + 1]], tangent[n:])
        if self.forced and t >= point.period:
            t -= point.period * np.floor(t / point.period)
        return attrs.evolve(point, x=x, t=t, mode=mode), turned

    def is_near_section(self, shot: Shot) -> bool:
        """Whether a jump is near the begin or the end of the pass."""
        times, point = shot.arc.jumps.t, shot.point
        nearest = np.minimum(np.abs(times - point.t), np.abs(times - point.t - point.period))
        return bool(np.any(nearest < NEAR_SECTION * point.period))

    @cached_property
    def _others(self) -> dict[str, float]:
        """The parameters of the extended system."""
        return {name: value for name, value in self.parameters.items() if name != self.name}

    def _run(self, point: Point, t: float, tangent: np.ndarray) -> HybridArc:
        return simulate(
            extended(self.system, (self.name,)),
            np.append(point.x, point.value),
            (point.t, t),
            mode=point.mode,
            parameters=self._others,
            solver=self.solver,
            tangent=tangent,
        )

    def _field(self, mode: str, t: float, x: np.ndarray, system: HybridSystem) -> np.ndarray:
        values = system.parameter_values(self._others)
        rates: Any = evaluate(system.variables, system.modes[system.mode_index(mode)].field, t, x, values)
        n = self.system.dimension
        return np.full(n, np.nan) if rates is None else np.asarray(rates[:n])
