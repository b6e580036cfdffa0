"""The sums of convolutions, order by order: each term is added as soon as both of its factors are known.

The coefficient of order ``o`` of a product is the sum of ``a[j] * b[o - j]``. Its terms are added in three
steps. Those of orders up to the last but two are summed in a loop over the rows of ``out``: at even orders,
for the next two orders at once, since reading takes most of the time. Then come the terms with the order
before. The terms with order ``o`` itself come last, in the recurrences.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from hybrid.compiler.statements.code import (
    Code,
    Statement,
    at,
    call,
    do,
    equal,
    get,
    less,
    put,
    several,
    when,
)
from hybrid.compiler.taylor.coefficients import ORDER, OUT, o
from hybrid.compiler.taylor.pairs import Layer
from hybrid.compiler.taylor.series import Recurrences
from hybrid.kernels.types.codes import NARROW

# Sums of more convolutions than this, with the newest coefficients, do not fit into registers.
AT_HAND = 16


def convolutions(block: Recurrences, layers: Sequence[Layer]) -> InRegisters | InMemory:
    """The way in which the convolutions of recurrences are summed."""
    return (InRegisters if 0 < len(block.pairs) <= AT_HAND else InMemory)(block, layers)


def in_turn(even: Sequence[Statement], odd: Sequence[Statement]) -> list[Statement]:
    """Statements for even orders, and others for odd orders."""
    return [when(equal(o // 2 * 2, o), even, odd)] if even or odd else []


def below_highest(statements: Sequence[Statement]) -> list[Statement]:
    """Statements for an order that has a next one."""
    return [when(less(o, ORDER), statements)] if statements else []


def padded(width: int, whole: int = NARROW) -> int:
    """A width rounded up to a multiple of ``whole``."""
    return -(-width // whole) * whole


class InMemory:
    """Sums in the rows of the second factors, which are not known before their sums are complete.

    Parameters
    ----------
    layers
        How the factors lie side by side.
    """

    def __init__(self, block: Recurrences, layers: Sequence[Layer]) -> None:
        self.block = block
        self.common = block.common_left
        self.factors = [
            (get(row.left) if self.common is None else self.common, get(row.right), padded(len(row.places)))
            for row in layers
        ]

    def first(self) -> list[Statement]:
        """Statements for order zero: no sum has terms yet."""
        return self._next(1)

    def ends(self) -> list[Statement]:
        """Add the terms with the order before, which order one has not.

        They also enter the sums of order ``o + 1`` that have been begun.
        """
        found = self._ends(o, 1), self._ends(o + 1, 2)
        return [when(less(1, o), [*found[0], *in_turn([], found[1])])] if found[0] else []

    def inner(self) -> list[Statement]:
        """Give each convolution without the terms of order ``o`` its name.

        The term with a first factor that is a component of the state is known, and is added.
        """
        block, found = self.block, list[Statement]()
        for i, (pair, total) in enumerate(zip(block.pairs, self._totals(), strict=True)):
            if pair in block.led:
                total = total + block.led[pair] * at("out", 0, block.beside(i))
            found.append(put(block.inner(i), total))
        return found

    def later(self) -> list[Statement]:
        """Begin the sums of the next two orders."""
        return in_turn(below_highest(self._next(o + 1)), [])

    def keep(self) -> list[Statement]:
        """Keep what the next order needs."""
        return []

    def _totals(self) -> Iterator[Code]:
        return (at("out", o, self.block.beside(i)) for i in range(len(self.block.pairs)))

    def _next(self, order: Any) -> list[Statement]:
        name = "convolve_pairs" if self.common is None else "convolve"
        return [do(name, OUT, order, *each) for each in self.factors]

    def _ends(self, order: Any, distance: int) -> list[Statement]:
        name = "add_ends_of_pairs" if self.common is None else "add_ends"
        return [do(name, OUT, order, distance, *each) for each in self.factors]


class InRegisters(InMemory):
    """Sums in registers of four: ``t`` for order ``o``, ``u`` for the next one.

    The newest coefficients stay in registers, too: ``p`` of the second factors, ``q`` of the first ones. To
    read what was just written takes longer than all else in an order.
    """

    nothing: Any = call("four_times", 0.0)

    def first(self) -> list[Statement]:
        """Statements for order zero: no sum has terms yet."""
        return [put(name, self.nothing) for name in self._names("t") + self._names("u")]

    def inner(self) -> list[Statement]:
        """Give each convolution its name, with the term of a first factor that is a component."""
        block, found = self.block, list[Statement]()
        if self.common is None or len(block.led) < len(block.pairs):
            return super().inner()
        [(_, right, _)] = self.factors
        value = next(iter(block.led.values()))
        for i, total in enumerate(self._names("t")):
            found.append(put(total, total + value * call("load", OUT, 0, right + NARROW * i)))
        return [*found, *(put(block.inner(i), total) for i, total in enumerate(self._totals()))]

    def later(self) -> list[Statement]:
        """Begin the sums of the next two orders, or go on to the second of them."""
        onwards = [put(*each) for each in zip(self._names("t"), self._names("u"), strict=True)]
        return in_turn(below_highest(self._next(o + 1)), onwards)

    def keep(self) -> list[Statement]:
        """Keep the newest coefficients."""
        block = self.block
        found = self._kept("p", list(block.pairs.values()))
        if self.common is None:
            found += self._kept("q", [block.newest(left) for left, _ in block.pairs])
        return found

    def _names(self, letter: str) -> list[Code]:
        count = padded(len(self.block.pairs)) // NARROW
        return [get(f"{self.block.prefix}{letter}{i}") for i in range(count)]

    def _totals(self) -> Iterator[Code]:
        totals = self._names("t")
        return (call("item", totals[i // NARROW], i % NARROW) for i in range(len(self.block.pairs)))

    def _kept(self, letter: str, values: Sequence[Any]) -> list[Statement]:
        values = [*values, *[0.0] * (padded(len(values)) - len(values))]
        fours = [call("four", *values[i : i + NARROW]) for i in range(0, len(values), NARROW)]
        return [put(*each) for each in zip(self._names(letter), fours, strict=True)]

    def _next(self, order: Any) -> list[Statement]:
        name = "convolved_pairs" if self.common is None else "convolved"
        names = several(self._names("t") + self._names("u"))
        factors = (several([each]) for each in self.factors[0])
        return [put(names, call(name, OUT, order, *factors, 0))]

    def _ends(self, order: Any, distance: int) -> list[Statement]:
        [(left, right, _)] = self.factors
        first, last = list[Statement](), list[Statement]()
        for i, (total, p) in enumerate(zip(self._names("tu"[distance - 1]), self._names("p"), strict=True)):
            if self.common is None:
                a, q = call("load", OUT, distance, left + NARROW * i), self._names("q")[i]
            else:
                a, q = at("out", distance, left), at("out", o - 1, left)
            first.append(put(total, total + a * p))
            last.append(put(total, total + q * call("load", OUT, distance, right + NARROW * i)))
        # The two terms may be one.
        return [*first, when(less(2 * distance, order), last)]
