"""Which attractor each start leads to, with attractors found as they are needed."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.progress import Progress
from hybrid.kernels.types import attractors as kernel_types
from hybrid.kernels.types import codes
from hybrid.status import StatusCode
from hybrid.sweep.attractors.attractor import KINDS, Attractor
from hybrid.sweep.attractors.find import MOST_POINTS, Found, extended, find
from hybrid.sweep.attractors.runs import CODE, MODE, NONE, OWNER, runs_of
from hybrid.sweep.attractors.setup import Setup

# Starts that are run first, to find attractors before the others run, and points that they may take at first:
# a start that leads to an attractor which is not known yet wastes these points.
PILOTS, FIRST_POINTS = 64, 128
# Starts in succession that lead to nothing new before the search for attractors ends.
PATIENCE = 16


class Search:
    """Finds attractors, and decides which starts lead to them.

    A start is decided by its own run and the points of an attractor. Starts are tried in the order of their
    coordinates, whatever the order in which they are given, so neither that order nor the number of threads
    has any influence.
    """

    def __init__(self, setup: Setup, threads: int) -> None:
        self.setup, self.threads = setup, threads
        self.found: list[Found] = []

    def pilot(self, origins: np.ndarray) -> None:
        """Find attractors from a few of the starts."""
        order = np.lexsort(origins.T[::-1])
        self._decide(origins, order[:: max(1, len(order) // PILOTS)], None)

    def decided(
        self, origins: np.ndarray, bar: Progress | None = None, found: np.ndarray | None = None
    ) -> np.ndarray:
        """What is found of each start, rows ``(N, 4)`` as those of ``Runs``; some may be known already."""
        order = np.lexsort(origins.T[::-1])
        if found is None:
            return self._decide(origins, order, bar)
        left = order[_undecided(found)[order]]
        if len(left):
            found[left] = self._decide(origins, left, bar)[left]
        return found

    def _decide(self, origins: np.ndarray, left: np.ndarray, bar: Progress | None) -> np.ndarray:
        found = np.zeros((len(origins), 4), dtype=np.int64)
        found[:, OWNER], found[:, CODE] = NONE, StatusCode.NOT_RUN
        most, vain, skipped, tried = self.setup.periods, 0, 0, bool(self.found)
        limit = min(FIRST_POINTS, most)
        with CTRL_C.ending():
            while len(left) and not CTRL_C.is_set():
                # Nothing can be decided before an attractor is known.
                points = limit if tried else 0
                found[left] = runs_of(self.setup).settle(
                    origins[left], self.known(), points, self.threads, bar
                )
                # The bar counts each start once.
                bar = None
                left = left[_undecided(found)[left]]
                grown, tried = False, True
                while not grown and skipped < len(left) and vain < PATIENCE and not CTRL_C.is_set():
                    seed = left[skipped]
                    grown = self.explore(origins[seed], int(found[seed, MODE]))
                    if not grown and limit < most:
                        break
                    vain = 0 if grown else vain + 1
                    skipped += 0 if grown else 1
                if not grown:
                    if limit == most:
                        break
                    limit, vain = min(2 * limit, most), 0
        return found

    def judged(self, origins: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """The rows with the attractor of each start: they have it."""
        return rows

    def led_to(self, x0: np.ndarray) -> int:
        """Index of the attractor to which a start leads, which may be new; -1 for none."""
        runs = runs_of(self.setup)
        row = runs.settle(x0[None], self.known(), self.setup.periods)[0]
        if row[OWNER] < 0 and self.explore(x0, int(row[MODE])):
            row = runs.settle(x0[None], self.known(), self.setup.periods)[0]
        return int(row[OWNER])

    def distance(self, one: Found, other: Found) -> float:
        """Mean distance of the points of an attractor from those of another, in units of its radius."""
        tree = one.tree(other.attractor.points)
        return float(np.mean(tree.query(one.in_radii(one.attractor.points))[0]))

    def explore(self, x0: np.ndarray, mode: int) -> bool:
        """Whether the run from a start adds to what is known of the attractors."""
        setup = self.setup
        if self.found:
            [row] = runs_of(setup).settle(x0[None], self.known(), setup.periods)
            if row[OWNER] != NONE or row[CODE] != codes.MAX_STEPS:
                return False
        new = find(setup, x0, setup.marked.mode_names[mode])
        if new is None:
            return False
        points, modes = new.attractor.points, new.attractor.mode
        for i, old in enumerate(self.found):
            same_kind = bool(old.attractor.round) == bool(new.attractor.round)
            if same_kind and np.median(old.distances(points, modes)) <= 1.0:
                # The run took longer than it may. More points of a sample may shorten the next one.
                if old.attractor.round or len(old.attractor.points) >= MOST_POINTS:
                    return False
                self.found[i] = extended(old, points, modes)
                return True
        self.found.append(new)
        return True

    def known(self) -> Any:
        """The points of all attractors as the kernels see them."""
        return known_of(self.setup, self.found)

    def ordered(self) -> tuple[tuple[Attractor, ...], np.ndarray]:
        """The attractors in the order of their labels, and the label of each as it was found ``(A,)``."""
        order = sorted(range(len(self.found)), key=lambda i: _rank(self.found[i]))
        labels = np.zeros(len(order) + 1, dtype=np.int64)
        labels[order] = np.arange(1, len(order) + 1)
        return tuple(_begun_lowest(self.found[i]) for i in order), labels


def _undecided(found: np.ndarray) -> np.ndarray:
    return (found[:, OWNER] == NONE) & (found[:, CODE] == codes.MAX_STEPS)


def known_of(setup: Setup, found: list[Found]) -> Any:
    """The points of attractors as the kernels see them, sorted along the component that tells them apart."""
    n, names = setup.system.dimension, setup.marked.mode_names
    if not found:
        empty, none = np.empty((0, n)), np.empty(0, dtype=np.int64)
        turns = np.zeros(n)
        return kernel_types.Known(
            points=empty, owner=none, mode=none, radius=empty, turns=turns, axis=0, widest=0.0
        )
    points = np.vstack([each.attractor.points for each in found])
    owner = np.repeat(np.arange(len(found)), [len(each.attractor.points) for each in found])
    index = {name: i for i, name in enumerate(names)}
    mode = np.array([index[name] for each in found for name in each.attractor.mode.tolist()], dtype=np.int64)
    radius = np.array([each.radius for each in found])
    # Points are not in order along a circle: if all components are angles, every point is looked at.
    turns = setup.turns
    spread = np.where(turns > 0.0, -1.0, np.ptp(points, axis=0) / radius.max(axis=0))
    axis = int(np.argmax(spread))
    order = np.argsort(points[:, axis], kind="stable")
    return kernel_types.Known(
        points=np.ascontiguousarray(points[order]),
        owner=owner[order],
        mode=mode[order],
        radius=radius,
        turns=np.array(turns),
        axis=axis,
        widest=math.inf if turns[axis] > 0.0 else float(radius[:, axis].max()),
    )


def _cells(found: Found) -> np.ndarray:
    """The points in units of the radius, as whole numbers: rounding does not decide which is the lowest."""
    points = found.attractor.points
    if not found.attractor.round:
        points = points.mean(axis=0)[None]
    return np.rint(points / found.radius)


def _rank(found: Found) -> tuple[Any, ...]:
    """What the order of the labels goes by."""
    attractor = found.attractor
    kind = KINDS.index(attractor.kind) if attractor.kind in KINDS else len(KINDS)
    lowest = min(map(tuple, _cells(found).tolist()))
    # That of a cyclic component is infinite, and its place is 0.
    size = np.where(np.isfinite(found.radius), found.radius, 0.0).tolist()
    return kind, attractor.round, *(place * unit for place, unit in zip(lowest, size, strict=True))


def _begun_lowest(found: Found) -> Attractor:
    """The attractor with the round of a periodic orbit begun at its lowest point."""
    attractor = found.attractor
    if not attractor.round:
        return attractor
    cells = _cells(found)
    first = min(range(len(cells)), key=lambda i: tuple(cells[i].tolist()))
    turned = {name: np.roll(getattr(attractor, name), -first, axis=0) for name in ("points", "mode")}
    return attrs.evolve(attractor, **turned)
