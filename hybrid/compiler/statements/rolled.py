"""Loops for statements that repeat: a chain of four hundred masses is as much code as one mass.

Statements repeat if they differ in numbers and names alone. Those that do not wait for one another become
one loop; what differs from turn to turn is a multiple of the turn, or comes from a list. Variables that are
set in such a loop, or that differ from turn to turn, are cells of an array.

Nothing is known of chains, rings or lattices here, and neither is of fields or series.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import attrs

from hybrid.compiler.statements.code import KNOWN, Code, Statement, at, bodies_in, call, get, put
from hybrid.compiler.statements.order import Order
from hybrid.kernels.types.codes import NARROW

# A loop with its lists is about as much code as so many statements; fewer stay as they are.
LEAST = 12
NUMBER, LANES, WHOLE, TRUTH, RESULT = range(5)
# The array of all cells of a kind.
CELLS = {NUMBER: "numbers", LANES: "lanes"}
TURN = get("turn")
# What calls return, if it is not a number.
RETURNED = {
    "load": LANES,
    "four_times": LANES,
    "convolved": LANES,
    "convolved_pairs": LANES,
    "four": LANES,
    "divided_dot_product": LANES,
    "length": WHOLE,
}
IN_WHOLE_NUMBERS = ("+", "-", "*", "//")
CONDITIONS = ("<", "<=", ">", ">=", "==", "!=", "and", "or", "not")


def rolled(statements: Sequence[Statement]) -> Sequence[Statement]:
    """The same statements with loops for those that repeat; as they are if there are none."""
    if sum(1 for _ in _simple(statements)) < LEAST:
        return statements
    roller = _Roller(statements)
    plan = roller.planned(statements)
    if not roller.has_loops:
        return statements
    arrays = [("array", name, roller.sizes[kind]) for kind, name in CELLS.items() if roller.sizes[kind]]
    return [*arrays, *roller.written(plan)]


def _simple(statements: Iterable[Statement]) -> Iterator[Statement]:
    """All statements but loops and branches, also those in them."""
    for statement in statements:
        bodies = bodies_in(statement)
        if not bodies:
            yield statement
        for body in bodies:
            yield from _simple(body)


@attrs.frozen
class _Repeated:
    """Statements of one shape that do not wait for one another; ``slots`` by statement, what differs."""

    statements: Sequence[Statement]
    slots: Sequence[Sequence[Any]]


class _Roller:
    """Plans which statements of a function become loops, then writes them."""

    def __init__(self, statements: Sequence[Statement]) -> None:
        self.whole = {each[1]: each[2] for each in statements if each[0] == "whole"}
        # The kinds of variables, and the place of each cell.
        self.kinds: dict[str, int] = {}
        self.cells: dict[str, tuple[int, int]] = {}
        self.sizes: Counter[int] = Counter()
        self.has_loops = False
        self.uses: Counter[str] = Counter()
        self._count((*statements,))
        for statement in _simple(statements):
            if statement[0] == "set":
                self._learn(statement[1], statement[2])

    def _count(self, term: Any) -> None:
        """Count the uses of variables; where one is set counts too. What items are taken of is a result."""
        if isinstance(term, tuple):
            if term[:1] == ("get",):
                self.uses[term[1]] += 1
            else:
                if term[:1] == ("item",):
                    self.kinds[term[1][1]] = RESULT
                for part in term:
                    self._count(part)

    def _learn(self, place: Code, term: Any) -> None:
        if place[0] == "get":
            self.kinds.setdefault(place[1], self._kind(term))
        elif place[0] == "several":
            terms = term[1:] if term[0] == "several" else [term] * len(place[1:])
            for each, part in zip(place[1:], terms, strict=True):
                self._learn(each, part)

    def _kind(self, term: Any) -> int:
        """What a term is: a number, four numbers, a whole number or a truth value."""
        if type(term) is int:
            return WHOLE
        if type(term) is float:
            return NUMBER
        operation, *parts = term
        if operation == "get":
            return self.kinds.get(parts[0], NUMBER if parts[0] == "t" else WHOLE)
        if operation in CONDITIONS:
            return TRUTH
        if operation in ("at", "item", "if", "listed"):
            return NUMBER
        if operation == "rounded":
            return self._kind(parts[0])
        if operation in IN_WHOLE_NUMBERS or operation in ("/", "neg"):
            kinds = {self._kind(part) for part in parts}
            if LANES in kinds:
                return LANES
            return WHOLE if kinds == {WHOLE} and operation != "/" else NUMBER
        return RETURNED.get(operation, NUMBER)

    # The plan: statements, loops and branches as they are, and what is repeated.

    def planned(self, statements: Sequence[Statement]) -> list[Any]:
        """Statements, and ``_Repeated`` in the place of those that repeat; also inside loops and branches."""
        plan, straight = list[Any](), list[Statement]()
        for statement in self._entry_by_entry(statements):
            if _is_straight(statement):
                straight.append(statement)
                continue
            plan += self._grouped(straight)
            straight = []
            bodies = bodies_in(statement)
            plan.append((statement, *map(self.planned, bodies)) if bodies else statement)
        return plan + self._grouped(straight)

    def _entry_by_entry(self, statements: Iterable[Statement]) -> Iterator[Statement]:
        """A long row is written entry by entry, as long as its values are many."""
        for statement in statements:
            if statement[0] == "do" and statement[1][0] == "store_row":
                _, array, row, column, (_, *values) = statement[1]
                if len(values) >= LEAST:
                    first = self.whole.get(column[1], column) if isinstance(column, tuple) else column
                    values += [0.0] * (-len(values) % NARROW)
                    yield from (put(at(array[1], row, first + i), value) for i, value in enumerate(values))
                    continue
            yield statement

    def _grouped(self, statements: list[Statement]) -> list[Any]:
        if len(statements) < LEAST:
            return [*statements]
        groups: dict[Any, list[tuple[Statement, list[Any]]]] = {}
        for level, statement in self._levels(statements):
            slots: list[Any] = []
            shape = self._shape(statement, slots)
            groups.setdefault((level, shape), []).append((statement, slots))
        if max(map(len, groups.values())) < LEAST:
            return [*statements]
        plan = list[Any]()
        # Statements of one level do not wait for one another, so its groups may come in any order.
        for (_, _), group in sorted(groups.items(), key=lambda item: item[0][0]):
            members, slots = [statement for statement, _ in group], [each for _, each in group]
            if len(group) < LEAST:
                plan += members
                continue
            self.has_loops = True
            self._allot_cells(members, slots)
            plan += self._runs(members, slots)
        return plan

    def _runs(self, members: Sequence[Statement], slots: Sequence[Sequence[Any]]) -> list[Any]:
        """Loops without lists for members in which all differs by the same steps; one loop for the others."""
        places = [[self.cells[x][1] if x in self.cells else x for x in row] for row in slots]
        steps = [_steps(*pair) for pair in pairwise(places)]
        plan, rest, begin = list[Any](), list[int](), 0
        while begin < len(members):
            end = begin + 1
            while end < len(members) and None not in steps[begin] and steps[end - 1] == steps[begin]:
                end += 1
            if end - begin >= LEAST:
                plan.append(_Repeated(members[begin:end], slots[begin:end]))
                begin = end
            else:
                rest.append(begin)
                begin += 1
        if len(rest) < LEAST:
            return plan + [members[i] for i in rest]
        return [*plan, _Repeated([members[i] for i in rest], [slots[i] for i in rest])]

    def _levels(self, statements: Sequence[Statement]) -> list[tuple[int, Statement]]:
        """Statements with their levels; a result is not first given to a variable that nothing else reads."""
        order = Order(self.whole)
        found = list[tuple[int, Statement]]()
        set_at: dict[str, int] = {}
        for statement in statements:
            name = self._only_stored(statement)
            if name in set_at:
                level, earlier = found[set_at[name]]
                if order.of(put(statement[1], 0.0)) <= level:
                    found[set_at[name]] = level, put(statement[1], earlier[2])
                    order.of(statement)
                    continue
            if statement[0] == "set" and statement[1][0] == "get":
                set_at[statement[1][1]] = len(found)
            found.append((order.of(statement), statement))
        return found

    def _only_stored(self, statement: Statement) -> str | None:
        """The variable that a statement writes to an array, if nothing else reads the variable."""
        if statement[0] == "do" or statement[1][0] == "get":
            return None
        value = statement[2]
        is_name = isinstance(value, tuple) and value[0] == "get" and self.uses[value[1]] == 2
        return value[1] if is_name else None

    def _shape(self, statement: Statement, slots: list[Any]) -> Any:
        """A statement without its numbers and variables, which are appended to ``slots``."""

        def taken(value: Any) -> Any:
            slots.append(value)
            if type(value) is str:
                return self.kinds[value]
            # A negative zero equals zero, but is another number.
            return "-0.0" if str(value) == "-0.0" else type(value)

        return self._with_slots(statement, taken)

    def _with_slots(self, term: Any, slot: Callable[[Any], Any]) -> Any:
        """A statement or a term with the results of ``slot`` for its numbers and variables."""
        kind = type(term)
        if kind is int or kind is float:
            return slot(term)
        if kind is str:
            return term
        if term[0] == "get":
            name = term[1]
            if name in self.whole:
                return slot(self.whole[name])
            return slot(name) if self.kinds.get(name) in CELLS else term
        known = KNOWN.get(term[0], ())
        # The operation comes before the arguments.
        return Code(
            part if place - 1 in known else self._with_slots(part, slot) for place, part in enumerate(term)
        )

    def _allot_cells(self, members: Sequence[Statement], slots: Sequence[Sequence[Any]]) -> None:
        for statement in members:
            for name in _names_set(statement):
                self._allot(name)
        for column in zip(*slots, strict=True):
            if type(column[0]) is str and len(set(column)) > 1:
                for name in column:
                    self._allot(name)

    def _allot(self, name: str) -> None:
        kind = self.kinds[name]
        if name not in self.cells:
            self.cells[name] = kind, self.sizes[kind]
            self.sizes[kind] += 1

    # The statements.

    def written(self, plan: Iterable[Any]) -> list[Statement]:
        """The statements of a plan."""
        found = list[Statement]()
        for each in plan:
            if isinstance(each, _Repeated):
                found.append(self._loop(each))
            elif each[0] == "whole":
                continue
            elif type(each[0]) is tuple:
                statement, *plans = each
                kept = statement[: -len(plans)]
                found.append((*map(self._plain, kept), *map(self.written, plans)))
            else:
                found.append(self._plain(each))
        return found

    def _plain(self, term: Any) -> Any:
        """A statement or a term with cells in the place of variables, and numbers in that of their names."""
        if not isinstance(term, tuple):
            return term
        if term[0] == "get":
            name = term[1]
            return self._cell(name) if name in self.cells else self.whole.get(name, term)
        return Code(map(self._plain, term))

    def _cell(self, name: str) -> Code:
        kind, place = self.cells[name]
        return at(CELLS[kind], place)

    def _loop(self, group: _Repeated) -> Statement:
        columns = iter([self._varying(column) for column in zip(*group.slots, strict=True)])
        body = self._with_slots(group.statements[0], lambda _: next(columns))
        return ("repeat", TURN[1], len(group.statements), (body,))

    def _varying(self, column: Sequence[Any]) -> Any:
        """A number or a variable that differs from turn to turn."""
        first = column[0]
        if len(set(column)) == 1:
            return (self._cell(first) if first in self.cells else get(first)) if type(first) is str else first
        if type(first) is str:
            kind, _ = self.cells[first]
            return at(CELLS[kind], self._varying([self.cells[name][1] for name in column]))
        stride = column[1] - first
        if type(first) is int and all(each == first + stride * k for k, each in enumerate(column)):
            scaled = TURN if stride == 1 else TURN * stride
            return scaled + first if first else scaled
        return call("listed", tuple(column), TURN)


def _steps(before: Sequence[Any], after: Sequence[Any]) -> list[Any]:
    """By how much whole numbers differ; 0 for what is equal, None for what is not."""
    pairs = zip(before, after, strict=True)
    return [b - a if type(a) is int else 0 if a == b else None for a, b in pairs]


def _is_straight(statement: Statement) -> bool:
    """Whether all that a statement reads and writes is written in it."""
    if statement[0] == "set":
        return True
    return statement[0] == "do" and statement[1][0] == "store"


def _names_set(statement: Statement) -> list[str]:
    if statement[0] == "do" or statement[1][0] == "at":
        return []
    places = statement[1][1:] if statement[1][0] == "several" else [statement[1]]
    return [place[1] for place in places]
