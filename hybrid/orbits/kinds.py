"""The kinds of bifurcations, one row each, and how branches are asked for them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid import arguments


@attrs.frozen
class Kind:
    """What there is to know of a kind of bifurcation before one is found.

    Attributes
    ----------
    name
        As ``bifurcation.kind`` says it.
    marker
        In pictures, by the names of matplotlib.
    plural
        Of a curve of them; by default the name with an s.
    of_orbits, of_equilibria
        Whether branches of these may have it.
    passes
        How many passes of the orbit make one of the branch that begins or crosses there; 0 if none does.
    leads_on
        Whether :func:`hybrid.continue_all` follows another branch from there. At the others the branch goes
        on by itself.
    lost
        Why two parameters do not keep it, in words; empty if it has a curve over two parameters.
    """

    name: str
    marker: str
    plural: str = attrs.Factory(lambda self: f"{self.name}s", takes_self=True)
    of_orbits: bool = True
    of_equilibria: bool = False
    passes: int = 0
    leads_on: bool = False
    lost: str = ""


CROSSING = "a branch point, which goes away when another parameter changes"
# Smooth ones, and those where the sequence of transitions changes; a boundary is where an equilibrium reaches
# a guard.
KINDS = {
    each.name: each
    for each in (
        Kind("fold", "o", of_equilibria=True),
        Kind("flip", "s", passes=2, leads_on=True),
        Kind("torus", "D", "tori"),
        Kind("Hopf", "*", "Hopf points", of_equilibria=True, leads_on=True),
        Kind("branch point", "P", of_equilibria=True, passes=1, leads_on=True, lost=CROSSING),
        Kind("boundary", "8", "boundaries", of_orbits=False, of_equilibria=True, leads_on=True),
        Kind("grazing", "v"),
        Kind("corner", "<"),
        Kind("border", ">"),
        Kind("crossing-sliding", "^"),
        Kind("grazing-sliding", "p"),
        Kind("switching-sliding", "h"),
        Kind("adding-sliding", "d"),
    )
}
OF_ORBITS = tuple(each.name for each in KINDS.values() if each.of_orbits)
OF_EQUILIBRIA = tuple(each.name for each in KINDS.values() if each.of_equilibria)


def plural(kind: str) -> str:
    """The name of several bifurcations of a kind, or of several zeros of a caller's function."""
    return KINDS[kind].plural if kind in KINDS else f"{kind}s"


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
