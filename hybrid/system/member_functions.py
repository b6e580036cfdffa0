"""Model functions of a system from those of the members of its repeats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid.arguments import shown
from hybrid.errors import ModelError, unknown_name
from hybrid.system.elements import Function
from hybrid.system.labels import plain_name
from hybrid.system.members import full_name
from hybrid.system.watched import Wrapper


@attrs.frozen
class MemberFunction(Wrapper):
    """A function of a member as one of the system: the index of the member is its last argument."""

    function: Function
    index: int

    @property
    def called(self) -> tuple[Function, ...]:
        """The user's function."""
        return (self.function,)

    def __call__(self, *arguments: Any) -> Any:
        """The value for this member."""
        return self.function(*arguments, self.index)


@attrs.frozen
class MemberReset(Wrapper):
    """The reset of a member as one of the system: a dict of what changes, by full names."""

    function: Function
    group: str
    index: int
    names: tuple[str, ...]

    @property
    def called(self) -> tuple[Function, ...]:
        """The user's function."""
        return (self.function,)

    def __call__(self, t: Any, x: Any, p: Any) -> dict[str, Any]:
        """What changes."""
        value = self.function(t, x, p, self.index)
        if not isinstance(value, dict):
            value = _in_order(f"{self.group}[{self.index}]", value, self.names)
        found: dict[str, Any] = {}
        for given, each in value.items():
            name = plain_name(given)
            full = full_name(self.group, self.index, name) if name in self.names else name
            if full in found:
                raise ModelError(f"{full!r} is given twice. Give each component one value.")
            found[full] = each
        return found


@attrs.frozen(eq=False)
class Part:
    """The fields of the members of one repeat.

    ``names`` are the components that move, ``function(t, x, p, i)`` gives their rates.
    """

    group: str
    count: int
    names: tuple[str, ...]
    function: Function

    def rates(self, t: Any, x: Any, p: Any) -> list[Any]:
        """The rates of all members in order."""
        return [each for i in range(self.count) for each in self._of_member(t, x, p, i)]

    def _of_member(self, t: Any, x: Any, p: Any, i: int) -> list[Any]:
        """The rates of one member in order."""
        return _rates(f"{self.group}[{i}]", self.function(t, x, p, i), self.names)


@attrs.frozen(eq=False)
class JoinedField(Wrapper):
    """The field of a mode: the rates of the system's ``names``, then those of the members."""

    own: Function
    names: tuple[str, ...]
    parts: tuple[Part, ...]

    @property
    def called(self) -> tuple[Function, ...]:
        """The user's functions."""
        return (self.own, *(part.function for part in self.parts))

    def __call__(self, t: Any, x: Any, p: Any) -> list[Any]:
        """The rates of all components that have one."""
        own = _rates("the system", self.own(t, x, p), self.names)
        return own + [rate for part in self.parts for rate in part.rates(t, x, p)]


def _rates(owner: str, value: Any, names: Sequence[str]) -> list[Any]:
    """Rates in the order of their names, from a dict or in this order."""
    if not isinstance(value, Mapping):
        value = _in_order(owner, value, names)
    rates = {plain_name(name): rate for name, rate in value.items()}
    for name in rates:
        if name not in names:
            raise ModelError(unknown_name(f"{owner}: component", name, names, "With a field"))
    missing = [name for name in names if name not in rates]
    if missing:
        raise ModelError(
            f"{owner} lacks the rate of {', '.join(missing)}. Return one rate for each of {', '.join(names)}."
        )
    return [rates[name] for name in names]


def _in_order(owner: str, value: Any, names: Sequence[str]) -> dict[str, Any]:
    """Values in order by their names."""
    ordered = value.ndim > 0 if isinstance(value, np.ndarray) else isinstance(value, Sequence)
    if not ordered or isinstance(value, str):
        raise ModelError(
            f"{owner}: the values must be a dict by name, or in order: {', '.join(names) or 'none'}; got "
            f"{shown(value)}."
        )
    if len(value) != len(names):
        raise ModelError(
            f"{owner}: {len(value)} values were returned for {len(names)} components "
            f"({', '.join(names) or 'none'}). Return one value for each."
        )
    return dict(zip(names, value, strict=True))
