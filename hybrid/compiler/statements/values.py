"""Expressions as statements on floats, which depend on nothing but the expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import reduce
from operator import mul
from typing import Any, ClassVar

from hybrid.compiler.statements.code import Code, Statement, Term, at, call, either, get, less, put
from hybrid.expression import operations as ops
from hybrid.expression.graph import nodes
from hybrid.expression.nodes import TWO, Expression, Power, Product, Sum, power, split
from hybrid.expression.tabulated import Tabulated, tables_of_time

COMPARISONS: dict[type[Expression], str] = {ops.Less: "<", ops.LessEqual: "<=", ops.Equal: "=="}
CONNECTIVES: dict[type[Expression], str] = {ops.And: "and", ops.Or: "or"}

LARGEST_UNROLLED_POWER = 16


def assignments(targets: Sequence[Code], expressions: Sequence[Expression]) -> list[Statement]:
    """Statements that first compute every expression and then store the values in their targets.

    ``targets`` may therefore overlap with variables that the expressions read.
    """
    uses = _uses(each for each in expressions if not each.is_number)
    # A table is read at its very knots: fusing would move its argument to the other side of one.
    rounded = [each.args[0] for each in tables_of_time(*expressions)]
    writer = _Writer((node for node, count in uses.items() if count > 1), rounded)
    stores = []
    for k, (target, expression) in enumerate(zip(targets, expressions, strict=True)):
        value: Term = get(f"y{k}")
        if expression.is_number:
            value = float(expression)
        else:
            writer.assign(value, expression)
        stores.append(put(target, value))
    return writer.statements + stores


def _uses(expressions: Iterable[Expression]) -> dict[Expression, int]:
    """Number of uses of each subexpression, except symbols and numbers."""
    uses: dict[Expression, int] = {}
    waiting = list(expressions)
    while waiting:
        node = waiting.pop()
        if not node.args:
            continue
        uses[node] = uses.get(node, 0) + 1
        if uses[node] == 1:
            waiting.extend(node.args)
    return uses


def unprintable(expressions: Iterable[Expression]) -> str | None:
    """Name of a function without a counterpart in compiled code, or None."""
    for node in nodes(*expressions):
        if node.args and not getattr(node, "code", "") and type(node) not in _Writer.WRITERS:
            return type(node).__name__
    return None


class _Writer:
    """Writes one block of statements; values that are needed several times become variables.

    So do the expressions in ``shared``, which occur in several others. Nothing is fused in those in
    ``rounded``.
    """

    def __init__(self, shared: Iterable[Expression], rounded: Iterable[Expression]) -> None:
        self.statements: list[Statement] = []
        self._variables: dict[Expression, Code] = {}
        self._shared, self._rounded = frozenset(shared), frozenset(rounded)

    def assign(self, target: Term, expression: Expression) -> None:
        value = self.term(expression)  # may append statements, which must come first
        self.statements.append(("set", target, value))

    def term(self, expression: Expression) -> Any:
        """The expression as a term."""
        if expression in self._shared or expression in self._variables:
            return self.name(expression)
        return self._written(expression)

    def name(self, expression: Expression) -> Any:
        """A term for the expression that can be repeated at no cost: a variable or a number."""
        if not expression.args:
            return self._written(expression)
        if expression not in self._variables:
            value = self._written(expression)  # may append statements, which must come first
            self._variables[expression] = variable = get(f"u{len(self._variables)}")
            self.statements.append(put(variable, value))
        return self._variables[expression]

    def _written(self, expression: Expression) -> Any:
        term = self._term(expression)
        return call("rounded", term) if expression in self._rounded and isinstance(term, Code) else term

    def _term(self, expression: Expression) -> Any:
        if expression.is_symbol:
            return entry(expression.label)
        if expression.is_number:
            return float(expression)
        writer = self.WRITERS.get(type(expression))
        if writer is not None:
            return writer(self, expression)
        return call(expression.code, *map(self.term, expression.args))

    def _sum(self, expression: Expression) -> Any:
        total: Any = None
        for term in expression.args:
            is_negative, size = self._sign_and_size(term)
            if total is None:
                total = self.term(term) if is_negative else size
            else:
                total = total - size if is_negative else total + size
        return total

    def _sign_and_size(self, term: Expression) -> tuple[bool, Any]:
        """Whether a term of a sum is subtracted, and what is then subtracted or added."""
        if term in self._shared or term in self._variables:
            return False, self.name(term)
        if term.is_number:
            value = float(term)
            return value < 0.0, abs(value)
        if term.is_product:
            return self._sign_and_factors(term)
        return False, self.term(term)

    def _product(self, expression: Expression) -> Any:
        is_negative, size = self._sign_and_factors(expression, signed=True)
        assert not is_negative
        return size

    def _sign_and_factors(self, expression: Expression, *, signed: bool = False) -> tuple[bool, Any]:
        """The sign of a product, and its factors multiplied; ``signed``, the first factor has the sign."""
        coefficient, rest = split(expression)
        above, below = list[Any](), list[Any]()
        for factor in rest.args if rest.is_product else (rest,):
            if factor in self._shared:
                above.append(self.name(factor))
            elif factor.is_power and factor.exponent.is_number and factor.exponent.value < 0:
                below.append(self.term(power(factor.base, -factor.exponent)))
            else:
                above.append(self.term(factor))
        numerator, denominator = _fraction(abs(coefficient))
        if numerator != 1.0 or not above:
            above.insert(0, numerator)
        if denominator is not None:
            below.append(denominator)
        if coefficient < 0 and signed:
            above[0] = -above[0]
        size = reduce(mul, above)
        return coefficient < 0 and not signed, size / reduce(mul, below) if below else size

    def _power(self, expression: Expression) -> Any:
        base, exponent = expression.args
        value = exponent.value if exponent.is_number else None
        is_long = value is None or isinstance(value, float) or Fraction(value).denominator > 2
        if value is None or is_long or abs(value) > LARGEST_UNROLLED_POWER:
            return call("**", self.term(base), self.term(exponent))
        if value < 0:
            return 1.0 / self.term(power(base, -exponent))
        times, half = divmod(Fraction(value), 1)
        if not times:
            return call("sqrt", self.term(base))
        factors = self._repeated(base, times)
        if half:
            factors.append(call("sqrt", self.name(base)))
        return reduce(mul, factors)

    def _repeated(self, base: Expression, times: int) -> list[Any]:
        """Factors that multiply to ``base**times``, by squaring."""
        if times <= 3:
            return [self.name(base)] * times
        return self._repeated(power(base, TWO), times // 2) + [self.name(base)] * (times % 2)

    def _condition(self, expression: Expression) -> Code:
        kind = type(expression)
        if kind in COMPARISONS:
            return call(COMPARISONS[kind], *map(self.term, expression.args))
        if kind in CONNECTIVES:
            return call(CONNECTIVES[kind], *map(self._condition, expression.args))
        if isinstance(expression, ops.Not):
            return call("not", self._condition(expression.args[0]))
        return call("!=", self.term(expression), 0.0)

    def _indicator(self, expression: Expression) -> Any:
        return either(self._condition(expression), 1.0, 0.0)

    def _select(self, expression: Expression) -> Any:
        condition, a, b = expression.args
        branches = self.term(a), self.term(b)
        return either(self._condition(condition), *branches)

    # In the next four methods a comparison with nan is false, and the last branch returns the nan.

    def _step(self, expression: Expression) -> Any:
        u = self.name(expression.args[0])
        return either(less(0.0, u), 1.0, either(less(u, 0.0), 0.0, 0.5 + u))

    def _gate(self, expression: Expression) -> Any:
        u, rest = self.name(expression.args[0]), self.term(expression.args[1])
        return either(less(u, 0.0), 0.0, rest * either(less(0.0, u), 1.0, 0.5 + u))

    def _sign(self, expression: Expression) -> Any:
        u = self.name(expression.args[0])
        return either(less(0.0, u), 1.0, either(less(u, 0.0), -1.0, u))

    def _extremum(self, expression: Expression) -> Any:
        beaten = "<" if isinstance(expression, ops.Maximum) else ">"
        a, b = sorted(expression.args, key=lambda argument: argument.is_number)
        left, right = self.name(a), self.name(b)
        is_beaten = call(beaten, left, right)
        if isinstance(expression, ops.LargerNumber | ops.SmallerNumber):
            is_beaten = call("or", is_beaten, call("!=", left, left))
        elif not b.is_number:
            is_beaten = call("or", is_beaten, call("!=", right, right))
        return either(is_beaten, right, left)

    def _whole_quotient(self, expression: Expression) -> Any:
        """As in Python: the remainder is exact, so the rest is a multiple of the divisor up to rounding."""
        a, b = map(self.name, expression.args)
        rest = self.name(ops.TruncatedRemainder(*expression.args))
        is_below = call(
            "or", call("and", less(rest, 0.0), less(0.0, b)), call("and", less(0.0, rest), less(b, 0.0))
        )
        return call("np.floor", (a - rest) / b + 0.5) - either(is_below, 1.0, 0.0)

    def _remainder(self, expression: Expression) -> Any:
        return call("%", *map(self.term, expression.args))

    def _cube_root(self, expression: Expression) -> Any:
        u = self.name(expression.args[0])
        return call("copysign", call("abs", u) ** (1 / 3), u)

    def _tabulated(self, expression: Tabulated) -> Any:
        """A call with the table's name in the place of where its numbers begin in ``p``."""
        pieces, u = expression.pieces, self.term(expression.args[0])
        return call("table", get("p"), pieces.name, len(pieces.knots), pieces.degree, expression.derived, u)

    def _exp2(self, expression: Expression) -> Any:
        return call("**", 2.0, self.term(expression.args[0]))

    WRITERS: ClassVar[dict[type[Expression], Callable[[_Writer, Any], Any]]] = {
        Sum: _sum,
        Product: _product,
        Power: _power,
        ops.Less: _indicator,
        ops.LessEqual: _indicator,
        ops.Equal: _indicator,
        ops.And: _indicator,
        ops.Or: _indicator,
        ops.Not: _indicator,
        ops.Select: _select,
        ops.Step: _step,
        ops.Gate: _gate,
        ops.Sign: _sign,
        ops.Maximum: _extremum,
        ops.Minimum: _extremum,
        ops.LargerNumber: _extremum,
        ops.SmallerNumber: _extremum,
        ops.WholeQuotient: _whole_quotient,
        ops.Remainder: _remainder,
        ops.CubeRoot: _cube_root,
        ops.Exp2: _exp2,
        Tabulated: _tabulated,
    }


def entry(label: str) -> Code:
    """A variable, or an entry of an array such as ``x[0]``."""
    array, bracket, index = label.partition("[")
    return at(array, int(index[:-1])) if bracket else get(label)


def _fraction(coefficient: int | Fraction | float) -> tuple[float, float | None]:
    """A positive number as a float, or as a quotient of two floats if one float is not exact."""
    if isinstance(coefficient, Fraction) and coefficient.denominator & (coefficient.denominator - 1):
        return float(coefficient.numerator), float(coefficient.denominator)
    return float(coefficient), None


def root_power(base: Code, exponent: Expression, name: Any) -> Any:
    """A power; half-integer powers use a square root."""
    value = exponent.value if exponent.is_number else 0.0
    if isinstance(value, float) or Fraction(value).denominator != 2:
        return call("**", base, name)
    product = reduce(mul, [base] * (abs(value.numerator) // 2) + [call("sqrt", base)])
    return product if value > 0 else 1.0 / product


class Constants:
    """Names for expressions that depend only on the parameters; they are computed once per call."""

    def __init__(self) -> None:
        self.names: dict[Expression, Code] = {}

    def name(self, expression: Expression) -> Any:
        """A name for the expression, or the number itself."""
        if expression.is_number:
            return float(expression)
        return self.names.setdefault(expression, get(f"k{len(self.names)}"))

    def statements(self) -> list[Statement]:
        """Assignments of all named expressions."""
        return assignments([*self.names.values()], [*self.names])
