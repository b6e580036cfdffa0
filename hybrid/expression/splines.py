"""Splines of SciPy in model functions: a call with a traced number is a table."""

from __future__ import annotations

import sys
from typing import Any

from hybrid.expression.table import Table
from hybrid.expression.values import is_traced


def teach_splines() -> bool:
    """Let SciPy's piecewise polynomials take traced numbers; False if they do already, or are not in use.

    They turn their argument into floats, which symbols are not. For floats nothing changes.
    """
    scipy = sys.modules.get("scipy.interpolate")
    if scipy is None or hasattr(scipy.PPoly.__call__, "of_numbers"):
        return False
    of_numbers = scipy.PPoly.__call__

    def __call__(self: Any, x: Any, nu: int = 0, extrapolate: Any = None) -> Any:
        if is_traced(x) and extrapolate in (None, True):
            return Table(self.derivative(nu) if nu else self)(x)
        return of_numbers(self, x, nu, extrapolate)

    __call__.of_numbers = of_numbers  # type: ignore[attr-defined]
    __call__.__doc__ = of_numbers.__doc__
    scipy.PPoly.__call__ = __call__
    return True
