"""The orbits of a system over some of its parameters, along one route, and Newton's method for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.flow import Flow, Landing
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.route import Loop, Route, Stretch
from hybrid.orbits.held import Held
from hybrid.simulation.holding import drawn_back
from hybrid.simulation.repeated import Repeated
from hybrid.solvers import Solver
from hybrid.system.functions import field_function, guard_function, reset_function
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import stage_of
from hybrid.system.periodicity import period_at
from hybrid.transform.extended import extended
from hybrid.transform.restricted import BEYOND, ends_of, restricted

# A stretch that takes no more than these units in the last place of the time is a straight line.
ULPS = 64
# A field is along a surface if its rate through it is this share of its terms.
ALONG = 1e-10
# The corrections stop when they are this small.
CONVERGED = 1e-12
MOST_CORRECTIONS = 8
# Each correction is at most this share of the one before it, or this share of how far an orbit may be.
CONTRACTION = 0.5
NEGLIGIBLE = 1e-2
# Relative step of the difference that gives the slope of a period that cannot be traced.
STEP = 1e-5
MOST_JUMPS = 100_000
# A singular value of the scaled equations is zero if it is this share of the largest.
ROUNDING = 1e-14


@attrs.frozen(eq=False)
class Family:
    """The orbits of a system over some of its parameters, along one route.

    ``periods`` is the number of forcing periods, 0 for an autonomous system. ``least`` are sizes ``(n,)`` of
    the states, below which none is measured: an orbit may pass zero. ``counted`` is by how much each counter
    grows over the period. ``held`` are the conserved quantities that all orbits of the family have in common.

    The unknowns are states ``(n,)`` without counters, which the route has. A whole state has them behind.
    """

    system: HybridSystem
    names: tuple[str, ...]
    parameters: Mapping[str, float]
    periods: int
    solver: Solver
    route: Route
    least: np.ndarray | float = 0.0
    counted: np.ndarray | float = 0.0
    held: Held | None = None
    _runs: dict[tuple[str, tuple[str, ...], bool, bool], Repeated] = attrs.field(factory=dict, init=False)

    @property
    def n(self) -> int:
        """Number of components of a state without counters."""
        return self.system.tangent_dimension

    def extended_state(self, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The state of the extended system, from a whole state."""
        return np.concatenate([x[: self.n], values, x[self.n :]])

    def _without_counters(self, slopes: np.ndarray) -> np.ndarray:
        """Derivatives ``(..., n + k + 1)`` in state, parameters and time, without the columns of counters."""
        last = self.n + len(self.names)
        if slopes.shape[-1] == last + 1:
            return slopes
        return np.delete(slopes, np.s_[last : slopes.shape[-1] - 1], axis=-1)

    @property
    def latest(self) -> Family:
        """The same family, of the system with all modes that runs have made by now."""
        return attrs.evolve(self, system=stage_of(self.system))

    @property
    def forced(self) -> bool:
        """Whether the period is given by the forcing."""
        return self.periods > 0

    @cached_property
    def extended(self) -> HybridSystem:
        """The system whose state ends with the free parameters."""
        return extended(self.system, self.names) if self.names else self.system

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
        found = self._at_rest.copy()
        found[self._places] = values
        return found

    @cached_property
    def _at_rest(self) -> np.ndarray:
        """All parameters, those that are free as the caller gave them."""
        return self.system.parameter_values(self.parameters)

    @cached_property
    def _places(self) -> list[int]:
        """Indices of the free parameters among all of them."""
        return [list(self.system.parameters).index(name) for name in self.names]

    def period(self, values: np.ndarray) -> float:
        """The period of a forced orbit."""
        forcing = period_at(self.system.period, self.system.variables, self.vector(values))
        assert forcing is not None
        return self.periods * forcing

    def slopes_of_period(self, values: np.ndarray) -> np.ndarray:
        """Derivatives ``(k,)`` of the period of a forced orbit in the parameters."""
        if not callable(self.system.period):
            return np.zeros(len(values))
        if self._slopes is not None:
            return self.periods * np.array(self._slopes(0.0, (), self.vector(values)))
        found = []
        for j, value in enumerate(values):
            h = STEP * (abs(value) or 1.0) * np.eye(len(values))[j]
            found.append((self.period(values + h) - self.period(values - h)) / (2.0 * h[j]))
        return np.array(found)

    @cached_property
    def _slopes(self) -> Callable[..., Any] | None:
        """The derivatives of the forcing period, if it can be traced."""
        from hybrid.expression.derivatives import derivative
        from hybrid.expression.evaluation import expressed
        from hybrid.expression.tracing import TraceError, model_symbols, trace

        period: Any = self.system.period
        names = tuple(self.system.parameters)
        try:
            (expression,) = trace(lambda t, x, p: period(p), 0, names)
        except TraceError:
            return None
        symbols = model_symbols(self.system.dimension, len(names)).p
        wanted = [symbols[names.index(name)] for name in self.names]
        return expressed([derivative(expression, each) for each in wanted])

    def around(self, loop: Loop, most: int | None = None) -> Pass | None:
        """One pass from these unknowns; None if a stretch does not end in so many steps or jumps."""
        if not np.all(np.isfinite(loop.flat)) or np.any(np.abs(np.diff(loop.times)) > 4.0 * abs(loop.period)):
            return None
        try:
            flows = tuple(
                self.flow(
                    stretch, loop.x[i], float(loop.times[i]), float(loop.times[i + 1]), loop.values, most
                )
                for i, stretch in enumerate(self.route)
            )
            landings = tuple(
                self.landing(stretch, flow, float(loop.times[i + 1]), loop.values)
                for i, (stretch, flow) in enumerate(zip(self.route, flows, strict=True))
            )
        except ArithmeticError:
            return None
        return Pass(self, loop, flows, landings)

    def corrected(
        self,
        loop: Loop,
        anchor: Pass,
        units: np.ndarray,
        across: np.ndarray | None = None,
        reach: float = np.inf,
    ) -> tuple[Pass, int] | None:
        """The nearest orbit by the shortest Newton steps, and how many; None if there is none.

        With ``across (r, m + k)``, directions of the scaled unknowns, no step has a part along them. An orbit
        farther than ``reach`` from the first unknowns, in these units, or one that the steps do not contract
        to, is another one. The passes take a few times the steps of the ``anchor`` at most.
        """
        predicted, before, most = loop.flat, np.inf, anchor.steps_allowed
        open_before = np.inf
        for corrections in range(MOST_CORRECTIONS + 1):
            found = self.around(loop, most)
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
            length, still_open = float(np.abs(change).max()), float(np.abs(values).max())
            # Near a singular place rounding keeps the last steps from becoming smaller.
            small = length <= (CLOSED if corrections == MOST_CORRECTIONS else CONVERGED)
            # Errors may grow so much that a small step closes a large gap.
            settled = still_open <= CONVERGED or still_open > CONTRACTION * open_before
            if small and settled and still_open <= CLOSED:
                return found, corrections
            loop = loop.plus(units * change)
            away = float(np.abs((loop.flat - predicted) / units).max())
            if length > 1.0 or away > reach or length > max(CONTRACTION * before, NEGLIGIBLE * reach):
                return None
            before, open_before = length, still_open
        return None

    def flow(
        self,
        stretch: Stretch,
        x: np.ndarray,
        begin: float,
        end: float,
        values: np.ndarray,
        most: int | None = None,
    ) -> Flow:
        """The motion of a stretch; ArithmeticError if it does not end in so many steps or jumps."""
        n, state = len(x), self.extended_state(np.append(x, stretch.counters), values)
        mode = self.extended.mode_index(stretch.mode)
        state = drawn_back(self.extended, stretch.mode, begin, state, self._others)
        if no_time(begin, end):
            first_rate = self._rate(mode, begin, state)
            last_rate = self._rate(self.extended.mode_index(stretch.end_mode), end, state)
            moved = x + (end - begin) * first_rate
            return Flow(None, moved, np.eye(n, n + len(values)), first_rate, last_rate, stretch.counters)
        way = 1.0 if end > begin else -1.0
        # Where the field has roots of a guard it is smooth on either side of that alone.
        sided = not stretch.within and self.compiled.emitted.propagators[mode].root > 1
        start = stretch.mode
        if sided and self._is_beyond(start, begin, state):
            start = BEYOND + start
        runs = self._runs_of(stretch.mode, stretch.within, way < 0.0, sided)
        limits = (self.solver.max_steps, MOST_JUMPS) if most is None else (most, most)
        try:
            led = runs.run(start, state, (way * begin, way * end), *limits)
        except ArgumentError as error:
            raise ArithmeticError from error
        if not led.ok or led.mode.removeprefix(BEYOND) != stretch.end_mode:
            raise ArithmeticError
        found = led.x[:n], led.tangents[:n], way * led.first_rate[:n], way * led.last_rate[:n]
        if not all(np.isfinite(each).all() for each in found):
            raise ArithmeticError
        return Flow(led.arc, *found, tuple(led.x[n + len(values) :].tolist()))

    def _runs_of(self, mode: str, within: tuple[str, ...], backwards: bool, sided: bool) -> Repeated:
        """The runs along a mode without its guards, or with those of some transitions."""
        key = mode, within, backwards, sided
        if key not in self._runs:
            self._runs[key] = Repeated(restricted(self.extended, *key), self.fixed, self.solver)
        return self._runs[key]

    def _is_beyond(self, mode: str, t: float, state: np.ndarray) -> bool:
        """Whether a state is beyond a guard at which its mode ends."""
        return any(
            float(each.guard.direction) * self._guard(each.name, t, state)[0] > 0.0
            for each in ends_of(self.extended, mode)
        )

    def landing(self, stretch: Stretch, flow: Flow, t: float, values: np.ndarray) -> Landing | None:
        """The jumps at the end of a stretch."""
        if not stretch.fired:
            return None
        state = self.extended_state(np.append(flow.end, flow.counters), values)
        whole = np.eye(len(state), len(state) + 1)
        height, gradient = self._guard(stretch.fired[0], t, state)
        for name in stretch.fired:
            state, slopes = self._reset(name, t, state)
            if slopes is not None:
                whole = _after(slopes, whole)
        whole, gradient = map(self._without_counters, (whole[: self.n], gradient))
        if not (np.isfinite(height) and np.all(np.isfinite(gradient)) and np.all(np.isfinite(whole))):
            raise ArithmeticError
        return Landing(state[: self.n], whole, height, gradient)

    def by_themselves(
        self, stretch: Stretch, flow: Flow, t: float, values: np.ndarray, span: float
    ) -> list[tuple[Stretch, np.ndarray]]:
        """The end of a stretch as the instants that are met by themselves, by chance or by symmetry.

        On neighbouring orbits each has a time of its own; all but these are set off by the one before them.
        With each, the state ``(n,)`` that it begins with. ``span`` is the time that the orbit takes.
        """
        state = self.extended_state(np.append(flow.end, flow.counters), values)
        sizes = np.append(np.abs(state), abs(span))
        sizes[: self.n] = np.maximum(sizes[: self.n], self.least)
        found = [(attrs.evolve(stretch, fired=()), flow.end)]
        for name in stretch.fired:
            source = self.extended.transitions[self.extended.transition_index(name)].source
            height, gradient = self._guard(name, t, state)
            if found[-1][0].fired and abs(height) <= CLOSED * float(np.abs(gradient) @ sizes):
                counters = tuple(state[self.n + len(values) :].tolist())
                found.append((Stretch(source, source, (), (), counters), state[: self.n]))
            last, begun = found[-1]
            found[-1] = attrs.evolve(last, fired=(*last.fired, name)), begun
            state, _ = self._reset(name, t, state)
        return found

    def _guard(self, name: str, t: float, state: np.ndarray) -> tuple[float, np.ndarray]:
        """The guard of a transition, and its derivatives in the extended state and the time."""
        index = self.extended.transition_index(name)
        function = guard_function(self.extended.transitions[index])
        height = self.compiled.value(function, index, t, state, self._others)[0]
        return float(height), self.compiled.derivative(function, index, t, state, self._others)[0]

    def _reset(self, name: str, t: float, state: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """The extended state after a transition, and its derivatives; None for the identity."""
        index = self.extended.transition_index(name)
        reset = reset_function(self.extended.transitions[index], self.extended.variables)
        if reset is None:
            return state, None
        slopes = self.compiled.derivative(reset, index, t, state, self._others)
        return self.compiled.value(reset, index, t, state, self._others), slopes

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
        function = field_function(self.extended.modes[mode], self.extended.variables)
        return self.compiled.value(function, mode, t, state, self._others)[: self.n]

    def rate(self, mode: str, t: float, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The field ``(n,)`` of a mode at a whole state."""
        return self._rate(self.extended.mode_index(mode), t, self.extended_state(x, values))

    def speed_terms(self, name: str, mode: str, t: float, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Terms ``(n + 1,)`` of a guard's speed along the field of a mode: of each state, and of time."""
        gradient = self.gradient(name, t, x, values)
        return np.append(gradient[:-1] * self.rate(mode, t, x, values), gradient[-1])

    def is_along(self, name: str, mode: str, t: float, x: np.ndarray, values: np.ndarray) -> bool:
        """Whether the field of a mode is along the surface of a guard."""
        terms = self.speed_terms(name, mode, t, x, values)
        return bool(abs(terms.sum()) <= ALONG * np.abs(terms).sum())

    def height(self, name: str, t: float, x: np.ndarray, values: np.ndarray) -> float:
        """The guard of a transition."""
        return self._guard(name, t, self.extended_state(x, values))[0]

    def gradient(self, name: str, t: float, x: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Derivatives ``(n + 1,)`` of the guard of a transition in the state and the time."""
        found = self._guard(name, t, self.extended_state(x, values))[1]
        return np.delete(found, np.s_[self.n : len(found) - 1])


def no_time(begin: float, end: float) -> bool:
    """Whether two times are the same but for rounding."""
    return abs(end - begin) <= ULPS * math.ulp(max(abs(begin), abs(end)))


def _after(slopes: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Derivatives in state and time of a map after another, at the same time."""
    found = slopes[:, :-1] @ before
    found[:, -1] += slopes[:, -1]
    return np.asarray(found)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray | None:
    """The shortest solution; equations that say the same as others, to rounding, count once."""
    try:
        return np.linalg.lstsq(matrix, right, rcond=ROUNDING)[0]
    except np.linalg.LinAlgError:
        return None
