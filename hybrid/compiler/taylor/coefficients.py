"""What the coefficients of a mode's series are called, and where they are stored.

An expression has a variable, a column of the matrix of all coefficients, or both; how its coefficients follow
from others, ``hybrid.compiler.taylor.series`` says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from hybrid.compiler.statements.code import Code, Statement, at, either, equal, get, put
from hybrid.compiler.statements.values import Constants
from hybrid.expression.graph import Group, mentions, nodes
from hybrid.expression.nodes import Expression, Symbol
from hybrid.kernels.types.codes import NARROW

# The order of a coefficient, the matrix of all coefficients, and the reciprocal of the order.
o, OUT, shrink = map(get, ("o", "out", "shrink"))
# The highest order.
ORDER = get("order")
# The coefficients of time from the first on.
ONE_THEN_ZERO = either(equal(o, 1), 1.0, 0.0)


class Coefficients:
    """The statements that compute the coefficients of some expressions, order by order.

    The coefficient of order ``o`` of an expression is a local variable or an entry ``out[o, column]``.
    ``first`` are the statements for order zero, ``higher`` those for the others, which follow in a loop over
    ``o``. Convolutions are split (``hybrid.compiler.taylor.convolutions``): the terms at both ends contain
    coefficients of this order, all others are summed before. ``pairs`` lists the convolutions: the column of
    the first factor and the second factor, with the code of the second factor's coefficient. ``led`` has
    those whose first factor is a component, with its code: that end is known before ``higher``. In every sum,
    the term known last is added last, so that only one addition waits for it.

    With ``lanes``, a coefficient holds four numbers, one per tangent vector, in one register. ``blocks``
    lists the factors that multiply a scalar factor, by the column of the scalar factor.

    Parameters
    ----------
    rows
        By symbol: the column of ``out`` that holds its series.
    time
        The symbol of time and its coefficient of order one and above; None if the symbol is in ``rows``.
    allot
        Function that allocates a new column and returns it.
    prefix
        Prefix of the names of local variables.
    known
        Recurrences that run before these and hold the series of all expressions without symbols of ``rows``.
    at_start
        By expression: code for order zero that is better than the code from its operations.
    lanes
        Whether each symbol in ``rows`` represents four numbers.
    """

    def __init__(
        self,
        rows: Mapping[Symbol, Any],
        time: tuple[Symbol, Code] | None,
        allot: Callable[[], int],
        prefix: str,
        constants: Constants,
        known: Coefficients | None = None,
        at_start: Mapping[Expression, Any] | None = None,
        lanes: bool = False,
    ) -> None:
        self.rows: dict[Any, Any] = {**rows}
        self.lanes = lanes
        self.time = time
        self.allot = allot
        self.prefix = prefix
        self.constants = constants
        self.known = known
        self.at_start = at_start or {}
        self.first: list[Statement] = []
        self.higher: list[Statement] = []
        self.pairs: dict[tuple[Any, Expression], Any] = {}
        # The place of each pair, or, with lanes, of each block and of each factor in it.
        self.places: dict[Any, int] = {}
        self.blocks: dict[Any, list[Expression]] = {}
        self.led: dict[tuple[Any, Expression], Any] = {}
        self.variables: dict[Expression, Any] = {}
        self.slopes: dict[Expression, int] = {}
        # By column: the variable that holds its newest entry.
        self.held: dict[Any, Code] = {}
        self.shared: Counter[Expression] = Counter()
        self.lateness: dict[Expression, int] = {}
        self.readiness: dict[Expression, tuple[int, int]] = {}
        moving = [] if known is not None or time is None else [time[0]]
        self.own = Group((*rows, *moving))

    def expect(self, symbols: Iterable[Symbol | None], rates: Sequence[Expression]) -> None:
        """Analyse the rates of symbols before their recurrences are written.

        This counts the factors of products: a factor that many products share becomes their common
        first factor. A symbol with a long rate is known late, so it is added last in every sum.
        """
        self.readiness.clear()
        for symbol, rate in zip(symbols, rates, strict=True):
            if symbol is not None:
                self.lateness[symbol] = rate.size
            for node in nodes(rate):
                if node.is_product:
                    self.shared.update(node.args)

    def coefficient(self, expression: Expression) -> Any:
        """The coefficient of order ``o``."""
        if expression in self.variables:
            return self.variables[expression]
        if expression in self.rows:
            return at("out", o, self.rows[expression])
        if self._is_known(expression):
            return self._known_coefficient(expression)
        if self._is_constant(expression):
            return self._bind(expression, self.constants.name(expression), 0.0)
        return self._operation(expression)

    def row(self, expression: Expression) -> Any:
        """The column that holds the series of the expression."""
        if expression in self.rows:
            return self.rows[expression]
        if self._is_known(expression):
            assert self.known is not None
            return self.known.row(expression)
        value = self.coefficient(expression)
        if expression not in self.rows:
            self.rows[expression] = self.allot()
            self._both(put(at("out", o, self.rows[expression]), value))
        return self.rows[expression]

    def inner(self, *place: int) -> Code:
        """The convolution of a pair without both ends; with lanes, of a block and a place in it."""
        return get(f"{self.prefix}s{'_'.join(map(str, place))}")

    def newest(self, column: Any) -> Code:
        """The entry of order ``o`` of a column, from a variable if one holds it."""
        if column in self.held:
            return self.held[column]
        for expression, place in self.rows.items():
            if place == column and expression in self.variables:
                return self.variables[expression]
        return at("out", o, column)

    def beside(self, *place: int) -> Code:
        """The column of the second factor of a pair; with lanes, of a block and a place in it."""
        if not self.lanes:
            return get(f"{self.prefix}c{place[0]}")
        return get("v") + get(f"{self.prefix}b{place[0]}") + NARROW * place[1]

    def _is_known(self, expression: Expression) -> bool:
        return self.known is not None and not mentions(expression, self.own)

    def _known_coefficient(self, expression: Expression) -> Code:
        assert self.known is not None
        return at("out", o, self.known.row(expression))

    def _is_constant(self, expression: Expression) -> bool:
        return not mentions(expression, self.own) and (
            self.known is None or self.known._is_constant(expression)
        )

    def _both(self, statement: Statement) -> None:
        self.first.append(statement)
        self.higher.append(statement)

    def _bind(self, expression: Expression, first: Any, higher: Any) -> Code:
        """A variable for the expression: its value at order zero, and above."""
        name = self._name(expression)
        self.first.append(put(name, self.at_start.get(expression, first)))
        self.higher.append(put(name, higher))
        return name

    def _name(self, expression: Expression) -> Any:
        return self.variables.setdefault(expression, get(f"{self.prefix}{len(self.variables)}"))

    def _divisor(self, name: Code) -> Code:
        """The name of what a coefficient of this name is multiplied by in the place of a division."""
        return get(f"{name[1]}d")

    def _kept(self, expression: Expression, column: Any = None) -> tuple[Any, Any]:
        """Name and column of an expression whose recurrence reads its own earlier coefficients."""
        self.rows[expression] = self.allot() if column is None else column
        return self._name(expression), self.rows[expression]

    def _store(self, *expressions: Expression) -> None:
        for expression in expressions:
            self._both(put(at("out", o, self.rows[expression]), self.variables[expression]))

    def _place(self, left: Any, right: Expression) -> tuple[Code, Code]:
        """A convolution with the column ``left``, without both ends, and the column of the other factor."""
        if self.lanes:
            rights = self.blocks.setdefault(left, [])
            block = self.places.setdefault(left, len(self.blocks) - 1)
            place = self.places.setdefault((left, right), len(rights))
            if place == len(rights):
                rights.append(right)
            return self.inner(block, place), self.beside(block, place)
        self.pairs.setdefault((left, right), 0.0)
        place = self.places.setdefault((left, right), len(self.places))
        return self.inner(place), self.beside(place)

    @property
    def common_left(self) -> Any:
        """The column of the first factor if all pairs have the same one, else None."""
        lefts = {left for left, _ in self.pairs}
        return lefts.pop() if len(lefts) == 1 else None

    def _beside(self, left: Any, right: Expression) -> tuple[Code, Code, Any]:
        """The results of ``_place`` and the coefficient of the other factor, written to its column."""
        value = self.coefficient(right)
        inner, column = self._place(left, right)
        self.pairs[left, right] = value
        return inner, column, value

    def _slope(self, u: Expression) -> int:
        """Column of ``o`` times the coefficients of ``u``: those of the derivative, shifted by one order."""
        if u not in self.slopes:
            value = self.coefficient(u)
            self.slopes[u] = self.allot()
            name = self.held[self.slopes[u]] = get(f"{self.prefix}g{len(self.slopes)}")
            self._both(put(name, o * value))
            self._both(put(at("out", o, self.slopes[u]), name))
        return self.slopes[u]

    def _operation(self, expression: Expression) -> Any:
        """The coefficient of an expression that has none yet, by the recurrence of its operation."""
        raise NotImplementedError
