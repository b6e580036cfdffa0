"""Whether the order of impacts that happen at once would change what they lead to."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np

from hybrid.transform.contacts.problem import NOISE
from hybrid.transform.contacts.solutions import SEVERAL, consistent
from hybrid.transform.contacts.statuses import OPEN, closed_statuses
from hybrid.transform.contacts.view import Mechanics, View

# Impacts in a sequence; one that has not ended by then has come close to its limit.
MOST_IMPACTS = 500


def order_matters(mechanics: Mechanics, view: View, contacts: Sequence[int]) -> bool:
    """Whether impacts of single contacts, one after another, depend on which is first."""
    rows = [mechanics.places[i][0] for i in contacts]
    if sum(view.speeds[row] < -NOISE * view.fast[row] for row in rows) < 2:
        return False
    ends = [_after(mechanics, view, order) for order in (contacts, [*reversed(contacts)])]
    return bool((np.abs(ends[0] - ends[1]) > SEVERAL * np.array(view.fast, dtype=float)).any())


def _after(mechanics: Mechanics, view: View, order: Sequence[int]) -> np.ndarray:
    """The speeds after impacts of single contacts; of those that approach the first in the order is next."""
    speeds = np.array(view.speeds, dtype=float)
    for _ in range(MOST_IMPACTS):
        approaching = [
            i for i in order if speeds[mechanics.places[i][0]] < -NOISE * view.fast[mechanics.places[i][0]]
        ]
        if not approaching:
            break
        i = approaching[0]
        rows = mechanics.rows_of([i])
        level = mechanics.impacts(attrs.evolve(view, speeds=[*speeds]), [i], [view.restitution[i]])
        found = consistent(level, [(OPEN, *closed_statuses(mechanics.contacts[i].contact))], [0])
        if not found:
            break
        speeds += np.array([view.delassus[k] for k in rows], dtype=float).T @ found[0].outcome.forces
    return speeds
