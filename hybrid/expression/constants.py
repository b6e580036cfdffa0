"""Names in generated code for values that depend only on the parameters."""

from __future__ import annotations

from hybrid.expression.code import assignments
from hybrid.expression.nodes import Expression


class Constants:
    """Names for expressions that depend only on the parameters; they are computed once per call."""

    def __init__(self) -> None:
        self.names: dict[Expression, str] = {}

    def name(self, expression: Expression) -> str:
        """A name for the expression, or the number itself."""
        if expression.is_number:
            text = repr(float(expression))
            return f"({text})" if text.startswith("-") else text
        return self.names.setdefault(expression, f"k{len(self.names)}")

    def statements(self) -> list[str]:
        """Assignments of all named expressions."""
        return assignments(list(self.names.values()), list(self.names))
