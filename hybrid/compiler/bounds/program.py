"""The expression of a guard or of a forcing as a list of operations, which the kernels run on intervals.

A program is data, so it needs no compiler. ``hybrid.kernels.events.bounds`` runs a program to bound its
expression over a piece of a step. The bounds prove where a guard has a zero and where it has none, and that
no pulse of a forcing is hidden.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import ClassVar

import sympy
from sympy.codegen.cfunctions import expm1, log1p, log2, log10

from hybrid.compiler.bounds.forcing import is_harmless
from hybrid.compiler.emitted import Programs
from hybrid.kernels.arithmetic import operations as op
from hybrid.symbolic import expressions as sym
from hybrid.symbolic.tracing import Symbols

ONE_OPERAND: dict[type[sympy.Basic], int] = {
    sympy.exp: op.EXP,
    sympy.log: op.LOG,
    sym.CubeRoot: op.CUBE_ROOT,
    sympy.sin: op.SIN,
    sympy.cos: op.COS,
    sympy.tan: op.TAN,
    sympy.asin: op.ASIN,
    sympy.acos: op.ACOS,
    sympy.atan: op.ATAN,
    sympy.sinh: op.SINH,
    sympy.cosh: op.COSH,
    sympy.tanh: op.TANH,
    sympy.asinh: op.ASINH,
    sympy.acosh: op.ACOSH,
    sympy.atanh: op.ATANH,
    log1p: op.LOG1P,
    expm1: op.EXPM1,
    sym.Absolute: op.ABSOLUTE,
    sympy.Abs: op.ABSOLUTE,
    sym.Floor: op.FLOOR,
    sym.Level: op.FLOOR,
    sym.Ceiling: op.CEILING,
    sym.Truncate: op.TRUNCATE,
    sym.Sign: op.SIGN,
    sympy.sign: op.SIGN,
    sym.Step: op.STEP,
    sym.Not: op.NOT,
}
TWO_OPERANDS: dict[type[sympy.Basic], int] = {
    sym.Maximum: op.MAXIMUM,
    sym.Minimum: op.MINIMUM,
    sym.LargerNumber: op.MAXIMUM,
    sym.SmallerNumber: op.MINIMUM,
    sym.Atan2: op.ANGLE,
    sym.Less: op.LESS,
    sym.LessEqual: op.LESS_EQUAL,
    sym.Equal: op.EQUAL,
    sym.And: op.AND,
    sym.Or: op.OR,
}


class NoProgram(Exception):
    """An expression has a function without interval arithmetic; the message names the function."""


def programs(
    guards: Sequence[sympy.Expr | None],
    forcings: Sequence[sympy.Expr | None],
    residues: Sequence[sympy.Expr | None],
    symbols: Symbols,
) -> Programs:
    """Programs of the guards' expressions, followed by those of the forcings and of the residues.

    Where the expression is None or has no interval arithmetic, the program has no rows.
    """
    rows: list[tuple[int, int, int, int]] = []
    checked: list[int] = []
    numbers: dict[float, int] = {}
    first = [0]
    pulses = range(len(guards), len(guards) + len(forcings))
    for place, expression in enumerate([*guards, *forcings, *residues]):
        if expression is not None:
            writer = _Writer(symbols, numbers)
            with suppress(NoProgram):
                rows += writer.written(expression)
                checked += writer.checked() if place in pulses else [0] * len(writer.rows)
        first.append(len(rows))
    return Programs(tuple(rows), tuple(checked), tuple(numbers), tuple(first))


class _Writer:
    """Writes the rows of one expression; a subexpression that occurs twice has one row."""

    def __init__(self, symbols: Symbols, numbers: dict[float, int]) -> None:
        self.numbers = numbers
        self.rows: list[tuple[int, int, int, int]] = []
        self.places: dict[sympy.Basic, int] = {}
        self.times = (symbols.t, *symbols.x)
        self.leaves: dict[sympy.Basic, tuple[int, int, int, int]] = {symbols.t: (op.TIME, 0, 0, 0)}
        self.leaves |= {x: (op.STATE, i, 0, 0) for i, x in enumerate(symbols.x)}
        self.leaves |= {p: (op.PARAMETER, i, 0, 0) for i, p in enumerate(symbols.p)}

    def written(self, expression: sympy.Expr) -> list[tuple[int, int, int, int]]:
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
        several = [each for each in self.places if isinstance(each, sympy.Tuple)]
        if several:
            return [int(row in {self.places[each] for each in several[0]}) for row in range(len(self.rows))]
        for expression, row in self.places.items():
            if not is_harmless(expression, self.times):
                marks[row] = 1
        return marks

    def place(self, expression: sympy.Expr) -> int:
        """Row of a subexpression."""
        if expression not in self.places:
            self.places[expression] = self._written(expression)
        return self.places[expression]

    def _add(self, operation: int, a: int = 0, b: int = 0, c: int = 0) -> int:
        self.rows.append((operation, a, b, c))
        return len(self.rows) - 1

    def _number(self, value: float) -> int:
        key = sympy.Float(value)
        if key not in self.places:
            self.places[key] = self._add(op.NUMBER, self._index(value))
        return self.places[key]

    def _index(self, value: float) -> int:
        return self.numbers.setdefault(float(value), len(self.numbers))

    def _written(self, expression: sympy.Expr) -> int:
        if expression in self.leaves:
            return self._add(*self.leaves[expression])
        if expression.is_Number or expression.is_NumberSymbol:
            return self._number(float(expression))
        if expression.is_Pow:
            return self._power(*expression.args)
        function, arguments = expression.func, expression.args
        if function in ONE_OPERAND:
            return self._add(ONE_OPERAND[function], self.place(arguments[0]))
        if function in TWO_OPERANDS:
            return self._add(TWO_OPERANDS[function], *map(self.place, arguments))
        if function in sym.IN_OTHER_TERMS:
            return self.place(sym.IN_OTHER_TERMS[function](*arguments))
        if function not in self.RULES:
            raise NoProgram(f"{function.__name__} has no interval arithmetic here")
        return self.RULES[function](self, *arguments)

    def _sum(self, *terms: sympy.Expr) -> int:
        total = self.place(terms[0])
        for term in terms[1:]:
            total = self._add(op.SUM, total, self.place(term))
        return total

    def _product(self, *factors: sympy.Expr) -> int:
        above = [f for f in factors if not self._divides(f)]
        below = [1 / f for f in factors if self._divides(f)]
        total = self.place(above[0]) if above else self._number(1.0)
        for factor in above[1:]:
            total = self._add(op.PRODUCT, total, self.place(factor))
        for factor in below:
            total = self._add(op.QUOTIENT, total, self.place(factor))
        return total

    @staticmethod
    def _divides(factor: sympy.Expr) -> bool:
        return bool(factor.is_Pow and factor.exp.is_Number and factor.exp.is_negative)

    def _power(self, base: sympy.Expr, exponent: sympy.Expr) -> int:
        a = self.place(base)
        if exponent.is_Integer:
            return self._add(op.WHOLE_POWER, a, int(exponent))
        if exponent == sym.HALF:
            return self._add(op.SQRT, a)
        if exponent.is_Number:
            return self._whole_or_fixed(a, float(exponent))
        logarithm = self._add(op.LOG, a)
        return self._add(op.EXP, self._add(op.PRODUCT, logarithm, self.place(exponent)))

    def _whole_or_fixed(self, base: int, exponent: float) -> int:
        if exponent.is_integer() and abs(exponent) < 2.0**31:
            return self._add(op.WHOLE_POWER, base, int(exponent))
        return self._add(op.FIXED_POWER, base, self._index(exponent))

    def _select(self, condition: sympy.Expr, a: sympy.Expr, b: sympy.Expr) -> int:
        return self._add(op.SELECT, self.place(condition), self.place(a), self.place(b))

    def _remainder(self, rounding: int, a: sympy.Expr, b: sympy.Expr) -> int:
        """``a - b*round(a/b)``; ``rounding`` rounds down or towards zero."""
        whole = self._add(rounding, self._add(op.QUOTIENT, self.place(a), self.place(b)))
        less = self._add(op.PRODUCT, self._number(-1.0), self._add(op.PRODUCT, self.place(b), whole))
        return self._add(op.SUM, self.place(a), less)

    RULES: ClassVar[dict[type[sympy.Basic], Callable[..., int]]] = {
        sympy.Add: _sum,
        sympy.Tuple: lambda self, *several: [self.place(each) for each in several][-1],
        sympy.Mul: _product,
        sym.Select: _select,
        log2: lambda self, u: self.place(sympy.log(u) / sympy.log(2)),
        log10: lambda self, u: self.place(sympy.log(u) / sympy.log(10)),
        sym.Remainder: lambda self, a, b: self._remainder(op.FLOOR, a, b),
        sym.TruncatedRemainder: lambda self, a, b: self._remainder(op.TRUNCATE, a, b),
    }
