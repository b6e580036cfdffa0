"""Members of a repeat by name: ``cell[3].soc`` is one of a member, ``cell.soc`` is that of all members."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from hybrid.errors import ArgumentError, ModelError, shown

_FULL_NAME = re.compile(r"([^\W\d]\w*)\[(0|[1-9]\d*)\]\.((?:[^\[\],<>=]|->)+)")
# Signs that a name of a member cannot have, as the names of modes that are made from sides have them, such as
# ``cell[3].v>0``; an arrow is none.
RESERVED = "[],<>="
# Numbers of tuples of names, and of names, whose parts are kept.
MOST_TUPLES, MOST_NAMES = 256, 20_000


class MemberName(NamedTuple):
    """The parts of a name such as ``cell[3].soc``."""

    group: str
    number: int
    name: str

    @property
    def shared(self) -> str:
        """The name for all members: ``cell.soc``."""
        return f"{self.group}.{self.name}"


def full_name(group: str, index: int, name: str) -> str:
    """The name of what belongs to one member."""
    return f"{group}[{index}].{name}"


@lru_cache(MOST_NAMES)
def member_name(name: str) -> MemberName | None:
    """The parts of a name; None if it is not that of a member."""
    found = _FULL_NAME.fullmatch(name)
    return None if found is None else MemberName(found[1], int(found[2]), found[3])


def shared_name(name: str) -> str:
    """The name for all members, such as ``cell.soc``; the name itself if it belongs to no member."""
    found = member_name(name)
    return name if found is None else found.shared


def about_all(text: str, name: str) -> str:
    """A text about what the member of this name reads, as one about all members; another text as it is."""
    parts = member_name(name)
    return (
        text if parts is None else text.replace(full_name(parts.group, parts.number, ""), f"{parts.group}.")
    )


@lru_cache(MOST_TUPLES)
def shared_names(names: tuple[str, ...]) -> Mapping[str, tuple[str, ...]]:
    """Names for all members, each with the names of the members that it stands for, in order."""
    found: dict[str, list[str]] = {}
    for name in names:
        parts = member_name(name)
        if parts is not None:
            found.setdefault(parts.shared, []).append(name)
    return MappingProxyType({shared: tuple(each) for shared, each in found.items()})


@lru_cache(MOST_TUPLES)
def groups_in(names: tuple[str, ...]) -> Mapping[str, int]:
    """The names of repeats that have members among these names, with the number of members."""
    found: dict[str, int] = {}
    for parts in filter(None, map(member_name, names)):
        found[parts.group] = max(found.get(parts.group, 0), parts.number + 1)
    return MappingProxyType(found)


@lru_cache(MOST_TUPLES)
def condensed(names: tuple[str, ...]) -> tuple[str, ...]:
    """The names with one name for all members in place of those of the members."""
    return tuple(dict.fromkeys(map(shared_name, names)))


def is_identifier(name: object) -> bool:
    """Whether a text can be written as an attribute in a model function."""
    return isinstance(name, str) and name.isidentifier() and not keyword.iskeyword(name) and name[0] != "_"


def is_component_name(name: object) -> bool:
    """Whether a text names a component, a parameter, or that of a member: ``q``, ``cell[3].soc``."""
    if is_identifier(name):
        return True
    parts = member_name(name) if isinstance(name, str) else None
    return parts is not None and is_identifier(parts.group) and is_identifier(parts.name)


def spread(
    argument: str,
    given: dict[Any, Any],
    shared: Mapping[str, tuple[str, ...]],
    error: type[ModelError] = ArgumentError,
) -> dict[Any, Any]:
    """Values by name, with those of all members (``cell.soc``) given to each one.

    Such a value is one for all members, or has an entry for each along its last axis. What is given to
    a single member counts more. ``shared`` are the names for all members, from `shared_names`.

    Raises
    ------
    ModelError
        If there are more or fewer entries than members; of the class ``error``.
    """
    if not shared or shared.keys().isdisjoint(given):
        return given
    found: dict[Any, Any] = {}
    for name in shared.keys() & given.keys():
        title = f"{argument}: {name!r}"
        found |= zip(shared[name], entries(title, given[name], len(shared[name]), error), strict=True)
    return found | {name: value for name, value in given.items() if name not in shared}


def for_each(given: dict[Any, Any], names: tuple[str, ...]) -> dict[Any, Any]:
    """Values by name; one under a name for all members is that of each, as a range is."""
    shared = shared_names(names)
    found = {each: given[name] for name in shared.keys() & given.keys() for each in shared[name]}
    return found | {name: value for name, value in given.items() if name not in shared}


def entries(title: str, value: Any, count: int, error: type[ModelError] = ArgumentError) -> list[Any]:
    """The entry of each member: one value is that of all; otherwise the last axis has one for each."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        return [value] * count
    array = np.asarray(value)
    if array.ndim == 0:
        return [value] * count
    if array.shape[-1] != count:
        raise error(
            f"{title} must be one value for all, or one for each of the {count} members; got "
            f"{shown(value)}, whose length is {array.shape[-1]}."
        )
    return list(np.moveaxis(array, -1, 0))
