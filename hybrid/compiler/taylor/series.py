"""Taylor series of a mode's solutions: recurrences for their coefficients, written as code.

Every expression of the vector field is split into elementary operations. Each has a recurrence for its
normalised Taylor coefficients along a solution (Jorba and Zou 2005, doi:10.1080/10586458.2005.10128904;
Griewank and Walther, Evaluating Derivatives, 2nd ed. 2008, table 13.2). Linear operations cost one
multiplication per order, products and functions cost one convolution per order.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from hybrid.compiler.statements.code import Code, Statement, at, call, either, equal, get, put
from hybrid.compiler.statements.values import Constants, assignments, root_power
from hybrid.compiler.taylor.sums import Term, added
from hybrid.expression import operations as ops
from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import Group, factors_of, is_negative, is_whole, mentions, nodes, terms_of
from hybrid.expression.nodes import ONE, TWO, ZERO, Expression, Symbol, add, multiply, number, power
from hybrid.expression.tabulated import Tabulated, has_knots_in_time
from hybrid.kernels.types.codes import NARROW

# A pair of functions, and the sign in the derivative of the second: cos' = -sin, cosh' = sinh.
PAIRS = dict.fromkeys((ops.Sin, ops.Cos), (ops.Sin, ops.Cos, -1.0)) | dict.fromkeys(
    (ops.Sinh, ops.Cosh), (ops.Sinh, ops.Cosh, 1.0)
)
# ``y' = (1 -+ y^2) u'``.
OWN_SQUARE = {ops.Tanh: -1, ops.Tan: 1}
# Longer inner sums are not expanded: other expressions may need them too.
MOST_TERMS = 4
# The order of a coefficient, the matrix of all coefficients, and the reciprocal of the order.
o, OUT, shrink = map(get, ("o", "out", "shrink"))
# The highest order.
ORDER = get("order")
# The coefficients of time from the first on.
ONE_THEN_ZERO = either(equal(o, 1), 1.0, 0.0)


class NoSeries(Exception):
    """An expression has no Taylor recurrence here; the message says which part."""


class Recurrences:
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
        known: Recurrences | None = None,
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
        if self.time is not None and expression == self.time[0]:
            return self._bind(expression, get("t"), self.time[1])
        if expression.is_sum:
            return self._sum(expression)
        if expression.is_product:
            return self._product(expression)
        if expression.is_power:
            return self._power(expression)
        if isinstance(expression, ops.Exp):
            return self._exponential(expression, expression.args[0])
        if type(expression) in PAIRS:
            return self._pair(expression)
        if type(expression) in OWN_SQUARE:
            return self._own_square(expression)
        if expression.in_other_terms is not None:
            return self._same(expression, expression.in_other_terms(*expression.args))
        if expression.by_derivative:
            return self._by_derivative(expression)
        if isinstance(expression, Tabulated) and self.time is not None and has_knots_in_time(expression):
            return self._table(expression, derivative(expression.args[0], self.time[0]))
        if isinstance(expression, ops.Level):
            return self._bind(expression, call("np.floor", self.coefficient(*expression.args)), 0.0)
        raise NoSeries(f"{expression.word} is not analytic")

    def _same(self, expression: Expression, other: Expression) -> Code:
        value = self.coefficient(other)
        return self._bind(expression, value, value)

    def _sum(self, expression: Expression) -> Code:
        terms = self._terms(expression)
        constant = add(*(factor for factor, rest in terms if rest is ONE))
        moving = [(factor, rest) for factor, rest in terms if rest is not ONE]
        first = added([self._times(*term) for term in moving])
        if constant is not ZERO:
            first = first + self.constants.name(constant)
        return self._bind(expression, first, added([self._higher_times(*term) for term in moving]))

    def _terms(self, expression: Expression) -> list[tuple[Expression, Expression]]:
        """The terms of a sum as pairs of a constant factor and a varying factor; inner sums are expanded.

        Otherwise each level of nested sums would wait for the level below. A difference of states, whose
        digits may cancel, is not expanded.
        """
        found = []
        for factor, rest in map(self._split, terms_of(expression)):
            if self._comes_apart(rest):
                found += [(factor * each, moving) for each, moving in self._terms(rest)]
            else:
                found.append((factor, rest))
        return found

    def _comes_apart(self, rest: Expression) -> bool:
        at_hand = self._is_known(rest) or rest in self.variables or rest in self.rows
        if not rest.is_sum or at_hand or len(rest.args) > MOST_TERMS:
            return False
        return not all(self._is_constant(term) or self._is_plain(*self._split(term)) for term in rest.args)

    @staticmethod
    def _is_plain(factor: Expression, rest: Expression) -> bool:
        return rest.is_symbol and factor in (1, -1)

    def _split(self, term: Expression) -> tuple[Expression, Expression]:
        """The product of the constant factors of a term, and that of the others."""
        factors = factors_of(term)
        constant = [factor for factor in factors if self._is_constant(factor)]
        return multiply(*constant), multiply(*(factor for factor in factors if factor not in constant))

    def _times(self, constant: Expression, rest: Expression) -> Term:
        value = self.coefficient(rest)
        if constant != 1:
            value = self.constants.name(constant) * value
        return Term(self._ready(rest), value, constant != 1)

    def _higher_times(self, constant: Expression, rest: Expression) -> Term:
        """``_times`` above order zero, where a sum with one varying term is a multiple of that term."""
        self.coefficient(rest)
        while rest.is_sum or rest.is_product:
            moving = [each for each in terms_of(rest) if not self._is_constant(each)]
            factor, inner = self._split(moving[0])
            if len(moving) > 1 or (factor == 1 and inner == rest):
                break
            constant, rest = constant * factor, inner
        return self._times(constant, rest)

    def _ready(self, expression: Expression) -> tuple[int, int]:
        """When a coefficient is known: operations after the states, and lateness of the states."""
        if expression.is_symbol:
            return 1, self.lateness.get(expression, 0)
        if expression not in self.readiness:
            moving = [each for each in expression.args if not self._is_constant(each)]
            depth, late = 0, 0
            if moving and not self._is_known(expression):
                depth, late = max(map(self._ready, moving))
                depth += 1 if expression.is_sum or expression.is_product else 2
            self.readiness[expression] = depth, late
        return self.readiness[expression]

    def _product(self, expression: Expression) -> Code:
        factors = expression.args
        if any(self._is_constant(factor) for factor in factors):
            term = self._split(expression)
            return self._bind(expression, self._times(*term).code, self._higher_times(*term).code)
        below = [f for f in factors if f.is_power and is_negative(f.exponent)]
        # A known divisor becomes a factor: the series of its reciprocal is stored.
        below = [f for f in below if self.known is None or mentions(f, self.own)]
        if below and len(below) < len(factors):
            above = multiply(*(f for f in factors if f not in below))
            return self._quotient(expression, above, multiply(*(1 / f for f in below)))
        if len(below) > 1:
            return self._quotient(expression, None, multiply(*(1 / f for f in below)))
        # The first factor is a known one, or else the one that most products share.
        *others, last = sorted(factors, key=lambda factor: (-mentions(factor, self.own), self.shared[factor]))
        return self._convolution(expression, last, multiply(*others))

    def _convolution(self, expression: Expression, a: Expression, b: Expression) -> Code:
        left = self.row(a)
        factor = self._known_coefficient(a) if self._is_known(a) else self.coefficient(a)
        inner, right, value = self._beside(left, b)
        if not self.lanes:
            # Time is a symbol too, but its coefficient becomes known only in ``higher``.
            if a.is_symbol and a in self.variables and not (self.time and a == self.time[0]):
                self.led[left, b] = factor
            else:
                inner = inner + factor * at("out", 0, right)
        return self._bind(expression, factor * value, inner + at("out", 0, left) * value)

    def _quotient(self, expression: Expression, above: Expression | None, below: Expression) -> Code:
        dividend = None if above is None else self.coefficient(above)
        divisor, value = self.row(below), self.coefficient(below)
        inner, column = self._place(divisor, expression)
        name, column = self._kept(expression, column)
        # The minus sign is included here, so that no term has to be negated.
        self.first.append(put(self._divisor(name), -1.0 / value))
        inner = inner if dividend is None else inner - dividend
        first = (1.0 if dividend is None else dividend) / value
        self._bind(expression, first, (inner + value * at("out", 0, column)) * self._divisor(name))
        self.pairs[divisor, expression] = name
        return name

    def _power(self, expression: Expression) -> Code:
        base, exponent = expression.args
        if not self._is_constant(exponent):
            return self._same(expression, ops.Exp(exponent * ops.Log(base)))
        if is_whole(exponent) and is_negative(exponent):
            return self._quotient(expression, None, power(base, -exponent))
        if is_whole(exponent):
            half = power(base, number(exponent.value // 2))
            return self._convolution(
                expression, *((base, power(base, exponent - 1)) if exponent.value % 2 else (half, half))
            )
        u, slope, k = self.row(base), self._slope(base), self.constants.name(exponent)
        value = self.coefficient(base)
        inner, column = self._place(u, expression)
        moving, _ = self._place(slope, expression)
        name, column = self._kept(expression, column)
        self.first.append(put(self._divisor(name), 1.0 / value))
        whole = moving + at("out", o, slope) * at("out", 0, column)
        higher = (k * whole + moving - o * inner) * shrink * self._divisor(name)
        self._bind(expression, root_power(value, exponent, k), higher)
        self.pairs[u, expression] = name
        self.pairs[slope, expression] = name
        return name

    def _rate(self, u: Expression) -> Any:
        """The constant rate of an argument that is linear in time; None for other arguments."""
        if self.time is None or self.time[1] is not ONE_THEN_ZERO:
            return None
        if mentions(u, [each for each in self.own if each is not self.time[0]]):
            return None
        slope = derivative(u, self.time[0])
        return self.constants.name(slope) if self._is_constant(slope) else None

    def _exponential(self, expression: Expression, u: Expression) -> Code:
        rate = self._rate(u)
        first = call("exp", self.coefficient(u))
        if rate is not None:
            name, column = self._kept(expression)
            self._bind(expression, first, shrink * rate * at("out", o - 1, column))
            self._store(expression)
            return name
        slope = self._slope(u)
        inner, column = self._place(slope, expression)
        name, column = self._kept(expression, column)
        self._bind(expression, first, _integrated(inner, slope, column))
        self.pairs[slope, expression] = name
        return name

    def _pair(self, expression: Expression) -> Any:
        odd, even, sign = PAIRS[type(expression)]
        (u,) = expression.args
        s, c = odd(u), even(u)
        rate = self._rate(u)
        argument = self.coefficient(u)
        if rate is not None:
            (s_name, s_column), (c_name, c_column) = self._kept(s), self._kept(c)
            values = (
                shrink * rate * at("out", o - 1, c_column),
                sign * shrink * rate * at("out", o - 1, s_column),
            )
        else:
            slope = self._slope(u)
            (s_sum, s_column), (c_sum, c_column) = (self._place(slope, each) for each in (s, c))
            (s_name, _), (c_name, _) = self._kept(s, s_column), self._kept(c, c_column)
            values = _integrated(c_sum, slope, c_column), sign * _integrated(s_sum, slope, s_column)
        self.first += [put(s_name, call(odd.code, argument)), put(c_name, call(even.code, argument))]
        self.higher += [put(s_name, values[0]), put(c_name, values[1])]
        if rate is not None:
            self._store(s, c)
        else:
            self.pairs[slope, s] = s_name
            self.pairs[slope, c] = c_name
        return self.variables[expression]

    def _table(self, expression: Tabulated, rate: Expression) -> Code:
        """A table of what grows at a constant rate, a polynomial on each step: its knots end steps."""
        name, higher = self._name(expression), either(equal(o, 0), 0.0, 0.0)
        orders = range(1 + expression.pieces.degree - expression.derived)
        values = [expression.differentiated(k) * rate**k / math.factorial(k) for k in orders]
        later = [get(f"{name[1]}d{k}") for k in orders[1:]]
        self.first += assignments([name, *later], values)
        for order, coefficient in enumerate(later, 1):
            higher = either(equal(o, order), coefficient, higher)
        self.higher.append(put(name, higher))
        return name

    def _own_square(self, expression: Expression) -> Code:
        sign = OWN_SQUARE[type(expression)]
        (u,) = expression.args
        argument, rate = self.coefficient(u), self._slope(u)
        slope = 1 + sign * power(expression, TWO)
        moving, slope_column = self._place(rate, slope)
        name, row = self._kept(expression)
        slope_name, _ = self._kept(slope, slope_column)
        inner, _ = self._place(row, expression)
        self.first.append(put(name, call(expression.code, argument)))
        self.higher.append(put(name, _integrated(moving, rate, slope_column)))
        self._store(expression)
        self.pairs[row, expression] = name
        self.first.append(put(slope_name, 1.0 + float(sign) * name * name))
        self.higher.append(put(slope_name, float(sign) * (inner + 2.0 * at("out", 0, row) * name)))
        self.pairs[rate, slope] = slope_name
        return name

    def _by_derivative(self, expression: Expression) -> Code:
        (u,) = expression.args
        argument, rate = self.coefficient(u), self._slope(u)
        inner, slope, _ = self._beside(rate, expression.slope())
        return self._bind(expression, call(expression.code, argument), _integrated(inner, rate, slope))


def _integrated(inner: Code, slope: Any, column: Any) -> Code:
    """The coefficient of what has a product as its rate: its inner terms, then the one of this order."""
    return (inner + at("out", o, slope) * at("out", 0, column)) * shrink
