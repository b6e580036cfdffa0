"""Interval arithmetic on arrays, including the derivative in time.

Every bound is rounded outwards, so an enclosure contains all values of its expression. The text of a guard
runs on enclosures as on numbers, with ``FUNCTIONS`` in place of NumPy.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

# An extremum of sine or cosine within this distance of an interval counts as inside.
SLACK = 1e-13


def down(a: np.ndarray, steps: int = 1) -> np.ndarray:
    for _ in range(steps):
        a = np.nextafter(a, -np.inf)
    return a


def up(a: np.ndarray, steps: int = 1) -> np.ndarray:
    for _ in range(steps):
        a = np.nextafter(a, np.inf)
    return a


class Truth:
    """A comparison of enclosures: certainly true, certainly false, or neither."""

    __array_ufunc__ = None

    def __init__(self, yes: Any, no: Any) -> None:
        self.yes, self.no = yes, no


class Enclosure:
    """Bounds of a value and of its derivative in time, arrays of one shape."""

    __array_ufunc__ = None

    def __init__(self, low: Any, high: Any, slope_low: Any = 0.0, slope_high: Any = 0.0) -> None:
        self.low, self.high = low, high
        self.slope_low, self.slope_high = slope_low, slope_high

    def __add__(self, other: Any) -> Enclosure:
        b = enclosure(other)
        return Enclosure(
            down(self.low + b.low),
            up(self.high + b.high),
            down(self.slope_low + b.slope_low),
            up(self.slope_high + b.slope_high),
        )

    __radd__ = __add__

    def __neg__(self) -> Enclosure:
        return Enclosure(-self.high, -self.low, -self.slope_high, -self.slope_low)

    def __pos__(self) -> Enclosure:
        return self

    def __sub__(self, other: Any) -> Enclosure:
        return self + -enclosure(other)

    def __rsub__(self, other: Any) -> Enclosure:
        return enclosure(other) + -self

    def __mul__(self, other: Any) -> Enclosure:
        b = enclosure(other)
        left = product(self.slope, b.value)
        right = product(self.value, b.slope)
        return Enclosure(*product(self.value, b.value), down(left[0] + right[0]), up(left[1] + right[1]))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Enclosure:
        return self * reciprocal(enclosure(other))

    def __rtruediv__(self, other: Any) -> Enclosure:
        return enclosure(other) * reciprocal(self)

    def __pow__(self, exponent: Any) -> Enclosure:
        if isinstance(exponent, int) and exponent >= 0:
            return whole_power(self, exponent)
        # Real powers are taken of positive bases only.
        return self._monotone(
            lambda a: np.power(a, exponent),
            lambda a: exponent * np.power(a, exponent - 1.0),
            rising=exponent > 0,
        )

    def _monotone(
        self,
        function: Callable[[Any], Any],
        derivative: Callable[[Any], Any],
        rising: bool = True,
    ) -> Enclosure:
        """Image under a monotone function with a monotone derivative."""
        ends = (self.low, self.high) if rising else (self.high, self.low)
        first, second = derivative(self.low), derivative(self.high)
        return chained(self, (function(ends[0]), function(ends[1])), (first, second))

    @property
    def value(self) -> tuple[Any, Any]:
        return self.low, self.high

    @property
    def slope(self) -> tuple[Any, Any]:
        return self.slope_low, self.slope_high

    def __gt__(self, other: Any) -> Truth:
        b = enclosure(other)
        return Truth(self.low > b.high, self.high <= b.low)

    def __lt__(self, other: Any) -> Truth:
        return enclosure(other) > self

    @property
    def sign(self) -> np.ndarray:
        """+1 or -1 where the sign is certain, 0 elsewhere."""
        return np.where(self.low > 0, 1, np.where(self.high < 0, -1, 0))


def enclosure(a: Any) -> Enclosure:
    return a if isinstance(a, Enclosure) else Enclosure(a, a)


def product(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    # Zero times infinity is zero here: an infinite bound stands for finite but unbounded numbers.
    with np.errstate(invalid="ignore", over="ignore"):
        ends = [np.where((x == 0) | (y == 0), 0.0, np.multiply(x, y)) for x in a for y in b]
    low = np.minimum(np.minimum(ends[0], ends[1]), np.minimum(ends[2], ends[3]))
    high = np.maximum(np.maximum(ends[0], ends[1]), np.maximum(ends[2], ends[3]))
    return down(low), up(high)


def chained(a: Enclosure, value: tuple[Any, Any], derivative: tuple[Any, Any]) -> Enclosure:
    """An image whose derivative lies between two bounds; allows for errors of NumPy's functions."""
    low = down(np.minimum(*derivative), 3)
    high = up(np.maximum(*derivative), 3)
    return Enclosure(down(value[0], 3), up(value[1], 3), *product((low, high), a.slope))


def reciprocal(a: Enclosure) -> Enclosure:
    through = (a.low <= 0) & (a.high >= 0)
    with np.errstate(divide="ignore"):
        low = np.where(through, -np.inf, 1.0 / a.high)
        high = np.where(through, np.inf, 1.0 / a.low)
    square = product((low, high), (low, high))
    return Enclosure(down(low), up(high), *product((-square[1], -np.maximum(square[0], 0.0)), a.slope))


def whole_power(a: Enclosure, exponent: int) -> Enclosure:
    """Powers with an exponent of 0, 1, 2, ..."""
    if exponent == 0:
        return Enclosure(np.ones_like(a.low), np.ones_like(a.low))
    return chained(a, power_range(a, exponent), tuple(exponent * b for b in power_range(a, exponent - 1)))


def power_range(a: Enclosure, exponent: int) -> tuple[Any, Any]:
    first, second = a.low**exponent, a.high**exponent
    if exponent % 2:
        return first, second
    inside = (a.low <= 0) & (a.high >= 0) & (exponent > 0)
    return np.where(inside, 0.0, np.minimum(first, second)), np.maximum(first, second)


def sine_range(low: Any, high: Any) -> tuple[Any, Any]:
    """Bounds of the sine over an interval."""
    slack = SLACK * (1.0 + np.abs(low))

    def reached(phase: float) -> Any:
        turns = np.ceil((low - slack - phase) / (2 * np.pi))
        return phase + 2 * np.pi * turns <= high + slack

    first, second = np.sin(low), np.sin(high)
    least = np.where(reached(-np.pi / 2), -1.0, np.minimum(first, second))
    most = np.where(reached(np.pi / 2), 1.0, np.maximum(first, second))
    return least, most


def sin(a: Any) -> Enclosure:
    a = enclosure(a)
    return chained(a, sine_range(a.low, a.high), sine_range(a.low + np.pi / 2, a.high + np.pi / 2))


def cos(a: Any) -> Enclosure:
    a = enclosure(a)
    least, most = sine_range(a.low, a.high)
    return chained(a, sine_range(a.low + np.pi / 2, a.high + np.pi / 2), (-most, -least))


def even(a: Enclosure) -> tuple[Any, Any]:
    """Bounds of the absolute value, at which even functions take their extremes."""
    inside = (a.low <= 0) & (a.high >= 0)
    nearer = np.where(inside, 0.0, np.minimum(np.abs(a.low), np.abs(a.high)))
    return nearer, np.maximum(np.abs(a.low), np.abs(a.high))


def tanh(a: Any) -> Enclosure:
    a = enclosure(a)
    near, far = even(a)
    with np.errstate(over="ignore"):
        derivative = 1.0 / np.cosh(far) ** 2, 1.0 / np.cosh(near) ** 2
    return chained(a, (np.tanh(a.low), np.tanh(a.high)), derivative)


def arctan(a: Any) -> Enclosure:
    a = enclosure(a)
    near, far = even(a)
    derivative = 1.0 / (1.0 + far * far), 1.0 / (1.0 + near * near)
    return chained(a, (np.arctan(a.low), np.arctan(a.high)), derivative)


def exp(a: Any) -> Enclosure:
    with np.errstate(over="ignore"):
        return enclosure(a)._monotone(np.exp, np.exp)


def expm1(a: Any) -> Enclosure:
    with np.errstate(over="ignore"):
        return enclosure(a)._monotone(np.expm1, np.exp)


def log1p(a: Any) -> Enclosure:
    return enclosure(a)._monotone(np.log1p, lambda b: 1.0 / (1.0 + b))


def sqrt(a: Any) -> Enclosure:
    a = enclosure(a)
    # The argument of a root is never negative; a negative bound comes from rounding.
    a = Enclosure(np.maximum(a.low, 0.0), np.maximum(a.high, 0.0), *a.slope)
    with np.errstate(divide="ignore"):
        root = a._monotone(np.sqrt, lambda b: 0.5 / np.sqrt(b))
    return Enclosure(np.maximum(root.low, 0.0), root.high, *root.slope)


def cbrt(a: Any) -> Enclosure:
    a = enclosure(a)
    near, far = even(a)
    with np.errstate(divide="ignore"):
        derivative = (1.0 / (3.0 * np.cbrt(far) ** 2), 1.0 / (3.0 * np.cbrt(near) ** 2))
    return chained(a, (np.cbrt(a.low), np.cbrt(a.high)), derivative)


def absolute(a: Any) -> Enclosure:
    a = enclosure(a)
    signs = np.where(a.low >= 0, 1.0, -1.0), np.where(a.high <= 0, -1.0, 1.0)
    low, high = even(a)
    return Enclosure(low, high, *product(signs, a.slope))


def sign(a: Any) -> Enclosure:
    a = enclosure(a)
    settled = (a.low > 0) | (a.high < 0)
    return Enclosure(
        np.sign(a.low), np.sign(a.high), np.where(settled, 0.0, -np.inf), np.where(settled, 0.0, np.inf)
    )


def where(condition: Truth, first: Any, second: Any) -> Enclosure:
    a, b = enclosure(first), enclosure(second)

    def chosen(x: Any, y: Any, otherwise: Any) -> Any:
        return np.where(condition.yes, x, np.where(condition.no, y, otherwise))

    return Enclosure(
        chosen(a.low, b.low, np.minimum(a.low, b.low)),
        chosen(a.high, b.high, np.maximum(a.high, b.high)),
        chosen(a.slope_low, b.slope_low, -np.inf),
        chosen(a.slope_high, b.slope_high, np.inf),
    )


def maximum(first: Any, second: Any) -> Enclosure:
    a, b = enclosure(first), enclosure(second)
    above, below = a.low > b.high, b.low > a.high
    slope_low = np.where(
        above, a.slope_low, np.where(below, b.slope_low, np.minimum(a.slope_low, b.slope_low))
    )
    slope_high = np.where(
        above, a.slope_high, np.where(below, b.slope_high, np.maximum(a.slope_high, b.slope_high))
    )
    return Enclosure(np.maximum(a.low, b.low), np.maximum(a.high, b.high), slope_low, slope_high)


def minimum(first: Any, second: Any) -> Enclosure:
    return -maximum(-enclosure(first), -enclosure(second))


FUNCTIONS = SimpleNamespace(
    pi=np.pi,
    sin=sin,
    cos=cos,
    tanh=tanh,
    arctan=arctan,
    exp=exp,
    expm1=expm1,
    log1p=log1p,
    sqrt=sqrt,
    cbrt=cbrt,
    abs=absolute,
    sign=sign,
    where=where,
    maximum=maximum,
    minimum=minimum,
)
