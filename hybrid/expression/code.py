"""Expressions as Python statements on floats, to be compiled.

The text depends only on the expressions, so that it can serve as a cache key.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any, ClassVar

from hybrid.expression import operations as ops
from hybrid.expression.graph import nodes
from hybrid.expression.nodes import TWO, ZERO, Expression, Power, Product, Sum, power, split
from hybrid.expression.tabulated import Tabulated

IMPORTS = (
    "import numpy as np\n"
    "from math import (\n"
    "    acos, acosh, asin, asinh, atan, atan2, atanh, copysign, cos, cosh, exp, expm1, hypot, inf,\n"
    "    log, log10, log1p, log2, sin, sinh, sqrt, tan, tanh,\n"
    ")\n"
    "from hybrid.kernels.arithmetic.columns import (\n"
    "    add_ends, add_ends_of_pairs, combine, combine_tangents, convolve, convolve_pairs, convolved,\n"
    "    spread_tangents,\n"
    ")\n"
    "from hybrid.kernels.arithmetic.doubled import divided_dot_product\n"
    "from hybrid.kernels.arithmetic.lanes import four_times, load, store, store_down, store_row\n"
    "from hybrid.kernels.arithmetic.tables import table\n"
)

COMPARISONS: dict[type[Expression], str] = {ops.Less: "<", ops.LessEqual: "<=", ops.Equal: "=="}
CONNECTIVES: dict[type[Expression], str] = {ops.And: "and", ops.Or: "or"}

# How tightly a text binds: it needs brackets inside a text that binds more tightly.
SUM, PRODUCT, POWER, ATOM = range(4)

LARGEST_UNROLLED_POWER = 16


def assignments(targets: Sequence[str], expressions: Sequence[Expression]) -> list[str]:
    """Statements that first compute every expression and then store the values in their targets.

    ``targets`` may therefore overlap with variables that the expressions read.
    """
    uses = _uses(each for each in expressions if not each.is_number)
    printer = _Printer(node for node, count in uses.items() if count > 1)
    stores = []
    for k, (target, expression) in enumerate(zip(targets, expressions, strict=True)):
        if expression is ZERO:
            value = "0.0"
        elif expression.is_number:
            value = printer.text(expression)
        else:
            value = f"y{k}"
            printer.assign(value, expression)
        stores.append(f"{target} = {value}")
    return printer.lines + stores


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
    """Name of a function without a counterpart in generated code, or None."""
    for node in nodes(*expressions):
        if node.args and not getattr(node, "code", "") and type(node) not in _Printer.PRINTERS:
            return type(node).__name__
    return None


class _Printer:
    """Prints one block of statements; values that are needed several times become variables.

    So do the expressions in ``shared``, which occur in several others.
    """

    def __init__(self, shared: Iterable[Expression] = ()) -> None:
        self.lines: list[str] = []
        self._variables: dict[Expression, str] = {}
        self._shared = frozenset(shared)

    def assign(self, name: str, expression: Expression) -> None:
        text = self.text(expression)  # may append lines, which must come first
        self.lines.append(f"{name} = {text}")

    def text(self, expression: Expression, binding: int = SUM) -> str:
        """The expression as code, in brackets if it binds less tightly than ``binding``."""
        if expression in self._shared or expression in self._variables:
            return self.name(expression)
        text, own = self._print(expression)
        return f"({text})" if own < binding else text

    def name(self, expression: Expression) -> str:
        """Code for the expression that can be repeated at no cost: a name or a number."""
        if not expression.args:
            return _in_brackets(*self._print(expression), ATOM)
        if expression not in self._variables:
            text, _ = self._print(expression)  # may append lines, which must come first
            self._variables[expression] = f"u{len(self._variables)}"
            self.lines.append(f"{self._variables[expression]} = {text}")
        return self._variables[expression]

    def _print(self, expression: Expression) -> tuple[str, int]:
        if expression.is_symbol:
            return expression.label, ATOM
        if expression.is_number:
            return _float_text(float(expression))
        printer = self.PRINTERS.get(type(expression))
        if printer is not None:
            return printer(self, expression)
        return f"{expression.code}({', '.join(self.text(argument) for argument in expression.args)})", ATOM

    def _sum(self, expression: Expression) -> tuple[str, int]:
        parts: list[str] = []
        for term in expression.args:
            text = self.text(term, PRODUCT)
            if not parts:
                parts.append(text)
            elif text.startswith("-"):
                parts.append(f" - {text[1:]}")
            else:
                parts.append(f" + {text}")
        return "".join(parts), SUM

    def _product(self, expression: Expression) -> tuple[str, int]:
        coefficient, rest = split(expression)
        above, below = [], []
        for factor in rest.args if rest.is_product else (rest,):
            if factor in self._shared:
                above.append(self.name(factor))
            elif factor.is_power and factor.exponent.is_number and factor.exponent.value < 0:
                below.append(self.text(power(factor.base, -factor.exponent), ATOM))
            else:
                above.append(self.text(factor, POWER))
        sign = "-" if coefficient < 0 else ""
        numerator, denominator = _fraction(abs(coefficient))
        if numerator != "1.0" or not above:
            above.insert(0, numerator)
        if denominator is not None:
            below.append(denominator)
        over = f"({'*'.join(below)})" if len(below) > 1 else "".join(below)
        return f"{sign}{'*'.join(above)}" + (f"/{over}" if below else ""), PRODUCT

    def _power(self, expression: Expression) -> tuple[str, int]:
        base, exponent = expression.args
        value = exponent.value if exponent.is_number else None
        if value is None or isinstance(value, float) or Fraction(value).denominator > 2:
            return f"{self.text(base, ATOM)}**{self.text(exponent, ATOM)}", POWER
        if abs(value) > LARGEST_UNROLLED_POWER:
            return f"{self.text(base, ATOM)}**{self.text(exponent, ATOM)}", POWER
        if value < 0:
            return f"1.0/{self.text(power(base, -exponent), ATOM)}", PRODUCT
        whole, half = divmod(Fraction(value), 1)
        if not whole:
            return f"sqrt({self.text(base)})", ATOM
        factors = self._repeated(base, whole)
        if half:
            factors.append(f"sqrt({self.name(base)})")
        return "*".join(factors), PRODUCT

    def _repeated(self, base: Expression, times: int) -> list[str]:
        """Factors that multiply to ``base**times``, by squaring."""
        if times <= 3:
            return [self.name(base)] * times
        return self._repeated(power(base, TWO), times // 2) + [self.name(base)] * (times % 2)

    def _condition(self, expression: Expression) -> str:
        kind = type(expression)
        if kind in COMPARISONS:
            a, b = (self.text(argument) for argument in expression.args)
            return f"{a} {COMPARISONS[kind]} {b}"
        if kind in CONNECTIVES:
            a, b = (f"({self._condition(argument)})" for argument in expression.args)
            return f"{a} {CONNECTIVES[kind]} {b}"
        if isinstance(expression, ops.Not):
            return f"not ({self._condition(expression.args[0])})"
        return f"{self.text(expression)} != 0.0"

    def _indicator(self, expression: Expression) -> tuple[str, int]:
        return f"(1.0 if {self._condition(expression)} else 0.0)", ATOM

    def _select(self, expression: Expression) -> tuple[str, int]:
        condition, a, b = expression.args
        return f"({self.text(a)} if {self._condition(condition)} else {self.text(b)})", ATOM

    # In the next four methods a comparison with nan is false, and the last branch returns the nan.

    def _step(self, expression: Expression) -> tuple[str, int]:
        u = self.name(expression.args[0])
        return f"(1.0 if {u} > 0.0 else 0.0 if {u} < 0.0 else 0.5 + {u})", ATOM

    def _gate(self, expression: Expression) -> tuple[str, int]:
        u, rest = self.name(expression.args[0]), self.text(expression.args[1], POWER)
        return f"(0.0 if {u} < 0.0 else {rest}*(1.0 if {u} > 0.0 else 0.5 + {u}))", ATOM

    def _sign(self, expression: Expression) -> tuple[str, int]:
        u = self.name(expression.args[0])
        return f"(1.0 if {u} > 0.0 else -1.0 if {u} < 0.0 else {u})", ATOM

    def _extremum(self, expression: Expression) -> tuple[str, int]:
        beaten = "<" if isinstance(expression, ops.Maximum) else ">"
        a, b = sorted(expression.args, key=lambda argument: argument.is_number)
        left, right = self.name(a), self.name(b)
        if isinstance(expression, ops.LargerNumber | ops.SmallerNumber):
            return f"({right} if {left} {beaten} {right} or {left} != {left} else {left})", ATOM
        if b.is_number:
            return f"({right} if {left} {beaten} {right} else {left})", ATOM
        return f"({right} if {left} {beaten} {right} or {right} != {right} else {left})", ATOM

    def _whole_quotient(self, expression: Expression) -> tuple[str, int]:
        """As in Python: the remainder is exact, so the rest is a multiple of the divisor up to rounding."""
        a, b = (self.name(argument) for argument in expression.args)
        rest = self.name(ops.TruncatedRemainder(*expression.args))
        below = f"({rest} < 0.0 and {b} > 0.0) or ({rest} > 0.0 and {b} < 0.0)"
        return f"(np.floor(({a} - {rest})/{b} + 0.5) - (1.0 if {below} else 0.0))", ATOM

    def _remainder(self, expression: Expression) -> tuple[str, int]:
        a, b = (self.text(argument, ATOM) for argument in expression.args)
        return f"({a} % {b})", ATOM

    def _cube_root(self, expression: Expression) -> tuple[str, int]:
        u = self.name(expression.args[0])
        return f"copysign(abs({u})**{1 / 3!r}, {u})", ATOM

    def _tabulated(self, expression: Tabulated) -> tuple[str, int]:
        """A call with the table's name in the place of where its numbers begin in ``p``."""
        pieces, u = expression.pieces, self.text(expression.args[0])
        sizes = f"{len(pieces.knots)}, {pieces.degree}, {expression.derived}"
        return f"table(p, {pieces.name}, {sizes}, {u})", ATOM

    def _exp2(self, expression: Expression) -> tuple[str, int]:
        return f"2.0**{self.text(expression.args[0], ATOM)}", POWER

    PRINTERS: ClassVar[dict[type[Expression], Callable[[_Printer, Any], tuple[str, int]]]] = {
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


def _in_brackets(text: str, own: int, binding: int) -> str:
    return f"({text})" if own < binding else text


def _float_text(value: float) -> tuple[str, int]:
    text = repr(value)
    return text, PRODUCT if text.startswith("-") else ATOM


def _fraction(coefficient: int | Fraction | float) -> tuple[str, str | None]:
    """A positive number as a float, or as a quotient of two floats if one float is not exact."""
    if isinstance(coefficient, Fraction) and coefficient.denominator & (coefficient.denominator - 1):
        return repr(float(coefficient.numerator)), repr(float(coefficient.denominator))
    return repr(float(coefficient)), None


def power_text(base: str, exponent: Expression, name: str) -> str:
    """Text of a power; half-integer powers use a square root."""
    value = exponent.value if exponent.is_number else 0.0
    if isinstance(value, float) or Fraction(value).denominator != 2:
        return f"{base}**{name}"
    product = "*".join([base] * (abs(value.numerator) // 2) + [f"sqrt({base})"])
    return product if value > 0 else f"1.0/({product})"
