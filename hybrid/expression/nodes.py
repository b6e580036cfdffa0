"""Expressions: what a model function computes, as a graph in which equal parts are one object.

A node is a number, a symbol, a sum, a product, a power, or a function of other nodes. Nodes never change. A
value that a function uses twice is one node with two uses, and two functions that compute the same share it.

Arithmetic is simplified as it is written down, locally and in time that grows with the number of terms:
numbers are added up, equal terms and factors are collected. Nothing is expanded: ``3*(a - b)`` does not
become ``3*a - 3*b``, which rounds where ``a - b`` is exact. Only a factor -1 goes into a sum, where it
changes no rounding.
"""

# ruff: noqa: D102 - methods that override others are explained there

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from fractions import Fraction
from threading import Lock
from typing import TYPE_CHECKING, Any, ClassVar
from weakref import WeakValueDictionary
from zlib import crc32

from hybrid.expression.exact import digits, exact, raised

# A higher power of a product is not split into powers of its factors, which may leave the floating range.
HIGHEST_SPLIT = 16
# A number that is taken out of a power has at most this many binary digits, for the same reason.
MOST_DIGITS = 500
# Operations of a tree are counted up to here.
COUNTLESS = 10**9
# Where numbers stand in the order of terms: behind all symbols.
LAST = 1 << 62
WORD = (1 << 64) - 1
INDEXED = re.compile(r"([xp])\[(\d+)\]")

_known: WeakValueDictionary[tuple[Any, ...], Expression] = WeakValueDictionary()
_making = Lock()


def _kept(kind: type[Expression], *args: Any) -> Any:
    """The one node of a kind with these parts."""
    key = (kind, *args)
    node = _known.get(key)
    if node is None:
        with _making:
            node = _known.get(key)
            if node is None:
                node = object.__new__(kind)
                node._begin(*args)
                _known[key] = node
    return node


class Expression:
    """A node; equal expressions are one object.

    Attributes
    ----------
    args
        The nodes that it is computed from.
    mask
        One bit for each symbol in it.
    traits
        One bit for each class of functions in it.
    size
        Operations of the expression written out as a tree.
    order
        Where it stands among the terms of a sum: by its first symbol, in the order of time, states and
        parameters, by its size, by its numbers. It does not depend on what else has been computed.
    """

    __slots__ = ("__weakref__", "args", "mask", "order", "size", "traits")

    args: tuple[Expression, ...]
    mask: int
    traits: int
    size: int
    order: tuple[int, int, float, int]

    is_number: ClassVar[bool] = False
    is_symbol: ClassVar[bool] = False
    is_sum: ClassVar[bool] = False
    is_product: ClassVar[bool] = False
    is_power: ClassVar[bool] = False
    is_exponential: ClassVar[bool] = False
    own_traits: ClassVar[int] = 0
    attached: Any = ()  # what an operation has besides its arguments

    if TYPE_CHECKING:
        # What numbers, symbols, powers and functions have alone: ``is_number`` and its like tell which it is.
        value: Any
        label: Any
        positive: bool
        base: Any
        exponent: Any
        numpy: ClassVar[Any]
        code: ClassVar[Any]
        word: ClassVar[Any]
        bounds: ClassVar[Any]
        range: ClassVar[Any]
        in_other_terms: ClassVar[Any]
        by_derivative: ClassVar[bool]

        def slope(self, place: int = 0) -> Any: ...
        def __float__(self) -> float: ...

    def _begin(self, *args: Any) -> None:
        mask, traits, size = 0, self.own_traits, max(1, len(args) - 1)
        first, numbers, word = LAST, 0.0, crc32(type(self).__name__.encode())
        for each in args:
            mask |= each.mask
            traits |= each.traits
            size += each.size
            first = min(first, each.order[0])
            numbers += each.order[2]
            word = (word * 0x9E3779B97F4A7C15 + each.order[3]) & WORD
            word ^= word >> 29
        self.args, self.mask, self.traits = args, mask, traits
        self.size = min(size, COUNTLESS)
        self.order = first, self.size, numbers if math.isfinite(numbers) else 0.0, word

    def rebuilt(self, args: Sequence[Expression]) -> Expression:
        """The same operation on other nodes."""
        return type(self)(*args, *self.attached)

    def raised(self, exponent: Number) -> Expression | None:
        """A power of it in simpler terms, if there are any."""
        return None

    @property
    def leads_with_minus(self) -> bool:
        """Whether the number in its first term is negative."""
        return False

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, int | float) and self.is_number and self.value == other)

    __hash__ = object.__hash__

    def __add__(self, other: Any) -> Expression:
        return add(self, node(other))

    def __radd__(self, other: Any) -> Expression:
        return add(node(other), self)

    def __sub__(self, other: Any) -> Expression:
        return add(self, -node(other))

    def __rsub__(self, other: Any) -> Expression:
        return add(node(other), -self)

    def __mul__(self, other: Any) -> Expression:
        return multiply(self, node(other))

    def __rmul__(self, other: Any) -> Expression:
        return multiply(node(other), self)

    def __truediv__(self, other: Any) -> Expression:
        return multiply(self, power(node(other), MINUS_ONE))

    def __rtruediv__(self, other: Any) -> Expression:
        return multiply(node(other), power(self, MINUS_ONE))

    def __pow__(self, other: Any) -> Expression:
        return power(self, node(other))

    def __rpow__(self, other: Any) -> Expression:
        return power(node(other), self)

    def __neg__(self) -> Expression:
        return multiply(MINUS_ONE, self)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (*self.args, *self.attached)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self.args))})"


class Number(Expression):
    """A number: whole, a fraction, or a float if it is neither exactly."""

    __slots__ = ("value",)

    is_number = True

    def __new__(cls, value: Any) -> Any:
        value = exact(value)
        return _kept(Number, type(value), value if value == value else "nan")

    def _begin(self, *args: Any) -> None:
        kind, value = args
        self.value = kind(value)
        self.args, self.mask, self.traits, self.size = (), 0, 0, 0
        number = float(self.value)
        self.order = LAST, 0, number if math.isfinite(number) else 0.0, crc32(number.hex().encode())

    def __float__(self) -> float:
        return float(self.value)

    def __repr__(self) -> str:
        return str(self.value)

    @property
    def is_exact(self) -> bool:
        return not isinstance(self.value, float)

    @property
    def is_whole(self) -> bool:
        return isinstance(self.value, int)

    @property
    def leads_with_minus(self) -> bool:
        return bool(self.value < 0)

    def __reduce__(self) -> tuple[Any, ...]:
        return Number, (self.value,)


class Symbol(Expression):
    """A variable by its name, real; it may be known to be ``positive``."""

    __slots__ = ("label", "positive")

    is_symbol = True
    # Every symbol that there has been, by its bit: names are few.
    known: ClassVar[list[Symbol]] = []

    def __new__(cls, label: str, positive: bool = False) -> Any:
        return _kept(Symbol, label, positive)

    def _begin(self, *args: Any) -> None:
        self.label, self.positive = label, _ = args
        self.args, self.traits, self.size = (), 0, 0
        self.mask = 1 << len(Symbol.known)
        Symbol.known.append(self)
        self.order = _place(label), 0, 0.0, crc32(label.encode())

    def __reduce__(self) -> tuple[Any, ...]:
        return Symbol, (self.label, self.positive)

    def __repr__(self) -> str:
        return self.label


def _place(label: str) -> int:
    """Where a symbol stands: time, states, parameters, all others."""
    if label == "t":
        return 0
    found = INDEXED.fullmatch(label)
    if found:
        return (1 if found[1] == "x" else 1 << 32) + int(found[2])
    return (1 << 40) + crc32(label.encode())


class Sum(Expression):
    """A sum of different terms, each with one number as a factor; a number comes last."""

    __slots__ = ()
    is_sum = True

    def __new__(cls, *terms: Expression) -> Any:
        return add(*terms)

    @property
    def leads_with_minus(self) -> bool:
        return self.args[0].leads_with_minus


class Product(Expression):
    """A product of powers of different bases; a number comes first."""

    __slots__ = ()
    is_product = True

    def __new__(cls, *factors: Expression) -> Any:
        return multiply(*factors)

    @property
    def leads_with_minus(self) -> bool:
        return self.args[0].is_number and self.args[0].leads_with_minus

    def raised(self, exponent: Number) -> Expression | None:
        """Its factors raised one by one if the power is whole; else what is not negative, by itself."""
        size, numbers = abs(float(exponent.value)), [each for each in self.args if each.is_number]
        if size > HIGHEST_SPLIT or any(digits(each.value) * size > MOST_DIGITS for each in numbers):
            return None
        if exponent.is_whole:
            return multiply(*(power(each, exponent) for each in self.args))
        apart = [Number(abs(each.value)) for each in numbers if abs(each.value) != 1]
        apart += [each for each in self.args if is_even_power(each)]
        if not apart:
            return None
        sign = MINUS_ONE if self.leads_with_minus else ONE
        inner = multiply(sign, *(each for each in self.args if not (each.is_number or is_even_power(each))))
        return multiply(power(inner, exponent), *(power(each, exponent) for each in apart))


class Power(Expression):
    """A power ``base**exponent``."""

    __slots__ = ("base", "exponent")
    is_power = True

    def __new__(cls, base: Expression, exponent: Expression) -> Any:
        return power(base, exponent)

    def _begin(self, *args: Any) -> None:
        super()._begin(*args)
        self.base, self.exponent = args

    def raised(self, exponent: Number) -> Expression | None:
        base, inner = self.base, self.exponent
        if exponent.is_whole or (base.is_symbol and base.positive):
            return power(base, multiply(inner, exponent))
        if is_even_power(self):
            return power(Function.known["Absolute"](base), multiply(inner, exponent))
        return None


class Function(Expression):
    """A function of other nodes; ``hybrid.expression.operations`` has them all, with their rules."""

    __slots__ = ()
    known: ClassVar[dict[str, Any]] = {}
    # The bit of the class in the traits of nodes.
    own_trait: ClassVar[int] = 0
    word: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        cls.own_trait = 1 << len(Function.known)
        cls.own_traits |= cls.own_trait
        Function.known[cls.__name__] = cls
        if "word" not in vars(cls):
            cls.word = cls.__name__.lower()

    def __new__(cls, *args: Any) -> Any:
        parts = tuple(map(node, args))
        made = cls.simplified(*parts)
        return _kept(cls, *parts) if made is None else made

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        """The value in simpler terms, if there are any."""
        return None


def node(value: Any) -> Expression:
    """A number as a node; a node as it is."""
    return value if isinstance(value, Expression) else number(value)


def number(value: Any) -> Number:
    """A number as a node of the same value; exact for whole numbers, eighths and fractions."""
    return Number(
        value if isinstance(value, int | Fraction) and not isinstance(value, bool) else float(value)
    )


def add(*terms: Expression) -> Expression:
    """The sum of terms, with equal ones collected."""
    constant: Any = 0
    found: dict[Expression, Any] = {}
    for term in terms:
        for each in term.args if term.is_sum else (term,):
            if each.is_number:
                constant = constant + each.value
            else:
                factor, rest = split(each)
                found[rest] = found[rest] + factor if rest in found else factor
    rests = sorted((rest for rest, factor in found.items() if factor != 0), key=order_of)
    parts = [_times(found[rest], rest) for rest in rests]
    if any(part.is_sum for part in parts):
        # Sums whose factors come to 1 or -1.
        return add(*parts, Number(constant))
    if constant != 0:
        parts.append(Number(constant))
    if len(parts) > 1:
        return _kept(Sum, *parts)
    return parts[0] if parts else ZERO


def order_of(part: Expression) -> tuple[int, int, float, int]:
    """The key by which terms and factors are sorted."""
    return part.order


def split(term: Expression) -> tuple[Any, Expression]:
    """The number in a term, and the rest of the term."""
    if term.is_product and term.args[0].is_number:
        rest = term.args[1:]
        return term.args[0].value, rest[0] if len(rest) == 1 else _kept(Product, *rest)
    if term.is_number:
        return term.value, ONE
    return 1, term


def _times(factor: Any, rest: Expression) -> Expression:
    """A term: a number times what has no number as a factor."""
    number = Number(factor)
    if number is ONE:
        return rest
    if rest.is_sum and number is MINUS_ONE:
        return _negative(rest)
    return _kept(Product, number, *(rest.args if rest.is_product else (rest,)))


def _negative(total: Expression) -> Expression:
    """The opposite of a sum, term by term."""
    parts = []
    for each in total.args:
        factor, rest = split(each)
        parts.append(Number(-factor) if rest is ONE else _times(-factor, rest))
    return _kept(Sum, *parts)


def multiply(*factors: Expression) -> Expression:
    """The product of factors, with the powers of equal bases collected, and those of e.

    Numbers and powers are collected as long as they cannot leave the range of floats.
    """
    coefficient: Any = 1
    found: dict[Expression, Any] = {}
    exponential: Expression | None = None
    is_high = False
    for factor in factors:
        for each in factor.args if factor.is_product else (factor,):
            if each is ZERO:
                return ZERO
            if each.is_number:
                coefficient = exact(coefficient * each.value)
            elif each.is_exponential:
                args = each.args if exponential is None else [exponential.args[0] + each.args[0]]
                exponential = each.rebuilt(args)
            else:
                base, exponent = each, 1
                if each.is_power and each.exponent.is_number:
                    base, exponent = each.base, each.exponent.value
                found[base] = found[base] + exponent if base in found else exponent
                is_high = is_high or abs(found[base]) > max(HIGHEST_SPLIT, abs(exponent))
    is_high = is_high and (len(found) > 1 or coefficient != 1)
    if found and (is_high or _is_out_of_range(coefficient, factors)):
        parts = sorted((each for each in factors if each is not ONE), key=order_of)
        return _kept(Product, *sorted(parts, key=lambda part: not part.is_number))
    parts = [base if e == 1 else power(base, Number(e)) for base, e in found.items() if e != 0]
    if exponential is not None:
        parts.append(exponential)
    if any(part.is_product or part.is_number for part in parts):
        return multiply(Number(coefficient), *parts)
    leading = Number(coefficient)
    if len(parts) < 2:
        return _times(leading.value, parts[0]) if parts else leading
    parts.sort(key=order_of)
    return _kept(Product, *(parts if leading is ONE else [leading, *parts]))


def _is_out_of_range(coefficient: Any, factors: Sequence[Expression]) -> bool:
    """Whether a product of numbers is far larger or smaller than each of them."""
    if coefficient == 0:
        return True
    size = digits(coefficient)
    return size > MOST_DIGITS and all(
        size > digits(each.value)
        for factor in factors
        for each in (factor.args if factor.is_product else (factor,))
        if each.is_number
    )


def power(base: Expression, exponent: Expression) -> Expression:
    """A power; those of numbers are numbers, and whole powers of products and of powers come apart."""
    if base is ONE:
        return ONE
    if not exponent.is_number:
        return _power_of_zero(exponent) if base is ZERO else _kept(Power, base, exponent)
    if exponent is ZERO or exponent is ONE:
        return base if exponent is ONE else ONE
    if base.is_number:
        return Number(raised(base.value, exponent.value))
    assert isinstance(exponent, Number)
    made = base.raised(exponent)
    return _kept(Power, base, exponent) if made is None else made


def _power_of_zero(exponent: Expression) -> Expression:
    select, less, equal = (Function.known[name] for name in ("Select", "Less", "Equal"))
    return select(less(ZERO, exponent), ZERO, select(equal(exponent, ZERO), ONE, Number(math.inf)))


def is_even_power(expression: Expression) -> bool:
    """Whether an expression is an even whole power, which is never negative."""
    if not expression.is_power or not expression.exponent.is_number:
        return False
    return expression.exponent.is_whole and expression.exponent.value % 2 == 0


ZERO, ONE, MINUS_ONE, TWO, HALF = (Number(each) for each in (0, 1, -1, 2, Fraction(1, 2)))
NAN = Number(math.nan)
