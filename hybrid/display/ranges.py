"""Named numbers with their ranges in words."""

from __future__ import annotations

import math
from collections.abc import Mapping


def described(ranges: Mapping[str, tuple[float, float]]) -> str:
    """Each name with its number, or with its range if the lowest and the highest value differ."""
    found = []
    for name, (low, high) in ranges.items():
        same = math.isclose(low, high, rel_tol=1e-3, abs_tol=1e-12)
        found.append(f"{name} {(low + high) / 2:.4g}" if same else f"{name} {low:.4g} to {high:.4g}")
    return ", ".join(found)
