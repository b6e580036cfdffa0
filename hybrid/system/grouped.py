"""What model functions get if a system has members of a repeat: ``x.cell[3].soc``, ``x.cell.soc``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from operator import index, itemgetter
from typing import Any

import attrs
import numpy as np

from hybrid.errors import ModelError, unknown_name
from hybrid.system.members import member_name

# Classes of arrays for numbers that NumPy does not know, by the class of the numbers.
ARRAYS: dict[type, type[np.ndarray]] = {}


class UnknownComponentError(ModelError, AttributeError):
    """A model function asked for a state or a parameter that the system does not have."""


class UnknownMemberError(ModelError, IndexError):
    """A model function asked for a member that a repeat does not have."""


@attrs.frozen(eq=False)
class Layout:
    """Where the values of the members are.

    Attributes
    ----------
    kind
        Plural noun for the names, as error texts list them.
    group
        Name of the repeat.
    members
        For each member a class of named values and the places of these values.
    """

    kind: str
    group: str
    members: tuple[tuple[type[Any], tuple[int, ...]], ...]


class Members:
    """The members of a repeat in a state or among parameters.

    ``cell[3].soc`` is the value of one member, ``cell.soc`` an array with the value of each.
    """

    __slots__ = ("_layout", "_values")

    def __init__(self, layout: Layout, values: tuple[Any, ...]) -> None:
        self._layout, self._values = layout, values

    def __len__(self) -> int:
        return len(self._layout.members)

    def __iter__(self) -> Iterator[Any]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, key: Any) -> Any:
        members = self._layout.members
        if isinstance(key, slice):
            return Members(attrs.evolve(self._layout, members=members[key]), self._values)
        try:
            kind, places = members[index(key)]
        except IndexError:
            group, last = self._layout.group, len(members) - 1
            raise UnknownMemberError(
                f"{group}[{key}] does not exist: {group} has {len(members)} members, {group}[0] to "
                f"{group}[{last}]. Write a condition on the index, such as i < {last}."
            ) from None
        values = self._values
        return kind._make([values[place] for place in places])

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("__"):
            raise AttributeError(name)
        found = []
        for kind, places in self._layout.members:
            if name not in kind._fields:
                kinds = self._layout.kind
                what = f"{kinds.removesuffix('s')} of {self._layout.group}"
                raise UnknownComponentError(unknown_name(what, name, kind._fields, kinds))
            found.append(self._values[places[kind._fields.index(name)]])
        return gathered(found)


def gathered(values: list[Any]) -> np.ndarray:
    """Values as an array that a model function cannot change: that would not change the state."""
    kind = ARRAYS.get(type(values[0])) if values else None
    found = np.array(values) if kind is None else np.array(values, dtype=object).view(kind)
    found.flags.writeable = False
    return found


def grouped_class(
    kind: str, letter: str, names: tuple[str, ...], plain: Callable[[str, tuple[str, ...]], type[Any]]
) -> type[Any]:
    """A class of tuples for values of which some belong to members.

    Parameters
    ----------
    kind, letter
        Plural noun for the names, and what model functions call their values.
    names
        All names in order, such as ``i``, ``cell[0].soc``, ``cell[1].soc``.
    plain
        ``plain(kind, names)`` makes a class of values with plain names.
    """
    own: list[str] = []
    groups: dict[str, dict[int, dict[str, int]]] = {}
    attributes: dict[str, Any] = {"__slots__": (), "_fields": names, "_make": classmethod(tuple.__new__)}
    for place, name in enumerate(names):
        attributes[name] = property(itemgetter(place))
        parts = member_name(name)
        if parts is None:
            own.append(name)
        else:
            groups.setdefault(parts.group, {}).setdefault(parts.number, {})[parts.name] = place
    for group, members in groups.items():
        # Of the parameters of a member some may be states, and their names are missing here.
        each = [members.get(i, {}) for i in range(max(members) + 1)]
        found = tuple((plain(kind, tuple(places)), tuple(places.values())) for places in each)
        attributes[group] = _reader(Layout(kind, group, found))
    known = (*own, *groups)

    def __getattr__(self: Any, name: str) -> Any:
        raise UnknownComponentError(unknown_name(kind.removesuffix("s"), name, known, kind))

    def __getitem__(self: Any, key: Any) -> Any:
        if isinstance(key, str):
            getattr(self, key)
            raise ModelError(f"{letter}[{key!r}] is written {letter}.{key}: names are attributes here.")
        return tuple.__getitem__(self, key)

    attributes |= {"__getattr__": __getattr__, "__getitem__": __getitem__}
    return type(kind.title().replace(" ", ""), (tuple,), attributes)


def _reader(layout: Layout) -> property:
    return property(lambda values: Members(layout, values))
