"""Numbers of clocks that resets may change: those that read a held component or a counter."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.errors import ModelError
from hybrid.system.clocks import Clock, Quantity
from hybrid.system.elements import Transition
from hybrid.system.members import full_name, groups_in
from hybrid.system.variables import Variables


def moving_numbers(transition: Transition, variables: Variables) -> tuple[int, ...]:
    """The places among the numbers of a transition's clock of those that resets may change.

    Raises
    ------
    ModelError
        If a number reads a component of the state that has a field.
    """
    clock = transition.clock
    if clock is None or isinstance(variables.state, int):
        return ()
    if clock.moving is not None:
        return clock.moving
    found, kept = [], {*variables.held, *variables.counters}
    for place, quantity in enumerate(clock.quantities):
        if isinstance(quantity, float):
            continue
        names = _asked(quantity, variables)
        _check(transition, clock, names & {*variables.state})
        if names & kept:
            found.append(place)
    return tuple(found)


def _check(transition: Transition, clock: Clock, flowing: set[str]) -> None:
    """ModelError if a clock reads components that have a field."""
    if flowing:
        name = min(flowing)
        raise ModelError(
            f"Transition {transition.name!r}: {type(clock).__name__} reads {name!r}, which has a field. A "
            "clock reads parameters, and components that resets alone change (held=, counters=). Hold the "
            f"value of {name!r} from a reset on, or write a Guard."
        )


def _asked(quantity: Quantity, variables: Variables) -> set[str]:
    """The names that a quantity reads."""
    if isinstance(quantity, str):
        return {quantity}
    asking = _Asking(variables)
    try:
        with np.errstate(all="ignore"):
            quantity(asking)
    except Exception:  # the trial call of the clock tells what is wrong
        pass
    return asking.asked


class _Asking:
    """Parameters that keep the names that they are asked for."""

    def __init__(self, variables: Variables) -> None:
        self.asked: set[str] = set()
        self._groups = groups_in((*variables.state_names, *variables.parameter_names))
        self._parameters = {name: np.float64(value) for name, value in variables.parameters.items()}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._groups:
            return _AskingMembers([_AskingMember(self, name, i) for i in range(self._groups[name])])
        return self.value(name)

    def value(self, name: str) -> Any:
        """The value of a parameter, or 1.0 for a component; the name is kept."""
        self.asked.add(name)
        return self._parameters.get(name, np.float64(1.0))

    def __iter__(self) -> Any:
        return iter(self._parameters.values())

    def __len__(self) -> int:
        return len(self._parameters)

    def __getitem__(self, place: Any) -> Any:
        return [*self._parameters.values()][place]


class _AskingMember:
    """The parameters of a member of a repeat, which keep the names that they are asked for."""

    def __init__(self, asking: _Asking, group: str, index: int) -> None:
        self._asking, self._group, self._index = asking, group, index

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return self._asking.value(full_name(self._group, self._index, name))


class _AskingMembers(list[_AskingMember]):
    """The same of all members."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return np.array([getattr(each, name) for each in self])
