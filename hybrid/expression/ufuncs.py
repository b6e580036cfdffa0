"""Universal functions of NumPy and SciPy as operations on expressions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybrid.expression import operations as ops
from hybrid.expression.nodes import HALF, MINUS_ONE, ONE, TWO, ZERO, Expression, add, multiply, number, power
from hybrid.expression.vocabulary import WHERE


def _quotient(a: Expression, b: Expression) -> Expression:
    return multiply(a, power(b, MINUS_ONE))


def _clip(a: Expression, low: Expression, high: Expression) -> Expression:
    return ops.Minimum(ops.Maximum(a, low), high)


def _heaviside(a: Expression, at_zero: Expression) -> Expression:
    return ops.Select(ops.Less(a, ZERO), ZERO, ops.Select(ops.Less(ZERO, a), ONE, at_zero))


DEGREE = number(np.pi / 180.0)

# Keyed by the ufunc's name, which its aliases share.
RULES: dict[str, Callable[..., Any]] = {
    "add": add,
    "subtract": lambda a, b: add(a, -b),
    "multiply": multiply,
    "divide": _quotient,
    "floor_divide": ops.WholeQuotient,
    "remainder": ops.Remainder,
    "fmod": ops.TruncatedRemainder,
    "power": power,
    "float_power": power,
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "absolute": ops.Absolute,
    "fabs": ops.Absolute,
    "sign": ops.Sign,
    "square": lambda a: power(a, TWO),
    "reciprocal": lambda a: power(a, MINUS_ONE),
    "sqrt": lambda a: power(a, HALF),
    "cbrt": ops.CubeRoot,
    "exp": ops.Exp,
    "exp2": ops.Exp2,
    "expm1": ops.Expm1,
    "log": ops.Log,
    "log2": ops.Log2,
    "log10": ops.Log10,
    "log1p": ops.Log1p,
    "sin": ops.Sin,
    "cos": ops.Cos,
    "tan": ops.Tan,
    "arcsin": ops.Arcsin,
    "arccos": ops.Arccos,
    "arctan": ops.Arctan,
    "arctan2": ops.Atan2,
    "sinh": ops.Sinh,
    "cosh": ops.Cosh,
    "tanh": ops.Tanh,
    "arcsinh": ops.Arcsinh,
    "arccosh": ops.Arccosh,
    "arctanh": ops.Arctanh,
    "erf": ops.Erf,
    "erfc": ops.Erfc,
    "hypot": ops.Hypot,
    "deg2rad": lambda a: DEGREE * a,
    "radians": lambda a: DEGREE * a,
    "rad2deg": lambda a: a / DEGREE,
    "degrees": lambda a: a / DEGREE,
    "floor": ops.Floor,
    "ceil": ops.Ceiling,
    "trunc": ops.Truncate,
    "rint": ops.Round,
    "maximum": ops.Maximum,
    "minimum": ops.Minimum,
    "fmax": ops.LargerNumber,
    "fmin": ops.SmallerNumber,
    "clip": _clip,
    "heaviside": _heaviside,
    "less": ops.Less,
    "less_equal": ops.LessEqual,
    "greater": lambda a, b: ops.Less(b, a),
    "greater_equal": lambda a, b: ops.LessEqual(b, a),
    "equal": ops.Equal,
    "not_equal": lambda a, b: ops.Not(ops.Equal(a, b)),
    "logical_and": ops.And,
    "logical_or": ops.Or,
    "logical_xor": lambda a, b: ops.Not(ops.Equal(ops.Not(a), ops.Not(b))),
    "logical_not": ops.Not,
    "conjugate": lambda a: a,
    WHERE: ops.Select,
}
