"""The functions that expressions are made of, each with all that is known of it: one class per function.

``numpy`` is its value; if that is a universal function, models may call it. ``code`` is its name in generated
code, ``word`` that in texts, ``bounds`` its number in interval programs. ``slopes`` are its derivatives in
its arguments, ``range`` holds its values, and ``parity`` says whether it is even (1) or odd (-1).
``in_other_terms`` expresses it by functions with series; with ``by_derivative`` its series is the integral of
its slope's.
"""

# ruff: noqa: D102 - methods that override others are explained there

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from hybrid.expression.functions import RealFunction
from hybrid.expression.nodes import (
    HALF,
    ONE,
    TWO,
    ZERO,
    Expression,
    Function,
    Number,
    number,
    power,
)
from hybrid.expression.ranges import (
    ANYTHING,
    NOT_NEGATIVE,
    POSITIVE,
    End,
    Range,
    absolute,
    closed,
    either,
    exponential,
    extreme,
)
from hybrid.expression.vocabulary import Special
from hybrid.kernels.arithmetic import operations as op


def _always(found: Range) -> Any:
    return staticmethod(lambda *parts: found)


def _zero(*args: Expression) -> Expression:
    return ZERO


class OfNumber(RealFunction):
    """A function whose argument and value are numbers without a unit."""


class Exp(OfNumber):
    """``e**u``."""

    is_exponential = True
    numpy, code, bounds = np.exp, "exp", op.EXP
    range = staticmethod(exponential)
    slopes = (lambda u: Exp(u),)

    def raised(self, exponent: Number) -> Expression | None:
        return Exp(exponent * self.args[0])


class Expm1(OfNumber):
    """``e**u - 1``."""

    numpy, code, bounds, by_derivative = np.expm1, "expm1", op.EXPM1, True
    slopes = (lambda u: Exp(u),)


class Exp2(OfNumber):
    """``2**u``."""

    numpy, range = np.exp2, _always(POSITIVE)
    in_other_terms = staticmethod(lambda u: Exp(number(math.log(2.0)) * u))
    slopes = (lambda u: number(math.log(2.0)) * Exp2(u),)


class Log(OfNumber):
    """The natural logarithm."""

    numpy, code, bounds, by_derivative = np.log, "log", op.LOG, True
    slopes = (lambda u: 1 / u,)


class Log1p(OfNumber):
    """``log(1 + u)``."""

    numpy, code, bounds, by_derivative = np.log1p, "log1p", op.LOG1P, True
    slopes = (lambda u: 1 / (1 + u),)


class Log2(OfNumber):
    """The logarithm to the base 2."""

    numpy, code = np.log2, "log2"
    in_other_terms = staticmethod(lambda u: Log(u) / number(math.log(2.0)))
    slopes = (lambda u: 1 / (number(math.log(2.0)) * u),)


class Log10(OfNumber):
    """The logarithm to the base 10."""

    numpy, code = np.log10, "log10"
    in_other_terms = staticmethod(lambda u: Log(u) / number(math.log(10.0)))
    slopes = (lambda u: 1 / (number(math.log(10.0)) * u),)


class Sin(OfNumber):
    """The sine."""

    numpy, code, bounds = np.sin, "sin", op.SIN
    parity, range = -1, _always(closed(-1.0, 1.0))
    slopes = (lambda u: Cos(u),)


class Cos(OfNumber):
    """The cosine."""

    numpy, code, bounds = np.cos, "cos", op.COS
    parity, range = 1, _always(closed(-1.0, 1.0))
    slopes = (lambda u: -Sin(u),)


class Tan(OfNumber):
    """The tangent."""

    numpy, code, bounds, parity = np.tan, "tan", op.TAN, -1
    slopes = (lambda u: 1 + power(Tan(u), TWO),)


class Arcsin(OfNumber):
    """The arc sine."""

    numpy, code, bounds, by_derivative = np.arcsin, "asin", op.ASIN, True
    parity, range = -1, _always(closed(-2.0, 2.0))
    slopes = (lambda u: 1 / sqrt(1 - power(u, TWO)),)


class Arccos(OfNumber):
    """The arc cosine."""

    numpy, code, bounds, by_derivative = np.arccos, "acos", op.ACOS, True
    range = _always(closed(0.0, 4.0))
    slopes = (lambda u: -1 / sqrt(1 - power(u, TWO)),)


class Arctan(OfNumber):
    """The arc tangent."""

    numpy, code, bounds, by_derivative = np.arctan, "atan", op.ATAN, True
    parity, range = -1, _always(closed(-2.0, 2.0))
    slopes = (lambda u: 1 / (1 + power(u, TWO)),)


class Sinh(OfNumber):
    """The hyperbolic sine."""

    numpy, code, bounds, parity = np.sinh, "sinh", op.SINH, -1
    slopes = (lambda u: Cosh(u),)


class Cosh(OfNumber):
    """The hyperbolic cosine."""

    numpy, code, bounds = np.cosh, "cosh", op.COSH
    parity, range = 1, _always(closed(1.0, math.inf))
    slopes = (lambda u: Sinh(u),)


class Tanh(OfNumber):
    """The hyperbolic tangent."""

    numpy, code, bounds = np.tanh, "tanh", op.TANH
    parity, range = -1, _always(Range(End(-1.0, False), End(1.0, False)))
    slopes = (lambda u: 1 - power(Tanh(u), TWO),)


class Arcsinh(OfNumber):
    """The inverse of the hyperbolic sine."""

    numpy, code, bounds, parity, by_derivative = np.arcsinh, "asinh", op.ASINH, -1, True
    slopes = (lambda u: 1 / sqrt(power(u, TWO) + 1),)


class Arccosh(OfNumber):
    """The inverse of the hyperbolic cosine."""

    numpy, code, bounds, by_derivative = np.arccosh, "acosh", op.ACOSH, True
    range = _always(NOT_NEGATIVE)
    slopes = (lambda u: 1 / (sqrt(u - 1) * sqrt(u + 1)),)


class Arctanh(OfNumber):
    """The inverse of the hyperbolic tangent."""

    numpy, code, bounds, parity, by_derivative = np.arctanh, "atanh", op.ATANH, -1, True
    slopes = (lambda u: 1 / (1 - power(u, TWO)),)


class Erf(OfNumber):
    """The error function."""

    numpy = Special("erf")
    code, bounds, by_derivative = "erf", op.ERF, True
    parity, range = -1, _always(closed(-1.0, 1.0))
    slopes = (lambda u: number(2.0 / math.sqrt(math.pi)) * Exp(-power(u, TWO)),)


class Erfc(OfNumber):
    """One less the error function, with all digits where that is small."""

    numpy = Special("erfc")
    code, bounds, by_derivative = "erfc", op.ERFC, True
    range = _always(closed(0.0, 2.0))
    slopes = (lambda u: -Erf(u).slope(),)


class Hypot(RealFunction):
    """``sqrt(a**2 + b**2)``, with slope 0 at the origin."""

    numpy, code = np.hypot, "hypot"
    range = _always(NOT_NEGATIVE)
    in_other_terms = staticmethod(lambda a, b: sqrt(power(a, TWO) + power(b, TWO)))
    slopes = (lambda a, b: a / Hypot(a, b), lambda a, b: b / Hypot(a, b))


class PiecewiseConstant(RealFunction):
    """A function that is constant between its jumps."""

    slopes = (_zero, _zero)


class Floor(PiecewiseConstant):
    """The largest integer not above ``u``."""

    # ``math.floor`` in code gives an integer, which cannot hold every float.
    numpy: ClassVar[Any] = np.floor
    code, bounds = "np.floor", op.FLOOR


class Level(Floor):
    """A floor in a place where it does not jump: its jumps are events of their own."""

    word = "floor"
    # Written so that it can be told from a floor that jumps.
    numpy = staticmethod(lambda u: np.floor(np.positive(np.positive(u))))


class Ceiling(PiecewiseConstant):
    """The smallest integer not below ``u``."""

    word = "ceil"
    numpy, code, bounds = np.ceil, "np.ceil", op.CEILING


class Truncate(PiecewiseConstant):
    """``u`` without its fraction."""

    word = "trunc"
    numpy, code, bounds = np.trunc, "np.trunc", op.TRUNCATE


class Round(PiecewiseConstant):
    """The nearest integer; the even one of two that are as near."""

    word = "rint"
    numpy, code, bounds = np.rint, "np.rint", op.ROUND
    # But for the value at the jumps.
    in_other_terms = staticmethod(lambda u: Floor(u + HALF))


class Sign(PiecewiseConstant):
    """-1, 0 or 1."""

    numpy = np.sign
    bounds, range = op.SIGN, _always(closed(-1.0, 1.0))


class Step(PiecewiseConstant):
    """1 where ``u > 0``, 0 where ``u < 0``, 1/2 at 0."""

    numpy, bounds = staticmethod(lambda u: np.heaviside(u, 0.5)), op.STEP
    range = _always(closed(0.0, 1.0))


class Truth(PiecewiseConstant):
    """A condition: 1 where it holds, else 0."""

    range = _always(closed(0.0, 1.0))


class Less(Truth):
    """Whether ``a < b``."""

    numpy = staticmethod(lambda a, b: a < b)
    bounds = op.LESS


class LessEqual(Truth):
    """Whether ``a <= b``."""

    word = "less_equal"
    numpy = staticmethod(lambda a, b: a <= b)
    bounds = op.LESS_EQUAL


class Equal(Truth):
    """Whether ``a == b``."""

    numpy = staticmethod(lambda a, b: a == b)
    bounds = op.EQUAL


class And(Truth):
    """Whether both hold; a number other than 0 does."""

    word = "logical_and"
    numpy, bounds = np.logical_and, op.AND

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        return ZERO if ZERO in args else _decided(cls, args)


class Or(Truth):
    """Whether one of two holds; a number other than 0 does."""

    word = "logical_or"
    numpy, bounds = np.logical_or, op.OR

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        if any(each.is_number and each is not ZERO for each in args):
            return ONE
        return _decided(cls, args)


def _decided(connective: Any, args: tuple[Expression, ...]) -> Expression | None:
    """The value for two numbers; for a number that decides nothing the other argument, if it is 0 or 1."""
    others = [each for each in args if not each.is_number]
    if not others:
        return connective.of_numbers(*map(float, args))
    return others[0] if len(others) == 1 and isinstance(others[0], Truth) else None


class Not(Truth):
    """Whether ``a`` is 0."""

    word = "logical_not"
    numpy, bounds = np.logical_not, op.NOT


class Absolute(RealFunction):
    """``|u|``, with slope 0 at 0."""

    word = "abs"
    numpy, code, bounds = np.abs, "abs", op.ABSOLUTE
    parity, range = 1, staticmethod(absolute)
    slopes = (lambda u: Sign(u),)

    def raised(self, exponent: Number) -> Expression | None:
        if not exponent.is_whole or exponent.value == 1:
            return None
        odd = exponent.value % 2
        return power(self.args[0], exponent - odd) * (self if odd else ONE)


class Extreme(RealFunction):
    """The larger or the smaller of two, with slope 1/2 in each if they are equal."""

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        return args[0] if args[0] is args[1] else super().simplified(*args)


class Maximum(Extreme):
    """The larger of two."""

    numpy: ClassVar[Any] = np.maximum
    bounds = op.MAXIMUM
    range = staticmethod(extreme(max))
    slopes = (lambda a, b: Step(a - b), lambda a, b: Step(b - a))


class Minimum(Extreme):
    """The smaller of two."""

    numpy: ClassVar[Any] = np.minimum
    bounds = op.MINIMUM
    range = staticmethod(extreme(min))
    slopes = (lambda a, b: Step(b - a), lambda a, b: Step(a - b))


class LargerNumber(Maximum):
    """The larger of two, or the one that is a number if the other is nan."""

    word = "fmax"
    numpy, range = np.fmax, _always(ANYTHING)


class SmallerNumber(Minimum):
    """The smaller of two, or the one that is a number if the other is nan."""

    word = "fmin"
    numpy, range = np.fmin, _always(ANYTHING)


class WholeQuotient(PiecewiseConstant):
    """``floor(a/b)`` of the exact quotient: ``1 // 0.1`` is 9, because 0.1 is stored as a little more."""

    word = "floor_divide"
    numpy = np.floor_divide
    in_other_terms = staticmethod(lambda a, b: Floor(a / b))


class Remainder(RealFunction):
    """``a - b*floor(a/b)``, with the sign of ``b``."""

    word = "mod"
    numpy = np.remainder
    slopes = (lambda a, b: ONE, lambda a, b: -Floor(a / b))


class TruncatedRemainder(RealFunction):
    """``a - b*trunc(a/b)``, with the sign of ``a``."""

    word = "fmod"
    numpy, code = np.fmod, "np.fmod"
    slopes = (lambda a, b: ONE, lambda a, b: -Truncate(a / b))


class Atan2(RealFunction):
    """The angle of the point ``(x, y)``, called with ``y`` first."""

    word = "arctan2"
    numpy, code, bounds = np.arctan2, "atan2", op.ANGLE
    range = _always(closed(-4.0, 4.0))
    slopes = (lambda y, x: x / (x**2 + y**2), lambda y, x: -y / (x**2 + y**2))


class CubeRoot(RealFunction):
    """The real cube root, with the sign of ``u``."""

    word = "cbrt"
    numpy, bounds, parity = np.cbrt, op.CUBE_ROOT, -1
    slopes = (lambda u: 1 / (3 * power(CubeRoot(u), TWO)),)


class Select(RealFunction):
    """``a`` where the condition holds, else ``b``."""

    word = "where"
    numpy, bounds, range = staticmethod(np.where), op.SELECT, staticmethod(either)

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        condition, a, b = args
        if condition.is_number:
            return b if condition is ZERO else a
        return a if a is b else None


class Gate(RealFunction):
    """``Step(u)*rest``, but 0 where ``u < 0`` even if ``rest`` is infinite there."""

    numpy = staticmethod(lambda u, rest: np.where(u < 0.0, 0.0, np.heaviside(u, 0.5) * rest))

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        return None


class Several(Function):
    """Several expressions side by side; no value of its own."""


FUNCTIONS = tuple(
    each for each in [*vars().values()] if isinstance(each, type) and issubclass(each, RealFunction)
)
# Functions whose derivative does not show their jumps: a constant derivative proves nothing about them.
JUMPING = (PiecewiseConstant, Remainder, TruncatedRemainder)


def sqrt(u: Expression) -> Expression:
    """The square root."""
    return power(u, HALF)
