"""Numbers in expressions: whole numbers and fractions as long as they are short, else floats."""

from __future__ import annotations

import math
from fractions import Fraction

Value = int | Fraction | float
# An exact number has at most this many binary digits above and below the fraction bar; it is a float beyond.
EXACT_DIGITS = 53
# Floats count as exact up to this size, if they are whole numbers of eighths.
LARGEST_EXACT = 2.0**50


def exact(value: Value) -> Value:
    """A number as it is kept: exact if it is short, and a whole number if it is one."""
    if type(value) is int and -LARGEST_EXACT < value < LARGEST_EXACT:
        return value
    if isinstance(value, float):
        if not (abs(value) < LARGEST_EXACT and (8.0 * value).is_integer()):
            return float(value)
        value = Fraction(value)
    fraction = Fraction(value)
    if max(abs(fraction.numerator), fraction.denominator).bit_length() > EXACT_DIGITS:
        try:
            return exact(float(fraction))
        except OverflowError:
            return math.inf if fraction > 0 else -math.inf
    return fraction.numerator if fraction.denominator == 1 else fraction


def raised(base: Value, exponent: Value) -> Value:
    """A power: exact if both numbers are and it is short; nan if it is no real number."""
    both = isinstance(exponent, int) and not isinstance(base, float) and base != 0
    if both and digits(base) * abs(int(exponent)) <= EXACT_DIGITS:
        return Fraction(base) ** int(exponent)
    try:
        value: float | complex = float(base) ** float(exponent)
    except ZeroDivisionError:
        return math.nan
    except OverflowError:
        return math.inf
    return math.nan if isinstance(value, complex) else value


def digits(value: Value) -> float:
    """Binary digits of an exact number above or below its bar, or the floating exponent of another."""
    if isinstance(value, float):
        size = abs(value)
        return abs(math.log2(size)) if 0.0 < size < math.inf else math.inf
    fraction = Fraction(value)
    return math.log2(max(abs(fraction.numerator), fraction.denominator))
