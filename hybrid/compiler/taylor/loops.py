"""The loops over orders for the recurrences of the state, and of four tangent vectors at a time."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from hybrid.compiler.statements.code import Code, Statement, at, call, do, get, less, loop, put, several, when
from hybrid.compiler.taylor.coefficients import ORDER, OUT, o
from hybrid.compiler.taylor.convolutions import AT_HAND, InMemory, convolutions, in_turn, padded
from hybrid.compiler.taylor.pairs import Layer, layers
from hybrid.compiler.taylor.series import Recurrences
from hybrid.expression.graph import mentions
from hybrid.expression.nodes import Expression, Symbol
from hybrid.kernels.types.codes import HIGHEST_ORDER, NARROW, WIDE

TABLE, VECTORS, GROUPS = map(get, ("table", "vectors", "groups"))


def reciprocal(order: Any) -> Code:
    """``1 / order`` from a list: to divide takes longer."""
    return call("listed", (0.0, *(1.0 / each for each in range(1, HIGHEST_ORDER + 2))), order)


class StateLoop:
    """Statements for the series of ``y' = rates`` from ``starts``, in the columns ``targets``.

    Parameters
    ----------
    symbols
        Symbols of the components of ``y`` in the rates; None for a component that the rates do not read.
    """

    def __init__(
        self,
        symbols: Sequence[Symbol | None],
        targets: Sequence[int],
        rates: Sequence[Expression],
        starts: Sequence[Any],
        block: Recurrences,
    ) -> None:
        self.block, self.starts = block, starts
        self.front: list[Any] = []
        self.names = {target: get(f"{block.prefix}y{i}") for i, target in enumerate(targets)}
        names = self.names.values()
        block.variables |= {symbol: name for symbol, name in zip(symbols, names, strict=True) if symbol}
        self.values = [block.coefficient(rate) for rate in rates]

    def write_front(self, width: int, others: dict[int, Any]) -> None:
        """Write the first ``width`` columns as one vector: those of ``y``, and ``others`` by column."""
        columns = self.names | others
        self.front = [columns.get(i, 0.0) for i in range(width)]

    def layers(self) -> list[Layer]:
        """How the factors of the convolutions lie side by side."""
        block = self.block
        squares = [block.rows.get(right) == left for left, right in block.pairs]
        return layers([left for left, _ in block.pairs], squares, block.prefix)

    @cached_property
    def sums(self) -> InMemory:
        """How the convolutions are summed; all of them must be known."""
        return convolutions(self.block, self.layers())

    def first(self) -> list[Statement]:
        """Statements for order zero."""
        begin = [put(name, start) for name, start in zip(self.names.values(), self.starts, strict=True)]
        return [*begin, *self._known(self.block.first), *self.sums.first(), *self.sums.keep()]

    def higher(self) -> list[Statement]:
        """Statements for order ``o``; ``shrink`` is 1/o. No order comes after ``order``."""
        sums = self.sums
        step = [put(name, get("shrink") * self._rate(i)) for i, name in enumerate(self.names.values())]
        begin = [*sums.ends(), *step, *sums.inner(), *sums.later()]
        return [*begin, *self._known(self.block.higher), *sums.keep()]

    def _known(self, statements: Sequence[Statement]) -> list[Statement]:
        """What is done once the components of an order are known."""
        return [*self._separate(), *statements, *self._rows(), *self._rates()]

    def _rate(self, place: int) -> Code:
        return get(f"{self.block.prefix}r{place}")

    def _rates(self) -> list[Statement]:
        return [put(self._rate(i), value) for i, value in enumerate(self.values)]

    def _separate(self) -> list[Statement]:
        """Write the columns of ``y`` that are not among the first ones, one by one."""
        behind = [target for target in self.names if target >= len(self.front)]
        return [put(at("out", o, target), self.names[target]) for target in behind]

    def _rows(self) -> list[Statement]:
        """Write adjacent columns as one vector, so that they can soon be read as one vector."""
        block, found = self.block, self.layers()
        rows: list[tuple[Any, Sequence[Any]]] = [(0, self.front)]
        values = list(block.pairs.values())
        rows += [(get(row.right), [values[i] for i in row.places]) for row in found if row.right != row.left]
        if block.common_left is None:
            rows += [
                (get(row.left), [block.newest(left) for left in row.lefts]) for row in found if row.lefts
            ]
        return [do("store_row", OUT, o, column, several(numbers)) for column, numbers in rows]


class TangentLoop:
    """Statements for the series of four tangent vectors at a time, with columns from ``vectors`` on.

    The four coefficients of a component form one vector. The vectors of the components come one after the
    other; the operands of products with common factors follow. These factors are series of the state, which
    are complete before those of the first four vectors begin. The sums of products are built up as those of
    ``InRegisters``, with one register for each product.
    """

    # Columns of a register, and what the operands of each common factor begin on.
    width, whole = NARROW, WIDE
    nothing: Any = call("four_times", 0.0)

    def __init__(self, seeds: Sequence[Symbol], block: Recurrences) -> None:
        self.names = [get(f"{block.prefix}v{i}") for i in range(len(seeds))]
        block.rows |= {seed: get("v") + self.width * i for i, seed in enumerate(seeds)}
        block.variables |= dict(zip(seeds, self.names, strict=True))
        self.block = block
        self.values: list[Any] = []

    def compute(self, rates: Sequence[Expression]) -> None:
        """Write the recurrences of the rates; this also requests the series of the state that they need."""
        self.values = [self._lanes(rate) for rate in rates]

    def _lanes(self, rate: Expression) -> Any:
        """The coefficient of a rate; one without any vector, zero, is no register by itself."""
        value = self.block.coefficient(rate)
        return value if mentions(rate, self.block.own) else call("four_times", value)

    @property
    def columns(self) -> int:
        """Number of columns that four tangent vectors need."""
        return self._begins()[-1]

    def places(self) -> dict[str, int]:
        """By name: where the operands of products with a common factor begin, counted from ``v``."""
        return {f"{self.block.prefix}b{i}": begin for i, begin in enumerate(self._begins()[:-1])}

    def statements(self) -> list[Statement]:
        """The series of all vectors, one register after the other."""
        block, scale = self.block, get("later")
        start = [put(get("v"), VECTORS + get("g") * self.columns), put(o, 0), *self._begin()]
        start += [put(name, self.nothing) for letter in "tu" for name in self._products(letter)]
        first = [*block.first, *self._rows(), *self._step(1, 1.0)]
        higher = [
            put(scale, reciprocal(o + 1)),
            *self._sums(),
            *block.higher,
            *self._rows(),
            *self._step(o + 1, scale),
        ]
        series = loop("g", 0, GROUPS, [*start, *first, loop("o", 1, ORDER, higher)])
        return [*self._spread(), series]

    def _spread(self) -> list[Statement]:
        """Write all vectors to where their series begin."""
        return [do("spread_tangents", get("x"), len(self.names), OUT, VECTORS, self.columns)]

    def _begin(self) -> list[Statement]:
        """Take the vectors of one register from there."""
        places = enumerate(self.names)
        return [put(name, call("load", OUT, 0, get("v") + self.width * i)) for i, name in places]

    def _begins(self) -> list[int]:
        """Where the operands of each common factor begin, and the end."""
        found = [padded(self.width * len(self.names), self.whole)]
        for rights in self.block.blocks.values():
            found.append(found[-1] + padded(self.width * len(rights), self.whole))
        return found

    def _products(self, letter: str) -> list[Code]:
        return [get(f"{self.block.prefix}{letter}{i}") for i in range(len(self.block.pairs))]

    def _sums(self) -> list[Statement]:
        """The sums of all products but for the terms with this order of the vectors; those of later orders.

        All orders of the other factors are known, so only the newest orders of the vectors are missing.
        """
        block, found, onwards = self.block, list[Statement](), list[Statement]()
        places = ((left, i, k) for i, left in enumerate(block.blocks) for k in range(len(block.blocks[left])))
        t, u, p = map(self._products, "tup")
        for k, (left, *place) in enumerate(places):
            found.append(put(block.inner(*place), t[k] + at("out", 1, left) * p[k]))
            onwards.append(put(t[k], u[k] + at("out", 2, left) * p[k]))
        begun, k = list[Statement](), 0
        for blocks in self._together():
            names = slice(k, k + sum(len(rights) for _, _, rights in blocks))
            begun.append(put(several(t[names] + u[names]), self._convolved(blocks)))
            k = names.stop
        return [*found, *in_turn([when(less(o + 1, ORDER), begun)], onwards)] if found else []

    def _convolved(self, blocks: Sequence[tuple[int, Any, list[Expression]]]) -> Code:
        """The sums of two orders of all products in some blocks."""
        lefts = several([left for _, left, _ in blocks])
        begins = several([self.block.beside(i, 0) for i, _, _ in blocks])
        widths = several([NARROW * len(rights) for _, _, rights in blocks])
        return call("convolved", OUT, o + 1, lefts, begins, widths, 1)

    def _together(self) -> list[list[tuple[int, Any, list[Expression]]]]:
        """The blocks that are summed in one loop: all of them, or each alone.

        Those of large systems repeat, and become a loop themselves.
        """
        blocks = [(i, *each) for i, each in enumerate(self.block.blocks.items())]
        if self._is_small:
            return [blocks] if blocks else []
        return [[each] for each in blocks]

    @property
    def _is_small(self) -> bool:
        return len(self.block.pairs) <= AT_HAND

    def _rows(self) -> list[Statement]:
        """Write the operands of this order, and keep them: to read what was just written takes long."""
        block, found = self.block, list[Statement]()
        kept = iter(self._products("p"))
        for i, (left, rights) in enumerate(block.blocks.items()):
            names = [next(kept) for _ in rights]
            found += [put(name, block.pairs[left, right]) for name, right in zip(names, rights, strict=True)]
            found += self._row(i, names)
        return found

    def _row(self, block: int, names: Sequence[Code]) -> list[Statement]:
        """Write the operands of a block."""
        beside = self.block.beside
        if self._is_small:
            return [do("store_row", OUT, o, beside(block, 0), several(names))]
        return [self._keep(o, beside(block, k), name) for k, name in enumerate(names)]

    def _keep(self, order: Any, column: Any, value: Any) -> Statement:
        """Write a register to its column."""
        return do("store", OUT, order, column, value)

    def _step(self, order: Any, scale: Any) -> list[Statement]:
        """The vectors of an order from their rates in the order before."""
        rates = [get(f"{self.block.prefix}r{i}") for i in range(len(self.names))]
        found = [put(*each) for each in zip(rates, self.values, strict=True)]
        for i, (name, rate) in enumerate(zip(self.names, rates, strict=True)):
            found += [put(name, scale * rate), self._keep(order, get("v") + self.width * i, name)]
        return found
