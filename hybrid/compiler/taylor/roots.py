"""Fractional powers of guards: smooth functions of the square root of the guard."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np
import sympy

from hybrid.compiler.taylor.series import NoSeries
from hybrid.symbolic.evaluation import Program
from hybrid.symbolic.nodes import MOST_EXPANDED, is_larger_than, mentions, nodes_of, replaced, symbols_of
from hybrid.symbolic.tracing import Symbols

ROOT = sympy.Symbol("w", positive=True)
HALF = sympy.Rational(1, 2)
# Ratios at two points differ if they do by more than this share.
DIFFERENT = 1e-10


def singular_bases(
    field: Sequence[sympy.Expr], known: Sequence[sympy.Expr], symbols: Symbols
) -> list[sympy.Expr]:
    """The guards with fractional powers in the field; these powers are singular where the guard is zero.

    A series continues through a zero of any other base to a branch that the power does not have. So a base
    that may change its sign must be a guard.
    """
    bases: set[sympy.Expr] = set()
    for power in nodes_of(sympy.Pow, *field):
        if power.exp.is_Integer or not mentions(power.base, symbols.variables):
            continue
        if not any(is_multiple(power.base, guard, symbols) for guard in known):
            if not power.base.is_nonnegative:
                raise NoSeries(
                    f"it has the power {power.exp} of an expression that may change sign and is not a guard"
                )
            continue
        if not (power.exp.is_Rational and power.exp.q == 2 and power.exp.is_positive):
            raise NoSeries(f"it has the power {power.exp} of a guard")
        bases.add(power.base)
    return sorted(bases, key=sympy.default_sort_key)


def is_multiple(expression: sympy.Expr, other: sympy.Expr, symbols: Symbols) -> bool:
    """Whether an expression is a multiple of another, with a factor that depends on parameters only."""
    if other == 0 or is_larger_than(MOST_EXPANDED, expression) or _ratio_varies(expression, other, symbols):
        return False
    return not mentions(sympy.cancel(expression / other), symbols.variables)


def _ratio_varies(expression: sympy.Expr, other: sympy.Expr, symbols: Symbols) -> bool:
    """Whether the ratio has different values at two points, for the same parameters.

    SymPy takes minutes to simplify the ratio of large expressions with many parameters.
    """
    names = sorted(symbols_of(expression) | symbols_of(other), key=str)
    generator = np.random.default_rng(0)
    point = dict(zip(names, generator.uniform(0.5, 1.5, len(names)), strict=True))
    moved = {name: value + generator.uniform(0.1, 0.5) for name, value in point.items()}
    moved |= {name: value for name, value in point.items() if name not in symbols.variables}
    program = Program([expression, other])
    with np.errstate(all="ignore"):
        (one, below), (two, beside) = program.run(point), program.run(moved)
        # The comparison fails where a value is not finite.
        return bool(abs(one * beside - two * below) > DIFFERENT * (abs(one * beside) + abs(two * below)))


@attrs.frozen
class Root:
    """The square root of a guard ``base``, which has a smooth ``rate`` in time."""

    symbol: sympy.Symbol
    base: sympy.Expr
    rate: sympy.Expr


def regular_root(field: Sequence[sympy.Expr], z: sympy.Expr, place: int, symbols: Symbols) -> Root | None:
    """The root ``w`` of a guard ``z`` if ``w' = z'/(2 w)`` is smooth in ``w``; else None.

    An example is a tank that empties with ``h' = -sqrt(h)``: the root falls at a constant rate and reaches
    zero at nonzero speed. On the clock ``dt = w ds`` the tank would never be empty.
    """
    root = sympy.Symbol(f"w{place}", positive=True)
    states = [x for x in symbols.x if mentions(z, (x,)) and not mentions(z.diff(x), symbols.variables)]
    if not states:
        return None
    slope = in_roots(slope_along(field, z, symbols), z, root)
    first = states[0]
    along = slope.xreplace({first: (root**2 - z.xreplace({first: sympy.Integer(0)})) / z.diff(first)})
    terms = sympy.Add.make_args(along.expand())
    if not all(term.as_powers_dict()[root] >= 1 for term in terms):
        return None
    return Root(root, z, sympy.Add(*(term / (2 * root) for term in terms)))


def slope_along(field: Sequence[sympy.Expr], z: sympy.Expr, symbols: Symbols) -> sympy.Expr:
    """The rate of an expression along the field."""
    return z.diff(symbols.t) + sympy.Add(
        *(z.diff(x) * rate for x, rate in zip(symbols.x, field, strict=True) if mentions(z, (x,)))
    )


def on_clock(rate: sympy.Expr, z: sympy.Expr) -> sympy.Expr:
    """``w`` times the rate, with powers of ``z`` written as nonnegative powers of ``w``."""
    terms = sympy.Add.make_args(in_roots(rate, z))
    singular = [term for term in terms if term.has(1 / ROOT)]
    regular = sympy.Add(*(term for term in terms if term not in singular))
    return sympy.Add(ROOT * regular, *(ROOT * term for term in singular))


def in_roots(expression: sympy.Expr, z: sympy.Expr, root: sympy.Symbol = ROOT) -> sympy.Expr:
    """Fractional powers of ``z`` as integer powers times its root, which saves products to compute ``z``."""
    powers = {p for p in nodes_of(sympy.Pow, expression) if p.base == z and not p.exp.is_Integer}
    return replaced(expression, {p: sympy.Mul(*_whole_power(z, p.exp - HALF, root), root) for p in powers})


def _whole_power(z: sympy.Expr, exponent: sympy.Integer, root: sympy.Symbol) -> tuple[sympy.Expr, ...]:
    # Negative powers are written as powers of the root, where they may cancel a root in the rate.
    return (z**exponent,) if exponent >= 0 else (root ** (2 * exponent),)
