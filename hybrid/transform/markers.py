"""A system with a transition in every mode that marks the crossings of a surface and changes nothing."""

from __future__ import annotations

import attrs

from hybrid.system.elements import Guard, Transition
from hybrid.system.graph import HybridSystem
from hybrid.system.portable import made_by

MARKER = "section"


def with_section(system: HybridSystem, section: Guard) -> HybridSystem:
    """The system with a marker transition in every mode, in the order of the modes.

    The markers come first: where an event lies on the section, the point before the event counts.
    """
    markers = [Transition(name, name, section, name=f"{MARKER} in {name}") for name in system.mode_names]
    marked = attrs.evolve(system, transitions=(*markers, *system.transitions))
    return made_by(marked, with_section, system, section)
