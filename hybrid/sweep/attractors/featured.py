"""Which attractor each start leads to, by features of its run."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from hybrid.display.progress import Progress
from hybrid.kernels.types import codes
from hybrid.status import StatusCode
from hybrid.sweep.attractors.attractor import BY_FEATURES, Attractor
from hybrid.sweep.attractors.features import Features
from hybrid.sweep.attractors.find import collected
from hybrid.sweep.attractors.groups import Linkage, Precision
from hybrid.sweep.attractors.runs import CODE, MODE, NONE, OWNER
from hybrid.sweep.attractors.search import Search
from hybrid.sweep.attractors.setup import Setup
from hybrid.sweep.attractors.stretches import features_in, measured_in_threads, pauses, settled


@attrs.frozen(eq=False)
class Cluster:
    """An attractor with the scatter of its features ``(F,)``, by which another run is told to lead to it."""

    attractor: Attractor
    scatter: np.ndarray

    def gap(self, values: np.ndarray) -> np.ndarray:
        """How far features ``(F,)`` are out of the range of the group."""
        low, high = np.array([*self.attractor.ranges.values()]).T
        return np.maximum(np.maximum(low - values, values - high), 0.0)


class FeatureSearch:
    """Takes the features of runs, and groups the runs by them.

    It has the methods of `Search`. Groups are known only when all runs have been taken, in ``judged``.
    """

    def __init__(self, setup: Setup, features: Features, threads: int) -> None:
        self.setup, self.features, self.threads = setup, features, threads
        self.found: list[Cluster] = []
        self.known = Precision(math.sqrt(setup.solver.rtol), math.sqrt(setup.solver.atol))

    def pilot(self, origins: np.ndarray) -> None:
        """Nothing: no attractor needs to be known before the others."""

    def decided(
        self, origins: np.ndarray, bar: Progress | None = None, found: np.ndarray | None = None
    ) -> np.ndarray:
        """Rows of starts without an attractor yet, with their features; they may be known already."""
        if found is not None:
            return found
        return measured_in_threads(self.setup, self.features, origins, self.threads, bar)

    def judged(self, origins: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """The rows with the attractor of each start, whose features are grouped here."""
        rows = rows.copy()
        there = np.flatnonzero(rows[:, CODE] == StatusCode.SUCCESS)
        values, changes = features_in(rows)
        owners = Linkage(values[there], changes[there], self.known, self.features.apart).grouped()
        groups = [there[owners == i] for i in range(int(owners.max(initial=-1)) + 1)]
        groups.sort(key=lambda members: self.known.rank(np.median(values[members], axis=0)))
        self.found = []
        for members in groups:
            middle = members[_middle(values[members], origins[members])]
            found = self._attractor(origins[middle], int(rows[middle, MODE]), values[middle], values[members])
            rows[members, OWNER] = len(self.found)
            self.found.append(Cluster(found, np.sqrt(np.mean(changes[members] ** 2, axis=0))))
        return rows

    def led_to(self, x0: np.ndarray) -> int:
        """Index of the attractor to which a start leads, which may be new; -1 for none."""
        rows = measured_in_threads(self.setup, self.features, x0[None], 1)
        if rows[0, CODE] != StatusCode.SUCCESS:
            return NONE
        [values], [changes] = features_in(rows)
        best, nearest = NONE, 1.0
        for i, group in enumerate(self.found):
            wide = self.features.apart
            if wide is None:
                wide = self.known.allowed(values, values, changes, group.scatter)
            # A feature that never differs has no width.
            far = float(np.max(group.gap(values) / np.maximum(wide, np.finfo(float).tiny)))
            if far <= nearest:
                best, nearest = i, far
        if best == NONE:
            best = len(self.found)
            new = self._attractor(x0, int(rows[0, MODE]), values, values[None])
            self.found.append(Cluster(new, changes))
        return best

    def distance(self, one: Cluster, other: Cluster) -> float:
        """How far apart two attractors are, in the sizes of their features."""
        values = np.array([[*each.attractor.features.values()] for each in (one, other)])
        sizes = np.maximum(np.abs(values).max(axis=0), np.finfo(float).tiny)
        return float(np.max(np.abs(values[0] - values[1]) / sizes))

    def ordered(self) -> tuple[tuple[Attractor, ...], np.ndarray]:
        """The attractors in the order of their labels, and the label of each as it was found ``(A,)``."""
        return tuple(each.attractor for each in self.found), np.append(np.arange(1, len(self.found) + 1), 0)

    def _attractor(self, x0: np.ndarray, mode: int, own: np.ndarray, values: np.ndarray) -> Attractor:
        """The attractor of a start with its features, and those of all its runs.

        It has no points if the search has been interrupted, since these take another run.
        """
        setup, names = self.setup, self.features.names
        points, length = settled(setup, x0, setup.marked.mode_names[mode])
        waits = pauses(setup)
        collected(points, len(waits) * length + sum(waits))
        jumps = points.trajectory.jumps
        states, places = collected(points, length)
        done = points.code == codes.DONE
        rate = (points.trajectory.jumps - jumps) / length - (1 if setup.markers else 0)
        if not done:
            states, places = states[:0], places[:0]
        unknown = np.full(setup.system.tangent_dimension, np.nan)
        ends = np.column_stack([values.min(axis=0), values.max(axis=0)])
        return Attractor(
            kind=BY_FEATURES,
            points=states,
            mode=np.array(points.trajectory.system.mode_names)[places[:, 0]],
            round=0,
            period=math.nan,
            jumps=rate if done else math.nan,
            exponents=unknown,
            standard_error=unknown,
            start=x0,
            features=dict(zip(names, own.tolist(), strict=True)),
            ranges=dict(zip(names, map(tuple, ends.tolist()), strict=True)),
        )


def _middle(values: np.ndarray, origins: np.ndarray) -> int:
    """The run whose features are nearest to the median, the one with the lowest start among equals."""
    extent = np.ptp(values, axis=0)
    away = np.abs(values - np.median(values, axis=0)) / np.where(extent > 0.0, extent, 1.0)
    return int(np.lexsort((*origins.T[::-1], away.max(axis=1)))[0])


def search_of(setup: Setup, threads: int) -> Any:
    """The search that a setup asks for, by points or by features."""
    if setup.features is None:
        return Search(setup, threads)
    return FeatureSearch(setup, setup.features, threads)
