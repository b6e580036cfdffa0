"""Model functions as expressions, found by calling them once on symbols."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable
from functools import cached_property, lru_cache
from typing import Any

import attrs

from hybrid.errors import ModelError
from hybrid.expression.graph import Group, is_larger_than, nodes
from hybrid.expression.nodes import Expression, Number, Symbol, number
from hybrid.expression.pieces import Pieces
from hybrid.expression.splines import teach_splines
from hybrid.expression.tabulated import Tabulated
from hybrid.expression.text import text
from hybrid.expression.ufuncs import RULES
from hybrid.expression.values import Traced as Traced
from hybrid.expression.values import TracedArray, values_of
from hybrid.expression.values import TraceError as TraceError
from hybrid.expression.vocabulary import NEEDS_TABLE
from hybrid.system.grouped import ARRAYS

# Largest number of operations of an expression shown in an error text.
SHOWN = 100


class SymbolicAlgebra:
    """Traced numbers as expressions."""

    def number(self, value: Any) -> Expression:
        """A number of the same value."""
        return number(float(value))

    def combined(self, name: str, contents: tuple[Expression, ...]) -> Expression:
        """The result of the rule ``name`` for these expressions."""
        made: Expression = RULES[name](*contents)
        return made

    def looked_up(self, pieces: Pieces, content: Expression, derived: int) -> Expression:
        """The table as one operation."""
        made: Expression = Tabulated(content, pieces, derived)
        return made

    def expression(self, content: Expression) -> Expression:
        """The content itself."""
        return content


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
# Of the values of all members of a repeat, as in x.cell.soc.
ARRAYS[Traced] = TracedArray
# The row of a schedule that fires.
ROW = Symbol("row")


@attrs.frozen
class Symbols:
    """The symbols of a traced function, with the names they have in generated code."""

    t: Symbol
    x: Group
    p: Group

    @cached_property
    def variables(self) -> Group:
        """The columns of a derivative: the states, then time."""
        return Group((*self.x, self.t))


@lru_cache(maxsize=1000)
def model_symbols(n: int, m: int) -> Symbols:
    """Real symbols ``t``, ``x[0] ... x[n-1]`` and ``p[0] ... p[m-1]``."""
    x = Group(Symbol(f"x[{i}]") for i in range(n))
    p = Group(Symbol(f"p[{i}]") for i in range(m))
    return Symbols(Symbol("t"), x, p)


def trace(
    function: Callable[..., Any], state: tuple[str, ...] | int, parameters: Iterable[str]
) -> list[Expression]:
    """Values of a model function as expressions in the symbols of `model_symbols`.

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
    list of Expression
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
        expressions = values_of(function, state, names, SYMBOLIC, (symbols.t, symbols.x, symbols.p), row=ROW)
    except ModelError as error:
        if str(error) == NEEDS_TABLE and teach_splines():
            return trace(function, state, names)
        raise
    except Exception as error:
        raise TraceError(_told(error)) from error
    for node in nodes(*expressions):
        if isinstance(node, Number) and node.value != node.value:
            shown = next((text(each) for each in expressions if not is_larger_than(SHOWN, each)), text(node))
            raise TraceError(f"it is not a real number everywhere: {shown}")
    return expressions
