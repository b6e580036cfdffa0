"""A mapping that cannot be changed, unlike a dict, and can be pickled and copied, unlike a mapping proxy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

Value = TypeVar("Value")


class FrozenMapping(Mapping[str, Value]):
    """The items of another mapping, read-only; ``frozen | {"e": 0.5}`` is a dict with a change."""

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, Value]) -> None:
        self._items = dict(items)

    def __getitem__(self, name: str) -> Value:
        return self._items[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __or__(self, other: Mapping[str, Value]) -> dict[str, Value]:
        return self._items | dict(other)

    def __ror__(self, other: Mapping[str, Value]) -> dict[str, Value]:
        return dict(other) | self._items

    def copy(self) -> dict[str, Value]:
        """A dict with the same items."""
        return self._items.copy()

    def __copy__(self) -> FrozenMapping[Value]:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> FrozenMapping[Value]:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenMapping, (self._items,)

    def __repr__(self) -> str:
        return repr(self._items)
