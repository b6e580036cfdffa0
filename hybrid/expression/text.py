"""Expressions as people write them."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from hybrid.expression.graph import factors_of
from hybrid.expression.nodes import Expression, Number, Symbol, power, split

# How tightly a text binds.
SUM, PRODUCT, POWER, ATOM = range(4)
# Significant digits of floats.
DIGITS = 15


def text(expression: Expression, names: Mapping[Symbol, str] | None = None) -> str:
    """An expression as text, such as ``x[0]**2 - 3*x[1]``; ``names`` are those of symbols."""
    return _Writer(names or {}).text(expression)


class _Writer:
    def __init__(self, names: Mapping[Symbol, str]) -> None:
        self.names = names

    def text(self, expression: Expression, binding: int = SUM) -> str:
        found, own = self._written(expression)
        return f"({found})" if own < binding else found

    def _written(self, expression: Expression) -> tuple[str, int]:
        if isinstance(expression, Number):
            return _number(expression.value)
        if isinstance(expression, Symbol):
            return self.names.get(expression, expression.label), ATOM
        if expression.is_sum:
            return self._sum(expression), SUM
        if expression.is_product:
            return self._product(expression), PRODUCT
        if expression.is_power:
            return self._power(*expression.args)
        arguments = ", ".join(map(self.text, expression.args))
        return f"{expression.word}({arguments})", ATOM

    def _sum(self, expression: Expression) -> str:
        """Terms with a plus first, if there is one."""
        terms = [self.text(each, PRODUCT) for each in expression.args]
        first, *rest = sorted(terms, key=lambda term: term.startswith("-"))
        return first + "".join(f" - {term[1:]}" if term[0] == "-" else f" + {term}" for term in rest)

    def _product(self, expression: Expression) -> str:
        coefficient, rest = split(expression)
        above: list[str] = []
        below: list[str] = []
        for factor in sorted(factors_of(rest), key=self._rank):
            if factor.is_power and factor.exponent.leads_with_minus and factor.exponent.is_number:
                below.append(self.text(power(factor.base, -factor.exponent), POWER))
            else:
                above.append(self.text(factor, PRODUCT if not below and not above else POWER))
        size, sign = abs(coefficient), "-" if coefficient < 0 else ""
        if isinstance(size, Fraction) and (size.numerator == 1 or not _is_binary(size)):
            below.insert(0, str(size.denominator))
            size = size.numerator
        if size != 1 or not above:
            above.insert(0, _number(size)[0])
        over = "*".join(below)
        over = f"/({over})" if len(below) > 1 else f"/{over}" if below else ""
        return f"{sign}{'*'.join(above)}{over}"

    def _rank(self, factor: Expression) -> tuple[int, str]:
        """Symbols first, by their names."""
        return (0 if not factor.size else 1 if factor.is_power else 2), self.text(factor)

    def _power(self, base: Expression, exponent: Expression) -> tuple[str, int]:
        if exponent.is_number and exponent.value == Fraction(1, 2):
            return f"sqrt({self.text(base)})", ATOM
        if exponent.is_number and exponent.value == -1:
            return f"1/{self.text(base, POWER)}", PRODUCT
        return f"{self.text(base, ATOM)}**{self.text(exponent, ATOM)}", POWER


def _is_binary(value: Fraction) -> bool:
    """Whether a fraction has few decimals."""
    return value.denominator & (value.denominator - 1) == 0


def _number(value: int | Fraction | float) -> tuple[str, int]:
    if isinstance(value, Fraction) and _is_binary(value):
        value = float(value)
    if isinstance(value, Fraction):
        shown = f"{value.numerator}/{value.denominator}"
        binding = PRODUCT
    elif isinstance(value, float):
        shown, binding = f"{value:.{DIGITS}g}", ATOM
    else:
        shown, binding = str(value), ATOM
    return shown, min(binding, PRODUCT if value < 0 else ATOM)
