"""SymPy functions with the floating-point meaning of NumPy's: kinks, jumps and choices.

SymPy's own Max, Piecewise, sign and Mod reason about their arguments, which is slow, and rewrite them,
which can change the rounding. The functions here only evaluate numbers and give their derivatives.
"""

# ruff: noqa: D102 - the methods are the hooks that SymPy documents

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
import sympy
from sympy.codegen.cfunctions import exp2, hypot
from sympy.core.parameters import distribute

from hybrid.symbolic.nodes import contains, interned, once

ZERO = sympy.Integer(0)
ONE = sympy.Integer(1)
TWO = sympy.Integer(2)
HALF = sympy.Rational(1, 2)
# A length below this is zero in the slope of a length.
SMALLEST_LENGTH = sympy.Float(1e-300)
# Number of numbers kept in the cache.
MOST_NUMBERS = 10_000
# A number taken out of a power, or collected in a product, has at most this many binary digits on either side
# of the fraction bar, so that neither the number nor the rest leaves the floating range.
MOST_DIGITS = 500
# A higher power of a product is not split into powers of its factors, which may leave the floating range.
HIGHEST_SPLIT = 16


def number(value: Any) -> sympy.Expr:
    """A float or an integer as a SymPy number of the same value.

    Multiples of 1/8 become exact rationals, so that ``z**1.5`` and ``2.0*x`` keep their structure.
    """
    return _number(float(value))


# Cached so that equal numbers are one object, which keeps the assumptions that SymPy has derived.
@lru_cache(maxsize=MOST_NUMBERS)
def _number(value: float) -> sympy.Expr:
    if math.isfinite(value) and abs(value) < 2.0**50 and (8.0 * value).is_integer():
        return sympy.Rational(int(8.0 * value), 8)
    return sympy.Float(value) if math.isfinite(value) else sympy.sympify(value)


def product(*factors: sympy.Expr) -> sympy.Expr:
    """SymPy's product; a number times a symbol or function is built without SymPy's evaluation.

    Equal factors and numbers are collected as long as they cannot leave the floating range.
    """
    if len(factors) == 2:
        a, b = factors if factors[0].is_Number else factors[::-1]
        if a.is_Number and (b.is_Symbol or b.is_Function) and a is not ZERO and a is not ONE:
            return sympy.Mul(a, b, evaluate=False)
    made = sympy.Mul(*factors)
    if _digits(made) > MOST_DIGITS or _collects_high_powers(made, factors):
        return sympy.Mul(*(Together(each) if each.is_Mul else each for each in factors))
    return made


def quotient(a: sympy.Expr, b: sympy.Expr) -> sympy.Expr:
    """SymPy's quotient, with the numbers of `product`."""
    return product(a, 1 / b)


def _collects_high_powers(made: sympy.Expr, factors: tuple[sympy.Expr, ...]) -> bool:
    """Whether a product has several factors, and among them a high power that no factor had."""
    if not made.is_Mul or (len(made.args) == 2 and made.args[0].is_Number and not _digits(made)):
        return False
    high = {each for each in made.args if _is_high(each)}
    return bool(high) and not high <= {each for factor in factors for each in sympy.Mul.make_args(factor)}


def _is_high(factor: sympy.Expr) -> bool:
    return bool(factor.is_Pow and factor.exp.is_Rational and abs(factor.exp.p) > HIGHEST_SPLIT * factor.exp.q)


def _digits(expression: sympy.Expr) -> float:
    """Binary digits of the numerator or denominator of an expression's number, or its floating exponent."""
    coefficient = expression.args[0] if expression.is_Mul else expression
    if coefficient.is_Rational and coefficient:
        return math.log2(max(abs(coefficient.p), coefficient.q))
    if coefficient.is_Float and coefficient:
        size = abs(float(coefficient))
        return abs(math.log2(size)) if 0.0 < size < math.inf else math.inf
    return 0.0


def power(base: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
    """SymPy's power; even powers below a root are taken out as absolute values.

    SymPy looks for their signs itself, which may take for ever where sums are not expanded. SymPy also splits
    ``(t/50)**200``, which leaves the floating range and is prevented here.
    """
    if base.is_Number and base.is_zero and not exponent.is_Number:
        # SymPy takes the sign out of the exponent, and then has complex infinity for a base.
        return Select(Less(ZERO, exponent), ZERO, Select(Equal(exponent, ZERO), ONE, sympy.oo))
    if exponent.is_Number and base.is_Mul:
        size = abs(float(exponent))
        if size > HIGHEST_SPLIT or _digits(base) * size > MOST_DIGITS:
            return Together(base) ** exponent
    if not exponent.is_Rational:
        return base**exponent
    # SymPy asks for the modulus of a base. That takes a factor -1 out, again and again where SymPy keeps it
    # outside of sums.
    with distribute(True):
        return _rational_power(base, exponent)


def _rational_power(base: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
    if _is_even_power(base):
        inner, whole = base.args[0], base.exp * exponent
        return sympy.Pow(inner if exponent.is_Integer else Absolute(inner), whole)
    if base.is_Mul and not exponent.is_Integer:
        outer = [each for each in base.args if _is_even_power(each)]
        size = sympy.Abs(base.args[0]) if base.args[0].is_Number else ONE
        rest = sympy.Mul(*(each for each in base.args if each not in outer)) / size
        root = rest**exponent if not rest.is_Mul else sympy.Pow(rest, exponent, evaluate=False)
        return sympy.Mul(size**exponent, *(power(each, exponent) for each in outer), root)
    return base**exponent


def length(a: sympy.Expr, b: sympy.Expr) -> sympy.Expr:
    """``sqrt(a**2 + b**2)``."""
    return sympy.sqrt(power(a, TWO) + power(b, TWO))


def _is_even_power(expression: sympy.Expr) -> bool:
    return bool(expression.is_Pow and expression.exp.is_Integer and expression.exp.is_even)


class RealFunction(sympy.Function):
    """A real function that is evaluated by ``value`` if all arguments are numbers."""

    is_real = True
    value: ClassVar[Callable[..., float]]

    @classmethod
    def eval(cls, *args: sympy.Expr) -> sympy.Expr | None:
        if all(arg.is_Number for arg in args):
            return number(cls.value(*map(float, args)))
        return None


class Together(RealFunction):
    """``u``, a product that SymPy must not take apart."""

    # Read by ``hybrid.symbolic.nodes.degree_of``.
    keeps_degree = True

    @classmethod
    def eval(cls, u: sympy.Expr) -> sympy.Expr | None:
        return u if u.is_Number else None

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return ONE

    def _sympystr(self, printer: Any) -> str:
        return f"({printer.doprint(self.args[0])})"


# Functions that some code treats as these expressions.
IN_OTHER_TERMS: dict[type[sympy.Basic], Callable[..., sympy.Expr]] = {
    Together: lambda u: u,
    hypot: length,
    exp2: lambda u: sympy.exp(sympy.log(2) * u),
}


class PiecewiseConstant(RealFunction):
    """A function that is constant between its jumps."""

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return ZERO


class Floor(PiecewiseConstant):
    """The largest integer not above ``u``."""

    value = staticmethod(math.floor)


class Level(Floor):
    """A floor in a place where it does not jump: its jumps are events of their own."""


class Ceiling(PiecewiseConstant):
    """The smallest integer not below ``u``."""

    value = staticmethod(math.ceil)


class Truncate(PiecewiseConstant):
    """``u`` without its fraction."""

    value = staticmethod(math.trunc)


class Sign(PiecewiseConstant):
    """-1, 0 or 1."""

    value = staticmethod(lambda u: float((u > 0) - (u < 0)))


class Step(PiecewiseConstant):
    """1 where ``u > 0``, 0 where ``u < 0``, 1/2 at 0."""

    value = staticmethod(lambda u: 0.5 + 0.5 * ((u > 0) - (u < 0)))


class Less(PiecewiseConstant):
    """1 if ``a < b``, else 0."""

    value = staticmethod(lambda a, b: float(a < b))


class LessEqual(PiecewiseConstant):
    """1 if ``a <= b``, else 0."""

    value = staticmethod(lambda a, b: float(a <= b))


class Equal(PiecewiseConstant):
    """1 if ``a == b``, else 0."""

    value = staticmethod(lambda a, b: float(a == b))


class And(PiecewiseConstant):
    """1 if neither argument is 0, else 0."""

    value = staticmethod(lambda a, b: float(bool(a and b)))

    @classmethod
    def eval(cls, *args: sympy.Expr) -> sympy.Expr | None:
        return ZERO if ZERO in args else _decided(cls, args)


class Or(PiecewiseConstant):
    """0 if both arguments are 0, else 1."""

    value = staticmethod(lambda a, b: float(bool(a or b)))

    @classmethod
    def eval(cls, *args: sympy.Expr) -> sympy.Expr | None:
        if any(arg.is_Number and not arg.is_zero for arg in args):
            return ONE
        return _decided(cls, args)


def _decided(connective: Any, args: tuple[sympy.Expr, ...]) -> sympy.Expr | None:
    """The value for two numbers; for a number that decides nothing the other argument, if it is 0 or 1."""
    others = [arg for arg in args if not arg.is_Number]
    if not others:
        return number(connective.value(*map(float, args)))
    return others[0] if len(others) == 1 and isinstance(others[0], TRUTHS) else None


class Not(PiecewiseConstant):
    """1 if ``a`` is 0, else 0."""

    value = staticmethod(lambda a: float(not a))


TRUTHS = (Less, LessEqual, Equal, And, Or, Not)


class Absolute(RealFunction):
    """``|u|``, with slope 0 at 0."""

    value = staticmethod(abs)

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return Sign(self.args[0])


class Maximum(RealFunction):
    """The larger of two, with slope 1/2 in each if they are equal."""

    value = staticmethod(max)

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        mine, other = self.args if argindex == 1 else self.args[::-1]
        return Step(mine - other)


class Minimum(RealFunction):
    """The smaller of two, with slope 1/2 in each if they are equal."""

    value = staticmethod(min)

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        mine, other = self.args if argindex == 1 else self.args[::-1]
        return Step(other - mine)


class LargerNumber(Maximum):
    """The larger of two, or the one that is a number if the other is nan."""


class SmallerNumber(Minimum):
    """The smaller of two, or the one that is a number if the other is nan."""


class WholeQuotient(PiecewiseConstant):
    """``floor(a/b)`` of the exact quotient: ``1 // 0.1`` is 9, because 0.1 is stored as a little more."""

    value = staticmethod(lambda a, b: float(np.floor_divide(a, b)))


class Remainder(RealFunction):
    """``a - b*floor(a/b)``, with the sign of ``b``."""

    value = staticmethod(lambda a, b: a % b if b else math.nan)

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return ONE if argindex == 1 else -Floor(self.args[0] / self.args[1])


class TruncatedRemainder(RealFunction):
    """``a - b*trunc(a/b)``, with the sign of ``a``."""

    value = staticmethod(lambda a, b: math.fmod(a, b) if b else math.nan)

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return ONE if argindex == 1 else -Truncate(self.args[0] / self.args[1])


class Atan2(RealFunction):
    """The angle of the point ``(x, y)``, called with ``y`` first."""

    value = staticmethod(math.atan2)

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        y, x = self.args
        return (x if argindex == 1 else -y) / (x**2 + y**2)


class CubeRoot(RealFunction):
    """The real cube root, with the sign of ``u``."""

    value = staticmethod(lambda u: math.copysign(abs(u) ** (1 / 3), u))

    def fdiff(self, argindex: int = 1) -> sympy.Expr:
        return 1 / (3 * self**2)


class Select(RealFunction):
    """``a`` where the condition holds, else ``b``."""

    @classmethod
    def eval(cls, condition: sympy.Expr, a: sympy.Expr, b: sympy.Expr) -> sympy.Expr | None:
        if condition.is_Number:
            return b if condition.is_zero else a
        return a if a == b else None

    def _eval_derivative(self, variable: sympy.Symbol) -> sympy.Expr:
        condition, a, b = self.args
        return Select(condition, a.diff(variable), b.diff(variable))


class Gate(RealFunction):
    """``Step(u)*rest``, but 0 where ``u < 0`` even if ``rest`` is infinite there."""

    @classmethod
    def eval(cls, u: sympy.Expr, rest: sympy.Expr) -> sympy.Expr | None:
        return None


IN_OTHER_TERMS[WholeQuotient] = lambda a, b: Floor(a / b)

# Functions whose derivative does not show their jumps: a constant derivative proves nothing about them.
JUMPING = (PiecewiseConstant, Remainder, TruncatedRemainder)


@once
def defined_at_origin(expression: sympy.Expr) -> sympy.Expr:
    """Make slopes of lengths zero, not 0/0, where the length is zero.

    ``u*hypot(u, w)``, a drag, has the slope ``hypot(u, w) + u*u/hypot(u, w)``, which is 0 at the origin. The
    same for roots of sums of squares.
    """
    if not expression.args:
        return expression
    arguments = [defined_at_origin(argument) for argument in expression.args]
    if expression.is_Pow and _is_over_length(*expression.args):
        arguments[0] = Maximum(arguments[0], SMALLEST_LENGTH)
    same = all(new is old for new, old in zip(arguments, expression.args, strict=True))
    return expression if same else interned(expression.func(*arguments))


def _is_over_length(base: sympy.Expr, exponent: sympy.Expr) -> bool:
    """Whether a power is one over a length; of a sum, over its root."""
    if isinstance(base, hypot):
        return bool(exponent == -ONE)
    return bool(exponent == -HALF and base.is_Add and all(map(_is_square, base.args)))


def _is_square(term: sympy.Expr) -> bool:
    """Whether a term of a sum is an even power, or a positive multiple of one."""
    *numbers, rest = term.args if term.is_Mul else (term,)
    return _is_even_power(rest) and all(each.is_Number and each.is_positive for each in numbers)


@once
def close_gates(expression: sympy.Expr) -> sympy.Expr:
    """Make products zero where a factor switches them off, even if another factor is infinite there.

    The slope of ``max(z, 0)**(1/4)`` is ``max(z, 0)**(-3/4)/4 * Step(z)``: 0 for ``z < 0``, never
    ``inf*0``.
    """
    return interned(_closed(expression)) if contains(expression, (Step, Select)) else expression


def _closed(expression: sympy.Expr) -> sympy.Expr:
    arguments = [close_gates(argument) for argument in expression.args]
    if not expression.is_Mul:
        return expression.func(*arguments)
    plain = [factor for factor in arguments if not _switches(factor)]
    product = sympy.Mul(*plain)
    for factor in arguments:
        if isinstance(factor, Step) and product != 1:
            product = Gate(factor.args[0], product)
        elif isinstance(factor, Step):
            product = factor
        elif _switches(factor):
            condition, a, b = factor.args
            product = Select(condition, a * product, b * product)
    return product


def _switches(factor: sympy.Expr) -> bool:
    return isinstance(factor, Step) or (isinstance(factor, Select) and ZERO in factor.args[1:])
