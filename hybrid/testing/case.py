"""One example for the properties: how its run is computed, accepted, and described when a property fails."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, NoReturn

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump
from hybrid.solvers import DOP853, Solver
from hybrid.status import StatusCode
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Function, Mode, Transition
from hybrid.system.functions import ModelFunction, field_function, reset_function
from hybrid.system.graph import HybridSystem, laws_of
from hybrid.system.laws import Laws
from hybrid.system.variables import named_values
from hybrid.testing.engine import LIBRARY, Engine
from hybrid.testing.errors import PropertyError, discard
from hybrid.testing.reads import is_passed
from hybrid.testing.run import LOOSER, MOST_JUMPS, Run, before_trouble, is_clean, mode_after
from hybrid.testing.sizes import sizes_along
from hybrid.transform.contacts.growth import contacts_of

TIGHT = DOP853(rtol=1e-12, atol=1e-14, max_steps=20_000)
# The whole run, which is only looked at, ends after this many: more than tell that jumps repeat endlessly.
MOST_OF_WHOLE = 2000
# A run is discarded if looser tolerances move its end by more than this, relative to its size.
SENSITIVE = 1e-6


def as_case(case: object) -> Case:
    """Return a case, or raise an ArgumentError."""
    return arguments.instance("case", case, Case, "Draw one with hybrid.testing.cases.")


@attrs.frozen(eq=False, repr=False)
class Case:
    """A start, a span of time and parameter values: one example for the properties.

    Attributes
    ----------
    system
        The model.
    parameters
        Values of all parameters, by name.
    mode
        Mode in which the run starts; None if no mode allows the state.
    x0, t0, t1
        State ``(n,)`` at the start, and the time span.
    fraction
        Between 0 and 1: selects the jump to examine, where to split or cut the run, and the factor of the
        guards.
    passable
        Names of transitions whose guard the state may cross and stay in the same mode.
    solver
        Method and tolerances of every run.
    engine
        Computes the runs.
    laws
        What the author knows; by default the laws that the system carries.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case
    >>> ball = models.bouncing_ball()
    >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6)
    >>> len(case.run.arc.jumps), case.field("flight", 0.0, (1.0, 0.0))
    (1, array([ 0.  , -9.81]))
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
    laws: Laws = attrs.Factory(lambda self: laws_of(self.system), takes_self=True)

    def __repr__(self) -> str:
        return f"Case({self.told()})"

    def _repr_pretty_(self, printer: Any, cycle: bool) -> None:
        """How Hypothesis and IPython print a case: in one line, without the functions of its system."""
        printer.text(repr(self))

    def told(self) -> str:
        """The case in words; names only the parameters that differ from the declared values."""
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

    def named(self, x: Any) -> Any:
        """A state ``(n,)`` as model functions get it, so that ``case.named(x).q`` is a component.

        Examples
        --------
        >>> import models
        >>> ball = models.bouncing_ball()
        >>> case = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.3)
        >>> round(float(case.named(case.run.arc.x[0]).q), 9)
        1.0
        """
        return named_values("state components", self.system.state_names, x)

    def field(self, mode: str, t: float, x: Any) -> np.ndarray:
        """The vector field ``(n,)`` of a mode at ``(t, x)``, with the parameters of this case."""
        return self.evaluate(self.rates_of(mode), t, x)

    def law(self, name: str, t: float, x: Any, mode: str | None = None) -> float:
        """The quantity of a law of states, such as an energy, at ``(t, x)`` in a mode.

        Without ``mode`` this is the mode that the case starts in. The quantity is nan where the law says
        nothing of the mode.

        Raises
        ------
        ArgumentError
            If the case has no law of that name.
        """
        laws = [law for some in self.laws.in_modes.values() for law in some]
        arguments.known("Law", name, [law.name for law in laws], "Laws")
        mode = mode or self.mode
        names = () if mode is None else self.names_of_mode(mode)
        found = [law.in_mode(*names) for law in laws if law.name == name]
        function = next((each for each in found if each is not None), None)
        return np.nan if function is None else float(self.evaluate(function, t, x)[0])

    def mode_of(self, name: str) -> Mode:
        """The mode of that name."""
        return self.system.modes[self.system.mode_index(name)]

    def rates_of(self, name: str) -> Function:
        """The field of the mode of that name, with the rate 0 of what is held or counts."""
        return field_function(self.mode_of(name), self.system.variables).value

    @cached_property
    def values(self) -> np.ndarray:
        """Parameter vector ``(m,)``."""
        return self.system.parameter_values(self.parameters)

    def evaluate(self, function: Any, t: float, x: Any, row: int = 0) -> np.ndarray:
        """Evaluate a model function in plain Python, as a flat array; discard the example if not finite.

        ``row`` is that of a schedule that fires.
        """
        state = np.asarray(x, dtype=float)
        values = evaluate(self.system.variables, function, t, state, self.values, row=row)
        if values is None:
            discard("a model function is not finite")
        return np.asarray(values)

    def after(self, jump: Jump, t: float, x: Any) -> np.ndarray:
        """The state ``(n,)`` after the transition of a jump, from ``(t, x)``."""
        reset = reset_function(self.transition(jump), self.system.variables)
        return np.array(x, dtype=float) if reset is None else self.evaluate(reset.value, t, x, jump.row or 0)

    def is_wall(self, transition: Transition) -> bool:
        """Whether no state lies beyond the guard of a transition, in its direction, and stays in the mode.

        Some may for a two-way guard, a marker, a guard with a condition, which may not hold, and one of time
        alone, which says nothing of the state.
        """
        guard = transition.guard
        if guard.direction == 0 or transition.is_marker or guard.when is not None:
            return False
        return not self.is_passed(transition)

    def is_passed(self, transition: Transition) -> bool:
        """Whether the state goes on beyond a guard in the same mode: a clock, a counter, a membrane."""
        return transition.name in self.passable or is_passed(self.system, transition.name)

    def slope(self, function: ModelFunction, owner: str, t: float, x: np.ndarray) -> np.ndarray:
        """The derivative ``(rows, n + 1)``, as runs use it, of a function of mode or transition ``owner``."""
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
        """The transition of a jump."""
        return self.system.transitions[self.system.transition_index(jump.transition)]

    def names_of_mode(self, name: str) -> tuple[str | None, ...]:
        """The name of a mode, and that of the mode that it is a part of."""
        return name, self.mode_of(name).part_of

    def names_of_transition(self, name: str) -> tuple[str | None, ...]:
        """The name of a transition, and that of the one that it is a copy of."""
        return name, self.system.transitions[self.system.transition_index(name)].part_of

    def simulate(
        self,
        t1: float,
        *,
        system: HybridSystem | None = None,
        start: tuple[float, Any, str | None] | None = None,
        extra: Mapping[str, float] | None = None,
        **options: Any,
    ) -> HybridArc:
        """Run this case or a changed system to ``t1``, from the start of the case or from another start."""
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
        """The run of the case; the example is discarded if its run cannot be judged.

        A run that chatters, grazes or ends early is cut short before that. A run cannot be judged if two
        guards are reached together, or if its events or its end depend on the tolerances.
        """
        found = self._run
        if isinstance(found, str):
            discard(found)
        return found

    @property
    def whole(self) -> HybridArc:
        """The whole run, however it ends; the example is discarded if no mode allows the start."""
        arc = self.whole_if_any
        return discard("no mode allows the start") if arc is None else arc

    @cached_property
    def whole_if_any(self) -> HybridArc | None:
        """The whole run, however it ends; None if no mode allows the start."""
        if self.mode is None:
            return None
        try:
            return self.simulate(self.t1, max_jumps=MOST_OF_WHOLE)
        except ArgumentError:
            return None

    def guard_size(self, transition: Transition) -> float:
        """The largest absolute value of a guard on the whole run, in any mode."""
        if transition.name not in self._guard_sizes:
            arc, function = self.whole, transition.guard.function
            rows = zip(arc.t, arc.x, strict=True)
            found = [evaluate(self.system.variables, function, t, x, self.values) for t, x in rows]
            sizes = [abs(float(values[0])) for values in found if values is not None]
            self._guard_sizes[transition.name] = max(sizes, default=0.0)
        return self._guard_sizes[transition.name]

    @cached_property
    def _guard_sizes(self) -> dict[str, float]:
        return {}

    @property
    def duration(self) -> float:
        """How long the run of the case takes."""
        return float(self.run.t1 - self.t0)

    @cached_property
    def _run(self) -> Run | str:
        if self.mode is None:
            return f"no mode allows the start: {lies_beyond(self)}"
        arc, cut = self.whole_if_any, ""
        if arc is None:
            return "a run cannot start there"
        t1 = self.t1
        if not is_clean(arc) or len(arc.jumps) > MOST_JUMPS:
            t1, cut = before_trouble(arc)
            arc = self.simulate(t1)
        if not is_clean(arc):
            return f"the run failed: {arc.status}" if not arc.status.ok else "the run grazes or chatters"
        if not np.all(arc.jumps.transversality):
            return "a guard is reached without speed"
        last = arc.jumps.t[-1] if len(arc.jumps) else self.t0
        if not t1 - last > 1e-6 * (t1 - self.t0):
            return "the run ends at an event"
        other = self.simulate(t1, solver=self.looser)
        if not np.array_equal(other.jumps.transition_index, arc.jumps.transition_index):
            return "the events of the run depend on the tolerances"
        scale = sizes_along(
            self.system,
            self.values,
            arc,
            lambda function, index, t, x: self.engine.derivative(
                self.system, function, index, t, x, self.values
            ),
        )
        error = np.abs(arc.x[-1] - other.x[-1])
        if not np.all(error <= SENSITIVE * scale):
            return "the end of the run depends on the tolerances"
        return Run(arc, t1, error, scale, cut)

    def the_jump(self) -> Jump:
        """The jump of the run that ``fraction`` selects; the example is discarded if the run has no jump."""
        jumps = self.run.arc.jumps
        if not len(jumps):
            discard("no event on the run")
        return jumps[int(self.fraction * len(jumps))]

    def follows_at_once(self, jump: Jump) -> bool:
        """Whether a jump of the run follows another at its instant: the state has landed beyond its guard."""
        return jump.j > 0 and self.run.arc.jumps.t[jump.j - 1] == jump.t

    def fail(self, property_name: str, *lines: str, hint: str, time: float | None = None) -> NoReturn:
        """Raise a PropertyError that describes the case; ``time`` is that on the run at which it fails."""
        told = "\n".join(f"  {line}" for line in lines)
        name = self.system.name or "the system"
        raise PropertyError(
            f"{property_name}: this does not hold for {name}.\n{told}\n"
            f"  case: {self.told()}\n  likely: {hint}",
            time,
        )


def lies_beyond(case: Case) -> str:
    """In words: the guards that forbid the start of a case."""
    told = [f"the gap of contact {name!r}" for name in negative_gaps(case)]
    for transition in () if told else case.system.transitions:
        value = guard_beyond(case, transition, case.t0, case.x0)
        if not value < 0.0:
            told.append(f"guard {transition.name!r} of mode {transition.source!r}")
    for law in case.laws.invariant:
        values = [float(case.evaluate(each, case.t0, case.x0)[0]) for each in law.formulas]
        if not all(value >= 0.0 for value in values):
            told.append(f"invariant {law.name!r}" + (f" of mode {law.of!r}" if law.of else ""))
    return "it lies beyond " + ", ".join(told) if told else "a guard is not finite"


def negative_gaps(case: Case) -> list[str]:
    """The contacts whose gap is negative at the start of a case; none of a system without contacts."""
    growth = contacts_of(case.system)
    if growth is None:
        return []
    gaps = growth.mechanics.at(case.t0, np.array(case.x0), case.values).gaps
    return [each.name for each, gap in zip(growth.contacts, gaps, strict=True) if gap < 0.0]


def guard_beyond(case: Case, transition: Transition, t: float, x: Any) -> float:
    """The guard times its direction, negative before it fires; -inf where it is no wall."""
    if not case.is_wall(transition):
        return -np.inf
    values = evaluate(
        case.system.variables, transition.guard.function, t, np.asarray(x, dtype=float), case.values
    )
    return np.nan if values is None else float(transition.guard.direction * values[0])


def stretches(case: Case) -> Iterator[tuple[int, str | None, float, float]]:
    """Stretches between events: number of events before, mode, start, length; very short ones are skipped."""
    jumps, t1 = case.run.arc.jumps, case.run.t1
    times = [case.t0, *jumps.t, t1]
    for j in range(len(times) - 1):
        length = times[j + 1] - times[j]
        if length > 1e-9 * (t1 - case.t0):
            yield j, mode_after(jumps[j - 1]) if j else case.mode, times[j], length
