"""The loop over orders for the recurrences of the state, and of four tangent vectors at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from hybrid.compiler.statements.code import (
    Code,
    Statement,
    at,
    call,
    do,
    either,
    get,
    less,
    loop,
    put,
    several,
    when,
)
from hybrid.compiler.taylor.pairs import Layer, layers
from hybrid.compiler.taylor.series import OUT, Recurrences, o
from hybrid.expression.nodes import Expression, Symbol
from hybrid.kernels.types.codes import NARROW, WIDE

ORDER, TABLE, VECTORS, GROUPS = map(get, ("order", "table", "vectors", "groups"))


def below_highest(statements: Sequence[Statement]) -> list[Statement]:
    """Statements for an order that has a next one."""
    return [when(less(o, ORDER), statements)] if statements else []


def padded(width: int, whole: int = NARROW) -> int:
    """A width rounded up to a multiple of ``whole``."""
    return -(-width // whole) * whole


class StateLoop:
    """Statements for the series of ``y' = rates`` from ``starts``, in the columns ``targets``.

    In a sum of products, the terms of the orders before the last are added one order in advance.

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

    def first(self) -> list[Statement]:
        """Statements for order zero."""
        block = self.block
        begin = [put(name, start) for name, start in zip(self.names.values(), self.starts, strict=True)]
        last = [put(name, 0.0) for name, _ in self._last()]
        return [*begin, *self._separate(), *block.first, *self._rows(), *self._rates(), *self._sums(1), *last]

    def higher(self) -> list[Statement]:
        """Statements for order ``o``; ``shrink`` is 1/o. No order comes after ``order``."""
        block = self.block
        inner = [put(block.inner(i), at("out", o, block.beside(i))) for i in range(len(block.pairs))]
        names = self.names.values()
        step = [put(name, get("shrink") * self._rate(i)) for i, name in enumerate(names)]
        sums = below_highest(self._sums(o + 1))
        ends = self._ends()
        sums = [*inner, *ends, *sums] if self._is_short else [*ends, *sums, *inner]
        last = [put(name, value) for name, value in self._last()]
        return [*sums, *step, *self._separate(), *block.higher, *self._rows(), *self._rates(), *last]

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
                (get(row.left), [at("out", o, left) for left in row.lefts]) for row in found if row.lefts
            ]
        return [do("store_row", OUT, o, column, several(numbers)) for column, numbers in rows]

    def _sums(self, order: Any) -> list[Statement]:
        """The terms of an order that contain no order above the last but one."""
        name = "convolve" if self.block.common_left is not None else "convolve_pairs"
        return [do(name, OUT, order, 2, *factors) for factors in self._factors()]

    @property
    def _is_short(self) -> bool:
        """Whether an order takes no longer than it takes to write a register and to read it."""
        return len(self.block.pairs) <= NARROW

    def _last(self) -> list[tuple[Code, Any]]:
        """Names of all factors' coefficients in the order before, with their values at the end of an order.

        Order two has one term with them. With few convolutions it is faster to keep them than to read them.
        """
        if not self._is_short:
            return []
        found = list[tuple[Code, Any]]()
        for i, ((left, _), value) in enumerate(self.block.pairs.items()):
            found.append((self._before("q", i), either(less(1, o), at("out", o, left), 0.0)))
            found.append((self._before("p", i), value))
        return found

    def _before(self, letter: str, place: int) -> Code:
        return get(f"{self.block.prefix}{letter}{place}")

    def _ends(self) -> list[Statement]:
        """The terms of order ``o`` with the order before; order one has none."""
        block = self.block
        name = "add_ends" if block.common_left is not None else "add_ends_of_pairs"
        found = [do(name, OUT, o, *factors) for factors in self._factors()]
        if self._is_short:
            found = []
            for i, (left, _) in enumerate(block.pairs):
                q, p, inner = self._before("q", i), self._before("p", i), block.inner(i)
                ends = q * at("out", 1, block.beside(i)) + at("out", 1, left) * p
                found.append(put(inner, inner + ends))
        return [when(less(1, o), found)] if found else []

    def _factors(self) -> list[tuple[Any, ...]]:
        """Columns of the factors of all convolutions, their number and the widest register."""
        common = self.block.common_left
        return [
            (get(row.left) if common is None else common, get(row.right), padded(len(row.places)), WIDE)
            for row in self.layers()
        ]


class TangentLoop:
    """Statements for the series of four tangent vectors at a time, with columns from ``vectors`` on.

    The four coefficients of a component form one vector. The vectors of the components come one after the
    other; the operands of products with common factors follow.
    """

    def __init__(self, seeds: Sequence[Symbol], block: Recurrences) -> None:
        block.rows |= {seed: get("v") + NARROW * i for i, seed in enumerate(seeds)}
        self.components, self.block = len(seeds), block
        self.values: list[Any] = []

    def compute(self, rates: Sequence[Expression]) -> None:
        """Write the recurrences of the rates; this also requests the series of the state that they need."""
        self.values = [self.block.coefficient(rate) for rate in rates]

    @property
    def columns(self) -> int:
        """Number of columns that four tangent vectors need."""
        return NARROW * (self.components + sum(map(len, self.block.blocks.values())))

    def first(self) -> list[Statement]:
        """Statements for order zero, and for order one of the vectors themselves."""
        later = [self._later(1, i, value) for i, value in enumerate(self.values)]
        return [
            do("spread_tangents", get("x"), self.components, OUT, VECTORS, self.columns),
            *self._each([*self.block.first, *later]),
        ]

    def higher(self) -> list[Statement]:
        """Statements for order ``o``, and for order ``o + 1`` of the vectors themselves."""
        block, sums = self.block, list[Statement]()
        for i, (left, rights) in enumerate(block.blocks.items()):
            names = several([block.inner(i, place) for place in range(len(rights))])
            widths = NARROW * len(rights), WIDE
            sums.append(put(names, call("convolved", OUT, o, 1, left, block.beside(i, 0), *widths)))
        scale = get("later")
        later = [self._later(o + 1, i, scale * value) for i, value in enumerate(self.values)]
        statements = self._each([*sums, *block.higher, *later])
        return below_highest([put(scale, 1.0 / (o + 1)), *statements])

    def _later(self, order: Any, place: int, value: Any) -> Statement:
        return do("store", OUT, order, get("v") + NARROW * place, value)

    def _each(self, statements: Iterable[Statement]) -> list[Statement]:
        """Repeat the statements for all vectors, four at a time."""
        start = put(get("v"), VECTORS + get("g") * self.columns)
        return [loop("g", 0, GROUPS, [start, *statements])]

    def places(self) -> dict[str, int]:
        """By name: where the operands of products with a common factor begin, counted from ``v``."""
        found, place = {}, NARROW * self.components
        for i, rights in enumerate(self.block.blocks.values()):
            found[f"{self.block.prefix}b{i}"] = place
            place += NARROW * len(rights)
        return found
