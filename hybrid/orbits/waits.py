"""What delays have under way along an orbit: as many at its end as at its start, or it does not close."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.arc import HybridArc
from hybrid.system.graph import HybridSystem


def waits_change(system: HybridSystem, arc: HybridArc) -> bool:
    """Whether more, or fewer, are under way at the end of an arc than at its start."""
    counts = [i for i, name in enumerate(system.state_names) if name in system.under_way]
    counts = [i for i in counts if i >= system.tangent_dimension]
    return bool(np.any(arc.x[0, counts] != arc.x[-1, counts]))
