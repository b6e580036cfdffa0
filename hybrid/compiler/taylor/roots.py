"""Fractional powers of guards: smooth functions of a root of the guard."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import lcm

import attrs
import numpy as np

from hybrid.compiler.taylor.series import NoSeries
from hybrid.expression.derivatives import derivative
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import (
    MOST_EXPANDED,
    base_and_exponent,
    factors_of,
    is_larger_than,
    is_negative,
    is_positive,
    is_whole,
    mentions,
    nodes_of,
    replaced,
    symbols_of,
    terms_of,
)
from hybrid.expression.nodes import (
    ZERO,
    Expression,
    Number,
    Power,
    Symbol,
    add,
    multiply,
    number,
    order_of,
    power,
)
from hybrid.expression.operations import CubeRoot
from hybrid.expression.polynomials import expanded, ratio
from hybrid.expression.ranges import range_of
from hybrid.expression.signs import sign_of
from hybrid.expression.tracing import Symbols

ROOT = Symbol("w", positive=True)
THIRD = number(Fraction(1, 3))
# Exponents are told from other floats up to this denominator.
LARGEST_DENOMINATOR = 7
# In a series in the root of the order ``q``, with ``w**m`` the lowest power in the field, only each
# ``q + m``-th term may differ from zero. The control of the step looks at eight terms.
WIDEST_GAP = 8
# Ratios at two points differ if they do by more than this share.
DIFFERENT = 1e-10
# Where points are drawn that tell two expressions apart: first where all is positive.
RANGES = ((0.5, 1.5), (-1.5, -0.5), *((-0.3, 0.3), (-1.5, 1.5)) * 4)


def with_fractions(expression: Expression, known: Sequence[Expression]) -> Expression:
    """The expression with fractions for the floats that stand for them in exponents, such as 1/3."""
    found: dict[Expression, Expression] = {}
    for node in nodes_of(Power, expression):
        fraction = fraction_of(node.exponent)
        if fraction is not None and fraction is not node.exponent:
            found[node] = power(node.base, fraction)
    for node in nodes_of(CubeRoot, expression):
        sign = sign_of(node.args[0], known)
        if sign:
            found[node] = sign * power(sign * node.args[0], THIRD)
    return replaced(expression, found) if found else expression


def fraction_of(exponent: Expression) -> Number | None:
    """The fraction that an exponent is, or that its float stands for; None for any other."""
    if not isinstance(exponent, Number) or exponent.is_exact:
        return exponent if isinstance(exponent, Number) else None
    fraction = Fraction(exponent.value).limit_denominator(LARGEST_DENOMINATOR)
    return number(fraction) if float(fraction) == exponent.value else None


def singular_bases(
    field: Sequence[Expression], known: Sequence[Expression], symbols: Symbols
) -> dict[Expression, int]:
    """The guards with fractional powers in the field, with the order of the root that makes them smooth.

    Such a power is singular where the guard is zero. A series continues through a zero of any other base to a
    branch that the power does not have. So a base that may change its sign must be a guard.
    """
    bases: dict[Expression, list[Fraction]] = {}
    for node in nodes_of(Power, *field):
        base, exponent = node.args
        if is_whole(exponent) or not mentions(base, symbols.variables):
            continue
        if not any(is_multiple(base, guard, symbols) for guard in known):
            if not range_of(base).low.value >= 0.0:
                power_of = f"it has the power {exponent} of an expression"
                raise NoSeries(f"{power_of} that may change sign and is not a guard")
            continue
        if not (is_positive(exponent) and exponent.is_exact):
            raise NoSeries(f"it has the power {exponent} of a guard")
        bases.setdefault(base, []).append(Fraction(exponent.value))
    return {base: _order(bases[base]) for base in sorted(bases, key=order_of)}


def _order(exponents: Sequence[Fraction]) -> int:
    """The order of the root of which all these powers of a guard are whole powers."""
    order = lcm(*(exponent.denominator for exponent in exponents))
    if order > 2 and order + min(exponents) * order > WIDEST_GAP:
        powers = " and ".join(map(str, sorted(set(exponents))))
        raise NoSeries(f"it has the powers {powers} of a guard, and series in its root have wide gaps")
    return order


def is_multiple(expression: Expression, other: Expression, symbols: Symbols) -> bool:
    """Whether an expression is a multiple of another, with a factor that depends on parameters only."""
    if (
        other is ZERO
        or is_larger_than(MOST_EXPANDED, expression)
        or _ratio_varies(expression, other, symbols)
    ):
        return False
    return ratio(expression, other, symbols.variables) is not None


def _ratio_varies(expression: Expression, other: Expression, symbols: Symbols) -> bool:
    """Whether the ratio has different values at two points, for the same parameters.

    This spares writing out large expressions. The points lie where
    both expressions have values. If no such points are found, the ratio may vary or not.
    """
    names = sorted(symbols_of(expression, other), key=order_of)
    generator = np.random.default_rng(0)
    program = Program([expression, other])
    for low, high in RANGES:
        point = dict(zip(names, generator.uniform(low, high, len(names)), strict=True))
        moved = {name: value + generator.uniform(0.1, 0.5) for name, value in point.items()}
        moved |= {name: value for name, value in point.items() if name not in symbols.variables}
        with np.errstate(all="ignore"):
            (one, below), (two, beside) = program.run(point), program.run(moved)
            size = abs(one * beside) + abs(two * below)
            if np.isfinite(size):
                return bool(abs(one * beside - two * below) > DIFFERENT * size)
    return False


@attrs.frozen
class Root:
    """The root of a guard ``base`` of some order, which has a smooth ``rate`` in time."""

    symbol: Symbol
    base: Expression
    order: int
    rate: Expression


def regular_root(
    field: Sequence[Expression], z: Expression, order: int, place: int, symbols: Symbols
) -> Root | None:
    """The root ``w`` of a guard ``z = w**q`` if ``w' = z'/(q w**(q-1))`` is smooth in ``w``; else None.

    An example is a tank that empties with ``h' = -sqrt(h)``: the root falls at a constant rate and reaches
    zero at nonzero speed. On the clock ``dt = w ds`` the tank would never be empty.
    """
    root = Symbol(f"w{place}", positive=True)
    terms = _slope_in_root(field, z, order, root, symbols)
    if terms is None or _least_power(terms, root) < order - 1:
        return None
    return Root(root, z, order, add(*(term / (order * root ** (order - 1)) for term in terms)))


def is_crossed(field: Sequence[Expression], z: Expression, order: int, symbols: Symbols) -> bool:
    """Whether the rate of a guard ``z`` does not vanish with each root of the guard."""
    terms = _slope_in_root(field, z, order, ROOT, symbols)
    return terms is not None and _least_power(terms, ROOT) == 0


def _slope_in_root(
    field: Sequence[Expression], z: Expression, order: int, root: Symbol, symbols: Symbols
) -> Sequence[Expression] | None:
    """The terms of the rate of ``z`` with ``root`` in place of a state; None if ``z`` gives no state."""
    states = [x for x in symbols.x if mentions(z, (x,)) and not mentions(derivative(z, x), symbols.variables)]
    if not states:
        return None
    slope = in_roots(slope_along(field, z, symbols), z, order, root)
    first = states[0]
    rest = replaced(z, {first: ZERO})
    return terms_of(expanded(replaced(slope, {first: (root**order - rest) / derivative(z, first)})))


def _least_power(terms: Sequence[Expression], root: Symbol) -> float:
    return min(float(_power_of(root, term)) for term in terms)


def _power_of(root: Symbol, term: Expression) -> Expression:
    """The exponent of a root among the factors of a term."""
    powers = dict(map(base_and_exponent, factors_of(term)))
    return powers.get(root, ZERO)


def slope_along(field: Sequence[Expression], z: Expression, symbols: Symbols) -> Expression:
    """The rate of an expression along the field."""
    return derivative(z, symbols.t) + add(
        *(derivative(z, x) * rate for x, rate in zip(symbols.x, field, strict=True) if mentions(z, (x,)))
    )


def on_clock(rate: Expression, z: Expression, order: int) -> Expression:
    """``w**(q-1)`` times the rate, with powers of ``z = w**q`` written as nonnegative powers of ``w``."""
    return _times_root(in_roots(rate, z, order), number(order - 1))


def _times_root(expression: Expression, exponent: Expression) -> Expression:
    """``w**exponent`` times an expression, multiplied into the sums that divide by ``w``."""
    if expression.is_product:
        own = _power_of(ROOT, expression)
        rest = [each for each in expression.args if base_and_exponent(each)[0] is not ROOT]
        sums = [each for each in rest if _divides_by_root(each)]
        if len(sums) == 1:
            others = (each for each in rest if each is not sums[0])
            return multiply(*others, _times_root(sums[0], exponent + own))
        return multiply(*rest, ROOT ** (exponent + own))
    terms = terms_of(expression)
    singular = [term for term in terms if _divides_by_root(term)]
    if len(terms) == 1:
        return expression * ROOT**exponent
    regular = add(*(term for term in terms if term not in singular))
    return add(regular * ROOT**exponent, *(_times_root(term, exponent) for term in singular))


def _divides_by_root(term: Expression) -> bool:
    return any(each.base is ROOT and is_negative(each.exponent) for each in nodes_of(Power, term))


def in_roots(expression: Expression, z: Expression, order: int, root: Symbol = ROOT) -> Expression:
    """Fractional powers of ``z`` as integer powers times those of its root, which saves products."""
    powers = {p for p in nodes_of(Power, expression) if p.base is z and not is_whole(p.exponent)}
    return replaced(expression, {p: _in_root(z, int(p.exponent.value * order), order, root) for p in powers})


def _in_root(z: Expression, exponent: int, order: int, root: Symbol) -> Expression:
    """``root**exponent``, with ``z`` for its powers of the order."""
    if exponent < 0:
        # Negative powers are written as powers of the root, where they may cancel a root in the rate.
        return root**exponent
    whole, rest = divmod(exponent, order)
    return multiply(z**whole, root**rest)
