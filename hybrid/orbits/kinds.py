"""What all branches can be asked: bifurcations by their kinds, and whether they are closed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from hybrid import arguments


def of_kinds(found: Sequence[Any], kinds: str | Iterable[str], allowed: Iterable[str]) -> tuple[Any, ...]:
    """Those of one kind or of several, in order.

    Raises
    ------
    ArgumentError
        If a kind is not among those ``allowed``.
    """
    wanted = "be a kind of bifurcation, or several of them"
    names = [kinds] if isinstance(kinds, str) else arguments.items("kinds", kinds, wanted, least=1)
    there, known = ", ".join(dict.fromkeys(each.kind for each in found)) or "none", [*allowed]
    for name in names:
        arguments.known("kinds: Kind", name, known, f"On this branch: {there}. Kinds")
    return tuple(each for each in found if each.kind in names)


def comes_back(parameter: np.ndarray, x: np.ndarray) -> bool:
    """Whether the last point of a branch is the first one, with values ``(N,)`` and states ``(N, n)``."""
    return len(x) > 1 and bool(parameter[0] == parameter[-1] and np.array_equal(x[0], x[-1]))
