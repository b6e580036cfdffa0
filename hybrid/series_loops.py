"""The loop over orders that recurrences run in: the state, and with it four tangent vectors at a time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sympy

from hybrid.kernels.codes import NARROW
from hybrid.series import Recurrences


def indented(statements: Iterable[str]) -> list[str]:
    """One level deeper."""
    return [f"    {statement}" for statement in statements]


def padded(width: int, whole: int = NARROW) -> int:
    """A width filled up to whole vectors."""
    return -(-width // whole) * whole


class StateLoop:
    """Statements for the series of ``y' = rates`` from ``starts``, in the columns ``targets``.

    What a sum of products needs of the orders before the last is added up an order in advance.

    Parameters
    ----------
    symbols
        What the rates call the components of ``y``, None for one that they do not read.
    """

    def __init__(
        self,
        symbols: Sequence[sympy.Symbol | None],
        targets: Sequence[str],
        rates: Sequence[sympy.Expr],
        starts: Sequence[str],
        block: Recurrences,
    ) -> None:
        names = [f"{block.prefix}y{i}" for i in range(len(targets))]
        block.variables |= {symbol: name for symbol, name in zip(symbols, names, strict=True) if symbol}
        values = [block.coefficient(rate) for rate in rates]
        self.block = block
        self.rates = [f"{block.prefix}r{i} = {value}" for i, value in enumerate(values)]
        stored = [f"out[o, {target}] = {name}" for target, name in zip(targets, names, strict=True)]
        self.begin = [*(f"{name} = {start}" for name, start in zip(names, starts, strict=True)), *stored]
        shrunk = [f"{name} = shrink*{block.prefix}r{i}" for i, name in enumerate(names)]
        self.advance = [*shrunk, *stored]

    def first(self) -> list[str]:
        """Order zero."""
        block = self.block
        before = [f"{name} = 0.0" for name in block.after]
        return [*self.begin, *block.first, *self._rows(), *self.rates, *self._sums("1"), *before]

    def higher(self) -> list[str]:
        """Order ``o``, once ``shrink`` is 1/o."""
        block = self.block
        inner = [
            f"{block.prefix}s{i}_{place} = out[o, {block.prefix}b{i} + {place}]"
            for i, rights in enumerate(block.blocks.values())
            for place in range(len(rights))
        ]
        after = [f"{name} = {value}" for name, value in block.after.items()]
        sums = self._sums("o + 1")
        return [*inner, *sums, *self.advance, *block.higher, *self._rows(), *self.rates, *after]

    def _rows(self) -> list[str]:
        """What is multiplied by one factor is written as one vector, so that it can be read as one soon."""
        block = self.block
        rows = []
        for i, (left, rights) in enumerate(block.blocks.items()):
            values = ", ".join(block.entries[left, right] for right in rights)
            rows.append(f"store_row(out, o, {block.prefix}b{i}, ({values},))")
        return rows

    def _sums(self, order: str) -> list[str]:
        block = self.block
        return [
            f"convolve(out, {order}, 2, {left}, {block.prefix}b{i}, {padded(len(rights))})"
            for i, (left, rights) in enumerate(block.blocks.items())
        ]


class TangentLoop:
    """Statements for the series of four tangent vectors at a time, whose columns begin at ``start``.

    The four coefficients of a component are one vector, those of the components stand one after the other,
    behind them what is multiplied by common factors.
    """

    def __init__(self, seeds: Sequence[sympy.Symbol], block: Recurrences) -> None:
        block.rows |= {seed: f"v + {NARROW * i}" for i, seed in enumerate(seeds)}
        self.start, self.components, self.block = 0, len(seeds), block
        self.values: list[str] = []

    def compute(self, rates: Sequence[sympy.Expr]) -> None:
        """Write the recurrences of the rates; what they need of the state is asked for now."""
        self.values = [self.block.coefficient(rate) for rate in rates]

    @property
    def columns(self) -> int:
        """Columns that four tangent vectors need."""
        return NARROW * (self.components + sum(map(len, self.block.blocks.values())))

    def first(self) -> list[str]:
        """Order zero, and of the vectors themselves order one."""
        later = self._later("1", "{}")
        return [
            f"spread_tangents(x, {self.components}, out, {self.start}, {self.columns})",
            *self._each([*self.block.first, *later]),
        ]

    def higher(self) -> list[str]:
        """Order ``o``, and of the vectors themselves order ``o + 1``."""
        block = self.block
        sums, inner = [], []
        for i, (left, rights) in enumerate(block.blocks.items()):
            base = f"{block.prefix}b{i}"
            sums.append(f"convolve(out, o, 1, {left}, {base}, {NARROW * len(rights)})")
            inner += [
                f"{block.prefix}s{i}_{place} = load(out, o, {base} + {NARROW * place})"
                for place in range(len(rights))
            ]
        later = self._later("o + 1", "later*({})")
        return ["later = 1.0/(o + 1)", *self._each([*sums, *inner, *block.higher, *later])]

    def _later(self, order: str, value: str) -> list[str]:
        return [
            f"store(out, {order}, v + {NARROW * i}, {value.format(each)})"
            for i, each in enumerate(self.values)
        ]

    def _each(self, statements: Iterable[str]) -> list[str]:
        """The statements for all vectors, four at a time."""
        bases, place = [], NARROW * self.components
        for i, rights in enumerate(self.block.blocks.values()):
            bases.append(f"{self.block.prefix}b{i} = v + {place}")
            place += NARROW * len(rights)
        start = f"v = {self.start} + g*{self.columns}"
        return ["for g in range(groups):", *indented([start, *bases, *statements])]
