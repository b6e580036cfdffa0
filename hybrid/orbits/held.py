"""Conserved quantities that the search for an orbit holds at their values at the guess.

A conserved quantity makes a family of orbits, one per value: the end of a period says nothing of the value.
Its gradient borders Newton's matrix, which is regular then, and one orbit of the family is left.
"""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.newton import Departure, Shot
from hybrid.system.derivatives import evaluate
from hybrid.system.graph import HybridSystem, laws_of
from hybrid.system.laws import Law

# Step of the central differences for gradients, as a share of the state: their two errors are equal there.
STEP = float(np.finfo(float).eps) ** (1 / 3)


@attrs.frozen(eq=False)
class Held:
    """Conserved quantities of the mode that an orbit begins in, with the values that they are held at."""

    system: HybridSystem
    parameters: np.ndarray
    laws: tuple[Law, ...]
    values: np.ndarray
    counters: np.ndarray

    def departure(self, t: float, x: np.ndarray, magnitude: np.ndarray) -> Departure | None:
        """How far a point is from the held values; None if a quantity has no value or slope there."""
        here, slopes = self._at(t, x), self._slopes(t, x, magnitude)
        if not (np.all(np.isfinite(here)) and np.all(np.isfinite(slopes))):
            return None
        return Departure(here - self.values, slopes)

    @property
    def told(self) -> str:
        """What is held, in words."""
        pairs = zip(self.laws, self.values, strict=True)
        return f"Held as at the guess: {', '.join(f'{law.name} = {value:.9g}' for law, value in pairs)}."

    def kept(self, shot: Shot, share: float) -> Held | None:
        """Those of the quantities that the map over the period keeps to first order; None if it keeps none.

        A quantity of one mode may change in another one, or at a jump. ``share`` is the accuracy of the map.
        """
        start, magnitude = shot.point, shot.magnitude
        before = self._slopes(start.t, start.x, magnitude)
        after = self._slopes(start.t + start.period, shot.end, magnitude)
        with np.errstate(invalid="ignore", over="ignore"):
            apart = np.abs(after @ shot.fundamental - before) @ magnitude
            terms = (np.abs(after) @ np.abs(shot.fundamental) + np.abs(before)) @ magnitude
            same = (apart <= share * terms) & (terms > 0.0) & np.isfinite(self.values)
        laws = tuple(law for law, stays in zip(self.laws, same, strict=True) if stays)
        return attrs.evolve(self, laws=laws, values=self.values[same]) if laws else None

    def _at(self, t: float, x: np.ndarray) -> np.ndarray:
        found = [
            evaluate(
                self.system.variables,
                law.function,
                t,
                np.append(x, self.counters),
                self.parameters,
                finite=False,
            )
            for law in self.laws
        ]
        return np.array([np.nan if each is None else each[0] for each in found])

    def _slopes(self, t: float, x: np.ndarray, magnitude: np.ndarray) -> np.ndarray:
        """Gradients ``(h, n)`` by central differences: they lead Newton's method, whose zero is exact."""
        steps = STEP * np.where(magnitude > 0.0, magnitude, 1.0)
        columns = [(self._at(t, x + h) - self._at(t, x - h)) / (2.0 * h.sum()) for h in np.diag(steps)]
        return np.stack(columns, axis=-1)


def held_by(
    system: HybridSystem, parameters: np.ndarray, shot: Shot, share: float, counters: np.ndarray
) -> Held | None:
    """The conserved quantities of a system, at their values at the start of a shot; None if it has none."""
    if not system.laws.conserved or not shot.whole:
        return None
    mode = system.modes[system.mode_index(shot.mode)]
    laws = tuple(law for law in laws_of(system).conserved if law.holds_in(mode.name, mode.part_of))
    if not laws:
        return None
    found = Held(system, parameters, laws, np.zeros(len(laws)), counters)
    return attrs.evolve(found, values=found._at(shot.point.t, shot.point.x)).kept(shot, share)
