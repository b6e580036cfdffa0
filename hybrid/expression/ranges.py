"""Ranges of expressions over all real values of their symbols: enough to prove the sign of some of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import attrs

from hybrid.expression.graph import once
from hybrid.expression.nodes import Expression, Power, Product, Sum

# Ends that are differences of numbers are wrong by rounding; so much of the numbers is allowed for it.
ROUNDING = 1e-12


@attrs.frozen
class End:
    """One end of a range; the value itself is ``taken``, or only approached."""

    value: float
    taken: bool


@attrs.frozen
class Range:
    """All values of an expression, wherever it is a number, lie between two ends."""

    low: End
    high: End

    @property
    def positive(self) -> bool:
        """Whether all values are above zero."""
        return self.low.value > 0.0 or (self.low.value == 0.0 and not self.low.taken)

    @property
    def negative(self) -> bool:
        """Whether all values are below zero."""
        return self.high.value < 0.0 or (self.high.value == 0.0 and not self.high.taken)


def closed(low: float, high: float) -> Range:
    """The range with both ends, as far as they are finite."""
    return Range(End(low, math.isfinite(low)), End(high, math.isfinite(high)))


ANYTHING = closed(-math.inf, math.inf)
NOT_NEGATIVE = closed(0.0, math.inf)
POSITIVE = Range(End(0.0, False), NOT_NEGATIVE.high)


def has_one_sign(expression: Expression) -> bool:
    """Whether an expression is proved to be above zero for all values of its symbols, or below zero."""
    found = range_of(expression)
    return found.positive or found.negative


@once
def range_of(expression: Expression) -> Range:
    """A range that holds all values of an expression."""
    if expression.is_number:
        value = float(expression)
        return ANYTHING if math.isnan(value) else Range(End(value, True), End(value, True))
    if expression.is_symbol:
        return POSITIVE if expression.positive else ANYTHING
    rule = RULES.get(type(expression))
    if rule is None:
        return expression.range(*map(range_of, expression.args))
    return rule(*map(range_of, expression.args))


def _sum(*terms: Range) -> Range:
    return Range(_sum_of_ends(each.low for each in terms), _sum_of_ends(each.high for each in terms))


def _sum_of_ends(ends: Iterable[End]) -> End:
    ends = [*ends]
    total, sizes = sum(end.value for end in ends), sum(abs(end.value) for end in ends)
    if math.isfinite(sizes) and abs(total) < ROUNDING * sizes:
        total = 0.0
    if total == 0.0 and sizes > 0.0:
        return End(0.0, True)
    return End(total, all(end.taken for end in ends))


def _product(*factors: Range) -> Range:
    product, *others = factors
    for other in others:
        ends = [_times(a, b) for a in (product.low, product.high) for b in (other.low, other.high)]
        product = Range(_outermost(ends, min), _outermost(ends, max))
    return product


def _times(a: End, b: End) -> End:
    zeros = [end for end in (a, b) if end.value == 0.0]
    if zeros:
        return End(0.0, any(end.taken for end in zeros))
    return End(a.value * b.value, a.taken and b.taken)


def _outermost(ends: Iterable[End], choose: Callable[[Iterable[float]], float]) -> End:
    ends = [*ends]
    value = choose(end.value for end in ends)
    return End(value, any(end.taken for end in ends if end.value == value))


def _power(base: Range, exponent: Range) -> Range:
    size, number = exponent.low.value, exponent.low == exponent.high
    if number and size % 2.0 == 0.0:
        base = absolute(base)
    elif not base.positive and not (number and size > 0.0 and not size.is_integer()):
        return ANYTHING
    if not number:
        return POSITIVE
    low = base.low if base.low.value >= 0.0 else End(0.0, True)
    ends = [_raised(low, size), _raised(base.high, size)]
    return Range(*(ends if size > 0.0 else ends[::-1]))


def _raised(end: End, exponent: float) -> End:
    if end.value == 0.0 and exponent < 0.0:
        return End(math.inf, False)
    try:
        return End(end.value**exponent, end.taken)
    except OverflowError:
        return End(math.inf, False)


def absolute(argument: Range) -> Range:
    """The range of sizes."""
    low, high = argument.low, argument.high
    if low.value >= 0.0:
        return argument
    if high.value <= 0.0:
        return Range(End(-high.value, high.taken), End(-low.value, low.taken))
    return Range(End(0.0, True), max(high, End(-low.value, low.taken), key=lambda end: end.value))


def exponential(argument: Range) -> Range:
    """The range of exponentials."""
    return Range(*(End(_exp(end.value), end.taken) for end in (argument.low, argument.high)))


def _exp(value: float) -> float:
    try:
        return math.exp(value)
    except OverflowError:
        return math.inf


def extreme(choose: Callable[[Iterable[float]], float]) -> Callable[[Range, Range], Range]:
    """The range of the larger, or of the smaller, of two."""

    def extreme(a: Range, b: Range) -> Range:
        return Range(
            *(_both(choose(one.value for one in pair), *pair) for pair in ((a.low, b.low), (a.high, b.high)))
        )

    return extreme


def _both(value: float, *ends: End) -> End:
    return End(value, any(end.taken for end in ends if end.value == value))


def either(condition: Range, a: Range, b: Range) -> Range:
    """The range of a choice."""
    return Range(_outermost((a.low, b.low), min), _outermost((a.high, b.high), max))


RULES: dict[type[Expression], Callable[..., Range]] = {Sum: _sum, Product: _product, Power: _power}
