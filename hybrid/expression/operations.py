"""The functions that expressions are made of, each with all that is known of it: one class per function.

``on_floats`` is its value, ``numpy`` the same on arrays, ``code`` its name in generated code, ``bounds`` its
number in interval programs. ``slope(i)`` is its derivative in an argument, ``range`` holds its values, and
``parity`` says whether it is even (1) or odd (-1). ``in_other_terms`` expresses it by functions with series.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from hybrid.expression.nodes import (
    HALF,
    NAN,
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
from hybrid.kernels.arithmetic import operations as op


class RealFunction(Function):
    """A function of real numbers; numbers are put in, a sign comes out where it may."""

    __slots__ = ()
    on_floats: ClassVar[Callable[..., float]]
    numpy: ClassVar[Callable[..., Any]]
    code: ClassVar[str] = ""
    bounds: ClassVar[int] = 0
    parity: ClassVar[int] = 0
    range: ClassVar[Any] = staticmethod(lambda *parts: ANYTHING)
    in_other_terms: ClassVar[Callable[..., Expression] | None] = None

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        """The number that it is of numbers; the value at the opposite if it is even or odd."""
        if all(each.is_number for each in args):
            return cls.of_numbers(*map(float, args))
        if cls.parity and args[0].leads_with_minus:
            value = cls(-args[0])
            return value if cls.parity > 0 else -value
        return None

    @classmethod
    def of_numbers(cls, *values: float) -> Number:
        """The value at numbers; nan where there is none."""
        try:
            return number(cls.on_floats(*values))
        except OverflowError:
            return number(math.inf)
        except ValueError:
            return NAN

    def slope(self, place: int = 0) -> Expression:
        """The derivative in one of the arguments."""
        raise NotImplementedError(f"{type(self).__name__} has no derivative")


def _always(found: Range) -> Any:
    return staticmethod(lambda *parts: found)


class Exp(RealFunction):
    """``e**u``."""

    on_floats, numpy, code, bounds = staticmethod(math.exp), np.exp, "exp", op.EXP
    range = staticmethod(exponential)

    def slope(self, place: int = 0) -> Expression:
        return self

    def raised(self, exponent: Number) -> Expression | None:
        return Exp(exponent * self.args[0])


class Expm1(RealFunction):
    """``e**u - 1``."""

    on_floats, numpy, code, bounds = staticmethod(math.expm1), np.expm1, "expm1", op.EXPM1

    def slope(self, place: int = 0) -> Expression:
        return Exp(self.args[0])


class Exp2(RealFunction):
    """``2**u``."""

    on_floats, numpy, range = staticmethod(lambda u: 2.0**u), np.exp2, _always(POSITIVE)
    in_other_terms = staticmethod(lambda u: Exp(number(math.log(2.0)) * u))

    def slope(self, place: int = 0) -> Expression:
        return number(math.log(2.0)) * self


class Log(RealFunction):
    """The natural logarithm."""

    on_floats, numpy, code, bounds = staticmethod(math.log), np.log, "log", op.LOG

    def slope(self, place: int = 0) -> Expression:
        return 1 / self.args[0]


class Log1p(RealFunction):
    """``log(1 + u)``."""

    on_floats, numpy, code, bounds = staticmethod(math.log1p), np.log1p, "log1p", op.LOG1P

    def slope(self, place: int = 0) -> Expression:
        return 1 / (1 + self.args[0])


class Log2(RealFunction):
    """The logarithm to the base 2."""

    on_floats, numpy, code = staticmethod(math.log2), np.log2, "log2"
    in_other_terms = staticmethod(lambda u: Log(u) / number(math.log(2.0)))

    def slope(self, place: int = 0) -> Expression:
        return 1 / (number(math.log(2.0)) * self.args[0])


class Log10(RealFunction):
    """The logarithm to the base 10."""

    on_floats, numpy, code = staticmethod(math.log10), np.log10, "log10"
    in_other_terms = staticmethod(lambda u: Log(u) / number(math.log(10.0)))

    def slope(self, place: int = 0) -> Expression:
        return 1 / (number(math.log(10.0)) * self.args[0])


class Sin(RealFunction):
    """The sine."""

    on_floats, numpy, code, bounds = staticmethod(math.sin), np.sin, "sin", op.SIN
    parity, range = -1, _always(closed(-1.0, 1.0))

    def slope(self, place: int = 0) -> Expression:
        return Cos(self.args[0])


class Cos(RealFunction):
    """The cosine."""

    on_floats, numpy, code, bounds = staticmethod(math.cos), np.cos, "cos", op.COS
    parity, range = 1, _always(closed(-1.0, 1.0))

    def slope(self, place: int = 0) -> Expression:
        return -Sin(self.args[0])


class Tan(RealFunction):
    """The tangent."""

    on_floats, numpy, code, bounds, parity = staticmethod(math.tan), np.tan, "tan", op.TAN, -1

    def slope(self, place: int = 0) -> Expression:
        return 1 + power(self, TWO)


class Arcsin(RealFunction):
    """The arc sine."""

    on_floats, numpy, code, bounds = staticmethod(math.asin), np.arcsin, "asin", op.ASIN
    parity, range = -1, _always(closed(-2.0, 2.0))

    def slope(self, place: int = 0) -> Expression:
        return 1 / sqrt(1 - power(self.args[0], TWO))


class Arccos(RealFunction):
    """The arc cosine."""

    on_floats, numpy, code, bounds = staticmethod(math.acos), np.arccos, "acos", op.ACOS
    range = _always(closed(0.0, 4.0))

    def slope(self, place: int = 0) -> Expression:
        return -1 / sqrt(1 - power(self.args[0], TWO))


class Arctan(RealFunction):
    """The arc tangent."""

    on_floats, numpy, code, bounds = staticmethod(math.atan), np.arctan, "atan", op.ATAN
    parity, range = -1, _always(closed(-2.0, 2.0))

    def slope(self, place: int = 0) -> Expression:
        return 1 / (1 + power(self.args[0], TWO))


class Sinh(RealFunction):
    """The hyperbolic sine."""

    on_floats, numpy, code, bounds, parity = staticmethod(math.sinh), np.sinh, "sinh", op.SINH, -1

    def slope(self, place: int = 0) -> Expression:
        return Cosh(self.args[0])


class Cosh(RealFunction):
    """The hyperbolic cosine."""

    on_floats, numpy, code, bounds = staticmethod(math.cosh), np.cosh, "cosh", op.COSH
    parity, range = 1, _always(closed(1.0, math.inf))

    def slope(self, place: int = 0) -> Expression:
        return Sinh(self.args[0])


class Tanh(RealFunction):
    """The hyperbolic tangent."""

    on_floats, numpy, code, bounds = staticmethod(math.tanh), np.tanh, "tanh", op.TANH
    parity, range = -1, _always(Range(End(-1.0, False), End(1.0, False)))

    def slope(self, place: int = 0) -> Expression:
        return 1 - power(self, TWO)


class Arcsinh(RealFunction):
    """The inverse of the hyperbolic sine."""

    on_floats, numpy, code, bounds, parity = staticmethod(math.asinh), np.arcsinh, "asinh", op.ASINH, -1

    def slope(self, place: int = 0) -> Expression:
        return 1 / sqrt(power(self.args[0], TWO) + 1)


class Arccosh(RealFunction):
    """The inverse of the hyperbolic cosine."""

    on_floats, numpy, code, bounds = staticmethod(math.acosh), np.arccosh, "acosh", op.ACOSH
    range = _always(NOT_NEGATIVE)

    def slope(self, place: int = 0) -> Expression:
        return 1 / (sqrt(self.args[0] - 1) * sqrt(self.args[0] + 1))


class Arctanh(RealFunction):
    """The inverse of the hyperbolic tangent."""

    on_floats, numpy, code, bounds, parity = staticmethod(math.atanh), np.arctanh, "atanh", op.ATANH, -1

    def slope(self, place: int = 0) -> Expression:
        return 1 / (1 - power(self.args[0], TWO))


class Hypot(RealFunction):
    """``sqrt(a**2 + b**2)``, with slope 0 at the origin."""

    on_floats, numpy, code = staticmethod(math.hypot), np.hypot, "hypot"
    range = _always(NOT_NEGATIVE)
    in_other_terms = staticmethod(lambda a, b: sqrt(power(a, TWO) + power(b, TWO)))

    def slope(self, place: int = 0) -> Expression:
        return self.args[place] / self


class PiecewiseConstant(RealFunction):
    """A function that is constant between its jumps."""

    def slope(self, place: int = 0) -> Expression:
        return ZERO


class Floor(PiecewiseConstant):
    """The largest integer not above ``u``."""

    # ``math.floor`` in code gives an integer, which cannot hold every float.
    on_floats, numpy, code, bounds = staticmethod(math.floor), np.floor, "np.floor", op.FLOOR


class Level(Floor):
    """A floor in a place where it does not jump: its jumps are events of their own."""

    # Written so that a list of operations tells it from a floor that jumps.
    numpy = staticmethod(lambda u: np.floor(np.positive(np.positive(u))))


class Ceiling(PiecewiseConstant):
    """The smallest integer not below ``u``."""

    on_floats, numpy, code, bounds = staticmethod(math.ceil), np.ceil, "np.ceil", op.CEILING


class Truncate(PiecewiseConstant):
    """``u`` without its fraction."""

    on_floats, numpy, code, bounds = staticmethod(math.trunc), np.trunc, "np.trunc", op.TRUNCATE


class Sign(PiecewiseConstant):
    """-1, 0 or 1."""

    on_floats, numpy = staticmethod(lambda u: float((u > 0) - (u < 0)) if u == u else u), np.sign
    bounds, range = op.SIGN, _always(closed(-1.0, 1.0))


class Step(PiecewiseConstant):
    """1 where ``u > 0``, 0 where ``u < 0``, 1/2 at 0."""

    on_floats = staticmethod(lambda u: 0.5 + 0.5 * ((u > 0) - (u < 0)))
    numpy, bounds = staticmethod(lambda u: np.heaviside(u, 0.5)), op.STEP
    range = _always(closed(0.0, 1.0))


class Truth(PiecewiseConstant):
    """A condition: 1 where it holds, else 0."""

    range = _always(closed(0.0, 1.0))


class Less(Truth):
    """Whether ``a < b``."""

    on_floats, numpy = staticmethod(lambda a, b: float(a < b)), staticmethod(lambda a, b: a < b)
    bounds = op.LESS


class LessEqual(Truth):
    """Whether ``a <= b``."""

    on_floats, numpy = staticmethod(lambda a, b: float(a <= b)), staticmethod(lambda a, b: a <= b)
    bounds = op.LESS_EQUAL


class Equal(Truth):
    """Whether ``a == b``."""

    on_floats, numpy = staticmethod(lambda a, b: float(a == b)), staticmethod(lambda a, b: a == b)
    bounds = op.EQUAL


class And(Truth):
    """Whether both hold; a number other than 0 does."""

    on_floats, numpy, bounds = staticmethod(lambda a, b: float(bool(a and b))), np.logical_and, op.AND

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        return ZERO if ZERO in args else _decided(cls, args)


class Or(Truth):
    """Whether one of two holds; a number other than 0 does."""

    on_floats, numpy, bounds = staticmethod(lambda a, b: float(bool(a or b))), np.logical_or, op.OR

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        if any(each.is_number and each is not ZERO for each in args):
            return ONE
        return _decided(cls, args)


def _decided(connective: Any, args: tuple[Expression, ...]) -> Expression | None:
    """The value for two numbers; for a number that decides nothing the other argument, if it is 0 or 1."""
    others = [each for each in args if not each.is_number]
    if not others:
        return number(connective.on_floats(*map(float, args)))
    return others[0] if len(others) == 1 and isinstance(others[0], Truth) else None


class Not(Truth):
    """Whether ``a`` is 0."""

    on_floats, numpy, bounds = staticmethod(lambda a: float(not a)), np.logical_not, op.NOT


class Absolute(RealFunction):
    """``|u|``, with slope 0 at 0."""

    on_floats, numpy, code, bounds = staticmethod(abs), np.abs, "abs", op.ABSOLUTE
    parity, range = 1, staticmethod(absolute)

    def slope(self, place: int = 0) -> Expression:
        return Sign(self.args[0])

    def raised(self, exponent: Number) -> Expression | None:
        return power(self.args[0], exponent) if exponent.is_whole and exponent.value % 2 == 0 else None


class Extreme(RealFunction):
    """The larger or the smaller of two, with slope 1/2 in each if they are equal."""

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        return args[0] if args[0] is args[1] else super().simplified(*args)

    def _lead(self, place: int) -> Expression:
        """By how much one argument exceeds the other."""
        return self.args[place] - self.args[1 - place]


class Maximum(Extreme):
    """The larger of two."""

    on_floats, numpy, bounds = staticmethod(max), np.maximum, op.MAXIMUM
    range = staticmethod(extreme(max))

    def slope(self, place: int = 0) -> Expression:
        return Step(self._lead(place))


class Minimum(Extreme):
    """The smaller of two."""

    on_floats, numpy, bounds = staticmethod(min), np.minimum, op.MINIMUM
    range = staticmethod(extreme(min))

    def slope(self, place: int = 0) -> Expression:
        return Step(-self._lead(place))


class LargerNumber(Maximum):
    """The larger of two, or the one that is a number if the other is nan."""

    numpy, range = np.fmax, _always(ANYTHING)


class SmallerNumber(Minimum):
    """The smaller of two, or the one that is a number if the other is nan."""

    numpy, range = np.fmin, _always(ANYTHING)


class WholeQuotient(PiecewiseConstant):
    """``floor(a/b)`` of the exact quotient: ``1 // 0.1`` is 9, because 0.1 is stored as a little more."""

    on_floats, numpy = staticmethod(lambda a, b: float(np.floor_divide(a, b))), np.floor_divide
    in_other_terms = staticmethod(lambda a, b: Floor(a / b))


class Remainder(RealFunction):
    """``a - b*floor(a/b)``, with the sign of ``b``."""

    on_floats, numpy = staticmethod(lambda a, b: a % b if b else math.nan), np.remainder

    def slope(self, place: int = 0) -> Expression:
        return ONE if place == 0 else -Floor(self.args[0] / self.args[1])


class TruncatedRemainder(RealFunction):
    """``a - b*trunc(a/b)``, with the sign of ``a``."""

    on_floats, numpy, code = staticmethod(lambda a, b: math.fmod(a, b) if b else math.nan), np.fmod, "np.fmod"

    def slope(self, place: int = 0) -> Expression:
        return ONE if place == 0 else -Truncate(self.args[0] / self.args[1])


class Atan2(RealFunction):
    """The angle of the point ``(x, y)``, called with ``y`` first."""

    on_floats, numpy, code, bounds = staticmethod(math.atan2), np.arctan2, "atan2", op.ANGLE
    range = _always(closed(-4.0, 4.0))

    def slope(self, place: int = 0) -> Expression:
        y, x = self.args
        return (x if place == 0 else -y) / (x**2 + y**2)


class CubeRoot(RealFunction):
    """The real cube root, with the sign of ``u``."""

    on_floats = staticmethod(lambda u: math.copysign(abs(u) ** (1 / 3), u))
    numpy, bounds, parity = np.cbrt, op.CUBE_ROOT, -1

    def slope(self, place: int = 0) -> Expression:
        return 1 / (3 * power(self, TWO))


class Select(RealFunction):
    """``a`` where the condition holds, else ``b``."""

    numpy, bounds, range = np.where, op.SELECT, staticmethod(either)

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


# Functions whose derivative does not show their jumps: a constant derivative proves nothing about them.
JUMPING = (PiecewiseConstant, Remainder, TruncatedRemainder)


def sqrt(u: Expression) -> Expression:
    """The square root."""
    return power(u, HALF)
