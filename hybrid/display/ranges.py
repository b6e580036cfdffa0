"""Named numbers with their ranges in words."""

from __future__ import annotations

from collections.abc import Mapping

# Differences below this share of the size of a number are not shown.
SHOWN = 1e-3


def described(ranges: Mapping[str, tuple[float, float]], sizes: Mapping[str, float] | None = None) -> str:
    """Each name with its number, or with its range if the lowest and the highest value differ.

    ``sizes`` are those of such numbers elsewhere, besides which small ones count as zero.
    """
    found = []
    for name, (low, high) in ranges.items():
        size = max(abs(low), abs(high), (sizes or {}).get(name, 0.0))
        if max(abs(low), abs(high)) <= SHOWN * size:
            found.append(f"{name} 0")
        elif high - low <= SHOWN * size:
            found.append(f"{name} {(low + high) / 2:.4g}")
        else:
            found.append(f"{name} {low:.4g} to {high:.4g}")
    return ", ".join(found)
