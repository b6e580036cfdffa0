"""Names in generated code for values that depend only on the parameters."""

from __future__ import annotations

import sympy

from hybrid.symbolic.printer import assignments


class Constants:
    """Names for expressions that depend only on the parameters; they are computed once per call."""

    def __init__(self) -> None:
        self.names: dict[sympy.Expr, str] = {}

    def name(self, expression: sympy.Expr) -> str:
        """A name for the expression, or the number itself."""
        if expression.is_Number or expression.is_NumberSymbol:
            text = repr(float(expression))
            return f"({text})" if text.startswith("-") else text
        return self.names.setdefault(expression, f"k{len(self.names)}")

    def statements(self) -> list[str]:
        """Assignments of all named expressions."""
        return assignments(list(self.names.values()), list(self.names))
