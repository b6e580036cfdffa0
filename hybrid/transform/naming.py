"""Names that a person can read for surfaces and for the cells between them, such as ``v<belt, q>1``."""

from __future__ import annotations

from collections.abc import Sequence

import sympy

from hybrid.symbolic.nodes import is_larger_than, mentions
from hybrid.symbolic.switches import Surface
from hybrid.symbolic.tracing import Symbols, model_symbols
from hybrid.system.variables import Variables

# A surface written with more operations than this is named by its number.
LONGEST = 40
SIGNS = {-1: "<", 0: "=", 1: ">"}


class Names:
    """Names of sides in the words of a model."""

    def __init__(self, variables: Variables) -> None:
        names = variables.parameter_names
        self.symbols: Symbols = model_symbols(variables.dimension, len(names))
        pairs = [*zip(self.symbols.x, variables.state_names, strict=True)]
        pairs += zip(self.symbols.p, names, strict=True)
        self.words = {symbol: sympy.Symbol(name) for symbol, name in pairs}

    def side(self, surfaces: Sequence[Surface], number: int, side: int) -> str:
        """Name of a side of a surface; 0 is the surface."""
        surface = surfaces[number]
        if surface.argument is not None:
            part = {-1: ">1/2", 0: " in (0,1/2)", 1: "<1/2"}[side]
            return f"mod({self._text(surface.argument)},1){part}"
        left, right = self._equation(surface.height)
        return f"{left}{SIGNS[side]}{right}"

    def cell(self, surfaces: Sequence[Surface], sides: Sequence[tuple[int, int]]) -> str:
        """Name of a cell by its sides; empty if there are none."""
        return ", ".join(self.side(surfaces, number, side) for number, side in sides)

    def _equation(self, height: sympy.Expr) -> tuple[str, str]:
        """Both sides of ``height = 0``: what depends on the state on the left, if that makes sense."""
        if is_larger_than(LONGEST, height):
            return self._text(height), "0"
        terms = sympy.Add.make_args(height.expand())
        if len(terms) > len(sympy.Add.make_args(height)) + 1:
            terms = sympy.Add.make_args(height)
        left = [term for term in terms if mentions(term, self.symbols.x)]
        if not left:
            left = [*terms]
        elif all(term.could_extract_minus_sign() for term in left):
            return self._text(height), "0"
        moved = [term for term in left if term.could_extract_minus_sign()]
        right = [-term for term in terms if term not in left or term in moved]
        left = [term for term in left if term not in moved]
        return self._text(sympy.Add(*left)), self._text(sympy.Add(*right))

    def _text(self, expression: sympy.Expr) -> str:
        return str(expression.xreplace(self.words)).replace(" ", "").replace("**", "^")
