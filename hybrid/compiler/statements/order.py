"""Which statements wait for which."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hybrid.compiler.statements.code import Statement, at


class Order:
    """How many statements each statement waits for, one after the other.

    A statement waits for those before it that write what it reads or writes, and for those that read what it
    writes. Columns that are counted from a variable lie apart from those that are numbers, and those of four
    numbers apart from those of single ones.
    """

    def __init__(self, whole: Mapping[str, int]) -> None:
        self.whole = whole
        self.read: dict[Any, int] = {}
        self.write: dict[Any, int] = {}

    def of(self, statement: Statement) -> int:
        """The level of the next statement; those of one level may come in any order."""
        reads, writes = list[Any](), list[Any]()
        if statement[0] == "do":
            _, array, *place, value = statement[1]
            target = at(array[1], *place)
        else:
            _, target, value = statement
        self._find(value, reads)
        for each in target[1:] if target[0] == "several" else [target]:
            if each[0] == "at":
                writes.append(self._cell(each[1], each[2:]))
                for index in each[2:]:
                    self._find(index, reads)
            else:
                writes.append(each[1])
        level = 0
        for key in reads:
            level = max(level, self._latest(self.write, key))
        for key in writes:
            level = max(level, self._latest(self.write, key), self._latest(self.read, key))
        for known, keys in ((self.read, reads), (self.write, writes)):
            for key in keys:
                for each in _covering(key):
                    known[each] = max(known.get(each, 0), level + 1)
        return level

    def _latest(self, known: dict[Any, int], key: Any) -> int:
        """The level behind all accesses so far that may be of the same place."""
        if type(key) is str:
            return known.get(key, 0)
        array, row, column = key
        if row is None:
            return known.get((array, "any", column), 0)
        return max(known.get(key, 0), known.get((array, None, column), 0))

    def _find(self, term: Any, found: list[Any]) -> None:
        """Append what a term reads."""
        if not isinstance(term, tuple):
            return
        operation, *parts = term
        if operation == "get":
            found.append(parts[0])
        elif operation in ("at", "load"):
            array, *place = parts
            found.append(self._cell(array if operation == "at" else array[1], place))
            for index in place:
                self._find(index, found)
        else:
            # A convolution reads orders that are complete: nothing that statements beside it write.
            for part in parts:
                self._find(part, found)

    def _cell(self, array: str, place: Sequence[Any]) -> Any:
        """A key for an entry: array, row if it is a number, and column."""
        if len(place) == 1:
            return array, 0, self._column(place[0])
        row, column = place
        return array, row if type(row) is int else None, self._column(column)

    def _column(self, term: Any) -> Any:
        """An index as the variables that it is counted from, and a number."""
        if type(term) is int:
            return (), term
        if term[0] == "get":
            return ((), self.whole[term[1]]) if term[1] in self.whole else ((term[1],), 0)
        if term[0] == "+":
            (one, first), (other, second) = map(self._column, term[1:])
            return tuple(sorted(one + other, key=str)), first + second
        return (term,), 0


def _covering(key: Any) -> list[Any]:
    """The keys under which an access is noted."""
    if type(key) is str:
        return [key]
    array, _, column = key
    return [key, (array, "any", column)]
