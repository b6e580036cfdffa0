"""Names in generated code for what depends on the parameters alone."""

from __future__ import annotations

import sympy

from hybrid.symbolic.printer import assignments


class Constants:
    """Names for expressions of the parameters alone, computed once a call."""

    def __init__(self) -> None:
        self.names: dict[sympy.Expr, str] = {}

    def name(self, expression: sympy.Expr) -> str:
        """A name, or the number itself."""
        if expression.is_Number or expression.is_NumberSymbol:
            text = repr(float(expression))
            return f"({text})" if text.startswith("-") else text
        return self.names.setdefault(expression, f"k{len(self.names)}")

    def statements(self) -> list[str]:
        """Assignments of all of them."""
        return assignments(list(self.names.values()), list(self.names))
