"""Expressions as model functions: evaluated on numbers and on traced numbers by NumPy's functions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property, reduce
from typing import Any

import attrs

from hybrid.expression.graph import all_replaced, in_order, listed, listing
from hybrid.expression.nodes import Expression, Power, Product, Sum, Symbol
from hybrid.expression.tracing import ROW, Traced, model_symbols
from hybrid.system.rows import row_that_fires

ARITHMETIC: dict[type[Expression], Callable[..., Any]] = {
    Sum: lambda *terms: reduce(lambda a, b: a + b, terms),
    Product: lambda *factors: reduce(lambda a, b: a * b, factors),
    Power: lambda base, exponent: base**exponent,
}


@attrs.frozen(eq=False)
class Expressed:
    """A model function ``(t, x, p)`` whose values are given by expressions.

    Tracing gets the expressions themselves, in other symbols if need be, so a function derived from traced
    functions is compiled as if it had been written by hand.

    Attributes
    ----------
    expressions
        In the symbols of `hybrid.expression.tracing.model_symbols`.
    size
        Number of values; None for a scalar function.
    """

    expressions: tuple[Expression, ...]
    size: int | None = None

    def __call__(self, t: Any, x: Any, p: Any) -> Any:
        """The values at a point."""
        states, parameters = [*x], [*p]
        symbols = model_symbols(len(states), len(parameters))
        known = (symbols.t, *symbols.x, *symbols.p)
        values = (t, *states, *parameters)
        if isinstance(t, Traced) and isinstance(t.content, Expression):
            results: list[Any] = [
                Traced(each) for each in self._in_terms_of(known, [each.content for each in values])
            ]
        else:
            results = self._program.run({**dict(zip(known, values, strict=True)), ROW: row_that_fires()})
        return results if self.size is not None else results[0]

    def _in_terms_of(self, symbols: Sequence[Symbol], contents: Sequence[Expression]) -> Sequence[Expression]:
        changed = {old: new for old, new in zip(symbols, contents, strict=True) if new is not old}
        return all_replaced(self.expressions, changed) if changed else self.expressions

    @cached_property
    def _program(self) -> Program:
        return Program(self.expressions)

    def __reduce__(self) -> tuple[Any, ...]:
        return _of_listing, (listing(self.expressions), self.size)


def _of_listing(found: tuple[list[Any], list[int]], size: int | None) -> Expressed:
    return Expressed(listed(*found), size)


class Program:
    """Expressions as a list of calls of NumPy's functions, each on the results of calls before it."""

    def __init__(self, expressions: Iterable[Expression]) -> None:
        self.symbols: dict[int, Symbol] = {}
        self.constants: dict[int, float] = {}
        self.calls: list[tuple[int, Callable[..., Any], tuple[int, ...]]] = []
        expressions = [*expressions]
        places: dict[Expression, int] = {}
        for node in in_order(expressions):
            place = places[node] = len(places)
            if node.is_number:
                self.constants[place] = float(node)
            elif isinstance(node, Symbol):
                self.symbols[place] = node
            else:
                function = ARITHMETIC.get(type(node)) or node.numpy
                self.calls.append((place, function, tuple(places[each] for each in node.args)))
        self.results = [places[each] for each in expressions]

    def run(self, values: Mapping[Symbol, Any]) -> list[Any]:
        """Values of the expressions for numbers or traced numbers in place of their symbols."""
        found: dict[int, Any] = {place: values[symbol] for place, symbol in self.symbols.items()}
        found |= self.constants
        for place, function, operands in self.calls:
            found[place] = function(*(found[each] for each in operands))
        return [found[place] for place in self.results]


def expressed(expressions: Sequence[Expression]) -> Expressed:
    """A vector-valued model function."""
    return Expressed(tuple(expressions), len(expressions))


def scalar(expression: Expression) -> Expressed:
    """A scalar model function."""
    return Expressed((expression,))
