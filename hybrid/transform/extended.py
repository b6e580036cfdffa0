"""Parameters as states that do not move: what depends on them is then carried by tangent vectors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import attrs
import numpy as np

from hybrid.expression.reads import names_read
from hybrid.expression.values import TraceError
from hybrid.system.clocks import Clock, numbers_of
from hybrid.system.derived_clock import DerivedClock
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.functions import WholeField, WholeReset
from hybrid.system.graph import HybridSystem, watched_below
from hybrid.system.growth import finished
from hybrid.system.laws import Laws
from hybrid.system.moving import moving_numbers
from hybrid.system.portable import made_by
from hybrid.system.variables import PARAMETERS, STATE, named_values

_EXTENDED: WeakKeyDictionary[HybridSystem, dict[tuple[str, ...], HybridSystem]] = WeakKeyDictionary()


def extended(system: HybridSystem, names: tuple[str, ...]) -> HybridSystem:
    """The system with these parameters as held components, which every reset leaves as they are.

    They come last of what has tangent vectors; in a state without names they are components at its end whose
    rates are 0. A tangent vector along such a component is the derivative of the flow in the parameter, and a
    guard that moves with the parameter has a gradient there, so that the saltation matrix moves the event. If
    the period depends on one of the parameters the system has none: time is a plain number.
    """
    made = _EXTENDED.setdefault(system, {})
    if names not in made or not made[names].derived_from.holds():
        made[names] = made_by(_Extension(system, names).system(), extended, system, names)
    return made[names]


def with_parameters(system: HybridSystem, x: np.ndarray, values: np.ndarray) -> np.ndarray:
    """A state of an extended system with these parameters, from one of the original or of itself."""
    m = len(values)
    last = system.tangent_dimension
    counters = system.dimension - last
    return np.concatenate([x[: last - m], values, x[len(x) - counters :]])


class _Extension:
    def __init__(self, system: HybridSystem, names: tuple[str, ...]) -> None:
        self.original, self.names = system, names
        self.first, self.last = system.tangent_dimension, system.tangent_dimension + len(names)
        self.places = {name: self.first + i for i, name in enumerate(names)}
        self.kept = tuple(name for name in system.parameters if name not in names)

    def system(self) -> HybridSystem:
        original = self.original
        unnamed = isinstance(original.state, int)
        return attrs.evolve(
            original,
            state=self.last if unnamed else original.state,
            held=original.held if unnamed else (*original.held, *self.names),
            parameters={name: original.parameters[name] for name in self.kept},
            modes=[self._mode(mode) for mode in original.modes],
            transitions=[self._transition(each) for each in original.transitions],
            period=self._period(),
            units={},
            outputs={},
            laws=Laws(),
            notes=(),
            growth=finished(original).growth,
            derived_from=watched_below(original),
        )

    def _mode(self, mode: Mode) -> Mode:
        rates = self._function(mode.field)
        if isinstance(self.original.state, int):
            rates = WholeField(rates, len(self.names))
        holds = None if mode.holds is None else self._function(mode.holds)
        return attrs.evolve(mode, field=rates, jacobian=None, holds=holds)

    def _transition(self, transition: Transition) -> Transition:
        guard, reset, first, last = transition.guard, transition.reset, self.first, self.last
        new = None
        if reset is not None:
            values = self._function(WholeReset(reset.function, self.original.variables.components))

            def after(t: Any, x: Any, p: Any) -> Any:
                found = tuple(values(t, x, p))
                return (*found[:first], *x[first:last], *found[first:])

            new = Reset(after)
        when = None if guard.when is None else self._function(guard.when)
        moved: Guard | Clock
        if isinstance(guard, Clock):

            def numbers(x: Any, p: Any, clock: Clock = guard) -> tuple[Any, ...]:
                return numbers_of(clock, self._own(x), self._all_parameters(x, p))

            moving = moving_numbers(transition, self.original.variables)
            moved = DerivedClock(guard, numbers, when, guard.age, moving)
        else:
            moved = Guard(self._function(guard.function), guard.direction, when=when, at_start=guard.at_start)
        return attrs.evolve(transition, guard=moved, reset=new)

    def _period(self) -> Any:
        period = self.original.period
        if self.original.first_tick[-1]:
            # The derivative of a tick in its period grows with its number, which no phase tells.
            return None
        if not callable(period):
            return period
        try:
            reads = names_read(self.original, lambda t, x, p: period(p))
        except TraceError:
            return None
        if not reads.isdisjoint(self.names):
            return None
        return lambda p: period(self._parameters(p, self.original.parameters.__getitem__))

    def _all_parameters(self, x: Any, p: Any) -> Any:
        return self._parameters(p, lambda name: x[self.places[name]])

    def _parameters(self, p: Any, moved: Callable[[str], Any]) -> Any:
        """All parameters of the original, those that are states from ``moved``."""
        names = tuple(self.original.parameters)
        values = [moved(name) if name in self.names else getattr(p, name) for name in names]
        return named_values(PARAMETERS, names, values)

    def _function(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function of the original system as one of the extended state."""
        return lambda t, x, p: function(t, self._own(x), self._all_parameters(x, p))

    def _own(self, x: Any) -> Any:
        """The state of the original system."""
        original, first, last = self.original, self.first, self.last
        if isinstance(original.state, int):
            return x[:first]
        return named_values(STATE, original.state_names, (*x[:first], *x[last:]))
