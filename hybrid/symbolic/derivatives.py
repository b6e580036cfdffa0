"""Derivatives of expressions by the chain rule: all partial derivatives, or one along a vector.

SymPy's own ``diff`` walks an expression once per variable and queries assumptions at every node. Here
every node is differentiated once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import sympy
from sympy.codegen.cfunctions import expm1, hypot
from sympy.core.parameters import distribute, global_parameters

from hybrid.symbolic.expressions import (
    ONE,
    TWO,
    ZERO,
    Equal,
    Select,
    close_gates,
    defined_at_origin,
    power,
    product,
)
from hybrid.symbolic.nodes import interned, once

Partials = dict[sympy.Symbol, sympy.Expr]
# A derivative as a sum: each argument, and the factor of its derivative.
Terms = list[tuple[sympy.Expr, sympy.Expr]]
# Derivatives of functions, by the function and its argument. SymPy's own evaluate the function once more.
SLOPES: dict[type[sympy.Basic], Callable[[sympy.Expr, sympy.Expr], sympy.Expr]] = {
    sympy.sin: lambda f, a: sympy.cos(a, evaluate=False),
    sympy.cos: lambda f, a: -sympy.sin(a, evaluate=False),
    sympy.sinh: lambda f, a: sympy.cosh(a, evaluate=False),
    sympy.cosh: lambda f, a: sympy.sinh(a, evaluate=False),
    sympy.tanh: lambda f, a: 1 - power(f, TWO),
    sympy.asin: lambda f, a: 1 / sympy.sqrt(1 - power(a, TWO)),
    sympy.acos: lambda f, a: -1 / sympy.sqrt(1 - power(a, TWO)),
    sympy.atan: lambda f, a: 1 / (1 + power(a, TWO)),
    sympy.asinh: lambda f, a: 1 / sympy.sqrt(power(a, TWO) + 1),
    sympy.atanh: lambda f, a: 1 / (1 - power(a, TWO)),
    expm1: lambda f, a: sympy.exp(a, evaluate=False),
}


def jacobian_of(
    expressions: Iterable[sympy.Expr], variables: Iterable[sympy.Symbol]
) -> list[list[sympy.Expr]]:
    """Rows of the derivatives of ``expressions`` with respect to ``variables`` (states, then time).

    At a kink ``np.maximum`` and ``np.minimum`` have the mean of both slopes, ``np.abs`` has slope zero,
    and so has the length ``np.hypot`` at the origin. Piecewise constant functions have slope zero.
    """
    with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
        rows = partial_derivatives(expressions, list(variables))
        return [
            [entry if entry is ZERO else close_gates(defined_at_origin(entry)) for entry in row]
            for row in rows
        ]


def partial_derivatives(
    expressions: Iterable[sympy.Expr], variables: Sequence[sympy.Symbol]
) -> list[list[sympy.Expr]]:
    """Rows of the partial derivatives of ``expressions`` with respect to ``variables``."""
    wanted = frozenset(variables)
    rows = (_partials(expression, wanted, global_parameters.distribute) for expression in expressions)
    return [[interned(row[each]) if each in row else ZERO for each in variables] for row in rows]


def divergence(field: Sequence[sympy.Expr], variables: Sequence[sympy.Symbol]) -> sympy.Expr:
    """Divergence of a field: the sum of the derivatives of each rate in its own variable."""
    return sympy.Add(*(row[i] for i, row in enumerate(partial_derivatives(field, variables))))


@once
def _partials(expression: sympy.Expr, wanted: frozenset[sympy.Symbol], distributed: bool) -> Partials:
    """The nonzero partial derivatives; ``distributed`` is SymPy's setting for numbers times sums.

    The same expression always gives the same objects: SymPy compares equal expressions that are different
    objects branch by branch, as trees, which is slow.
    """
    if expression.is_Symbol:
        return {expression: ONE} if expression in wanted else {}
    if isinstance(expression, sympy.sign):
        return {}
    args = expression.args
    decays = _decays(expression)
    inner = [_partials(argument, wanted, distributed) for argument in (args if not decays else ())]
    terms: dict[sympy.Symbol, list[sympy.Expr]] = {}
    if decays:
        for argument, factor in decays:
            for v, part in _partials(argument, wanted, distributed).items():
                terms.setdefault(v, []).append(product(factor, part))
    elif isinstance(expression, Select):
        condition, (_, one, other) = args[0], inner
        for v in one | other:
            terms[v] = [Select(condition, one.get(v, ZERO), other.get(v, ZERO))]
    else:
        for place, partials in enumerate(inner):
            if not partials:
                continue
            if expression.is_Add:
                products = partials
            elif expression.is_Mul:
                before, behind = args[:place], args[place + 1 :]
                products = {v: _with_factor(part, before, behind) for v, part in partials.items()}
            else:
                outer = _outer(expression, place)
                products = {v: product(outer, part) for v, part in partials.items()}
            for v, term in products.items():
                terms.setdefault(v, []).append(term)
    sums = {v: sympy.Add(*each) if len(each) > 1 else each[0] for v, each in terms.items()}
    return {v: total for v, total in sums.items() if total != 0}


def directional(
    expressions: Iterable[sympy.Expr], seeds: dict[sympy.Symbol, sympy.Symbol]
) -> list[sympy.Expr]:
    """Derivatives along a vector, with one seed per symbol; common factors stay together."""
    found: dict[sympy.Expr, sympy.Expr] = {}
    return [interned(_along(expression, seeds, found)) for expression in expressions]


def _along(
    expression: sympy.Expr, seeds: dict[sympy.Symbol, sympy.Symbol], found: dict[sympy.Expr, sympy.Expr]
) -> sympy.Expr:
    if expression.is_Symbol:
        return seeds.get(expression, ZERO)
    known = found.get(expression)
    if known is not None:
        return known
    args = expression.args
    terms = [product(factor, _along(argument, seeds, found)) for argument, factor in _decays(expression)]
    for place, argument in enumerate(args if not terms else ()):
        inner = _along(argument, seeds, found)
        if inner == 0:
            continue
        if expression.is_Add:
            terms.append(inner)
        elif expression.is_Mul:
            terms.append(_with_factor(inner, args[:place], args[place + 1 :]))
        else:
            terms.append(product(_outer(expression, place), inner))
    found[expression] = sympy.Add(*terms) if len(terms) != 1 else terms[0]
    return found[expression]


@once
def _decays(expression: sympy.Expr) -> Terms:
    """The derivative of a negative power of exponentials in terms of their arguments; empty for the others.

    Where the exponentials overflow, the power is zero, and so is its derivative. The chain rule would divide
    one infinity by another there. Of ``1/cosh(a)``, the factor of ``a'`` is ``-tanh(a)/cosh(a)``; of
    ``1/(1 + exp(a))`` it is ``-1/(1 + exp(a))/(1 + exp(-a))``.
    """
    if not (expression.is_Pow and expression.exp.is_Number and expression.exp.is_negative):
        return []
    base, factor = expression.base, expression.exp * expression
    if isinstance(base, sympy.cosh):
        return [(base.args[0], product(factor, sympy.tanh(base.args[0], evaluate=False)))]
    terms = [_exponential(term) for term in base.args] if base.is_Add else []
    if not all(size != 0 for size, _ in terms):
        return []
    return [
        (argument, factor / sympy.Add(*(b / a * sympy.exp(other - argument) for b, other in terms)))
        for a, argument in terms
        if argument != 0
    ]


def _exponential(term: sympy.Expr) -> tuple[sympy.Expr, sympy.Expr]:
    """``a`` and ``u`` of a term ``a*exp(u)`` with a positive number ``a``; zeros of another term."""
    size, rest = term.as_coeff_Mul()
    if not size.is_positive or not (rest == 1 or isinstance(rest, sympy.exp)):
        return ZERO, ZERO
    return size, rest.args[0] if rest != 1 else ZERO


def _with_factor(
    factor: sympy.Expr, before: tuple[sympy.Expr, ...], behind: tuple[sympy.Expr, ...]
) -> sympy.Expr:
    """The product of a factor with those before and behind it."""
    if factor is ONE and len(before) + len(behind) == 1:
        [other] = (*before, *behind)
        return other
    return product(*before, factor, *behind)


def _outer(expression: sympy.Expr, index: int) -> sympy.Expr:
    """Derivative of the outermost function with respect to the argument ``index``."""
    if expression.is_Pow:
        base, exponent = expression.args
        if index == 0:
            return exponent * power(base, exponent - 1)
        # A power of zero has slope zero, not 0*inf.
        return expression * sympy.log(base if base.is_positive else Select(Equal(base, ZERO), ONE, base))
    if isinstance(expression, hypot):
        return expression.args[index] / expression
    slope = SLOPES.get(expression.func)
    return slope(expression, expression.args[0]) if slope else expression.fdiff(index + 1)
