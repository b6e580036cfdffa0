"""Groups of runs whose features lie together.

Runs are joined one after another, the nearest first (single linkage). A run says itself how far apart the
features of one attractor may be: they are taken of several stretches, all of which belong to one attractor.
So two groups are one attractor if the gap between them is no wider than twice the root mean square of that
change within one of them. On a periodic orbit the change is an error of rounding, and on a chaotic attractor
it is the scatter of the features, so each group brings its own scale.
"""

from __future__ import annotations

import math

import attrs
import numpy as np

# A gap within a group may be as many times as wide as its scatter. With one, groups of a few chaotic runs
# would fall apart: the farthest of ten normal numbers is often more than one deviation from the others.
WIDTHS = 2.0
# Digits of a feature that count for the order of the labels.
DIGITS = 5


@attrs.frozen
class Precision:
    """To what share of itself, and to what size, a feature is known."""

    share: float
    size: float

    def allowed(
        self, one: np.ndarray, other: np.ndarray, scatter: np.ndarray, other_scatter: np.ndarray
    ) -> np.ndarray:
        """How far apart two features ``(F,)`` of one attractor may be, by the scatter of each."""
        rounding = np.maximum(self.share * np.maximum(np.abs(one), np.abs(other)), self.size)
        return np.maximum(WIDTHS * np.maximum(scatter, other_scatter), rounding)

    def rank(self, values: np.ndarray) -> tuple[float, ...]:
        """Features ``(F,)`` to as many digits as count for an order."""
        return tuple(0.0 if abs(each) < self.size else float(f"{each:.{DIGITS - 1}e}") for each in values)


@attrs.frozen(eq=False)
class Linkage:
    """What decides whether two runs are together.

    Attributes
    ----------
    values, scatter
        Features of the runs ``(N, F)``, and how far they differ from stretch to stretch.
    known
        How well features are known.
    apart
        Distances ``(F,)`` that decide in place of the scatter; None if there are none.
    """

    values: np.ndarray
    scatter: np.ndarray
    known: Precision
    apart: np.ndarray | None

    def grouped(self) -> np.ndarray:
        """The group of each run ``(N,)``, counted from 0; the order of the runs has no influence on it."""
        count = len(self.values)
        if not count:
            return np.zeros(0, dtype=np.int64)
        order = np.lexsort(self.values.T[::-1])
        edges = _tree(self.values[order] / self._units())
        groups = _Groups(self.scatter[order])
        left, before = edges, len(edges) + 1
        # A group that has grown may have a wider scatter, so gaps that were too wide are looked at again.
        while before > len(left):
            before = len(left)
            left = [edge for edge in left if not self._joined(groups, order, *edge)]
        found = np.empty(count, dtype=np.int64)
        found[order] = groups.numbers()
        return found

    def _units(self) -> np.ndarray:
        """What distances in each feature ``(F,)`` are measured in, to tell which runs are near."""
        if self.apart is not None:
            return self.apart
        extent = np.ptp(self.values, axis=0)
        return np.where(extent > 0.0, extent, 1.0)

    def _joined(self, groups: _Groups, order: np.ndarray, i: int, j: int) -> bool:
        """Join the groups of two runs if the gap is narrow enough; whether it was."""
        one, other = self.values[order[i]], self.values[order[j]]
        wide = self.known.allowed(one, other, groups.scatter(i), groups.scatter(j))
        if np.any(np.abs(one - other) > (wide if self.apart is None else self.apart)):
            return False
        groups.join(i, j)
        return True


class _Groups:
    """Groups of runs that are joined, with the mean squares of their scatter."""

    def __init__(self, scatter: np.ndarray) -> None:
        self.leader = list(range(len(scatter)))
        self.squares, self.sizes = scatter**2, np.ones(len(scatter))

    def of(self, i: int) -> int:
        """The run that stands for the group of a run."""
        while self.leader[i] != i:
            self.leader[i] = self.leader[self.leader[i]]
            i = self.leader[i]
        return i

    def scatter(self, i: int) -> np.ndarray:
        """Root mean square of the scatter in the group of a run ``(F,)``."""
        leader = self.of(i)
        return np.asarray(np.sqrt(self.squares[leader] / self.sizes[leader]))

    def join(self, i: int, j: int) -> None:
        """Make one group of two."""
        one, other = sorted((self.of(i), self.of(j)))
        self.leader[other] = one
        self.squares[one] += self.squares[other]
        self.sizes[one] += self.sizes[other]

    def numbers(self) -> np.ndarray:
        """The number of the group of each run ``(N,)``."""
        leaders = [self.of(i) for i in range(len(self.leader))]
        return np.unique(leaders, return_inverse=True)[1].astype(np.int64)


def _tree(points: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of points ``(N, F)`` of a minimum spanning tree, the nearest first, by Prim's algorithm.

    Two points are as far apart as the feature in which they differ most.
    """
    count = len(points)
    near, parent = np.full(count, math.inf), np.zeros(count, dtype=np.int64)
    left = np.ones(count, dtype=bool)
    now, pairs, lengths = 0, [], []
    for _ in range(count - 1):
        left[now] = False
        far = np.abs(points - points[now]).max(axis=1)
        closer = left & (far < near)
        near[closer], parent[closer] = far[closer], now
        now = int(np.argmin(np.where(left, near, math.inf)))
        pairs.append((int(parent[now]), now))
        lengths.append(near[now])
    return [pairs[i] for i in np.argsort(lengths, kind="stable")]
