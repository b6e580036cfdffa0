"""Attractors followed along a parameter: which goes on, which appears, which dies."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.sweep.attractors.find import Found
from hybrid.sweep.attractors.runs import MODE, OWNER, runs_of
from hybrid.sweep.attractors.search import Search
from hybrid.sweep.attractors.text import read


def followed(task: Any, values: np.ndarray, texts: list[str]) -> list[dict[str, Any] | None]:
    """What was found at each value, with the ``labels`` of the attractors; None for a value that failed.

    Labels count attractors in the order in which they appear.
    """
    results: list[dict[str, Any] | None] = []
    alive: dict[int, Found] = {}
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


def _heirs(search: Search, alive: dict[int, Found]) -> dict[int, int]:
    """For each attractor at this value to which one of the last value leads: the label of that one."""
    claims: dict[int, list[tuple[float, int]]] = {}
    for label, old in alive.items():
        owner = _led_to(search, old.attractor.points[0])
        if owner >= 0:
            claims.setdefault(owner, []).append((_distance(old, search.found[owner]), label))
    return {owner: min(each)[1] for owner, each in claims.items()}


def _led_to(search: Search, x0: np.ndarray) -> int:
    """Index of the attractor to which a start leads, which may be new; -1 for none."""
    runs = runs_of(search.setup)
    row = runs.settle(x0[None], search.known(), search.setup.periods)[0]
    if row[OWNER] < 0 and search.explore(x0, int(row[MODE])):
        row = runs.settle(x0[None], search.known(), search.setup.periods)[0]
    return int(row[OWNER])


def _distance(one: Found, other: Found) -> float:
    """Mean distance of the points of an attractor from those of another, in units of its radius."""
    tree = one.tree(other.attractor.points)
    return float(np.mean(tree.query(one.in_radii(one.attractor.points))[0]))
