"""What is met between two places of a branch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from hybrid.orbits.continuation.change import Change
from hybrid.orbits.continuation.place import Place
from hybrid.simulation.arc import HybridArc


@attrs.frozen(eq=False)
class Event:
    """A bifurcation: its kind, the place itself, what is known of it, and the change of the route, if any."""

    kind: str
    place: Place
    message: str
    change: Change | None = None


@attrs.frozen(eq=False)
class OfThisProcess:
    """A function of an arc whose zero is a bifurcation; None where the bifurcation was pickled.

    Functions of callers are often lambdas, which pickle refuses. A branch is pickled without them.
    """

    function: Callable[[HybridArc], float] | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return (OfThisProcess, ())
