"""The functions that model functions may call, by what is known of them."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

# Those that give booleans, whatever their arguments.
TRUTHS = frozenset(
    {
        "less", "less_equal", "greater", "greater_equal", "equal", "not_equal", "logical_and", "logical_or",
        "logical_xor", "logical_not",
    }
)  # fmt: skip
# Name of np.where in an algebra.
WHERE = "where"
# What NumPy's functions do with booleans alone: True + True is True.
OF_TRUTHS = {
    "add": "logical_or", "multiply": "logical_and", "maximum": "logical_or", "minimum": "logical_and",
    "fmax": "logical_or", "fmin": "logical_and", "bitwise_and": "logical_and", "bitwise_or": "logical_or",
    "bitwise_xor": "logical_xor", "invert": "logical_not",
}  # fmt: skip
BITWISE = frozenset({"bitwise_and", "bitwise_or", "bitwise_xor", "invert"})
# These count booleans.
REDUCTIONS = ("reduce", "accumulate", "reduceat")
# What to write in place of functions that cannot be traced.
INSTEAD = {
    "logaddexp": "np.log(np.exp(a) + np.exp(b))",
    "logaddexp2": "np.log2(np.exp2(a) + np.exp2(b))",
    "copysign": "np.abs(a)*np.sign(b)",
    "signbit": "x < 0",
    "modf": "np.trunc(x) and x - np.trunc(x)",
    "ldexp": "a*2.0**b",
    "sinc": "np.sin(np.pi*x)/(np.pi*x)",
    "angle": "np.arctan2(y, x)",
    "sort": "np.minimum(a, b) and np.maximum(a, b)",
}
# What to write in place of what tracing cannot follow.
NEEDS_NUMBER = (
    "a number is needed where tracing has a symbol: use np.sin in place of math.sin (and so on), "
    "scipy.special.erf in place of math.erf, and np.zeros_like(x) in place of np.zeros to fill an array"
)
NEEDS_WHOLE_NUMBER = "a whole number is needed where tracing has a symbol: use"
NEEDS_FLOATS = "an array of floats cannot take symbols: use np.zeros_like(x) in place of np.zeros"
NEEDS_CHOICE = "a condition as an index cannot be traced: write np.where(x > 0, x, 0) in place of x[x > 0]"
NEEDS_TABLE = "a spline of SciPy needs a number: call hybrid.Table(spline), made once, in its place"
NEEDS_COPY = "it writes into its argument: take a copy first, x = x.copy()"
FOREIGN = (
    "only NumPy's functions can be traced or compiled. Write it with these, as a series or a fit, or carry "
    "its value as a component of the state, whose rate is the derivative of the function times that of its "
    "argument"
)
# These form sums of products, which NumPy does on object arrays with the operators of the scalars.
CONTRACTIONS = ("matmul", "vecdot", "matvec", "vecmat")


class Special:
    """A function of ``scipy.special``, which is imported when there is a number to compute."""

    names: ClassVar[set[str]] = set()

    def __init__(self, name: str) -> None:
        self.__name__ = name
        self.names.add(name)

    def __call__(self, *values: Any) -> Any:
        """The value at numbers."""
        return named(self.__name__)(*values)


def named(name: str) -> Any:
    """The universal function of that name, of NumPy or a `Special` one; None if there is none."""
    if name not in Special.names:
        return getattr(np, name, None)
    import scipy.special

    return getattr(scipy.special, name)
