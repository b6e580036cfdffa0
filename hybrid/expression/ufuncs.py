"""Universal functions of NumPy and SciPy as operations on expressions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybrid.expression import operations as ops
from hybrid.expression.functions import RealFunction
from hybrid.expression.nodes import HALF, MINUS_ONE, ONE, TWO, ZERO, Expression, add, multiply, number, power
from hybrid.expression.vocabulary import WHERE, Special


def _quotient(a: Expression, b: Expression) -> Expression:
    return multiply(a, power(b, MINUS_ONE))


def _clip(a: Expression, low: Expression, high: Expression) -> Expression:
    return ops.Minimum(ops.Maximum(a, low), high)


def _heaviside(a: Expression, at_zero: Expression) -> Expression:
    return ops.Select(ops.Less(a, ZERO), ZERO, ops.Select(ops.Less(ZERO, a), ONE, at_zero))


def _is_universal(function: type[RealFunction]) -> bool:
    """Whether a function of expressions is one of NumPy's or SciPy's."""
    return isinstance(vars(function).get("numpy"), np.ufunc | Special)


DEGREE = number(np.pi / 180.0)

# Keyed by the ufunc's name, which its aliases share.
RULES: dict[str, Callable[..., Any]] = {
    **{
        each.numpy.__name__: each
        for each in ops.FUNCTIONS
        if isinstance(vars(each).get("numpy"), np.ufunc | Special)
    },
    "add": add,
    "subtract": lambda a, b: add(a, -b),
    "multiply": multiply,
    "divide": _quotient,
    "power": power,
    "float_power": power,
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "fabs": ops.Absolute,
    "square": lambda a: power(a, TWO),
    "reciprocal": lambda a: power(a, MINUS_ONE),
    "sqrt": lambda a: power(a, HALF),
    "deg2rad": lambda a: DEGREE * a,
    "radians": lambda a: DEGREE * a,
    "rad2deg": lambda a: a / DEGREE,
    "degrees": lambda a: a / DEGREE,
    "clip": _clip,
    "heaviside": _heaviside,
    "less": ops.Less,
    "less_equal": ops.LessEqual,
    "greater": lambda a, b: ops.Less(b, a),
    "greater_equal": lambda a, b: ops.LessEqual(b, a),
    "equal": ops.Equal,
    "not_equal": lambda a, b: ops.Not(ops.Equal(a, b)),
    "logical_xor": lambda a, b: ops.Not(ops.Equal(ops.Not(a), ops.Not(b))),
    "conjugate": lambda a: a,
    WHERE: ops.Select,
}
# The universal functions that can be traced.
UFUNCS = RULES.keys() - {WHERE}
