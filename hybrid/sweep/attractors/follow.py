"""Attractors followed along a parameter: which goes on, which appears, which dies."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.sweep.attractors.text import read


def followed(task: Any, values: np.ndarray, texts: list[str]) -> list[dict[str, Any] | None]:
    """What was found at each value, with the ``labels`` of the attractors; None for a value that failed.

    Labels count attractors in the order in which they appear.
    """
    results: list[dict[str, Any] | None] = []
    alive: dict[int, Any] = {}
    count = 0
    for value, text in zip(values.tolist(), texts, strict=True):
        if not text:
            results.append(None)
            continue
        found = read(text)
        search = task.search({task.name: value})
        search.found = found["found"]
        heirs = _heirs(search, alive)
        found["counts"] += [0] * (len(search.found) - len(found["counts"]))
        labels = []
        for i in range(len(search.found)):
            if i not in heirs:
                count += 1
            labels.append(heirs.get(i, count))
        found["labels"] = labels
        alive = dict(zip(labels, search.found, strict=True))
        results.append(found)
    return results


def _heirs(search: Any, alive: dict[int, Any]) -> dict[int, int]:
    """For each attractor at this value to which one of the last value leads: the label of that one."""
    claims: dict[int, list[tuple[float, int]]] = {}
    for label, old in alive.items():
        # An interrupted search by features has no points.
        owner = search.led_to([*old.attractor.points, old.attractor.start][0])
        if owner >= 0:
            claims.setdefault(owner, []).append((search.distance(old, search.found[owner]), label))
    return {owner: min(each)[1] for owner, each in claims.items()}
