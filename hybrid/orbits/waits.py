"""What delays have under way along an orbit: as many at its end as at its start, or it does not close."""

from __future__ import annotations

from typing import TYPE_CHECKING

import attrs
import numpy as np

from hybrid.orbits.newton import Point
from hybrid.simulation.arc import HybridArc
from hybrid.system.graph import HybridSystem

if TYPE_CHECKING:
    from hybrid.orbits.shooting import Shooting


def waits_change(system: HybridSystem, arc: HybridArc) -> bool:
    """Whether more, or fewer, are under way at the end of an arc than at its start."""
    counts = [i for i, name in enumerate(system.state_names) if name in system.under_way]
    counts = [i for i in counts if i >= system.tangent_dimension]
    return bool(np.any(arc.x[0, counts] != arc.x[-1, counts]))


def settled(shooting: Shooting, guess: Point) -> tuple[Shooting, Point]:
    """The search from a point, periods after the guess, from which as many are under way one period later.

    A guess that says nothing of delays has nothing under way. It stays the guess if no such point comes.
    """
    system, found, point = shooting.system, shooting, guess
    for _ in system.under_way:
        arc = found.follow(point, point.period, found.mode)
        if not arc.status.ok:
            break
        if not waits_change(system, arc):
            return found, point
        state, counters = np.split(arc.x[-1], [system.tangent_dimension])
        found = attrs.evolve(found, mode=str(arc.mode[-1]), counters=counters)
        point = attrs.evolve(point, x=state)
    return shooting, guess
