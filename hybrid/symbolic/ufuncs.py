"""Rules that apply NumPy's universal functions to SymPy expressions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy.codegen.cfunctions import exp2, expm1, hypot, log1p, log2, log10

from hybrid.symbolic.expressions import (
    HALF,
    ONE,
    TWO,
    ZERO,
    Absolute,
    And,
    Atan2,
    Ceiling,
    CubeRoot,
    Equal,
    Floor,
    LargerNumber,
    Less,
    LessEqual,
    Maximum,
    Minimum,
    Not,
    Or,
    Remainder,
    Select,
    Sign,
    SmallerNumber,
    Truncate,
    TruncatedRemainder,
    WholeQuotient,
    number,
    power,
    product,
    quotient,
)
from hybrid.symbolic.values import WHERE


def _clip(a: sympy.Expr, low: sympy.Expr, high: sympy.Expr) -> sympy.Expr:
    return Minimum(Maximum(a, low), high)


def _heaviside(a: sympy.Expr, at_zero: sympy.Expr) -> sympy.Expr:
    return Select(Less(a, ZERO), ZERO, Select(Less(ZERO, a), ONE, at_zero))


def _as_it_stands(function: Any) -> Callable[[sympy.Expr], sympy.Expr]:
    """A SymPy function that is evaluated for numbers only: further evaluation takes 20 ms for a sum."""
    return lambda a: function(a) if a.is_Number else function(a, evaluate=False)


def _of_parity(parity: int, function: Any) -> Callable[[sympy.Expr], sympy.Expr]:
    """An even or odd SymPy function; the sign of an argument such as ``-a - b`` is taken out."""
    plain = _as_it_stands(function)

    def rule(a: sympy.Expr) -> sympy.Expr:
        if a.is_Number or not a.could_extract_minus_sign():
            return plain(a)
        # A sum is negated term by term, because tracing turns SymPy's distribution of -1 off.
        opposite = sympy.Add(*(-term for term in a.args)) if a.is_Add else -a
        return parity * plain(opposite)

    return rule


DEGREE = number(np.pi / 180.0)

# Keyed by the ufunc's name, which its aliases share.
RULES: dict[str, Callable[..., sympy.Expr]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": product,
    "divide": quotient,
    "floor_divide": WholeQuotient,
    "remainder": Remainder,
    "fmod": TruncatedRemainder,
    "power": power,
    "float_power": power,
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "absolute": Absolute,
    "fabs": Absolute,
    "sign": Sign,
    "square": lambda a: power(a, TWO),
    "reciprocal": lambda a: 1 / a,
    "sqrt": lambda a: power(a, HALF),
    "cbrt": CubeRoot,
    "exp": _as_it_stands(sympy.exp),
    "exp2": exp2,
    "expm1": expm1,
    "log": sympy.log,
    "log2": log2,
    "log10": log10,
    "log1p": log1p,
    "sin": _of_parity(-1, sympy.sin),
    "cos": _of_parity(+1, sympy.cos),
    "tan": _of_parity(-1, sympy.tan),
    "arcsin": _of_parity(-1, sympy.asin),
    "arccos": sympy.acos,
    "arctan": _of_parity(-1, sympy.atan),
    "arctan2": Atan2,
    "sinh": _of_parity(-1, sympy.sinh),
    "cosh": _of_parity(+1, sympy.cosh),
    "tanh": _of_parity(-1, sympy.tanh),
    "arcsinh": _of_parity(-1, sympy.asinh),
    "arccosh": sympy.acosh,
    "arctanh": _of_parity(-1, sympy.atanh),
    "hypot": hypot,
    "deg2rad": lambda a: DEGREE * a,
    "radians": lambda a: DEGREE * a,
    "rad2deg": lambda a: a / DEGREE,
    "degrees": lambda a: a / DEGREE,
    "floor": Floor,
    "ceil": Ceiling,
    "trunc": Truncate,
    "maximum": Maximum,
    "minimum": Minimum,
    "fmax": LargerNumber,
    "fmin": SmallerNumber,
    "clip": _clip,
    "heaviside": _heaviside,
    "less": Less,
    "less_equal": LessEqual,
    "greater": lambda a, b: Less(b, a),
    "greater_equal": lambda a, b: LessEqual(b, a),
    "equal": Equal,
    "not_equal": lambda a, b: Not(Equal(a, b)),
    "logical_and": And,
    "logical_or": Or,
    "logical_xor": lambda a, b: Not(Equal(Not(a), Not(b))),
    "logical_not": Not,
    "conjugate": lambda a: a,
    WHERE: Select,
}
