"""Taylor series of a mode's solutions: recurrences for their coefficients, written as code.

Every expression of the vector field is split into elementary operations. Each has a recurrence for its
normalised Taylor coefficients along a solution (Jorba and Zou 2005, doi:10.1080/10586458.2005.10128904;
Griewank and Walther, Evaluating Derivatives, 2nd ed. 2008, table 13.2). Linear operations cost one
multiplication per order, products and functions cost one convolution per order.
"""

from __future__ import annotations

import math
from typing import Any

from hybrid.compiler.statements.code import Code, at, call, either, equal, get, put
from hybrid.compiler.statements.values import assignments, root_power
from hybrid.compiler.taylor.coefficients import ONE_THEN_ZERO, Coefficients, o, shrink
from hybrid.compiler.taylor.sums import Term, added
from hybrid.expression import operations as ops
from hybrid.expression.derivatives import derivative
from hybrid.expression.graph import factors_of, is_negative, is_whole, mentions, terms_of
from hybrid.expression.nodes import ONE, TWO, ZERO, Expression, add, multiply, number, power
from hybrid.expression.tabulated import Tabulated, has_knots_in_time

# A pair of functions, and the sign in the derivative of the second: cos' = -sin, cosh' = sinh.
PAIRS = dict.fromkeys((ops.Sin, ops.Cos), (ops.Sin, ops.Cos, -1.0)) | dict.fromkeys(
    (ops.Sinh, ops.Cosh), (ops.Sinh, ops.Cosh, 1.0)
)
# ``y' = (1 -+ y^2) u'``.
OWN_SQUARE = {ops.Tanh: -1, ops.Tan: 1}
# Longer inner sums are not expanded: other expressions may need them too.
MOST_TERMS = 4


class NoSeries(Exception):
    """An expression has no Taylor recurrence here; the message says which part."""


class Recurrences(Coefficients):
    """How the coefficients of an expression follow from those of its parts, operation by operation."""

    def _operation(self, expression: Expression) -> Any:
        if self.time is not None and expression == self.time[0]:
            return self._bind(expression, get("t"), self.time[1])
        if expression.is_sum:
            return self._sum(expression)
        if expression.is_product:
            return self._product(expression)
        if expression.is_power:
            return self._power(expression)
        if isinstance(expression, ops.Exp):
            return self._exponential(expression, expression.args[0])
        if type(expression) in PAIRS:
            return self._pair(expression)
        if type(expression) in OWN_SQUARE:
            return self._own_square(expression)
        if expression.in_other_terms is not None:
            return self._same(expression, expression.in_other_terms(*expression.args))
        if expression.by_derivative:
            return self._by_derivative(expression)
        if isinstance(expression, Tabulated) and self.time is not None and has_knots_in_time(expression):
            return self._table(expression, derivative(expression.args[0], self.time[0]))
        if isinstance(expression, ops.Level):
            return self._bind(expression, call("np.floor", self.coefficient(*expression.args)), 0.0)
        raise NoSeries(f"{expression.word} is not analytic")

    def _same(self, expression: Expression, other: Expression) -> Code:
        value = self.coefficient(other)
        return self._bind(expression, value, value)

    def _sum(self, expression: Expression) -> Code:
        terms = self._terms(expression)
        constant = add(*(factor for factor, rest in terms if rest is ONE))
        moving = [(factor, rest) for factor, rest in terms if rest is not ONE]
        first = added([self._times(*term) for term in moving])
        if constant is not ZERO:
            first = first + self.constants.name(constant)
        return self._bind(expression, first, added([self._higher_times(*term) for term in moving]))

    def _terms(self, expression: Expression) -> list[tuple[Expression, Expression]]:
        """The terms of a sum as pairs of a constant factor and a varying factor; inner sums are expanded.

        Otherwise each level of nested sums would wait for the level below. A difference of states, whose
        digits may cancel, is not expanded.
        """
        found = []
        for factor, rest in map(self._split, terms_of(expression)):
            if self._comes_apart(rest):
                found += [(factor * each, moving) for each, moving in self._terms(rest)]
            else:
                found.append((factor, rest))
        return found

    def _comes_apart(self, rest: Expression) -> bool:
        at_hand = self._is_known(rest) or rest in self.variables or rest in self.rows
        if not rest.is_sum or at_hand or len(rest.args) > MOST_TERMS:
            return False
        return not all(self._is_constant(term) or self._is_plain(*self._split(term)) for term in rest.args)

    @staticmethod
    def _is_plain(factor: Expression, rest: Expression) -> bool:
        return rest.is_symbol and factor in (1, -1)

    def _split(self, term: Expression) -> tuple[Expression, Expression]:
        """The product of the constant factors of a term, and that of the others."""
        factors = factors_of(term)
        constant = [factor for factor in factors if self._is_constant(factor)]
        return multiply(*constant), multiply(*(factor for factor in factors if factor not in constant))

    def _times(self, constant: Expression, rest: Expression) -> Term:
        value = self.coefficient(rest)
        if constant != 1:
            value = self.constants.name(constant) * value
        return Term(self._ready(rest), value, constant != 1)

    def _higher_times(self, constant: Expression, rest: Expression) -> Term:
        """``_times`` above order zero, where a sum with one varying term is a multiple of that term."""
        self.coefficient(rest)
        while rest.is_sum or rest.is_product:
            moving = [each for each in terms_of(rest) if not self._is_constant(each)]
            factor, inner = self._split(moving[0])
            if len(moving) > 1 or (factor == 1 and inner == rest):
                break
            constant, rest = constant * factor, inner
        return self._times(constant, rest)

    def _ready(self, expression: Expression) -> tuple[int, int]:
        """When a coefficient is known: operations after the states, and lateness of the states."""
        if expression.is_symbol:
            return 1, self.lateness.get(expression, 0)
        if expression not in self.readiness:
            moving = [each for each in expression.args if not self._is_constant(each)]
            depth, late = 0, 0
            if moving and not self._is_known(expression):
                depth, late = max(map(self._ready, moving))
                depth += 1 if expression.is_sum or expression.is_product else 2
            self.readiness[expression] = depth, late
        return self.readiness[expression]

    def _product(self, expression: Expression) -> Code:
        factors = expression.args
        if any(self._is_constant(factor) for factor in factors):
            term = self._split(expression)
            return self._bind(expression, self._times(*term).code, self._higher_times(*term).code)
        below = [f for f in factors if f.is_power and is_negative(f.exponent)]
        # A known divisor becomes a factor: the series of its reciprocal is stored.
        below = [f for f in below if self.known is None or mentions(f, self.own)]
        if below and len(below) < len(factors):
            above = multiply(*(f for f in factors if f not in below))
            return self._quotient(expression, above, multiply(*(1 / f for f in below)))
        if len(below) > 1:
            return self._quotient(expression, None, multiply(*(1 / f for f in below)))
        # The first factor is a known one, or else the one that most products share.
        *others, last = sorted(factors, key=lambda factor: (-mentions(factor, self.own), self.shared[factor]))
        return self._convolution(expression, last, multiply(*others))

    def _convolution(self, expression: Expression, a: Expression, b: Expression) -> Code:
        left = self.row(a)
        factor = self._known_coefficient(a) if self._is_known(a) else self.coefficient(a)
        inner, right, value = self._beside(left, b)
        if not self.lanes:
            # Time is a symbol too, but its coefficient becomes known only in ``higher``.
            if a.is_symbol and a in self.variables and not (self.time and a == self.time[0]):
                self.led[left, b] = factor
            else:
                inner = inner + factor * at("out", 0, right)
        return self._bind(expression, factor * value, inner + at("out", 0, left) * value)

    def _quotient(self, expression: Expression, above: Expression | None, below: Expression) -> Code:
        dividend = None if above is None else self.coefficient(above)
        divisor, value = self.row(below), self.coefficient(below)
        inner, column = self._place(divisor, expression)
        name, column = self._kept(expression, column)
        # The minus sign is included here, so that no term has to be negated.
        self.first.append(put(self._divisor(name), -1.0 / value))
        inner = inner if dividend is None else inner - dividend
        first = (1.0 if dividend is None else dividend) / value
        self._bind(expression, first, (inner + value * at("out", 0, column)) * self._divisor(name))
        self.pairs[divisor, expression] = name
        return name

    def _power(self, expression: Expression) -> Code:
        base, exponent = expression.args
        if not self._is_constant(exponent):
            return self._same(expression, ops.Exp(exponent * ops.Log(base)))
        if is_whole(exponent) and is_negative(exponent):
            return self._quotient(expression, None, power(base, -exponent))
        if is_whole(exponent):
            half = power(base, number(exponent.value // 2))
            return self._convolution(
                expression, *((base, power(base, exponent - 1)) if exponent.value % 2 else (half, half))
            )
        u, slope, k = self.row(base), self._slope(base), self.constants.name(exponent)
        value = self.coefficient(base)
        inner, column = self._place(u, expression)
        moving, _ = self._place(slope, expression)
        name, column = self._kept(expression, column)
        self.first.append(put(self._divisor(name), 1.0 / value))
        whole = moving + at("out", o, slope) * at("out", 0, column)
        higher = (k * whole + moving - o * inner) * shrink * self._divisor(name)
        self._bind(expression, root_power(value, exponent, k), higher)
        self.pairs[u, expression] = name
        self.pairs[slope, expression] = name
        return name

    def _rate(self, u: Expression) -> Any:
        """The constant rate of an argument that is linear in time; None for other arguments."""
        if self.time is None or self.time[1] is not ONE_THEN_ZERO:
            return None
        if mentions(u, [each for each in self.own if each is not self.time[0]]):
            return None
        slope = derivative(u, self.time[0])
        return self.constants.name(slope) if self._is_constant(slope) else None

    def _exponential(self, expression: Expression, u: Expression) -> Code:
        rate = self._rate(u)
        first = call("exp", self.coefficient(u))
        if rate is not None:
            name, column = self._kept(expression)
            self._bind(expression, first, shrink * rate * at("out", o - 1, column))
            self._store(expression)
            return name
        slope = self._slope(u)
        inner, column = self._place(slope, expression)
        name, column = self._kept(expression, column)
        self._bind(expression, first, _integrated(inner, slope, column))
        self.pairs[slope, expression] = name
        return name

    def _pair(self, expression: Expression) -> Any:
        odd, even, sign = PAIRS[type(expression)]
        (u,) = expression.args
        s, c = odd(u), even(u)
        rate = self._rate(u)
        argument = self.coefficient(u)
        if rate is not None:
            (s_name, s_column), (c_name, c_column) = self._kept(s), self._kept(c)
            values = (
                shrink * rate * at("out", o - 1, c_column),
                sign * shrink * rate * at("out", o - 1, s_column),
            )
        else:
            slope = self._slope(u)
            (s_sum, s_column), (c_sum, c_column) = (self._place(slope, each) for each in (s, c))
            (s_name, _), (c_name, _) = self._kept(s, s_column), self._kept(c, c_column)
            values = _integrated(c_sum, slope, c_column), sign * _integrated(s_sum, slope, s_column)
        self.first += [put(s_name, call(odd.code, argument)), put(c_name, call(even.code, argument))]
        self.higher += [put(s_name, values[0]), put(c_name, values[1])]
        if rate is not None:
            self._store(s, c)
        else:
            self.pairs[slope, s] = s_name
            self.pairs[slope, c] = c_name
        return self.variables[expression]

    def _table(self, expression: Tabulated, rate: Expression) -> Code:
        """A table of what grows at a constant rate, a polynomial on each step: its knots end steps."""
        name, higher = self._name(expression), either(equal(o, 0), 0.0, 0.0)
        orders = range(1 + expression.pieces.degree - expression.derived)
        values = [expression.differentiated(k) * rate**k / math.factorial(k) for k in orders]
        later = [get(f"{name[1]}d{k}") for k in orders[1:]]
        self.first += assignments([name, *later], values)
        for order, coefficient in enumerate(later, 1):
            higher = either(equal(o, order), coefficient, higher)
        self.higher.append(put(name, higher))
        return name

    def _own_square(self, expression: Expression) -> Code:
        sign = OWN_SQUARE[type(expression)]
        (u,) = expression.args
        argument, rate = self.coefficient(u), self._slope(u)
        slope = 1 + sign * power(expression, TWO)
        moving, slope_column = self._place(rate, slope)
        name, row = self._kept(expression)
        slope_name, _ = self._kept(slope, slope_column)
        inner, _ = self._place(row, expression)
        self.first.append(put(name, call(expression.code, argument)))
        self.higher.append(put(name, _integrated(moving, rate, slope_column)))
        self._store(expression)
        self.pairs[row, expression] = name
        self.first.append(put(slope_name, 1.0 + float(sign) * name * name))
        self.higher.append(put(slope_name, float(sign) * (inner + 2.0 * at("out", 0, row) * name)))
        self.pairs[rate, slope] = slope_name
        return name

    def _by_derivative(self, expression: Expression) -> Code:
        (u,) = expression.args
        argument, rate = self.coefficient(u), self._slope(u)
        inner, slope, _ = self._beside(rate, expression.slope())
        return self._bind(expression, call(expression.code, argument), _integrated(inner, rate, slope))


def _integrated(inner: Code, slope: Any, column: Any) -> Code:
    """The coefficient of what has a product as its rate: its inner terms, then the one of this order."""
    return (inner + at("out", o, slope) * at("out", 0, column)) * shrink
