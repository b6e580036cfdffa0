"""Fractional powers of guards: smooth functions of a root of the guard."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import lcm

import attrs
import numpy as np
import sympy

from hybrid.compiler.taylor.series import NoSeries
from hybrid.symbolic.evaluation import Program
from hybrid.symbolic.expressions import CubeRoot, power
from hybrid.symbolic.nodes import MOST_EXPANDED, is_larger_than, mentions, nodes_of, replaced, symbols_of
from hybrid.symbolic.signs import sign_of
from hybrid.symbolic.tracing import Symbols

ROOT = sympy.Symbol("w", positive=True)
THIRD = sympy.Rational(1, 3)
# Exponents are told from other floats up to this denominator.
LARGEST_DENOMINATOR = 7
# In a series in the root of the order ``q``, with ``w**m`` the lowest power in the field, only each
# ``q + m``-th term may differ from zero. The control of the step looks at eight terms.
WIDEST_GAP = 8
# Ratios at two points differ if they do by more than this share.
DIFFERENT = 1e-10
# Where points are drawn that tell two expressions apart: first where all is positive.
RANGES = ((0.5, 1.5), (-1.5, -0.5), *((-0.3, 0.3), (-1.5, 1.5)) * 4)


def with_fractions(expression: sympy.Expr, known: Sequence[sympy.Expr]) -> sympy.Expr:
    """The expression with fractions for the floats that stand for them in exponents, such as 1/3."""
    found: dict[sympy.Expr, sympy.Expr] = {}
    for node in nodes_of(sympy.Pow, expression):
        fraction = fraction_of(node.exp)
        if node.exp.is_Float and fraction is not None:
            found[node] = power(node.base, fraction)
    for node in nodes_of(CubeRoot, expression):
        sign = sign_of(node.args[0], known)
        if sign:
            found[node] = sign * power(sign * node.args[0], THIRD)
    return replaced(expression, found) if found else expression


def fraction_of(exponent: sympy.Expr) -> sympy.Rational | None:
    """The fraction that an exponent is, or that its float stands for; None for any other."""
    if exponent.is_Rational or not exponent.is_Float:
        return exponent if exponent.is_Rational else None
    fraction = Fraction(float(exponent)).limit_denominator(LARGEST_DENOMINATOR)
    return sympy.Rational(fraction) if float(fraction) == float(exponent) else None


def singular_bases(
    field: Sequence[sympy.Expr], known: Sequence[sympy.Expr], symbols: Symbols
) -> dict[sympy.Expr, int]:
    """The guards with fractional powers in the field, with the order of the root that makes them smooth.

    Such a power is singular where the guard is zero. A series continues through a zero of any other base to a
    branch that the power does not have. So a base that may change its sign must be a guard.
    """
    bases: dict[sympy.Expr, list[sympy.Rational]] = {}
    for node in nodes_of(sympy.Pow, *field):
        base, exponent = node.args
        if exponent.is_Integer or not mentions(base, symbols.variables):
            continue
        if not any(is_multiple(base, guard, symbols) for guard in known):
            if not base.is_nonnegative:
                raise NoSeries(
                    f"it has the power {exponent} of an expression that may change sign and is not a guard"
                )
            continue
        if not (exponent.is_Rational and exponent.is_positive):
            raise NoSeries(f"it has the power {exponent} of a guard")
        bases.setdefault(base, []).append(exponent)
    return {base: _order(bases[base]) for base in sorted(bases, key=sympy.default_sort_key)}


def _order(exponents: Sequence[sympy.Rational]) -> int:
    """The order of the root of which all these powers of a guard are whole powers."""
    order = lcm(*(exponent.q for exponent in exponents))
    if order > 2 and order + min(exponents) * order > WIDEST_GAP:
        powers = " and ".join(map(str, sorted(set(exponents))))
        raise NoSeries(f"it has the powers {powers} of a guard, and series in its root have wide gaps")
    return order


def is_multiple(expression: sympy.Expr, other: sympy.Expr, symbols: Symbols) -> bool:
    """Whether an expression is a multiple of another, with a factor that depends on parameters only."""
    if other == 0 or is_larger_than(MOST_EXPANDED, expression) or _ratio_varies(expression, other, symbols):
        return False
    return not mentions(sympy.cancel(expression / other), symbols.variables)


def _ratio_varies(expression: sympy.Expr, other: sympy.Expr, symbols: Symbols) -> bool:
    """Whether the ratio has different values at two points, for the same parameters.

    SymPy takes minutes to simplify the ratio of large expressions with many parameters. The points lie where
    both expressions have values. If no such points are found, the ratio may vary or not.
    """
    names = sorted(symbols_of(expression) | symbols_of(other), key=str)
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

    symbol: sympy.Symbol
    base: sympy.Expr
    order: int
    rate: sympy.Expr


def regular_root(
    field: Sequence[sympy.Expr], z: sympy.Expr, order: int, place: int, symbols: Symbols
) -> Root | None:
    """The root ``w`` of a guard ``z = w**q`` if ``w' = z'/(q w**(q-1))`` is smooth in ``w``; else None.

    An example is a tank that empties with ``h' = -sqrt(h)``: the root falls at a constant rate and reaches
    zero at nonzero speed. On the clock ``dt = w ds`` the tank would never be empty.
    """
    root = sympy.Symbol(f"w{place}", positive=True)
    terms = _slope_in_root(field, z, order, root, symbols)
    if terms is None or _least_power(terms, root) < order - 1:
        return None
    return Root(root, z, order, sympy.Add(*(term / (order * root ** (order - 1)) for term in terms)))


def is_crossed(field: Sequence[sympy.Expr], z: sympy.Expr, order: int, symbols: Symbols) -> bool:
    """Whether the rate of a guard ``z`` does not vanish with each root of the guard."""
    terms = _slope_in_root(field, z, order, ROOT, symbols)
    return terms is not None and _least_power(terms, ROOT) == 0


def _slope_in_root(
    field: Sequence[sympy.Expr], z: sympy.Expr, order: int, root: sympy.Symbol, symbols: Symbols
) -> Sequence[sympy.Expr] | None:
    """The terms of the rate of ``z`` with ``root`` in place of a state; None if ``z`` gives no state."""
    states = [x for x in symbols.x if mentions(z, (x,)) and not mentions(z.diff(x), symbols.variables)]
    if not states:
        return None
    slope = in_roots(slope_along(field, z, symbols), z, order, root)
    first = states[0]
    along = slope.xreplace({first: (root**order - z.xreplace({first: sympy.Integer(0)})) / z.diff(first)})
    terms: Sequence[sympy.Expr] = sympy.Add.make_args(along.expand())
    return terms


def _least_power(terms: Sequence[sympy.Expr], root: sympy.Symbol) -> sympy.Expr:
    return min(term.as_powers_dict()[root] for term in terms)


def slope_along(field: Sequence[sympy.Expr], z: sympy.Expr, symbols: Symbols) -> sympy.Expr:
    """The rate of an expression along the field."""
    return z.diff(symbols.t) + sympy.Add(
        *(z.diff(x) * rate for x, rate in zip(symbols.x, field, strict=True) if mentions(z, (x,)))
    )


def on_clock(rate: sympy.Expr, z: sympy.Expr, order: int) -> sympy.Expr:
    """``w**(q-1)`` times the rate, with powers of ``z = w**q`` written as nonnegative powers of ``w``."""
    return _times_root(in_roots(rate, z, order), order - 1)


def _times_root(expression: sympy.Expr, exponent: sympy.Expr) -> sympy.Expr:
    """``w**exponent`` times an expression, multiplied into the sums that divide by ``w``."""
    if expression.is_Mul:
        power = expression.as_powers_dict()[ROOT]
        rest = [each for each in expression.args if each.as_base_exp()[0] != ROOT]
        sums = [each for each in rest if _divides_by_root(each)]
        if len(sums) == 1:
            others = (each for each in rest if each is not sums[0])
            return sympy.Mul(*others, _times_root(sums[0], exponent + power))
        return sympy.Mul(*rest, ROOT ** (exponent + power))
    terms = sympy.Add.make_args(expression)
    singular = [term for term in terms if _divides_by_root(term)]
    if len(terms) == 1:
        return expression * ROOT**exponent
    regular = sympy.Add(*(term for term in terms if term not in singular))
    return sympy.Add(regular * ROOT**exponent, *(_times_root(term, exponent) for term in singular))


def _divides_by_root(term: sympy.Expr) -> bool:
    return any(each.base == ROOT and each.exp.is_negative for each in nodes_of(sympy.Pow, term))


def in_roots(expression: sympy.Expr, z: sympy.Expr, order: int, root: sympy.Symbol = ROOT) -> sympy.Expr:
    """Fractional powers of ``z`` as integer powers times those of its root, which saves products."""
    powers = {p for p in nodes_of(sympy.Pow, expression) if p.base == z and not p.exp.is_Integer}
    return replaced(expression, {p: _in_root(z, int(p.exp * order), order, root) for p in powers})


def _in_root(z: sympy.Expr, exponent: int, order: int, root: sympy.Symbol) -> sympy.Expr:
    """``root**exponent``, with ``z`` for its powers of the order."""
    if exponent < 0:
        # Negative powers are written as powers of the root, where they may cancel a root in the rate.
        return root**exponent
    whole, rest = divmod(exponent, order)
    return sympy.Mul(z**whole, root**rest)
