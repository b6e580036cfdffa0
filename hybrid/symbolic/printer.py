"""SymPy expressions as Python statements on floats, to be compiled.

The text depends only on the expressions, so that it can serve as a cache key.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import ClassVar

import sympy
from sympy.codegen.cfunctions import exp2, expm1, hypot, log1p, log2, log10
from sympy.core.parameters import distribute

from hybrid.symbolic import expressions as sym
from hybrid.symbolic.nodes import is_larger_than, nodes

MATH_FUNCTIONS: dict[type[sympy.Basic], str] = {
    sympy.exp: "exp",
    expm1: "expm1",
    sympy.log: "log",
    log1p: "log1p",
    log2: "log2",
    log10: "log10",
    sympy.sin: "sin",
    sympy.cos: "cos",
    sympy.tan: "tan",
    sympy.asin: "asin",
    sympy.acos: "acos",
    sympy.atan: "atan",
    sym.Atan2: "atan2",
    sympy.sinh: "sinh",
    sympy.cosh: "cosh",
    sympy.tanh: "tanh",
    sympy.asinh: "asinh",
    sympy.acosh: "acosh",
    sympy.atanh: "atanh",
    hypot: "hypot",
    sym.TruncatedRemainder: "np.fmod",
    sym.Absolute: "abs",
    sympy.Abs: "abs",
    # math.floor gives an integer, which cannot hold every float
    sym.Floor: "np.floor",
    sym.Level: "np.floor",
    sym.Ceiling: "np.ceil",
    sym.Truncate: "np.trunc",
}

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
)

COMPARISONS: dict[type[sympy.Basic], str] = {sym.Less: "<", sym.LessEqual: "<=", sym.Equal: "=="}
CONNECTIVES: dict[type[sympy.Basic], str] = {sym.And: "and", sym.Or: "or"}

# How tightly a text binds: it needs brackets inside a text that binds more tightly.
SUM, PRODUCT, POWER, ATOM = range(4)

LARGEST_UNROLLED_POWER = 16
# In a block with more expressions than this, only whole expressions are shared: the time of the search for
# common parts of sums and products grows faster than the block.
LARGE = 400
# The same holds if an expression, written out as a tree, has more operations than this.
LARGE_TREE = 20_000


def assignments(
    targets: Sequence[str], expressions: Sequence[sympy.Expr], *, thorough: bool = True
) -> list[str]:
    """Statements that first compute every expression and then store the values in their targets.

    ``targets`` may therefore overlap with variables that the expressions read. Without ``thorough``, only
    whole expressions are shared, not parts of sums and products.
    """
    # Most entries of a large matrix are zero.
    varying = [each for each in expressions if not each.is_Number]
    uses = _uses(varying)
    if not thorough or len(uses) > LARGE or any(is_larger_than(LARGE_TREE, each) for each in varying):
        reduced, printer = varying, _Printer(node for node, count in uses.items() if count > 1)
    else:
        # With numbers distributed over sums, SymPy may mistake a sum for a product of its terms.
        with distribute(False):
            shared, reduced = sympy.cse(varying, symbols=sympy.numbered_symbols("c", real=True), list=True)
        printer = _Printer()
        for symbol, expression in shared:
            printer.assign(symbol.name, expression)
    stores, rest = [], iter(reduced)
    for k, (target, expression) in enumerate(zip(targets, expressions, strict=True)):
        value = f"y{k}"
        if expression is sym.ZERO:
            value = "0.0"
        elif expression.is_Number:
            value = printer.text(expression)
        else:
            printer.assign(value, next(rest))
        stores.append(f"{target} = {value}")
    return printer.lines + stores


def _uses(expressions: Iterable[sympy.Expr]) -> dict[sympy.Expr, int]:
    """Number of uses of each subexpression, except symbols and numbers."""
    uses: dict[sympy.Expr, int] = {}
    waiting = list(expressions)
    while waiting:
        node = waiting.pop()
        if not node.args:
            continue
        uses[node] = uses.get(node, 0) + 1
        if uses[node] == 1:
            waiting.extend(node.args)
    return uses


def unprintable(expressions: Iterable[sympy.Expr]) -> str | None:
    """Name of a function without a counterpart in generated code, or None."""
    known = {*MATH_FUNCTIONS, *_Printer.PRINTERS}
    for node in nodes(*expressions):
        if isinstance(node, sympy.Symbol | sympy.Number | sympy.NumberSymbol):
            continue
        if node.func not in known:
            return str(node.func.__name__)
    return None


class _Printer:
    """Prints one block of statements; values that are needed several times become variables.

    So do the expressions in ``shared``, which occur in several others.
    """

    def __init__(self, shared: Iterable[sympy.Expr] = ()) -> None:
        self.lines: list[str] = []
        self._variables: dict[sympy.Expr, str] = {}
        self._shared = frozenset(shared)

    def assign(self, name: str, expression: sympy.Expr) -> None:
        text = self.text(expression)  # may append lines, which must come first
        self.lines.append(f"{name} = {text}")

    def text(self, expression: sympy.Expr, binding: int = SUM) -> str:
        """The expression as code, in brackets if it binds less tightly than ``binding``."""
        if expression in self._shared:
            return self.name(expression)
        text, own = self._print(expression)
        return f"({text})" if own < binding else text

    def name(self, expression: sympy.Expr) -> str:
        """Code for the expression that can be repeated at no cost: a name or a number."""
        if expression.is_Symbol or expression.is_Number:
            return self.text(expression, ATOM)
        if expression not in self._variables:
            name = f"u{len(self._variables)}"
            self._variables[expression] = name
            text, _ = self._print(expression)  # may append lines, which must come first
            self.lines.append(f"{name} = {text}")
        return self._variables[expression]

    def _print(self, expression: sympy.Expr) -> tuple[str, int]:
        if expression.is_Symbol:
            return expression.name, ATOM
        if expression.is_Number or expression.is_NumberSymbol:
            return _float_text(float(expression))
        function = MATH_FUNCTIONS.get(expression.func)
        if function is not None:
            return f"{function}({', '.join(self.text(argument) for argument in expression.args)})", ATOM
        return self.PRINTERS[expression.func](self, expression)

    def _sum(self, expression: sympy.Expr) -> tuple[str, int]:
        parts: list[str] = []
        # SymPy puts the number first, but a - 1 reads better than -1 + a; the value is the same.
        for term in (*expression.args[1:], expression.args[0]):
            text = self.text(term, PRODUCT)
            if not parts:
                parts.append(text)
            elif text.startswith("-"):
                parts.append(f" - {text[1:]}")
            else:
                parts.append(f" + {text}")
        return "".join(parts), SUM

    def _product(self, expression: sympy.Expr) -> tuple[str, int]:
        coefficient, rest = expression.as_coeff_Mul()
        above, below = [], []
        for factor in sympy.Mul.make_args(rest):
            base, exponent = factor.as_base_exp()
            if factor in self._shared:
                above.append(self.name(factor))
            elif factor.is_Pow and exponent.is_Number and exponent.is_negative:
                below.append(self.text(sympy.Pow(base, -exponent), ATOM))
            else:
                above.append(self.text(factor, POWER))
        sign = "-" if coefficient.is_negative else ""
        numerator, denominator = _fraction(abs(coefficient))
        if numerator != "1.0" or not above:
            above.insert(0, numerator)
        if denominator is not None:
            below.append(denominator)
        over = f"({'*'.join(below)})" if len(below) > 1 else "".join(below)
        return f"{sign}{'*'.join(above)}" + (f"/{over}" if below else ""), PRODUCT

    def _power(self, expression: sympy.Expr) -> tuple[str, int]:
        base, exponent = expression.args
        if not exponent.is_Rational or exponent.q > 2 or abs(exponent) > LARGEST_UNROLLED_POWER:
            return f"{self.text(base, ATOM)}**{self.text(exponent, ATOM)}", POWER
        if exponent.is_negative:
            return f"1.0/{self.text(sympy.Pow(base, -exponent), ATOM)}", PRODUCT
        whole, halves = divmod(exponent.p, exponent.q)
        if not whole:
            return f"sqrt({self.text(base)})", ATOM
        factors = self._repeated(self.name(base), whole)
        if halves:
            factors.append(f"sqrt({self.name(base)})")
        return "*".join(factors), PRODUCT

    def _repeated(self, name: str, times: int) -> list[str]:
        """Factors that multiply to ``name**times``, by squaring."""
        if times <= 3:
            return [name] * times
        square = self.name(sympy.Pow(sympy.Symbol(name, real=True), 2))
        return self._repeated(square, times // 2) + [name] * (times % 2)

    def _condition(self, expression: sympy.Expr) -> str:
        if expression.func in COMPARISONS:
            a, b = (self.text(argument) for argument in expression.args)
            return f"{a} {COMPARISONS[expression.func]} {b}"
        if expression.func in CONNECTIVES:
            a, b = (f"({self._condition(argument)})" for argument in expression.args)
            return f"{a} {CONNECTIVES[expression.func]} {b}"
        if isinstance(expression, sym.Not):
            return f"not ({self._condition(expression.args[0])})"
        return f"{self.text(expression)} != 0.0"

    def _indicator(self, expression: sympy.Expr) -> tuple[str, int]:
        return f"(1.0 if {self._condition(expression)} else 0.0)", ATOM

    def _select(self, expression: sympy.Expr) -> tuple[str, int]:
        condition, a, b = expression.args
        return f"({self.text(a)} if {self._condition(condition)} else {self.text(b)})", ATOM

    # In the next four methods a comparison with nan is false, and the last branch returns the nan.

    def _step(self, expression: sympy.Expr) -> tuple[str, int]:
        u = self.name(expression.args[0])
        return f"(1.0 if {u} > 0.0 else 0.0 if {u} < 0.0 else 0.5 + {u})", ATOM

    def _gate(self, expression: sympy.Expr) -> tuple[str, int]:
        u, rest = self.name(expression.args[0]), self.text(expression.args[1], POWER)
        return f"(0.0 if {u} < 0.0 else {rest}*(1.0 if {u} > 0.0 else 0.5 + {u}))", ATOM

    def _sign(self, expression: sympy.Expr) -> tuple[str, int]:
        u = self.name(expression.args[0])
        return f"(1.0 if {u} > 0.0 else -1.0 if {u} < 0.0 else {u})", ATOM

    def _extremum(self, expression: sympy.Expr) -> tuple[str, int]:
        beaten = "<" if isinstance(expression, sym.Maximum) else ">"
        a, b = sorted(expression.args, key=lambda argument: bool(argument.is_Number))
        left, right = self.name(a), self.name(b)
        if isinstance(expression, sym.LargerNumber | sym.SmallerNumber):
            return f"({right} if {left} {beaten} {right} or {left} != {left} else {left})", ATOM
        if b.is_Number:
            return f"({right} if {left} {beaten} {right} else {left})", ATOM
        return f"({right} if {left} {beaten} {right} or {right} != {right} else {left})", ATOM

    def _whole_quotient(self, expression: sympy.Expr) -> tuple[str, int]:
        """As in Python: the remainder is exact, so the rest is a multiple of the divisor up to rounding."""
        a, b = (self.name(argument) for argument in expression.args)
        rest = self.name(sym.TruncatedRemainder(*expression.args))
        below = f"({rest} < 0.0 and {b} > 0.0) or ({rest} > 0.0 and {b} < 0.0)"
        return f"(np.floor(({a} - {rest})/{b} + 0.5) - (1.0 if {below} else 0.0))", ATOM

    def _remainder(self, expression: sympy.Expr) -> tuple[str, int]:
        a, b = (self.text(argument, ATOM) for argument in expression.args)
        return f"({a} % {b})", ATOM

    def _together(self, expression: sympy.Expr) -> tuple[str, int]:
        return self._print(expression.args[0])

    def _cube_root(self, expression: sympy.Expr) -> tuple[str, int]:
        u = self.name(expression.args[0])
        return f"copysign(abs({u})**{1 / 3!r}, {u})", ATOM

    def _exp2(self, expression: sympy.Expr) -> tuple[str, int]:
        return f"2.0**{self.text(expression.args[0], ATOM)}", POWER

    PRINTERS: ClassVar[dict[type[sympy.Basic], Callable[[_Printer, sympy.Expr], tuple[str, int]]]] = {
        sympy.Add: _sum,
        sympy.Mul: _product,
        sympy.Pow: _power,
        sym.Less: _indicator,
        sym.LessEqual: _indicator,
        sym.Equal: _indicator,
        sym.And: _indicator,
        sym.Or: _indicator,
        sym.Not: _indicator,
        sym.Together: _together,
        sym.Select: _select,
        sym.Step: _step,
        sym.Gate: _gate,
        sym.Sign: _sign,
        sympy.sign: _sign,
        sym.Maximum: _extremum,
        sym.Minimum: _extremum,
        sym.LargerNumber: _extremum,
        sym.SmallerNumber: _extremum,
        sym.WholeQuotient: _whole_quotient,
        sym.Remainder: _remainder,
        sym.CubeRoot: _cube_root,
        exp2: _exp2,
    }


def _float_text(value: float) -> tuple[str, int]:
    text = repr(value)
    return text, PRODUCT if text.startswith("-") else ATOM


def _fraction(coefficient: sympy.Number) -> tuple[str, str | None]:
    """A positive number as a float, or as a quotient of two floats if one float is not exact."""
    if coefficient.is_Rational and coefficient.q & (coefficient.q - 1) and _fits(coefficient):
        return repr(float(coefficient.p)), repr(float(coefficient.q))
    return repr(float(coefficient)), None


def _fits(fraction: sympy.Rational) -> bool:
    return max(abs(fraction.p), fraction.q).bit_length() < 1024


def power_text(base: str, exponent: sympy.Expr, name: str) -> str:
    """Text of a power; half-integer powers use a square root."""
    if not (exponent.is_Rational and exponent.q == 2):
        return f"{base}**{name}"
    product = "*".join([base] * (abs(exponent.p) // 2) + [f"sqrt({base})"])
    return product if exponent.is_positive else f"1.0/({product})"
