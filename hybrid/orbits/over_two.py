"""What curves over two parameters have in common, those of orbits and those of equilibria."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybrid.display.tables import counted
from hybrid.orbits.kinds import plural
from hybrid.status import Status


class SpecialPoint:
    """Where two things happen at once on a curve: their name, the two parameters, and what happens."""

    __slots__ = ()
    kind: str
    values: Mapping[str, float]
    message: str

    def __str__(self) -> str:
        where = ", ".join(f"{name} = {value:.10g}" for name, value in self.values.items())
        return f"{self.kind} at {where}: {self.message}"


class OverTwo:
    """A curve of a bifurcation, with the values ``(N, 2)`` of two parameters along it."""

    __slots__ = ()
    kind: str
    names: tuple[str, str]
    values: np.ndarray
    points: Sequence[SpecialPoint]
    status: Status

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        spans = ", ".join(
            f"{name} = {span.min():.6g} to {span.max():.6g}"
            for name, span in zip(self.names, self.values.T, strict=True)
        )
        special = ", ".join(each.kind for each in self.points) or "nothing special"
        kinds, count = plural(self.kind), counted(len(self), "point")
        return f"<Curve of {kinds}, {spans}, {count}, {special}, {self.status.brief}>"
