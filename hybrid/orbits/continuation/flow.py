"""One stretch of an orbit: where it leads, and what the jumps at its end do, with their derivatives."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.simulation.arc import HybridArc


@attrs.frozen(eq=False)
class Flow:
    """One stretch of an orbit.

    Attributes
    ----------
    arc
        The run of the extended system, whose last components are the parameters; None if it takes no time.
    end
        State ``(n,)`` at the end, before the jump.
    slopes
        Derivatives ``(n, n + k)`` of that in the start and the parameters, at fixed times.
    first_rate, last_rate
        The field ``(n,)`` at the two ends.
    counters
        Values of the counters at the end: jumps that accumulate within the stretch may have counted.
    """

    arc: HybridArc | None
    end: np.ndarray
    slopes: np.ndarray
    first_rate: np.ndarray
    last_rate: np.ndarray
    counters: tuple[float, ...] = ()

    @property
    def by_unknowns(self) -> np.ndarray:
        """Derivatives ``(n, n + 2 + k)`` of the end in the start, in both times and in the parameters."""
        n = len(self.end)
        found = np.empty((n, self.slopes.shape[1] + 2))
        found[:, :n], found[:, n + 2 :] = self.slopes[:, :n], self.slopes[:, n:]
        found[:, n] = -self.slopes[:, :n] @ self.first_rate
        found[:, n + 1] = self.last_rate
        return found

    def at(self, shares: np.ndarray) -> np.ndarray:
        """States ``(N, n)`` at shares ``(N,)`` of the time."""
        pieces = None if self.arc is None else self.arc._pieces
        if pieces is None or not len(pieces.t):
            return np.tile(self.end, (len(shares), 1))
        begin, end = pieces.t[0], pieces.t[-1] + pieces.h[-1]
        times = np.clip(begin + shares * (end - begin), begin, end)
        states = pieces.at(times)[0][:, : len(self.end)]
        states[shares >= 1.0] = self.end
        return states


@attrs.frozen(eq=False)
class Landing:
    """What the jumps at the end of a stretch do.

    Attributes
    ----------
    after
        State ``(n,)`` after them.
    slopes
        Derivatives ``(n, n + k + 1)`` of that in the state before, the parameters and the time.
    height, gradient
        The guard of the first of them, and its derivatives ``(n + k + 1,)`` in the same. The first sets off
        all others.
    """

    after: np.ndarray
    slopes: np.ndarray
    height: float
    gradient: np.ndarray
