"""Which names the values of a function are computed from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hybrid.expression.pieces import Pieces
from hybrid.expression.values import values_of
from hybrid.system.graph import HybridSystem

TIME = "t"


class _Names:
    """Traced numbers as the names that they were computed from."""

    def number(self, value: Any) -> frozenset[str]:
        """A number reads nothing."""
        float(value)
        return frozenset()

    def combined(self, name: str, contents: tuple[frozenset[str], ...]) -> frozenset[str]:
        """The names of all arguments."""
        return frozenset().union(*contents)

    def looked_up(self, pieces: Pieces, content: frozenset[str], derived: int) -> frozenset[str]:
        """The names of the argument."""
        return content

    def expression(self, content: frozenset[str]) -> frozenset[str]:
        """The names."""
        return content


def names_read(system: HybridSystem, function: Callable[..., Any]) -> frozenset[str]:
    """The components, parameters and ``t`` from which the values of a function of ``(t, x, p)`` are computed.

    Raises
    ------
    TraceError
        If the function cannot be followed.
    """
    variables = system.variables
    x = tuple(frozenset((name,)) for name in variables.state_names)
    p = tuple(frozenset((name,)) for name in variables.parameter_names)
    found = values_of(
        function, variables.components, variables.parameter_names, _Names(), (frozenset((TIME,)), x, p)
    )
    return frozenset().union(*found)
