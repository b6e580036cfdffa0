"""The point of a forced orbit at the time that it was asked for; the search was done at another time."""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np

from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.lap import Fired, Lap
from hybrid.orbits.newton import Point, Shot
from hybrid.orbits.orbit import PeriodicOrbit, first_start
from hybrid.system.periodicity import whole_turns


@attrs.frozen(eq=False)
class Asked:
    """The point of the guess, its mode, and the counters there."""

    point: Point
    mode: str
    counters: np.ndarray

    @property
    def t(self) -> float:
        """When an orbit that is found later passes the time of the guess: one period after it."""
        return self.point.t + self.point.period

    def is_at(self, t: float) -> bool:
        """Whether a time is the same but for rounding."""
        return abs(t - self.t) <= CLOSED * self.point.period

    def answered(self, orbit: PeriodicOrbit, lap: Lap, jumps: Sequence[Fired], shot: Shot) -> PeriodicOrbit:
        """The orbit from its point at the time that was asked for.

        If the orbit jumps there, the point is the state before the jumps or the state after them: whichever
        is nearer to the guess; a state in another mode than the guess is not near. If neither is a start, it
        is the state a moment later.
        """
        assert lap.orbit is not None
        times, route, n = lap.orbit.loop.times[:-1], lap.orbit.family.route, len(shot.end)
        nearest = times[np.argmin(np.abs(times - self.t))]
        here = np.flatnonzero(np.abs(times - nearest) <= CLOSED * orbit.period)
        first, last = int(here[0]), int(here[-1])
        lengths = orbit.system.turn_lengths[:n]
        turns = lengths * whole_turns(shot.end - shot.point.x, lengths)
        after = self._from(orbit, lap.orbit.loop.x[last] - turns, route[last].mode, jumps, first=False)
        after = attrs.evolve(after, fundamental=lap.fundamental(last))
        met = [jump.transition for jump in jumps if self.is_at(jump.t)]
        if not met:
            return after
        x, mode = lap.orbit.flows[first - 1].end - turns, route[first - 1].end_mode
        before = self._from(orbit, x, mode, jumps, first=True)
        before = attrs.evolve(before, fundamental=lap.fundamental(first, before=True))
        extent = np.where(shot.extent > 0.0, shot.extent, 1.0)
        apart = [
            (each.mode != self.mode, float(np.linalg.norm((each.x0[:n] - self.point.x) / extent)))
            for each in (before, after)
        ]
        points = [(before, met), (after, [])]
        rate, moment = lap.orbit.flows[last].first_rate, orbit.moment
        later = attrs.evolve(
            after, t0=after.t0 + moment, x0=after.x0 + moment * np.append(rate, 0.0 * self.counters)
        )
        return first_start([*(points if apart[0] < apart[1] else points[::-1]), (later, [])])

    def _from(
        self, orbit: PeriodicOrbit, x: np.ndarray, mode: str, jumps: Sequence[Fired], *, first: bool
    ) -> PeriodicOrbit:
        """The orbit from a state; the jumps there come ``first``, or last.

        Cyclic components have the values of the guess there.
        """
        x = np.where(orbit.system.is_cyclic[: len(x)], self.point.x, x)
        early = [jump for jump in jumps if jump.t > self.t and not self.is_at(jump.t)]
        here = [jump for jump in jumps if self.is_at(jump.t)]
        late = [jump for jump in jumps if jump.t < self.t and not self.is_at(jump.t)]
        order = [*here, *early, *late] if first else [*early, *late, *here]
        return attrs.evolve(
            orbit,
            x0=np.append(x, self.counters),
            mode=mode,
            t0=self.point.t,
            signature=(mode, *(jump.target for jump in order if jump.target is not None)),
            transitions=tuple(jump.transition for jump in order),
        )
