"""Expressions as model functions: evaluated on numbers and on traced numbers by NumPy's functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property, reduce
from typing import Any

import attrs
import numpy as np
import sympy
from sympy.codegen.cfunctions import exp2, expm1, hypot, log1p, log2, log10
from sympy.core.parameters import distribute

from hybrid.symbolic import expressions as sym
from hybrid.symbolic.nodes import replaced
from hybrid.symbolic.tracing import Traced, model_symbols

FUNCTIONS: dict[type[sympy.Basic], Callable[..., Any]] = {
    sympy.exp: np.exp,
    expm1: np.expm1,
    exp2: np.exp2,
    sympy.log: np.log,
    log1p: np.log1p,
    log2: np.log2,
    log10: np.log10,
    sympy.sin: np.sin,
    sympy.cos: np.cos,
    sympy.tan: np.tan,
    sympy.asin: np.arcsin,
    sympy.acos: np.arccos,
    sympy.atan: np.arctan,
    sympy.sinh: np.sinh,
    sympy.cosh: np.cosh,
    sympy.tanh: np.tanh,
    sympy.asinh: np.arcsinh,
    sympy.acosh: np.arccosh,
    sympy.atanh: np.arctanh,
    sympy.Abs: np.abs,
    sympy.sign: np.sign,
    hypot: np.hypot,
    sym.Absolute: np.abs,
    sym.Atan2: np.arctan2,
    sym.Ceiling: np.ceil,
    sym.CubeRoot: np.cbrt,
    sym.Gate: lambda u, rest: np.where(u < 0.0, 0.0, np.heaviside(u, 0.5) * rest),
    sym.Equal: lambda a, b: a == b,
    sym.Floor: np.floor,
    # Written so that a list of operations tells it from a floor that jumps.
    sym.Level: lambda u: np.floor(np.positive(np.positive(u))),
    sym.Less: lambda a, b: a < b,
    sym.LessEqual: lambda a, b: a <= b,
    sym.Maximum: np.maximum,
    sym.Minimum: np.minimum,
    sym.LargerNumber: np.fmax,
    sym.SmallerNumber: np.fmin,
    sym.WholeQuotient: np.floor_divide,
    sym.Remainder: np.remainder,
    sym.Together: lambda u: u,
    sym.Select: np.where,
    sym.Sign: np.sign,
    sym.Step: lambda u: np.heaviside(u, 0.5),
    sym.Truncate: np.trunc,
    sym.TruncatedRemainder: np.fmod,
    sym.And: np.logical_and,
    sym.Or: np.logical_or,
    sym.Not: np.logical_not,
    sympy.Add: lambda *terms: reduce(lambda a, b: a + b, terms),
    sympy.Mul: lambda *factors: reduce(lambda a, b: a * b, factors),
    sympy.Pow: lambda base, exponent: base**exponent,
}


@attrs.frozen(eq=False)
class Expressed:
    """A model function ``(t, x, p)`` whose values are given by expressions.

    Tracing gets the expressions themselves, in other symbols if need be, so a function derived from traced
    functions is compiled as if it had been written by hand.

    Attributes
    ----------
    expressions
        In the symbols of `hybrid.symbolic.tracing.model_symbols`.
    size
        Number of values; None for a scalar function.
    """

    expressions: tuple[sympy.Expr, ...]
    size: int | None = None

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The values at a point."""
        states, parameters = [*x], [*p]
        symbols = model_symbols(len(states), len(parameters))
        known = (symbols.t, *symbols.x, *symbols.p)
        values = (t, *states, *parameters)
        if isinstance(t, Traced) and isinstance(t.content, sympy.Basic):
            results: list[Any] = [
                Traced(each) for each in self._in_terms_of(known, [each.content for each in values])
            ]
        else:
            results = self._program.run(dict(zip(known, values, strict=True)))
        return results if self.size is not None else results[0]

    def _in_terms_of(
        self, symbols: Sequence[sympy.Symbol], contents: Sequence[sympy.Expr]
    ) -> Sequence[sympy.Expr]:
        changed = {old: new for old, new in zip(symbols, contents, strict=True) if new != old}
        if not changed:
            return self.expressions
        with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
            return [replaced(each, changed) for each in self.expressions]

    @cached_property
    def _program(self) -> Program:
        return Program(self.expressions)

    def __reduce__(self) -> tuple[Any, ...]:
        return Expressed, (self.expressions, self.size)


class Program:
    """Expressions as a list of calls of NumPy's functions, each on the results of calls before it."""

    def __init__(self, expressions: Iterable[sympy.Expr]) -> None:
        self.symbols: dict[int, sympy.Symbol] = {}
        self.constants: dict[int, float] = {}
        self.calls: list[tuple[int, Callable[..., Any], tuple[int, ...]]] = []
        self._places: dict[sympy.Expr, int] = {}
        self.results = [self._place(each) for each in expressions]

    def _place(self, node: sympy.Expr) -> int:
        if node in self._places:
            return self._places[node]
        operands = tuple(map(self._place, node.args)) if not node.is_Number else ()
        place = self._places[node] = len(self._places)
        if node.is_Number or node.is_NumberSymbol:
            self.constants[place] = float(node)
        elif node.is_Symbol:
            self.symbols[place] = node
        else:
            self.calls.append((place, FUNCTIONS[node.func], operands))
        return place

    def run(self, values: Mapping[sympy.Symbol, Any]) -> list[Any]:
        """Values of the expressions for numbers or traced numbers in place of their symbols."""
        found: dict[int, Any] = {place: values[symbol] for place, symbol in self.symbols.items()}
        found |= self.constants
        for place, function, operands in self.calls:
            found[place] = function(*(found[each] for each in operands))
        return [found[place] for place in self.results]


def expressed(expressions: Sequence[sympy.Expr]) -> Expressed:
    """A vector-valued model function."""
    return Expressed(tuple(expressions), len(expressions))


def scalar(expression: sympy.Expr) -> Expressed:
    """A scalar model function."""
    return Expressed((expression,))
