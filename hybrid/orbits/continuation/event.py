"""What is met between two places of a branch, and the kinds that there are."""

from __future__ import annotations

import attrs

from hybrid.orbits.continuation.change import Change
from hybrid.orbits.continuation.place import Place

# Kinds of bifurcations: smooth ones, and those where the sequence of transitions changes.
KINDS = (
    "fold",
    "flip",
    "torus",
    "Hopf",
    "branch point",
    "grazing",
    "corner",
    "border",
    "crossing-sliding",
    "grazing-sliding",
    "switching-sliding",
    "adding-sliding",
)


@attrs.frozen(eq=False)
class Event:
    """A bifurcation: its kind, the place itself, what is known of it, and the change of the route, if any."""

    kind: str
    place: Place
    message: str
    change: Change | None = None
