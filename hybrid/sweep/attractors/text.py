"""What a search has found as text, which stores keep, and back."""

from __future__ import annotations

import json
from typing import Any

import attrs
import numpy as np

from hybrid.sweep.attractors.attractor import Attractor
from hybrid.sweep.attractors.find import Found
from hybrid.sweep.attractors.search import Search


def written(search: Search, counts: list[int], beyond: int, starts: int) -> str:
    """What was found at one value as text; the order of attractors is that of their labels."""
    _, labels = search.ordered()
    order = sorted(range(len(search.found)), key=lambda i: int(labels[i]))
    return json.dumps(
        {
            "starts": starts,
            "beyond": beyond,
            "counts": [counts[i] for i in order],
            "found": [_as_json(search.found[i]) for i in order],
        }
    )


def _as_json(found: Found) -> dict[str, Any]:
    fields = attrs.asdict(found.attractor)
    return {
        "radius": found.radius.tolist(),
        "turns": found.turns.tolist(),
        **{
            name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in fields.items()
        },
    }


def read(text: str) -> dict[str, Any]:
    """What was found at one value, with the attractors as objects."""
    given = json.loads(text)
    found = []
    for each in given["found"]:
        radius, turns = (np.array(each.pop(name)) for name in ("radius", "turns"))
        arrays: dict[str, Any] = {
            name: np.array(value) if isinstance(value, list) else value for name, value in each.items()
        }
        found.append(Found(Attractor(**arrays), radius, turns))
    return {**given, "found": found}
