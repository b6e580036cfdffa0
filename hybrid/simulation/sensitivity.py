"""Derivatives of a run in its start and in parameters: of the end, of samples, and of the times of jumps."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import attrs
import numpy as np

from hybrid.compiler.compiled import compile_system
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump, Jumps
from hybrid.simulation.trajectory import start
from hybrid.solvers import Solver
from hybrid.status import apart_status
from hybrid.system.derivatives import evaluate
from hybrid.system.functions import field_function, guard_function
from hybrid.transform.aged import aged, with_age
from hybrid.transform.counted import Counted, counted
from hybrid.transform.extended import extended, with_parameters
from hybrid.transform.restricted import restricted

# A guard is at rest at a jump if its speed there is this share of that a little before.
AT_REST = 1e-3
# Shares of the way back to a place before the jump, and the weights that extrapolate from there to the jump.
BEFORE_REST = 0.02 * np.arange(1, 7)
TO_REST = np.array([6.0, -15.0, 20.0, -15.0, 6.0, -1.0])

# A wait that ends within this share of the time of a run ends at once.
AT_ONCE = 1e-9


@attrs.frozen(eq=False)
class Sensitivities:
    """Derivatives of one run, at fixed times, in the start ``(n)`` and in parameters ``(m)``.

    The parameters are carried as components of the state that do not move, so that fields, guards and resets
    which depend on them, and the saltation matrices of their jumps, need no rule of their own.

    Attributes
    ----------
    names
        Names of the parameters.
    components
        Those of a tangent vector ``(n,)`` that the run itself has: not the age.
    counted
        The extended system, with the jumps of its fields in time as events.
    arc
        The run of that system.
    jumps
        The jumps of the run itself, if they were kept.
    """

    names: tuple[str, ...]
    components: np.ndarray
    counted: Counted
    arc: HybridArc
    jumps: Jumps | None
    x0: np.ndarray
    mode: str
    t0: float
    samples: np.ndarray | None
    solver: Solver | None
    simulate: Callable[..., HybridArc]

    @property
    def end(self) -> np.ndarray:
        """Derivatives ``(n, m)`` of the last state in the parameters."""
        assert self.arc.fundamental is not None
        return self.arc.fundamental[self.components]

    @cached_property
    def sampled(self) -> np.ndarray:
        """Derivatives ``(N, n, n + m)`` of the samples in the start and in the parameters."""
        assert self.samples is not None
        return np.stack([self._of_run(tangents[self.components]) for _, tangents in self._at(self.samples)])

    @cached_property
    def times(self) -> np.ndarray:
        """Derivatives ``(jumps, n + m)`` of the times of jumps; nan for the limit of a chatter."""
        jumps = self.jumps
        assert jumps is not None, "only the jumps of a run have times"
        found = np.full((len(jumps), self.arc.system.tangent_dimension), np.nan)
        before = np.append(self.t0, jumps.t[:-1])
        # A jump that another sets off happens at the time of that one.
        first = np.flatnonzero((jumps.t > before) & (jumps.kind != "limit"))
        middles = 0.5 * (before[first] + jumps.t[first])
        places = self._at(middles)
        for i, t, (x, tangents) in zip(first, middles, places, strict=True):
            found[i] = self._time_of(jumps[int(i)], float(t), x, tangents)
        # The last of those jumps that is not behind each one.
        instants = np.searchsorted(first, np.arange(len(jumps)), side="right") - 1
        for k in range(1, len(jumps)):
            if jumps.t[k] == jumps.t[k - 1] and jumps.kind[k] != "limit":
                i = instants[k]
                tick = self._time_of_tick(jumps[k], jumps[int(first[i])], places[i][1]) if i >= 0 else None
                found[k] = found[k - 1] if tick is None else tick
        return self._of_run(found)

    def _time_of_tick(self, jump: Jump, first: Jump, tangents: np.ndarray) -> np.ndarray | None:
        """Derivatives ``(n + m,)`` of the time of a tick, which other jumps at its instant do not set off.

        They depend on components whose tangents do not move, so ``tangents`` may be those of any time since
        the last instant. None for other jumps. ``first`` is the first jump of the instant.
        """
        system = self.arc.system
        clock = system.transitions[system.transition_index(jump.transition)].clock
        if clock is None or clock.counts_from_entry:
            return None
        place = self._place(jump if clock.reads_time else first)
        if not clock.reads_time:
            # A wait that a jump of this instant has begun was not under way before.
            x, p = (
                system.variables.state_view(place),
                system.variables.parameter_view(self.arc.parameters.values()),
            )
            since = clock.function(jump.t, x, p)
            if not abs(since) <= AT_ONCE * abs(jump.t - self.t0):
                return None
        slope, _ = self._slope(jump, jump.t, place)
        return -(slope @ tangents) / jump.transversality

    def _place(self, jump: Jump) -> np.ndarray:
        """The state before a jump, with what the run with derivatives has besides."""
        system, assumed = self.arc.system, self.jumps
        assert assumed is not None, "only the jumps of a run have times"
        parameters = self.x0[self._first : system.tangent_dimension]
        place = with_parameters(self.counted.original, with_age(assumed.system, jump.x_minus), parameters)
        return self.counted.state(jump.t, place, self.arc.parameters)

    def _of_run(self, rows: np.ndarray) -> np.ndarray:
        """Derivatives in the start of the run itself and in the parameters, from those in all components."""
        places = np.arange(rows.shape[-1])
        return rows[..., np.isin(places, self.components) | (places >= self._first)]

    @property
    def _first(self) -> int:
        """The component at which the parameters begin."""
        return self.arc.system.tangent_dimension - len(self.names)

    def _at(self, times: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """The state at each time, and the tangent vectors ``(n + m, n + m)`` there."""
        trajectory = start(
            self.arc.system,
            self.x0,
            self.t0,
            mode=self.mode,
            parameters=self.arc.parameters,
            solver=self.solver,
            tangent=np.eye(self.arc.system.tangent_dimension),
        )
        found = []
        for t in times:
            trajectory.advance(float(t), trajectory.no_record())
            found.append((trajectory.x, trajectory.tangent_matrix))
        return found

    def _time_of(self, jump: Jump, t: float, x: np.ndarray, tangents: np.ndarray) -> np.ndarray:
        """Derivatives ``(n + m,)`` of the time of a jump, from a state before it in its mode.

        The guard of a tank that runs dry comes to rest where its root vanishes. There its change and its
        speed are both zero, and their quotient follows from places before.
        """
        system = self.arc.system
        slope, _ = self._slope(jump, jump.t, self._place(jump))
        if compile_system(system).emitted.steep[system.mode_index(jump.source)]:
            before = [self._moved(jump, t, x, tangents, share) for share in BEFORE_REST]
            slopes = [self._slope(jump, when, state) for when, state, _ in before]
            if abs(jump.transversality) <= AT_REST * abs(slopes[0][1]):
                quotients = [
                    -(along @ moved) / speed
                    for (along, speed), (_, _, moved) in zip(slopes, before, strict=True)
                ]
                return np.asarray(TO_REST @ np.array(quotients))
        return -(slope @ self._moved(jump, t, x, tangents, 0.0)[2]) / jump.transversality

    def _moved(
        self, jump: Jump, t: float, x: np.ndarray, tangents: np.ndarray, share: float
    ) -> tuple[float, np.ndarray, np.ndarray]:
        """Time, state and tangent vectors at a share of the way back from a jump to a state before it."""
        alone = restricted(self.arc.system, jump.source, self.counted.events_in(jump.source))
        when = jump.t - share * (jump.t - t)
        run = self.simulate(
            alone, x, (t, when), parameters=self.arc.parameters, solver=self.solver, tangent=tangents
        )
        assert run.fundamental is not None
        return when, run.x[-1], run.fundamental

    def _slope(self, jump: Jump, t: float, x: np.ndarray) -> tuple[np.ndarray, float]:
        """The gradient ``(n + m,)`` of a guard at a state, and its speed along the field of its mode."""
        system = self.arc.system
        index, mode = system.transition_index(jump.transition), system.mode_index(jump.source)
        values = system.parameter_values(self.arc.parameters)
        function = guard_function(system.transitions[index])
        [slope] = compile_system(system).derivative(function, index, t, x, values, jump.row or 0)
        field = field_function(system.modes[mode], system.variables).value
        rates = evaluate(system.variables, field, t, x, values)
        speed = np.nan if rates is None else slope[:-1] @ rates + slope[-1]
        return slope[: system.tangent_dimension], float(speed)


def with_sensitivities(
    arc: HybridArc,
    names: tuple[str, ...],
    x0: np.ndarray,
    mode: str,
    t_span: tuple[float, float],
    *,
    solver: Solver | None,
    max_jumps: int,
    samples: np.ndarray | None,
    simulate: Callable[..., HybridArc],
) -> HybridArc:
    """The arc of a run with its derivatives, from the run of the extended system that goes the same way.

    If that run has other jumps, both are right within the tolerances, and the status says so. Else the status
    is that of the run with derivatives, if there is anything to tell of it.
    """
    whole = aged(arc.system)
    n, m = whole.tangent_dimension, len(names)
    parameters = {name: value for name, value in arc.parameters.items() if name not in names}
    found = counted(extended(whole, names), m)
    own = np.arange(arc.system.tangent_dimension)
    begin = with_parameters(
        found.original, with_age(arc.system, x0), np.array([arc.parameters[name] for name in names])
    )
    begin = found.state(t_span[0], begin, parameters)
    again = simulate(
        found.system,
        begin,
        t_span,
        mode=mode,
        parameters=parameters,
        solver=solver,
        tangent=np.eye(n + m)[:, n:],
        max_jumps=max_jumps,
    )
    jumps = arc.jumps if arc.keeps_jumps else None
    known = Sensitivities(names, own, found, again, jumps, begin, mode, t_span[0], samples, solver, simulate)
    status = arc.status
    # How many jumps of a chatter are followed, up to its limit, is no property of the run.
    others = sum(name not in found.events for name in again.jumps.transition)
    if others != arc.jump_count and "limit" not in again.jumps.kind:
        status = apart_status(arc.jump_count, others)
    elif not again.status.ok:
        status = again.status
    jumps = None if jumps is None else attrs.evolve(jumps, sensitivities=known)
    return attrs.evolve(arc, jumps=jumps, sensitivities=known, status=status)
