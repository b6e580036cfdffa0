"""The expression of a guard or of a forcing as a list of operations, which the kernels run on intervals.

A program is data, so it needs no compiler. ``hybrid.kernels.events.bounds`` runs a program to bound its
expression over a piece of a step. The bounds prove where a guard has a zero and where it has none, and that
no pulse of a forcing is hidden.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import ClassVar

from hybrid.compiler.bounds.forcing import is_harmless
from hybrid.compiler.emitted import Programs
from hybrid.compiler.tables import Tables
from hybrid.expression.graph import is_negative
from hybrid.expression.nodes import HALF, Expression, Number, Product, Sum
from hybrid.expression.operations import Remainder, Several, TruncatedRemainder
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.tracing import Symbols
from hybrid.kernels.arithmetic import operations as op


class NoProgram(Exception):
    """An expression has a function without interval arithmetic; the message names the function."""


def programs(
    guards: Sequence[Expression | None],
    forcings: Sequence[Expression | None],
    residues: Sequence[Expression | None],
    symbols: Symbols,
    tables: Tables | None = None,
) -> Programs:
    """Programs of the guards' expressions, followed by those of the forcings and of the residues.

    Where the expression is None or has no interval arithmetic, the program has no rows.
    """
    tables = Tables(len(symbols.p)) if tables is None else tables
    rows: list[tuple[int, int, int, int]] = []
    checked: list[int] = []
    numbers: dict[float, int] = {}
    first = [0]
    pulses = range(len(guards), len(guards) + len(forcings))
    for place, expression in enumerate([*guards, *forcings, *residues]):
        if expression is not None:
            writer = _Writer(symbols, numbers, tables)
            with suppress(NoProgram):
                rows += writer.written(expression)
                checked += writer.checked() if place in pulses else [0] * len(writer.rows)
        first.append(len(rows))
    return Programs(tuple(rows), tuple(checked), tuple(numbers), tuple(first))


class _Writer:
    """Writes the rows of one expression; a subexpression that occurs twice has one row."""

    def __init__(self, symbols: Symbols, numbers: dict[float, int], tables: Tables) -> None:
        self.numbers, self.tables = numbers, tables
        self.rows: list[tuple[int, int, int, int]] = []
        self.places: dict[Expression, int] = {}
        self.times = (symbols.t, *symbols.x)
        self.leaves: dict[Expression, tuple[int, int, int, int]] = {symbols.t: (op.TIME, 0, 0, 0)}
        self.leaves |= {x: (op.STATE, i, 0, 0) for i, x in enumerate(symbols.x)}
        self.leaves |= {p: (op.PARAMETER, i, 0, 0) for i, p in enumerate(symbols.p)}

    def written(self, expression: Expression) -> list[tuple[int, int, int, int]]:
        """All rows; the last one computes the expression."""
        last = self.place(expression)
        if last != len(self.rows) - 1:
            # The row of the expression was written earlier, but the last row must compute the expression.
            self._add(op.SUM, last, self._number(0.0))
        return self.rows

    def checked(self) -> list[int]:
        """One number per row: 1 for a subexpression that could hide a pulse and for the last row, else 0.

        If several expressions were written, the 1 stands for these.
        """
        marks = [0] * (len(self.rows) - 1) + [1]
        several = [each for each in self.places if isinstance(each, Several)]
        if several:
            return [
                int(row in {self.places[each] for each in several[0].args}) for row in range(len(self.rows))
            ]
        for expression, row in self.places.items():
            if not is_harmless(expression, self.times):
                marks[row] = 1
        return marks

    def place(self, expression: Expression) -> int:
        """Row of a subexpression."""
        if expression not in self.places:
            self.places[expression] = self._written(expression)
        return self.places[expression]

    def _add(self, operation: int, a: int = 0, b: int = 0, c: int = 0) -> int:
        self.rows.append((operation, a, b, c))
        return len(self.rows) - 1

    def _number(self, value: float) -> int:
        key = Number(float(value))
        if key not in self.places:
            self.places[key] = self._add(op.NUMBER, self._index(value))
        return self.places[key]

    def _index(self, value: float) -> int:
        return self.numbers.setdefault(float(value), len(self.numbers))

    def _written(self, expression: Expression) -> int:
        if expression in self.leaves:
            return self._add(*self.leaves[expression])
        if expression.is_number:
            return self._number(float(expression))
        if expression.is_power:
            return self._power(*expression.args)
        if isinstance(expression, Tabulated):
            first = self.tables.place(expression.pieces)
            return self._add(op.TABLE, self.place(expression.args[0]), first, expression.derived)
        kind, arguments = type(expression), expression.args
        if kind in self.RULES:
            return self.RULES[kind](self, *arguments)
        if expression.bounds:
            return self._add(expression.bounds, *map(self.place, arguments))
        if expression.in_other_terms is not None:
            return self.place(expression.in_other_terms(*arguments))
        raise NoProgram(f"{expression.word} has no interval arithmetic here")

    def _sum(self, *terms: Expression) -> int:
        total = self.place(terms[0])
        for term in terms[1:]:
            total = self._add(op.SUM, total, self.place(term))
        return total

    def _product(self, *factors: Expression) -> int:
        above = [f for f in factors if not self._divides(f)]
        below = [1 / f for f in factors if self._divides(f)]
        total = self.place(above[0]) if above else self._number(1.0)
        for factor in above[1:]:
            total = self._add(op.PRODUCT, total, self.place(factor))
        for factor in below:
            total = self._add(op.QUOTIENT, total, self.place(factor))
        return total

    @staticmethod
    def _divides(factor: Expression) -> bool:
        return factor.is_power and is_negative(factor.exponent)

    def _power(self, base: Expression, exponent: Expression) -> int:
        a = self.place(base)
        if exponent is HALF:
            return self._add(op.SQRT, a)
        if exponent.is_number:
            return self._whole_or_fixed(a, float(exponent))
        logarithm = self._add(op.LOG, a)
        return self._add(op.EXP, self._add(op.PRODUCT, logarithm, self.place(exponent)))

    def _whole_or_fixed(self, base: int, exponent: float) -> int:
        if exponent.is_integer() and abs(exponent) < 2.0**31:
            return self._add(op.WHOLE_POWER, base, int(exponent))
        return self._add(op.FIXED_POWER, base, self._index(exponent))

    def _remainder(self, rounding: int, a: Expression, b: Expression) -> int:
        """``a - b*round(a/b)``; ``rounding`` rounds down or towards zero."""
        whole = self._add(rounding, self._add(op.QUOTIENT, self.place(a), self.place(b)))
        less = self._add(op.PRODUCT, self._number(-1.0), self._add(op.PRODUCT, self.place(b), whole))
        return self._add(op.SUM, self.place(a), less)

    RULES: ClassVar[dict[type[Expression], Callable[..., int]]] = {
        Sum: _sum,
        Several: lambda self, *several: [self.place(each) for each in several][-1],
        Product: _product,
        Remainder: lambda self, a, b: self._remainder(op.FLOOR, a, b),
        TruncatedRemainder: lambda self, a, b: self._remainder(op.TRUNCATE, a, b),
    }
