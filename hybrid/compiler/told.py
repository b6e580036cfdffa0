"""What was found out about a model, in its own words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hybrid.compiler.propagators.equations import Boundary, known_positive
from hybrid.compiler.written import Written
from hybrid.expression.continuity import jumps_of, may_jump
from hybrid.expression.nodes import Expression
from hybrid.expression.signs import simplified
from hybrid.expression.text import text
from hybrid.expression.tracing import Symbols
from hybrid.system.derivatives import complex_step_error
from hybrid.system.functions import field_function

if TYPE_CHECKING:
    from hybrid.system.graph import HybridSystem

# A state or a parameter in an expression.
_INDEXED = re.compile(r"\b[xp]\[\d+\]")


def where_it_jumps(
    system: HybridSystem, index: int, field: Written, boundaries: Sequence[Boundary], symbols: Symbols
) -> str:
    """Where the field of a mode jumps in what moves or is held, in words; empty if it is proved not to."""
    if field.expressions is None:
        function = field_function(system.modes[index], system.variables)
        differentiable = function.derivative is None or complex_step_error(system.variables, function) is None
        return "it branches" if may_jump(function.value, differentiable) else ""
    known = known_positive(boundaries)
    states = symbols.x[: system.tangent_dimension]
    places = jumps_of([simplified(entry, known) for entry in field.expressions], states)
    return ", or ".join(in_names(system, place) for place in places)


def told(system: HybridSystem, expressions: Sequence[Expression]) -> str:
    """Expressions in the names of the model."""
    return ", ".join(in_names(system, text(each)) for each in expressions)


def in_names(system: HybridSystem, words: str) -> str:
    """Words about a model with the names of its states and parameters."""
    names = {f"x[{i}]": name for i, name in enumerate(system.state_names)}
    names |= {f"p[{i}]": name for i, name in enumerate(system.parameters)}
    return _INDEXED.sub(lambda match: names[match[0]], words)
