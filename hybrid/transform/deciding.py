"""What systems share whose transitions are decided where a run first needs them.

A mode has a list of events that it looks out for. What follows an event is decided at the state of a run that
gets there, and written down as a transition with the conditions under which the same follows. Where none of
the transitions of an event holds, the run ends, and what follows is decided there.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import reduce
from typing import Any

import attrs

from hybrid.expression.evaluation import expressed, scalar
from hybrid.expression.nodes import ONE, Expression
from hybrid.expression.operations import And, Not
from hybrid.system.clocks import Clock
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.growth import Finished, Place
from hybrid.system.outputs import Output
from hybrid.transform.stages import Stages, numbered


@attrs.frozen
class NothingDecided:
    """Why nothing is decided: the name of the transition that ends the run."""

    name: str


@attrs.frozen(eq=False)
class Written:
    """A decision as expressions in the state at the event.

    Attributes
    ----------
    conditions
        What must hold for it.
    state
        The state after it; None if it stays.
    """

    conditions: list[Expression]
    state: list[Expression] | None


@attrs.define(eq=False)
class Watch:
    """An event that a mode looks out for, and what may happen then.

    Attributes
    ----------
    source, now
        The mode, by its name and by what holds there.
    event, guard
        What is looked out for.
    title
        What happens, in names of transitions.
    asked
        What has to hold for the event to count.
    cases
        The transitions that have been made, each with its condition.
    undecided
        Why a run has ended here.
    decisions
        What these transitions stand for.
    """

    source: str
    now: Any
    event: Any
    guard: Guard | Clock
    title: str
    asked: Expression = ONE
    cases: list[tuple[Transition, Expression]] = attrs.field(factory=list)
    undecided: Any = None
    decisions: list[Any] = attrs.field(factory=list)


@attrs.frozen(eq=False)
class Origin:
    """The call that has made a system: copies are made by it."""

    make: Callable[..., HybridSystem]
    called: Mapping[str, Any]


class Deciding(Stages):
    """Makes transitions as runs need them."""

    def __init__(self, original: HybridSystem, origin: Origin) -> None:
        super().__init__()
        self.original, self.origin, self.called = original, origin, origin.called
        self.why: dict[str, str] = {}

    @property
    def told(self) -> Mapping[str, str]:
        """By transition: why a run ends there, in words."""
        return self.why

    def __reduce__(self) -> tuple[Any, ...]:
        return _made_again, (self.origin.make, self.origin.called)

    def extend(self, transition: str, place: Place, known: Collection[str]) -> bool:
        """Make what happens at the end of a run; False if nothing can: the run ends there."""
        with self.lock:
            watch = self.frontier[transition]
            decision = self._decided(watch, place)
            if isinstance(decision, NothingDecided):
                watch.undecided = decision
                self.why[transition] = self._why(watch, decision, place)
                ends = self._frontier_name(watch, decision.name) in known
                self.stage = self.stage if ends else None
                return not ends
            if decision in watch.decisions:
                made, _ = watch.cases[watch.decisions.index(decision)]
                if made.name not in known:
                    return True
                # It holds in numbers and not in the compiled code: all depends on rounding.
                self.why[transition] = "What happens there depends on rounding."
                return False
            self._follow(watch, decision, place)
            self.stage = None
            return True

    @property
    @abstractmethod
    def given(self) -> list[Expression]:
        """What the author gives; each mode reads some of it."""

    @abstractmethod
    def _decided(self, watch: Watch, place: Place) -> Any:
        """What happens at an event, or `NothingDecided`."""

    @abstractmethod
    def _why(self, watch: Watch, undecided: Any, place: Place) -> str:
        """Why a run ends where nothing is decided."""

    @abstractmethod
    def _follow(self, watch: Watch, decision: Any, place: Place) -> None:
        """Make the transitions of a decision."""

    @abstractmethod
    def _all_watches(self) -> Iterator[Watch]:
        """The events of all modes."""

    def _add(
        self, watch: Watch, written: Written, target: str, title: str, accumulates_to: str | None = None
    ) -> None:
        """Make the transition of a case to a mode."""
        condition: Expression = reduce(And, written.conditions) if written.conditions else ONE
        asked = reduce(And, (Not(each) for _, each in watch.cases), And(watch.asked, condition))
        transition = Transition(
            watch.source,
            target,
            _asking(watch.guard, asked),
            None if written.state is None else Reset(expressed(written.state)),
            accumulates_to=accumulates_to,
            name=self._unused(f"{watch.source}->{target} by {title}"),
            part_of=title,
        )
        watch.cases.append((transition, condition))

    def _unused(self, name: str) -> str:
        used = {each.name for watch in self._all_watches() for each, _ in watch.cases}
        return next(each for each in numbered(name) if each not in used)

    @abstractmethod
    def _outputs(self) -> dict[str, Output]:
        """What is told in the modes that have been made."""

    def _with_modes(self, modes: Sequence[Mode], notes: Iterable[str]) -> HybridSystem:
        """The system with the modes that have been made, and with notes besides its own."""
        given: dict[str, Any] = {
            "modes": modes,
            "transitions": self._transitions(),
            "outputs": {**self.original.outputs, **self._outputs()},
            "notes": (*self.original.notes, *notes),
            "growth": self,
        }
        return attrs.evolve(self.original, **given)

    def _transitions(self) -> list[Transition]:
        """The transitions that have been made, and those that end a run where none of these holds."""
        found: list[Transition] = []
        for watch in self._all_watches():
            found += [each for each, _ in watch.cases]
            onward = self._frontier(watch)
            if onward is not None:
                found.append(onward)
        return found

    def _frontier(self, watch: Watch) -> Transition | None:
        """The transition that ends a run where none of the cases that have been made holds."""
        condition: Expression = reduce(And, (Not(each) for _, each in watch.cases), watch.asked)
        if condition == 0:
            return None
        part = watch.title if watch.undecided is None else watch.undecided.name
        name = self._frontier_name(watch, part)
        return Transition(watch.source, None, _asking(watch.guard, condition), name=name, part_of=part)

    def _frontier_name(self, watch: Watch, part: str) -> str:
        """A name that stays: a run in another thread may still be on an earlier stage."""
        first = part if watch.undecided is not None else f"{watch.source}: {part}"
        return next(each for each in numbered(first) if self.frontier.setdefault(each, watch) is watch)


def _asking(guard: Any, condition: Expression) -> Any:
    """A guard, or a clock, with a condition."""
    return attrs.evolve(guard, when=None if condition == 1 else scalar(condition))


def _made_again(make: Callable[..., HybridSystem], called: Mapping[str, Any]) -> Any:
    """The growth of a system that has been pickled."""
    growth = make(**called).growth
    assert isinstance(growth, Deciding), "the call makes a system that grows"
    return growth


def decided_by(system: HybridSystem) -> Deciding | None:
    """What decides the transitions of a system, or decided those that it has; None for other systems."""
    growth = system.growth
    made_by = growth.of if isinstance(growth, Finished) else growth
    return made_by if isinstance(made_by, Deciding) else None
