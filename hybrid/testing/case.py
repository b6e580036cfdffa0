"""One run to judge properties by: how it is carried out, found fit, and told when a property fails."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NoReturn

import attrs
import numpy as np
from hypothesis.errors import UnsatisfiedAssumption

from hybrid import arguments
from hybrid.compiler.agreement import compiled_value
from hybrid.compiler.compiled import CompiledSystem, compile_system
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc, Jump
from hybrid.simulation.saltation import saltation_matrix
from hybrid.simulation.simulate import simulate
from hybrid.solvers import DOP853, Solver
from hybrid.status import StatusCode
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Transition
from hybrid.system.functions import ModelFunction
from hybrid.system.graph import HybridSystem

TIGHT = DOP853(rtol=1e-12, atol=1e-14, max_steps=20_000)
# The same run with tolerances this much looser tells how far its end can be trusted.
LOOSER = 100.0
# A run is cut short after this many jumps: more of them show nothing new.
MOST_JUMPS = 5
# A run whose end moves by more than this with the tolerances, relative to its size, proves nothing.
SENSITIVE = 1e-6


class PropertyError(AssertionError):
    """A property that every system has does not hold; the text tells the case and what is likely wrong."""


def discard(reason: str) -> NoReturn:
    """Give an example up that can be neither right nor wrong; Hypothesis draws another one."""
    raise UnsatisfiedAssumption(reason)


def as_case(case: object) -> Case:
    """A case, or an ArgumentError."""
    return arguments.instance("case", case, Case, "Draw one with hybrid.testing.cases.")


class Engine:
    """What solves and linearises: the library, unless a subclass puts something else to the test."""

    def simulate(
        self, system: HybridSystem, x0: Any, t_span: tuple[float, float], **options: Any
    ) -> HybridArc:
        """As :func:`hybrid.simulate`."""
        return simulate(system, x0, t_span, **options)

    def saltation_matrix(
        self, system: HybridSystem, transition: str, t: float, x: Any, parameters: Mapping[str, float]
    ) -> np.ndarray:
        """As :func:`hybrid.saltation_matrix`."""
        return saltation_matrix(system, transition, t, x, parameters=parameters)

    def derivative(
        self,
        system: HybridSystem,
        function: ModelFunction,
        index: int,
        t: float,
        x: np.ndarray,
        parameters: np.ndarray,
    ) -> np.ndarray:
        """The derivative ``(rows, n + 1)`` that runs use of the field of a mode, a guard or a reset."""
        return compile_system(system).derivative(function, index, t, x, parameters)

    def value(
        self,
        compiled: CompiledSystem,
        function: ModelFunction,
        index: int,
        t: float,
        x: np.ndarray,
        parameters: np.ndarray,
    ) -> np.ndarray:
        """The values ``(rows,)`` that runs use of a field, a guard, its condition or a reset."""
        return compiled_value(compiled, function, index, t, x, parameters)


LIBRARY = Engine()


@attrs.frozen(eq=False)
class Run:
    """A run that is fit to be judged by.

    Attributes
    ----------
    arc
        The run, every jump of it transverse.
    t1
        Its end, before the first chatter, grazing or status that ended it.
    error
        By how much its end moves with the tolerances, ``(n,)``.
    scale
        Sizes of the components along it, ``(n,)``.
    """

    arc: HybridArc
    t1: float
    error: np.ndarray
    scale: np.ndarray

    @property
    def tolerance(self) -> np.ndarray:
        """How close the ends of two runs that should be the same must be, ``(n,)``."""
        return 1e-9 * self.scale + LOOSER * self.error


@attrs.frozen(eq=False, repr=False)
class Case:
    """A start, a span of time and parameter values: one example for the properties.

    Attributes
    ----------
    system
        The model.
    parameters
        All of its values, by name.
    mode
        Where the run starts; None if the guards allow the state in no mode.
    x0, t0, t1
        State ``(n,)`` at the start, and the span of time.
    fraction
        Between 0 and 1: which jump is looked at, where the run is split or cut, how guards are scaled.
    passable
        Names of transitions through whose guard the state may go on in the same mode.
    solver
        Method and tolerances of every run.
    engine
        What carries them out.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    mode: str | None
    x0: tuple[float, ...]
    t0: float
    t1: float
    fraction: float = 0.5
    passable: tuple[str, ...] = ()
    solver: Solver = TIGHT
    engine: Engine = LIBRARY

    def __repr__(self) -> str:
        return f"Case({self.told()})"

    def told(self) -> str:
        """The case in words, only those parameters named that are not as declared."""
        changed = [
            f"{name} = {value:.10g}"
            for name, value in self.parameters.items()
            if value != self.system.parameters[name]
        ]
        others = "the others as declared" if changed else "as declared"
        mode = f"mode {self.mode!r}" if self.mode else "no mode allows it"
        return (
            f"parameters {', '.join([*changed, others])}; from t = {self.t0:.10g} at "
            f"{self.state_told(self.x0)}, {mode}, to t = {self.t1:.10g}"
        )

    def state_told(self, x: Any) -> str:
        """A state with the names of its components."""
        return ", ".join(
            f"{name} = {value:.10g}" for name, value in zip(self.system.state_names, x, strict=True)
        )

    @property
    def values(self) -> np.ndarray:
        """Parameter vector ``(m,)``."""
        return self.system.parameter_values(self.parameters)

    def evaluate(self, function: Any, t: float, x: Any) -> np.ndarray:
        """A model function in plain Python, as a flat array; discards the example where it is not finite."""
        values = evaluate(self.system.variables, function, t, np.asarray(x, dtype=float), self.values)
        if values is None:
            discard("a model function is not finite")
        return np.asarray(values)

    def slope(self, function: ModelFunction, owner: str, t: float, x: np.ndarray) -> np.ndarray:
        """The derivative ``(rows, n + 1)`` that runs use of a function of the mode or transition named."""
        system = self.system
        index = system.mode_index(owner) if function.kind == "field" else system.transition_index(owner)
        slope = self.engine.derivative(system, function, index, t, x, self.values)
        if not np.all(np.isfinite(slope)):
            discard("a derivative is not finite at the event")
        return slope

    @property
    def looser(self) -> Solver:
        """The solver with looser tolerances."""
        return attrs.evolve(self.solver, rtol=LOOSER * self.solver.rtol, atol=LOOSER * self.solver.atol)

    def transition(self, jump: Jump) -> Transition:
        """The transition that a jump took."""
        return self.system.transitions[self.system.transition_index(jump.transition)]

    def simulate(
        self,
        t1: float,
        *,
        system: HybridSystem | None = None,
        start: tuple[float, Any, str | None] | None = None,
        extra: Mapping[str, float] | None = None,
        **options: Any,
    ) -> HybridArc:
        """The run of this case, or of a changed system, from its start or from another one, to ``t1``."""
        t0, x0, mode = start or (self.t0, self.x0, self.mode)
        arc = self.engine.simulate(
            system or self.system,
            x0,
            (t0, t1),
            mode=mode,
            parameters={**self.parameters, **(extra or {})},
            **{"solver": self.solver, **options},
        )
        if arc.status.code == StatusCode.INTERRUPTED:
            raise KeyboardInterrupt
        return arc

    @cached_property
    def run(self) -> Run:
        """The run, if it is fit to be judged by; an example that is not is discarded.

        A run that chatters, grazes or ends early is cut short before that. It is not fit if two guards are
        reached together, or if its events or its end hang on the tolerances.
        """
        found = self._run
        if isinstance(found, str):
            discard(found)
        return found

    @cached_property
    def _run(self) -> Run | str:
        if self.mode is None:
            return f"no mode allows the start: {lies_beyond(self)}"
        try:
            arc = self.simulate(self.t1, max_jumps=MOST_JUMPS)
        except ArgumentError as refusal:
            return str(refusal)
        t1 = self.t1
        if not is_clean(arc):
            t1 = _before_trouble(arc)
            arc = self.simulate(t1)
        if not is_clean(arc):
            return f"the run is not fit: {arc.status}" if not arc.status.ok else "the run grazes or chatters"
        if not np.all(arc.jumps.transversality):
            return "a guard is reached without speed"
        last = arc.jumps.t[-1] if len(arc.jumps) else self.t0
        if not t1 - last > 1e-6 * (t1 - self.t0):
            return "the run ends at an event"
        other = self.simulate(t1, solver=self.looser)
        if not np.array_equal(other.jumps.transition_index, arc.jumps.transition_index):
            return "the events of the run hang on the tolerances"
        size = np.abs(arc.x).max(axis=0)
        scale = np.maximum(size, 1e-3 * size.max() if size.any() else 1.0)
        error = np.abs(arc.x[-1] - other.x[-1])
        if not np.all(error <= SENSITIVE * scale):
            return "the end of the run hangs on the tolerances"
        return Run(arc, t1, error, scale)

    def the_jump(self) -> Jump:
        """One of the jumps of the run; the example is discarded if it has none."""
        jumps = self.run.arc.jumps
        if not len(jumps):
            discard("no event on the run")
        return jumps[int(self.fraction * len(jumps))]

    def fail(self, property_name: str, *lines: str, hint: str) -> NoReturn:
        """Raise a PropertyError that tells the case."""
        told = "\n".join(f"  {line}" for line in lines)
        name = self.system.name or "the system"
        raise PropertyError(
            f"{property_name}: this does not hold for {name}.\n{told}\n"
            f"  case: {self.told()}\n  likely: {hint}"
        )


def is_clean(arc: HybridArc) -> bool:
    """Whether a run reached its end, and every jump of it was transverse."""
    return arc.status.ok and not arc.grazings and not np.any(arc.jumps.kind != "transverse")


def _before_trouble(arc: HybridArc) -> float:
    """A time well before the first grazing, chatter or status, in the middle between two jumps."""
    bad = np.flatnonzero(arc.jumps.kind != "transverse")
    clean = arc.jumps.t[: bad[0]] if len(bad) else arc.jumps.t
    touched = min((grazing.t for grazing in arc.grazings), default=np.inf)
    times = np.unique([arc.t[0], *clean[clean < touched]])
    if len(times) < 2:
        end = min(touched, arc.t[-1])
        return float(0.5 * (times[0] + end))
    return float(0.5 * (times[-2] + times[-1]))


def lies_beyond(case: Case) -> str:
    """Which guards forbid the start of a case, in words."""
    told = []
    for transition in case.system.transitions:
        value = guard_beyond(case, transition, case.t0, case.x0)
        if not value < 0.0:
            told.append(f"guard {transition.name!r} of mode {transition.source!r}")
    return "it lies beyond " + ", ".join(told) if told else "a guard is not finite"


def guard_beyond(case: Case, transition: Transition, t: float, x: Any) -> float:
    """The guard times its direction: negative before it fires; -inf if it fires both ways or only marks."""
    direction = transition.guard.direction
    if direction == 0 or transition.is_marker:
        return -np.inf
    values = evaluate(
        case.system.variables, transition.guard.function, t, np.asarray(x, dtype=float), case.values
    )
    return np.nan if values is None else float(direction * values[0])


def matrix_told(matrix: np.ndarray) -> str:
    """A matrix or vector on one line."""
    return np.array2string(
        np.asarray(matrix),
        separator=", ",
        formatter={"float_kind": lambda v: f"{v:.8g}"},
        max_line_width=10**6,
    ).replace("\n", "")


def mode_after(jump: Jump) -> str:
    """The mode that a jump leads to; runs are cut before a jump that ends them."""
    assert jump.target is not None
    return jump.target


def stretches(case: Case) -> Iterator[tuple[int, str | None, float, float]]:
    """Between events: how many came before, the mode, start and length; the shortest are left out."""
    jumps, t1 = case.run.arc.jumps, case.run.t1
    times = [case.t0, *jumps.t, t1]
    for j in range(len(times) - 1):
        length = times[j + 1] - times[j]
        if length > 1e-9 * (t1 - case.t0):
            yield j, mode_after(jumps[j - 1]) if j else case.mode, times[j], length
