"""What a search has found as text, which stores keep, and back."""

from __future__ import annotations

import json
from typing import Any

import attrs
import numpy as np

from hybrid.sweep.attractors.attractor import Attractor
from hybrid.sweep.attractors.featured import Cluster
from hybrid.sweep.attractors.find import Found


def written(search: Any, counts: list[int], beyond: int, starts: int) -> str:
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


def _as_json(found: Found | Cluster) -> dict[str, Any]:
    own = {field.name: getattr(found, field.name) for field in attrs.fields(type(found))}
    own |= attrs.asdict(own.pop("attractor"))
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in own.items()}


def read(text: str) -> dict[str, Any]:
    """What was found at one value, with the attractors as objects."""
    given = json.loads(text)
    return {**given, "found": [_object_of(each) for each in given["found"]]}


def _object_of(given: dict[str, Any]) -> Found | Cluster:
    values: dict[str, Any] = {
        name: np.array(each) if isinstance(each, list) else each for name, each in given.items()
    }
    kind: type[Any] = Cluster if "scatter" in given else Found
    own = {field.name: values.pop(field.name, None) for field in attrs.fields(kind)}
    made: Found | Cluster = kind(**(own | {"attractor": Attractor(**values)}))
    return made
