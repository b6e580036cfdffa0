"""The time since the entry of the mode as a component of the state, for what `After` does to derivatives.

A run itself needs no such component: its clock knows when the mode was entered. A perturbation of the run
needs it. The perturbed run enters the mode earlier or later, and leaves it as much earlier or later. That
holds also where nothing else of the perturbation is left: in a rest at a fixed state.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from itertools import count
from typing import Any

import attrs
import numpy as np

from hybrid.system.clocks import Clock, numbers_of
from hybrid.system.derived_clock import DerivedClock
from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.entries import begins_age, check_ages, has_age
from hybrid.system.functions import WholeReset
from hybrid.system.graph import HybridSystem, watched_below
from hybrid.system.growth import Growth, Place
from hybrid.system.moving import moving_numbers
from hybrid.system.portable import made_by
from hybrid.system.variables import STATE, named_values

AGE = "age"


def aged(system: HybridSystem) -> HybridSystem:
    """The system with the age, last of what has tangent vectors; itself if no clock counts from an entry.

    The age moves at the rate 1 in modes whose clocks count from the entry. It is zero in all others, and
    after each jump from which they count. The component is an ordinary one, so that saltation matrices,
    orbits and sensitivities need no rule for it. Held components become ones with the rate 0 before it.
    """
    if system.age is not None or not system.aging:
        return system
    check_ages(system)
    if system._aged is None or not system._aged.derived_from.holds():
        made = made_by(_Aging(system).system(), aged, system)
        object.__setattr__(system, "_aged", made)
    found: HybridSystem = system._aged
    return found


def original_of(system: HybridSystem) -> HybridSystem:
    """The system whose aged one this is; itself if there is none."""
    if system._made_by is None or system._made_by[0] is not aged:
        return system
    found: HybridSystem = system._made_by[1]
    return found


def with_age(system: HybridSystem, x: np.ndarray) -> np.ndarray:
    """States of the aged system ``(..., n + 1)`` where a mode is entered, from states of the system."""
    return np.insert(x, system.tangent_dimension, 0.0, axis=-1) if aged(system) is not system else x


def without_age(system: HybridSystem, x: np.ndarray) -> np.ndarray:
    """States of the system ``(..., n)`` from its own or those of the aged one."""
    return np.delete(x, system.tangent_dimension, axis=-1) if x.shape[-1] > system.dimension else x


def least_dimension(system: HybridSystem) -> int:
    """How many components with tangent vectors, the age among them, count in every mode."""
    everywhere = all(has_age(system, mode) for mode in system.mode_names)
    return aged(system).tangent_dimension - (bool(system.aging) and not everywhere)


class _Aging:
    def __init__(self, system: HybridSystem) -> None:
        self.original, self.age = system, system.tangent_dimension
        # The number of components that have a field of their own, and of those held.
        self.moving = system.variables.moving
        self.held = self.age - self.moving

    def system(self) -> HybridSystem:
        original, state = self.original, self.original.state
        return attrs.evolve(
            original,
            state=self.age + 1 if isinstance(state, int) else (*state, *original.held, self._name()),
            held=(),
            modes=[self._mode(mode) for mode in original.modes],
            transitions=[self._transition(each) for each in original.transitions],
            outputs={name: each.changed(self._function) for name, each in original.outputs.items()},
            derived_from=watched_below(original),
            growth=original.growth and _Growth(original.growth, original.growth.original),
        )

    def _name(self) -> str:
        variables = self.original.variables
        taken = {*variables.state_names, *variables.parameters}
        return next(name for k in count(1) if (name := AGE + (str(k) if k > 1 else "")) not in taken)

    def _mode(self, mode: Mode) -> Mode:
        rates = self._function(mode.field)
        rest = (0.0,) * self.held + (float(has_age(self.original, mode.name)),)
        holds = None if mode.holds is None else self._function(mode.holds)
        return attrs.evolve(mode, field=lambda t, x, p: (*rates(t, x, p), *rest), jacobian=None, holds=holds)

    def _transition(self, transition: Transition) -> Transition:
        guard, age = transition.guard, self.age
        when = None if guard.when is None else self._function(guard.when)
        moved: Guard | Clock
        if isinstance(guard, Clock):
            read = self._without_time(guard)
            moving = moving_numbers(transition, self.original.variables)
            moved = DerivedClock(guard, read, when, age if guard.counts_from_entry else None, moving)
        else:
            moved = Guard(self._function(guard.function), guard.direction, when=when, at_start=guard.at_start)
        reset, enters = transition.reset, begins_age(self.original, transition)
        if reset is None and not enters:
            return attrs.evolve(transition, guard=moved)
        values = None
        if reset is not None:
            values = self._function(WholeReset(reset.function, self.original.variables.components))

        def after(t: Any, x: Any, p: Any) -> Any:
            found = (*x[:age], *x[age + 1 :]) if values is None else tuple(values(t, x, p))
            return (*found[:age], 0.0 if enters else x[age], *found[age:])

        return attrs.evolve(transition, guard=moved, reset=Reset(after))

    def _without_time(self, clock: Clock) -> Callable[[Any, Any], tuple[Any, ...]]:
        """The numbers of a clock as a function of the aged state and the parameters."""
        return lambda x, p: numbers_of(clock, self._own(x), p)

    def _function(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """A function of the original system as one of the aged state."""
        return lambda t, x, p: function(t, self._own(x), p)

    def _own(self, x: Any) -> Any:
        """The state of the original system."""
        original = self.original
        if isinstance(original.state, int):
            return x[: self.age]
        return named_values(STATE, original.state_names, (*x[: self.age], *x[self.age + 1 :]))


@attrs.define(eq=False)
class _Growth:
    """The growth of a system as that of the aged one."""

    inner: Growth
    original: Any
    # What has been made of the aged functions is not what has been made of their originals.
    written: dict[Any, Any] = attrs.field(factory=dict)

    @property
    def current(self) -> Any:
        """The aged system with all modes that have been made so far."""
        return aged(self.inner.current)

    def leads_on(self, transition: str) -> bool:
        """Whether a transition leads to a mode that the system lacks."""
        return self.inner.leads_on(transition)

    @property
    def told(self) -> Mapping[str, str]:
        """Why runs end, in words."""
        return self.inner.told

    @property
    def ambiguous(self) -> Mapping[str, str]:
        """Where another order would lead elsewhere."""
        return self.inner.ambiguous

    def extend(self, transition: str, place: Place, known: Collection[str]) -> bool:
        """Make what follows a transition that has ended a run at a place."""
        t, x, parameters = place
        return self.inner.extend(transition, (t, without_age(self.inner.current, x), parameters), known)

    def place(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> bool:
        """Make the modes in which a run may start; whether there were any to be made."""
        return self.inner.place(t, without_age(self.inner.current, x), parameters, mode)

    def mode_at(self, t: float, x: np.ndarray, parameters: np.ndarray, mode: str | None) -> str | None:
        """The mode in which a run starts."""
        return self.inner.mode_at(t, without_age(self.inner.current, x), parameters, mode)
