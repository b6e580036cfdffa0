"""Model functions as SymPy expressions, found by calling them once on symbols."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Any

import attrs
import sympy
from sympy.core.parameters import distribute

from hybrid.errors import ModelError
from hybrid.symbolic.expressions import number
from hybrid.symbolic.nodes import ask_no_more, interned, is_larger_than, nodes, once
from hybrid.symbolic.ufuncs import RULES
from hybrid.symbolic.values import Traced as Traced
from hybrid.symbolic.values import TraceError as TraceError
from hybrid.symbolic.values import values_of

# Largest number of operations of an expression shown in an error text.
SHOWN = 100
# Whether an expression with more operations is positive, zero or finite is not asked.
MOST_ASKED = 200


class SymbolicAlgebra:
    """Traced numbers as SymPy expressions."""

    def number(self, value: Any) -> sympy.Expr:
        """A number of the same value."""
        return number(value)

    def combined(self, name: str, contents: tuple[sympy.Expr, ...]) -> sympy.Expr:
        """The result of the rule ``name`` for these expressions."""
        return _combined(name, contents)

    def expression(self, content: sympy.Expr) -> sympy.Expr:
        """The content itself."""
        return content


@once
def _combined(name: str, contents: tuple[sympy.Expr, ...]) -> sympy.Expr:
    made = interned(RULES[name](*contents))
    if is_larger_than(MOST_ASKED, made):
        ask_no_more(made)
    return made


def _told(error: Exception) -> str:
    """What stopped a function, with what to write instead if that is known."""
    for frame, _ in traceback.walk_tb(error.__traceback__):
        if str(frame.f_globals.get("__name__")).startswith("numpy.linalg"):
            return (
                f"np.linalg.{frame.f_code.co_name} of numbers that depend on the state cannot be traced: "
                "write the solution out (Cramer's rule for two or three unknowns), or multiply by the "
                "inverse if the matrix is constant"
            )
    return f"{type(error).__name__}: {error}"


SYMBOLIC = SymbolicAlgebra()


@attrs.frozen
class Symbols:
    """The symbols of a traced function, with the names they have in generated code."""

    t: sympy.Symbol
    x: tuple[sympy.Symbol, ...]
    p: tuple[sympy.Symbol, ...]

    @property
    def variables(self) -> tuple[sympy.Symbol, ...]:
        """The columns of a derivative: the states, then time."""
        return (*self.x, self.t)


@lru_cache(maxsize=1000)
def model_symbols(n: int, m: int) -> Symbols:
    """Real symbols ``t``, ``x[0] ... x[n-1]`` and ``p[0] ... p[m-1]``."""
    x = tuple(sympy.Symbol(f"x[{i}]", real=True) for i in range(n))
    p = tuple(sympy.Symbol(f"p[{i}]", real=True) for i in range(m))
    return Symbols(sympy.Symbol("t", real=True), x, p)


def trace(
    function: Callable[..., Any], state: tuple[str, ...] | int, parameters: Iterable[str]
) -> list[sympy.Expr]:
    """Values of a model function as SymPy expressions in the symbols of `model_symbols`.

    Parameters
    ----------
    function
        ``(t, x, p)`` function of a model: plain Python.
    state
        Names of the state components, or their number.
    parameters
        Names of the parameters.

    Returns
    -------
    list of sympy.Expr
        The values as a flat list: one for a scalar, row by row for a matrix.

    Raises
    ------
    TraceError
        If the function branches on the value of an argument, uses it as an index, or computes with it
        outside of NumPy.
    """
    names = tuple(parameters)
    symbols = model_symbols(state if isinstance(state, int) else len(state), len(names))
    try:
        with distribute(False):  # 3*(a - b) must not become 3*a - 3*b, which rounds where a - b is exact
            expressions = values_of(function, state, names, SYMBOLIC, (symbols.t, symbols.x, symbols.p))
    except ModelError:
        raise
    except Exception as error:
        raise TraceError(_told(error)) from error
    for node in nodes(*expressions):
        if node in (sympy.I, sympy.zoo, sympy.nan):
            shown = next((str(each) for each in expressions if not is_larger_than(SHOWN, each)), str(node))
            raise TraceError(f"it is not a real number everywhere: {shown}")
    return expressions
