"""The derivative of an expression along a vector, as the equations of tangent vectors need it."""

from __future__ import annotations

import sympy

from hybrid.symbolic import ZERO


def directional(expression: sympy.Expr, seeds: dict[sympy.Symbol, sympy.Symbol]) -> sympy.Expr:
    """Derivative along the seeds, one for each symbol, in a form that keeps common factors together."""
    if not expression.free_symbols & seeds.keys():
        return ZERO
    if expression.is_Symbol:
        return seeds[expression]
    if expression.is_Add:
        return sympy.Add(*(directional(term, seeds) for term in expression.args))
    if expression.is_Mul:
        args = expression.args
        return sympy.Add(
            *(
                sympy.Mul(*args[:i], directional(factor, seeds), *args[i + 1 :])
                for i, factor in enumerate(args)
                if factor.free_symbols & seeds.keys()
            )
        )
    return sympy.Add(
        *(
            _outer(expression, i) * directional(argument, seeds)
            for i, argument in enumerate(expression.args)
            if argument.free_symbols & seeds.keys()
        )
    )


def _outer(expression: sympy.Expr, index: int) -> sympy.Expr:
    """Derivative of the outermost function in its argument of that index."""
    if expression.is_Pow:
        base, exponent = expression.args
        return exponent * base ** (exponent - 1) if index == 0 else expression * sympy.log(base)
    return expression.fdiff(index + 1)
