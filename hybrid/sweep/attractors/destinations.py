"""On which side of a basin boundary a start lies: to which attractor its run leads."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.sweep.attractors.find import Found
from hybrid.sweep.attractors.runs import CODE, MODE, OWNER, runs_of
from hybrid.sweep.attractors.search import Search
from hybrid.sweep.attractors.setup import Setup

# What a start leads to if it leads to no attractor: its run ends, or it is near none after all points.
ENDS, UNDECIDED = -1, -2


@attrs.frozen(eq=False)
class Begin:
    """A state with its mode; None if the guards are to choose the mode."""

    x: np.ndarray
    mode: str | None


class Destinations:
    """Tells to which attractor a start leads, with attractors found as they are needed."""

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.found: list[Found] = []
        self._searches: dict[str | None, Search] = {}

    def of(self, start: Begin) -> int:
        """The index of the attractor to which a start leads, or ENDS or UNDECIDED.

        Raises
        ------
        ArgumentError
            If the start violates its mode, or every mode.
        """
        search = self._search(start.mode)
        runs, x0 = runs_of(search.setup), start.x[None]
        row = runs.settle(x0, search.known(), self.setup.periods)[0]
        if row[OWNER] < 0 and row[CODE] == codes.MAX_STEPS and search.explore(start.x, int(row[MODE])):
            row = runs.settle(x0, search.known(), self.setup.periods)[0]
        if row[CODE] == codes.REFUSED:
            modes = "every mode" if start.mode is None else f"mode {start.mode!r}"
            raise ArgumentError(
                f"one, other: between the two, the state {start.x.tolist()} violates {modes}. Give starts "
                "that a line of allowed states joins."
            )
        if row[OWNER] >= 0:
            return int(row[OWNER])
        return UNDECIDED if row[CODE] == codes.MAX_STEPS else ENDS

    def _search(self, mode: str | None) -> Search:
        """The search for starts in a mode; all of them share what is found."""
        if mode not in self._searches:
            search = Search(attrs.evolve(self.setup, mode=mode), 1)
            search.found = self.found
            self._searches[mode] = search
        return self._searches[mode]
