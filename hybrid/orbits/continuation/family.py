"""The equations of a periodic orbit, stretch by stretch, and their derivatives in all unknowns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.route import Loop, Route, Stretch
from hybrid.orbits.periodic_schur import product_eigenvalues
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.solvers import Solver
from hybrid.system.functions import field_function, guard_function, reset_function
from hybrid.system.graph import HybridSystem
from hybrid.transform.extended import extended
from hybrid.transform.restricted import restricted

# The gap of each equation counts as closed at this share of the sizes; the corrections stop when they are
# this small.
CLOSED = 1e-10
CONVERGED = 1e-12
MOST_CORRECTIONS = 8
# Relative step of the difference that gives the slope of a period that cannot be traced.
STEP = 1e-5
# A singular value of the scaled equations is zero if it is this share of the largest.
ROUNDING = 1e-14
# Places of a stretch at which the size of the states is taken.
LOOKED_AT = 17
# Eigenvalues of one matrix are wrong by its norm times rounding; above this they come from its factors.
BLURRED = 1e-9


@attrs.frozen(eq=False)
class Flow:
    """One stretch of an orbit.

    Attributes
    ----------
    arc
        The run of the extended system, whose last components are the parameters; None if it takes no time.
    end
        State ``(n,)`` at the end, before the jump.
    slopes
        Derivatives ``(n, n + k)`` of that in the start and the parameters, at fixed times.
    first_rate, last_rate
        The field ``(n,)`` at the two ends.
    """

    arc: HybridArc | None
    end: np.ndarray
    slopes: np.ndarray
    first_rate: np.ndarray
    last_rate: np.ndarray

    def at(self, shares: np.ndarray) -> np.ndarray:
        """States ``(N, n)`` at shares ``(N,)`` of the time."""
        if self.arc is None:
            return np.tile(self.end, (len(shares), 1))
        begin, end = self.arc.t[0], self.arc.t[-1]
        times = np.clip(begin + shares * (end - begin), begin, end)
        return np.asarray(self.arc(times)[:, : len(self.end)])


@attrs.frozen(eq=False)
class Landing:
    """What the jumps at the end of a stretch do.

    Attributes
    ----------
    after
        State ``(n,)`` after them.
    slopes
        Derivatives ``(n, n + k + 1)`` of that in the state before, the parameters and the time.
    height, gradient
        The guard of the first of them, and its derivatives ``(n + k + 1,)`` in the same.
    """

    after: np.ndarray
    slopes: np.ndarray
    height: float
    gradient: np.ndarray


@attrs.frozen(eq=False)
class Pass:
    """One pass around an orbit, or near one: where its stretches end, and how that depends on unknowns."""

    family: Family
    loop: Loop
    flows: tuple[Flow, ...]
    landings: tuple[Landing | None, ...]
    _derivatives: dict[tuple[float, ...], np.ndarray] = attrs.field(factory=dict, init=False)

    @cached_property
    def scale(self) -> np.ndarray:
        """Sizes ``(n,)`` of the components along the orbit, or along the first one if these are larger."""
        shares = np.linspace(0.0, 1.0, LOOKED_AT)
        states = [flow.at(shares) for flow in self.flows if flow.arc is not None]
        sizes = np.maximum(np.abs(np.concatenate([self.loop.x, *states])).max(axis=0), self.family.least)
        return np.where(sizes > 0.0, sizes, 1.0)

    def units(self, sizes: np.ndarray) -> np.ndarray:
        """Units of the unknowns, for parameters of the ``sizes (k,)``.

        The states and times of many stretches count as much together as those of one.
        """
        count = len(self.flows)
        share = np.sqrt(count)
        return np.concatenate(
            [np.tile(share * self.scale, count), np.full(count + 1, share * self._span), sizes]
        )

    def derivatives(self, sizes: np.ndarray) -> np.ndarray:
        """Derivatives ``(m, m + k)`` of the scaled equations here, made once for these sizes."""
        key = tuple(sizes)
        if key not in self._derivatives:
            self._derivatives[key] = self.equations(self, self.units(sizes))[0]
        return self._derivatives[key]

    @property
    def _span(self) -> float:
        return abs(self.loop.period) or 1.0

    @cached_property
    def saltations(self) -> list[np.ndarray]:
        """The saltation matrix ``(n, n)`` of the jumps at the end of each stretch, or the identity."""
        n, found = self.loop.x.shape[1], []
        for i, (flow, landing) in enumerate(zip(self.flows, self.landings, strict=True)):
            if landing is None:
                found.append(np.eye(n))
                continue
            after, moved = self.flows[(i + 1) % len(self.flows)].first_rate, landing.slopes
            late = after - moved[:, :n] @ flow.last_rate - moved[:, -1]
            with np.errstate(all="ignore"):
                found.append(moved[:, :n] + np.outer(late, landing.gradient[:n]) / self.speed(i))
        return found

    @cached_property
    def maps(self) -> list[np.ndarray]:
        """The tangent map ``(n, n)`` of each stretch and the jumps at its end, at fixed times."""
        n = self.loop.x.shape[1]
        pairs = zip(self.saltations, self.flows, strict=True)
        return [saltation @ flow.slopes[:, :n] for saltation, flow in pairs]

    @cached_property
    def multipliers(self) -> np.ndarray:
        """Floquet multipliers ``(n,)``, largest first; nan where a guard is touched."""
        product = np.eye(self.loop.x.shape[1])
        for each in self.maps:
            product = each @ product
        if not np.all(np.isfinite(product)):
            return np.full(len(product), np.nan, dtype=complex)
        if len(self.maps) > 1 and np.finfo(float).eps * np.linalg.norm(product) > BLURRED:
            values = product_eigenvalues(self.maps, set()).values
        else:
            values = np.linalg.eigvals(product)
        return values[np.argsort(-np.abs(values), kind="stable")]

    @property
    def free_multipliers(self) -> np.ndarray:
        """Multipliers without the one along an autonomous orbit."""
        values = self.multipliers
        if self.family.forced:
            return values
        return np.delete(values, int(np.argmin(np.abs(values - 1.0))))

    def speed(self, i: int, rate: np.ndarray | None = None) -> float:
        """Speed of the guard at the end of a stretch, along the field there or another rate ``(n,)``."""
        landing, n = self.landings[i], self.loop.x.shape[1]
        assert landing is not None
        along = self.flows[i].last_rate if rate is None else rate
        return float(landing.gradient[:n] @ along + landing.gradient[-1])

    def fires_in_direction(self, i: int) -> bool:
        """Whether the guard at the end of a stretch, if there is one, is crossed in its direction."""
        stretch, system = self.family.route[i], self.family.system
        if not stretch.fired:
            return True
        transition = system.transitions[system.transition_index(stretch.fired[0])]
        return float(transition.guard.direction) * self.speed(i) >= 0.0

    def equations(self, anchor: Pass, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Scaled equations: derivatives ``(m, m + k)`` in the scaled unknowns, and values ``(m,)``.

        ``anchor`` is the orbit before: sizes are those there, and the phase of an autonomous orbit without
        jumps.
        """
        count, n = self.loop.x.shape
        k = len(self.loop.values)
        first, last = count * n, count * n + count + 1
        matrix, values = np.zeros((last, last + k)), np.zeros(last)
        for i, (flow, landing) in enumerate(zip(self.flows, self.landings, strict=True)):
            # How the end depends on all unknowns.
            end = np.zeros((n, last + k))
            end[:, i * n : (i + 1) * n], end[:, last:] = flow.slopes[:, :n], flow.slopes[:, n:]
            end[:, first + i] -= flow.slopes[:, :n] @ flow.first_rate
            end[:, first + i + 1] += flow.last_rate
            rows, after = slice(i * n, (i + 1) * n), slice((i + 1) % count * n, ((i + 1) % count + 1) * n)
            if landing is None:
                matrix[rows], values[rows] = end, flow.end
                self._join(i, matrix[first + i], values, first)
            else:
                matrix[rows], values[rows] = landing.slopes[:, :n] @ end, landing.after
                matrix[rows, last:] += landing.slopes[:, n:-1]
                matrix[rows, first + i + 1] += landing.slopes[:, -1]
                row = landing.gradient[:n] @ end
                row[last:] += landing.gradient[n:-1]
                row[first + i + 1] += landing.gradient[-1]
                matrix[first + i], values[first + i] = row, landing.height
            matrix[rows, after] -= np.eye(n)
            values[rows] -= self.loop.x[(i + 1) % count]
        self._close(anchor, matrix[-1], values, first)
        matrix *= units
        sizes = np.concatenate([np.tile(anchor.scale, count), np.abs(matrix[first:]).max(axis=1)])
        sizes[sizes == 0.0] = 1.0
        return matrix / sizes[:, None], values / sizes

    def _join(self, i: int, row: np.ndarray, values: np.ndarray, first: int) -> None:
        """A stretch that goes on smoothly ends at its share of the time between two jumps."""
        count, times = len(self.flows), self.loop.times
        if all(landing is None for landing in self.landings):
            begin, end = 0, count
            if i == count - 1:
                # The time of the start stays. The last equation fixes the phase of an autonomous orbit.
                row[first] = 1.0
                return
        else:
            begin = i
            while begin > 0 and self.landings[begin - 1] is None:
                begin -= 1
            end = i + 1
            while self.landings[end - 1] is None:
                end += 1
        share = (i + 1 - begin) / (end - begin)
        row[first + i + 1] += 1.0
        row[first + begin] -= 1.0 - share
        row[first + end] -= share
        values[first + i] = times[i + 1] - (1.0 - share) * times[begin] - share * times[end]

    def _close(self, anchor: Pass, row: np.ndarray, values: np.ndarray, first: int) -> None:
        """The last equation: the period is that of the forcing, or the time of the start is fixed."""
        loop, family, k = self.loop, self.family, len(self.loop.values)
        jumps = any(landing is not None for landing in self.landings)
        if family.forced:
            row[-k - 1], row[first] = 1.0, -1.0
            row[-k:] = -family.slopes_of_period(loop.values)
            values[-1] = loop.period - family.period(loop.values)
        elif jumps:
            row[first], values[-1] = 1.0, loop.times[0] - anchor.loop.times[0]
        else:
            n = loop.x.shape[1]
            across = anchor.flows[0].first_rate / anchor.scale**2
            row[:n] = across
            values[-1] = across @ (loop.x[0] - anchor.loop.x[0])


@attrs.frozen(eq=False)
class Family:
    """The orbits of a system over some of its parameters, along one route.

    ``periods`` is the number of forcing periods, 0 for an autonomous system. ``least`` are sizes ``(n,)`` of
    the states, below which none is measured: an orbit may pass zero.
    """

    system: HybridSystem
    names: tuple[str, ...]
    parameters: Mapping[str, float]
    periods: int
    solver: Solver
    route: Route
    least: np.ndarray | float = 0.0

    @property
    def forced(self) -> bool:
        """Whether the period is given by the forcing."""
        return self.periods > 0

    @cached_property
    def extended(self) -> HybridSystem:
        """The system whose state ends with the free parameters."""
        return extended(self.system, self.names)

    @cached_property
    def compiled(self) -> CompiledSystem:
        """Its functions."""
        return compile_system(self.extended)

    def all_parameters(self, values: np.ndarray) -> dict[str, float]:
        """All parameters by name."""
        return {
            **self.system.parameters,
            **self.parameters,
            **dict(zip(self.names, values.tolist(), strict=True)),
        }

    def vector(self, values: np.ndarray) -> np.ndarray:
        """All parameters ``(m,)`` of the original system."""
        return self.system.parameter_values(self.all_parameters(values))

    def period(self, values: np.ndarray) -> float:
        """The period of a forced orbit."""
        if not callable(self.system.period):
            assert self.system.period is not None
            return self.periods * float(self.system.period)
        forcing = self.system.forcing_period(self.all_parameters(values))
        assert forcing is not None
        return self.periods * forcing

    def slopes_of_period(self, values: np.ndarray) -> np.ndarray:
        """Derivatives ``(k,)`` of the period of a forced orbit in the parameters."""
        if not callable(self.system.period):
            return np.zeros(len(values))
        if self._slopes is not None:
            return self.periods * np.array([float(each(*self.vector(values))) for each in self._slopes])
        found = []
        for j, value in enumerate(values):
            h = STEP * (abs(value) or 1.0) * np.eye(len(values))[j]
            found.append((self.period(values + h) - self.period(values - h)) / (2.0 * h[j]))
        return np.array(found)

    @cached_property
    def _slopes(self) -> list[Callable[..., float]] | None:
        """The derivatives of the forcing period, if it can be traced."""
        import sympy

        from hybrid.symbolic.tracing import TraceError, model_symbols, trace

        period: Any = self.system.period
        names = tuple(self.system.parameters)
        try:
            (expression,) = trace(lambda t, x, p: period(p), self.system.state, names)
        except TraceError:
            return None
        symbols = model_symbols(self.system.dimension, len(names)).p
        wanted = [symbols[names.index(name)] for name in self.names]
        return [sympy.lambdify(symbols, sympy.diff(expression, each), "math") for each in wanted]

    def around(self, loop: Loop) -> Pass | None:
        """One pass from these unknowns; None if a stretch does not reach its end."""
        if not np.all(np.isfinite(loop.flat)) or np.any(np.abs(np.diff(loop.times)) > 4.0 * abs(loop.period)):
            return None
        try:
            flows = tuple(
                self.flow(stretch, loop.x[i], float(loop.times[i]), float(loop.times[i + 1]), loop.values)
                for i, stretch in enumerate(self.route)
            )
            landings = tuple(
                self._landing(stretch, flow.end, float(loop.times[i + 1]), loop.values)
                for i, (stretch, flow) in enumerate(zip(self.route, flows, strict=True))
            )
        except ArithmeticError:
            return None
        return Pass(self, loop, flows, landings)

    def corrected(
        self, loop: Loop, anchor: Pass, units: np.ndarray, across: np.ndarray | None = None
    ) -> tuple[Pass, int] | None:
        """The nearest orbit by the shortest Newton steps, and how many; None if there is none.

        With ``across (r, m + k)``, directions of the scaled unknowns, no step has a part along them.
        """
        for corrections in range(MOST_CORRECTIONS + 1):
            found = self.around(loop)
            if found is None:
                return None
            matrix, values = found.equations(anchor, units)
            if across is not None:
                matrix, right = np.vstack([matrix, across]), np.append(-values, np.zeros(len(across)))
            else:
                right = -values
            change = _solved(matrix, right)
            if change is None or not np.all(np.isfinite(change)):
                return None
            closed = np.all(np.abs(values) <= CLOSED)
            if closed and (np.abs(change).max() <= CONVERGED or corrections == MOST_CORRECTIONS):
                return found, corrections
            if np.abs(change).max() > 1.0:
                return None
            loop = loop.plus(units * change)
        return None

    def flow(self, stretch: Stretch, x: np.ndarray, begin: float, end: float, values: np.ndarray) -> Flow:
        """The motion of a stretch; ArithmeticError if it does not reach its end."""
        n = len(x)
        state = np.append(x, values)
        mode = self.extended.mode_index(stretch.mode)
        last_mode = self.extended.mode_index(stretch.end_mode)
        first_rate = self._rate(mode, begin, state)
        if begin == end:
            return Flow(None, x, np.eye(n, n + len(values)), first_rate, self._rate(last_mode, end, state))
        forwards = end > begin
        system = restricted(self.extended, stretch.mode, stretch.within, backwards=not forwards)
        arc = self._run(system, stretch.mode, state, (begin, end) if forwards else (-begin, -end), True)
        if not arc.status.ok or str(arc.mode[-1]) != stretch.end_mode:
            raise ArithmeticError
        assert arc.fundamental is not None
        found = arc.x[-1, :n], arc.fundamental[:n], first_rate, self._rate(last_mode, end, arc.x[-1])
        if not all(np.all(np.isfinite(each)) for each in found):
            raise ArithmeticError
        return Flow(arc, *found)

    def _landing(self, stretch: Stretch, x: np.ndarray, t: float, values: np.ndarray) -> Landing | None:
        """The jumps at the end of a stretch."""
        if not stretch.fired:
            return None
        system, compiled, p = self.extended, self.compiled, self._others
        n, state = len(x), np.append(x, values)
        slopes = np.eye(len(state), len(state) + 1)
        height, gradient = 0.0, np.zeros(len(state) + 1)
        for number, name in enumerate(stretch.fired):
            index = system.transition_index(name)
            transition = system.transitions[index]
            if number == 0:
                guard = guard_function(transition)
                height = float(compiled.value(guard, index, t, state, p)[0])
                gradient = compiled.derivative(guard, index, t, state, p)[0]
            reset = reset_function(transition, system.state)
            if reset is not None:
                own = compiled.derivative(reset, index, t, state, p)
                state = compiled.value(reset, index, t, state, p)
                slopes = own[:, :-1] @ slopes
                slopes[:, -1] += own[:, -1]
        if not (np.isfinite(height) and np.all(np.isfinite(gradient)) and np.all(np.isfinite(slopes))):
            raise ArithmeticError
        return Landing(state[:n], slopes[:n], height, gradient)

    @cached_property
    def _others(self) -> np.ndarray:
        """The parameters of the extended system."""
        return self.extended.parameter_values(self.fixed)

    @cached_property
    def fixed(self) -> dict[str, float]:
        """The parameters that are not free, by name."""
        given = {**self.system.parameters, **self.parameters}
        return {name: value for name, value in given.items() if name not in self.names}

    def _rate(self, mode: int, t: float, state: np.ndarray) -> np.ndarray:
        n = self.system.dimension
        function = field_function(self.extended.modes[mode], self.extended.dimension)
        return self.compiled.value(function, mode, t, state, self._others)[:n]

    def rate(self, mode: str, t: float, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The field ``(n,)`` of a mode."""
        return self._rate(self.extended.mode_index(mode), t, np.append(x, values))

    def gradient(self, name: str, t: float, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivatives ``(n + 1,)`` of the guard of a transition in the state and the time."""
        index = self.extended.transition_index(name)
        function = guard_function(self.extended.transitions[index])
        found = self.compiled.derivative(function, index, t, np.append(x, values), self._others)[0]
        return np.delete(found, range(len(x), len(found) - 1))

    def _run(
        self, system: HybridSystem, mode: str, state: np.ndarray, span: tuple[float, float], tangents: bool
    ) -> HybridArc:
        try:
            return simulate(
                system,
                state,
                span,
                mode=mode,
                parameters=self.fixed,
                solver=self.solver,
                tangent=np.eye(len(state)) if tangents else None,
            )
        except ArgumentError as error:
            raise ArithmeticError from error


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray | None:
    """The shortest solution; equations that say the same as others, to rounding, count once."""
    try:
        return np.linalg.lstsq(matrix, right, rcond=ROUNDING)[0]
    except np.linalg.LinAlgError:
        return None
