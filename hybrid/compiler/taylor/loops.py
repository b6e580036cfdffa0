"""The loop over orders for the recurrences of the state, and of four tangent vectors at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hybrid.compiler.taylor.pairs import Layer, layers
from hybrid.compiler.taylor.series import Recurrences
from hybrid.expression.nodes import Expression, Symbol
from hybrid.kernels.types.codes import NARROW, WIDE


def indented(statements: Iterable[str]) -> list[str]:
    """Indent statements by one level."""
    return [f"    {statement}" for statement in statements]


def below_highest(statements: Iterable[str]) -> list[str]:
    """Statements for an order that has a next one."""
    found = indented(statements)
    return ["if o < order:", *found] if found else []


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
        targets: Sequence[str],
        rates: Sequence[Expression],
        starts: Sequence[str],
        block: Recurrences,
    ) -> None:
        self.block, self.starts = block, starts
        self.front: list[str] = []
        self.names = {target: f"{block.prefix}y{i}" for i, target in enumerate(targets)}
        names = self.names.values()
        block.variables |= {symbol: name for symbol, name in zip(symbols, names, strict=True) if symbol}
        values = [block.coefficient(rate) for rate in rates]
        self.rates = [f"{block.prefix}r{i} = {value}" for i, value in enumerate(values)]

    def write_front(self, width: int, others: dict[str, str]) -> None:
        """Write the first ``width`` columns as one vector: those of ``y``, and the texts of ``others``."""
        columns = self.names | others
        self.front = [columns.get(str(i), "0.0") for i in range(width)]

    def layers(self) -> list[Layer]:
        """How the factors of the convolutions lie side by side."""
        block = self.block
        squares = [block.rows.get(right) == left for left, right in block.pairs]
        return layers([left for left, _ in block.pairs], squares, block.prefix)

    def first(self) -> list[str]:
        """Statements for order zero."""
        block = self.block
        begin = [f"{name} = {start}" for name, start in zip(self.names.values(), self.starts, strict=True)]
        last = [f"{name} = 0.0" for name in self._last()]
        return [*begin, *self._separate(), *block.first, *self._rows(), *self.rates, *self._sums("1"), *last]

    def higher(self) -> list[str]:
        """Statements for order ``o``; ``shrink`` is 1/o. No order comes after ``order``."""
        block = self.block
        inner = [f"{block.prefix}s{i} = out[o, {block.prefix}c{i}]" for i in range(len(block.pairs))]
        step = [f"{name} = shrink*{block.prefix}r{i}" for i, name in enumerate(self.names.values())]
        sums = below_highest(self._sums("o + 1"))
        ends = self._ends()
        sums = [*inner, *ends, *sums] if self._is_short else [*ends, *sums, *inner]
        last = [f"{name} = {value}" for name, value in self._last().items()]
        return [*sums, *step, *self._separate(), *block.higher, *self._rows(), *self.rates, *last]

    def _separate(self) -> list[str]:
        """Write the columns of ``y`` that are not among the first ones, one by one."""
        behind = [target for target in self.names if int(target) >= len(self.front)]
        return [f"out[o, {target}] = {self.names[target]}" for target in behind]

    def _rows(self) -> list[str]:
        """Write adjacent columns as one vector, so that they can soon be read as one vector."""
        block, rows = self.block, [("0", self.front)]
        values, found = list(block.pairs.values()), self.layers()
        rows += [(each.right, [values[i] for i in each.places]) for each in found if each.right != each.left]
        if block.common_left is None:
            rows += [(each.left, [f"out[o, {left}]" for left in each.lefts]) for each in found if each.lefts]
        return [f"store_row(out, o, {column}, ({', '.join(values)},))" for column, values in rows]

    def _sums(self, order: str) -> list[str]:
        """The terms of an order that contain no order above the last but one."""
        name = "convolve" if self.block.common_left else "convolve_pairs"
        return [f"{name}(out, {order}, 2, {factors})" for factors in self._factors()]

    @property
    def _is_short(self) -> bool:
        """Whether an order takes no longer than it takes to write a register and to read it."""
        return len(self.block.pairs) <= NARROW

    def _last(self) -> dict[str, str]:
        """Names of all factors' coefficients in the order before, with their values at the end of an order.

        Order two has one term with them. With few convolutions it is faster to keep them than to read them.
        """
        if not self._is_short:
            return {}
        found = {}
        for i, ((left, _), value) in enumerate(self.block.pairs.items()):
            found[f"{self.block.prefix}q{i}"] = f"out[o, {left}] if o > 1 else 0.0"
            found[f"{self.block.prefix}p{i}"] = value
        return found

    def _ends(self) -> list[str]:
        """The terms of order ``o`` with the order before; order one has none."""
        prefix, common = self.block.prefix, self.block.common_left
        name = "add_ends" if common else "add_ends_of_pairs"
        found = [f"{name}(out, o, {factors})" for factors in self._factors()]
        if self._is_short:
            found = []
            for i, (left, _) in enumerate(self.block.pairs):
                ends = f"{prefix}q{i}*out[1, {prefix}c{i}] + out[1, {left}]*{prefix}p{i}"
                found.append(f"{prefix}s{i} = {prefix}s{i} + {ends}")
        return ["if o > 1:", *indented(found)] if found else []

    def _factors(self) -> list[str]:
        """Columns of the factors of all convolutions, their number and the widest register, as text."""
        common = self.block.common_left
        return [
            f"{common or each.left}, {each.right}, {padded(len(each.places))}, {WIDE}"
            for each in self.layers()
        ]


class TangentLoop:
    """Statements for the series of four tangent vectors at a time, with columns from ``vectors`` on.

    The four coefficients of a component form one vector. The vectors of the components come one after the
    other; the operands of products with common factors follow.
    """

    def __init__(self, seeds: Sequence[Symbol], block: Recurrences) -> None:
        block.rows |= {seed: f"v + {NARROW * i}" for i, seed in enumerate(seeds)}
        self.components, self.block = len(seeds), block
        self.values: list[str] = []

    def compute(self, rates: Sequence[Expression]) -> None:
        """Write the recurrences of the rates; this also requests the series of the state that they need."""
        self.values = [self.block.coefficient(rate) for rate in rates]

    @property
    def columns(self) -> int:
        """Number of columns that four tangent vectors need."""
        return NARROW * (self.components + sum(map(len, self.block.blocks.values())))

    def first(self) -> list[str]:
        """Statements for order zero, and for order one of the vectors themselves."""
        later = self._later("1", "{}")
        return [
            f"spread_tangents(x, {self.components}, out, vectors, {self.columns})",
            *self._each([*self.block.first, *later]),
        ]

    def higher(self) -> list[str]:
        """Statements for order ``o``, and for order ``o + 1`` of the vectors themselves."""
        block = self.block
        sums = []
        for i, (left, rights) in enumerate(block.blocks.items()):
            names = "".join(f"{block.prefix}s{i}_{place}, " for place in range(len(rights)))
            factors = f"{left}, {block.prefix}b{i}, {NARROW * len(rights)}, {WIDE}"
            sums.append(f"{names}= convolved(out, o, 1, {factors})")
        later = self._later("o + 1", "later*({})")
        statements = self._each([*sums, *block.higher, *later])
        return below_highest(["later = 1.0/(o + 1)", *statements])

    def _later(self, order: str, value: str) -> list[str]:
        return [
            f"store(out, {order}, v + {NARROW * i}, {value.format(each)})"
            for i, each in enumerate(self.values)
        ]

    def _each(self, statements: Iterable[str]) -> list[str]:
        """Repeat the statements for all vectors, four at a time."""
        bases, place = [], NARROW * self.components
        for i, rights in enumerate(self.block.blocks.values()):
            bases.append(f"{self.block.prefix}b{i} = v + {place}")
            place += NARROW * len(rights)
        start = f"v = vectors + g*{self.columns}"
        return ["for g in range(groups):", *indented([start, *bases, *statements])]
