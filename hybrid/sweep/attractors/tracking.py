"""Edge tracking: a trajectory on the boundary between two basins, between two runs that part."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.compiler.interrupts import CTRL_C
from hybrid.kernels.types import codes
from hybrid.sweep.attractors.destinations import UNDECIDED, Begin, Destinations
from hybrid.sweep.attractors.find import collected, extent_of
from hybrid.sweep.attractors.runs import Points
from hybrid.sweep.attractors.setup import Setup
from hybrid.system.periodicity import closed_change

# Widths of a pair of starts, as shares of the extent of what the runs visit: bisection ends at the first, and
# runs have parted at the second. Between them a pair may grow by a factor of 10 000 from point to point.
CLOSE, APART = 1e-9, 1e-5
# Points that a pair is followed for at once.
CHUNK = 32


@attrs.frozen(eq=False)
class TwoStarts:
    """Two starts in one mode, of which the first leads to the attractor ``near`` and the other does not."""

    one: np.ndarray
    other: np.ndarray
    mode: str | None


class Tracking:
    """Follows the boundary of the basin of an attractor.

    Each round takes a pair of starts on both sides of the boundary. Bisection brings them together. Their
    runs then follow the boundary until they have parted; where they were still together, the next round
    begins.

    Attributes
    ----------
    points, modes
        The edge trajectory so far: states in the middle between the runs, and names of their modes.
    far
        To what the far start of the pair leads.
    met
        Everything that starts on the far side have led to.
    """

    def __init__(self, destinations: Destinations, near: int, far: int, pair: TwoStarts) -> None:
        self.destinations, self.near, self.far, self.pair = destinations, near, far, pair
        self.setup: Setup = destinations.setup
        self.moving = self.setup.system.tangent_dimension
        self.met = {far}
        self.points = np.empty((0, len(pair.one)))
        self.modes: list[str] = []
        visited = [each.attractor.points for each in destinations.found]
        self.extent = extent_of(np.vstack([pair.one, pair.other, *visited]), self.setup)
        # Points for which the last pair stayed together, and whether that was none.
        self.together, self.lost = 0, False

    def width(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """How far states ``(..., n)`` are apart, as a share of the extent; counters do not count."""
        change = closed_change(other - one, self.setup.turns) / self.extent
        return np.asarray(np.abs(change[..., : self.moving]).max(axis=-1))

    def middle(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """The state half way between two ``(..., n)``, with the counters of the first."""
        half = 0.5 * closed_change(other - one, self.setup.turns)
        half[..., self.moving :] = 0.0
        return np.asarray(one + half)

    def bisect(self) -> None:
        """Bring the pair together, as far as starts between the two lead to an attractor in time."""
        while self.width(self.pair.one, self.pair.other) > CLOSE and not CTRL_C.is_set():
            pair = self.pair
            middle = self.middle(pair.one, pair.other)
            if np.array_equal(middle, pair.one) or np.array_equal(middle, pair.other):
                return
            side = self.destinations.of(Begin(middle, pair.mode))
            if side == UNDECIDED or CTRL_C.is_set():
                return
            if side == self.near:
                self.pair = attrs.evolve(pair, one=middle)
            else:
                self.pair, self.far = attrs.evolve(pair, other=middle), side
                self.met.add(side)

    def follow(self) -> bool:
        """Follow the pair until the runs have parted; whether they were together in one mode before."""
        pair, setup = self.pair, self.setup
        runs = [Points(setup, each, pair.mode) for each in (pair.one, pair.other)]
        names = np.array(runs[0].trajectory.system.mode_names)
        states, places = [np.empty((0, 2, len(pair.one)))], [np.empty((0, 2), dtype=np.int64)]
        count, parted = 0, False
        while not parted and count < setup.periods and not CTRL_C.is_set():
            found = [collected(run, CHUNK) for run in runs]
            least = min(len(each[0]) for each in found)
            states.append(np.stack([each[0][:least] for each in found], axis=1))
            places.append(np.stack([each[1][:least, 0] for each in found], axis=1))
            count += least
            apart = self.width(states[-1][:, 0], states[-1][:, 1]) > APART
            parted = bool(apart.any()) or any(run.code != codes.DONE for run in runs)
        return self._advanced(np.vstack(states), np.vstack(places), names)

    def _advanced(self, states: np.ndarray, places: np.ndarray, names: np.ndarray) -> bool:
        """Go on from the last of the points ``(N, 2, n)`` at which two runs were together in one mode."""
        one, other = states[:, 0], states[:, 1]
        near = self.width(one, other) <= APART
        # Numbers of what is under way belong to the place, like the mode.
        told = np.flatnonzero(self.setup.turns[self.moving :] == 0.0) + self.moving
        same = (places[:, 0] == places[:, 1]) & (one[:, told] == other[:, told]).all(axis=1)
        parted = np.flatnonzero(~near)
        end = parted[0] if parted.size else len(near)
        there = np.flatnonzero(same[:end])
        if not there.size:
            self.lost = True
            return False
        last = int(there[-1])
        self.together = last + 1
        shown = np.flatnonzero(same[: last + 1])
        self.points = np.vstack([self.points, self.middle(one[shown], other[shown])])
        self.modes += names[places[shown, 0]].tolist()
        self.pair = TwoStarts(one[last], other[last], str(names[places[last, 0]]))
        return True
