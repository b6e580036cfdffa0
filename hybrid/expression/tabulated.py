"""Tables as an operation on expressions: one node, with the piecewise polynomial attached."""

# ruff: noqa: D102 - methods that override others are explained there

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hybrid.expression.functions import RealFunction
from hybrid.expression.graph import Group, all_replaced, degree_of, mentions, nodes_of, replaced, symbols_of
from hybrid.expression.nodes import ONE, ZERO, Expression, Symbol, _kept, add, number
from hybrid.expression.operations import Absolute, Less, Remainder, Select
from hybrid.expression.pieces import Pieces
from hybrid.expression.ranges import Range, closed
from hybrid.expression.values import looked_up


class Tabulated(RealFunction):
    """The value of a table at ``u``, or a derivative of some order of its pieces."""

    __slots__ = ("derived", "pieces")

    word = "table"
    pieces: Pieces
    derived: int

    def __new__(cls, u: Expression, pieces: Pieces, derived: int = 0) -> Any:
        if derived > pieces.degree:
            return ZERO
        if u.is_number:
            return number(float(pieces.at(float(u), derived)))
        return _kept(cls, u, pieces, derived)

    def _begin(self, *args: Any) -> None:
        u, self.pieces, self.derived = args
        super()._begin(u)
        # Terms stand in the same order in every process.
        first, size, numbers, word = self.order
        self.order = first, size, numbers, word ^ int(self.pieces.name[1:], 16) ^ self.derived

    @property
    def attached(self) -> Any:
        return self.pieces, self.derived

    def numpy(self, u: Any) -> Any:
        """The values at numbers."""
        return looked_up(self.pieces, u, self.derived)

    def range(self, u: Range) -> Range:
        """All values, wherever it is read."""
        return closed(*self.pieces.ends(self.derived))

    def slope(self, place: int = 0) -> Expression:
        return self.differentiated(1)

    def differentiated(self, times: int) -> Expression:
        """A derivative of its pieces, of a further order."""
        found: Expression = Tabulated(self.args[0], self.pieces, self.derived + times)
        return found

    @property
    def jumps(self) -> bool:
        """Whether it jumps at a knot."""
        return self.pieces.jumps(self.derived)

    @property
    def number_of_piece(self) -> Expression:
        """A table that jumps at every knot."""
        found: Expression = Tabulated(self.args[0], self.pieces.places())
        return found


def has_knots_in_time(node: Expression) -> bool:
    """Whether a node is a table of ``a t + b``, or of ``(a t + b) % T``: its knots end steps.

    ``a``, ``b`` and ``T`` are made of numbers and parameters.
    """
    if not isinstance(node, Tabulated):
        return False
    argument = node.args[0]
    names = {each.label for each in symbols_of(argument)}
    if "t" not in names or any(name.startswith("x[") for name in names):
        return False
    return repeat_of(node) is not None or _is_affine(argument)


def tables_of_time(*expressions: Expression) -> set[Tabulated]:
    """The tables whose knots end steps: within a step they are polynomials of time."""
    return {node for node in nodes_of(Tabulated, *expressions) if has_knots_in_time(node)}


def repeat_of(node: Tabulated) -> Expression | None:
    """The period in time of a table of ``(a t + b) % T``; None for other tables."""
    argument, time = node.args[0], Symbol("t")
    if not isinstance(argument, Remainder) or argument.args[1].mask & time.mask:
        return None
    inner, length = argument.args
    if not _is_affine(inner):
        return None
    return length / Absolute(replaced(inner, {time: ONE}) - replaced(inner, {time: ZERO}))


def _is_affine(argument: Expression) -> bool:
    return degree_of(argument, frozenset((Symbol("t"),))) == 1


def in_branches(expressions: Iterable[Expression], states: Iterable[Symbol]) -> list[Expression]:
    """The same expressions with choices between pieces for the tables that jump in the state.

    The choices halve the knots, so that each piece is behind few of them.
    """
    group, expressions = Group(states), [*expressions]
    jumping = [each for each in nodes_of(Tabulated, *expressions) if each.jumps and mentions(each, group)]
    return all_replaced(expressions, {each: _halved(each, 0, len(each.pieces.knots)) for each in jumping})


def _halved(table: Tabulated, first: int, last: int) -> Expression:
    """The pieces of a table from one knot to another, as a choice between two halves."""
    u, knots = table.args[0], table.pieces.knots
    if first == last:
        away = u - number(float(knots[max(first - 1, 0)]))
        row = table.pieces.derived(table.derived)[first]
        return add(*(number(float(factor)) * away**k for k, factor in enumerate(row)))
    middle = (first + last) // 2
    halves = _halved(table, first, middle), _halved(table, middle + 1, last)
    found: Expression = Select(Less(u, number(float(knots[middle]))), *halves)
    return found
