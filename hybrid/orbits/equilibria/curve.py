"""Curves of solutions of ``N`` equations in ``N + 1`` unknowns: Newton's method, pseudo-arclength steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Protocol

import attrs
import numpy as np

from hybrid.orbits.equilibria.smooth import row_lengths
from hybrid.orbits.zeros import zero_on_the_way

# Corrections stop at this size, in units of the unknowns, and fail if they have not come to the second one.
SMALL, LOOSE = 1e-14, 1e-10
MOST_CORRECTIONS = 12
# A step may turn by this angle (its cosine).
LEAST_COSINE = 0.95
# Lengths of steps, in units of the unknowns and of the range of the parameter.
FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.01, 0.05, 1e-9
FEW_CORRECTIONS, LONGER = 4, 1.5
# A step that ends where the equations are this much nearer to singular than before it is taken longer.
CROSSED, OVER = 0.1, 1.5
# A state that is larger than the first one by this factor grows without bound.
UNBOUNDED = 2.0**26


class System(Protocol):
    """``N`` equations in ``N + 1`` unknowns."""

    def residual(self, u: np.ndarray) -> np.ndarray:
        """Values ``(N,)``."""
        ...

    def jacobian(self, u: np.ndarray) -> np.ndarray:
        """Derivatives ``(N, N + 1)``."""
        ...


@attrs.frozen(eq=False)
class Spot:
    """A point of a curve.

    Attributes
    ----------
    system
        The equations of the curve.
    u, units
        The unknowns ``(N + 1,)`` and their units.
    tangent
        The direction of the curve ``(N + 1,)``, of length 1, in these units.
    scales
        Units of the equations ``(N,)``: the largest that their rows have been along the curve. At a branch
        point a row may be zero.
    """

    system: System
    u: np.ndarray
    units: np.ndarray
    tangent: np.ndarray
    scales: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        """The derivatives in the unknowns, all in their units, and the tangent below."""
        return np.vstack([self.system.jacobian(self.u) * self.units / self.scales[:, None], self.tangent])

    def step(self, length: float) -> tuple[Spot, int] | None:
        """The point at a distance along the tangent, and how many corrections it took; or None."""
        made = corrected(self.system, self.u + length * self.units * self.tangent, self.units, self.tangent)
        if made is None:
            return None
        found = spot_at(self.system, made[0], self.units, self.tangent, self.scales)
        if found is None or found.tangent @ self.tangent < LEAST_COSINE:
            return None
        return found, made[1]

    def distance(self, other: Spot) -> float:
        """How far another point is along the tangent."""
        return float(self.tangent @ ((other.u - self.u) / self.units))


def corrected(
    system: System, guess: np.ndarray, units: np.ndarray, normal: np.ndarray
) -> tuple[np.ndarray, int] | None:
    """The solution near a guess in the plane across ``normal``, and how many corrections it took; or None."""
    u, before = guess, np.inf
    for count in range(1, MOST_CORRECTIONS + 1):
        rows, values = _rows(system, u, units)
        values = np.append(values, normal @ ((u - guess) / units))
        try:
            step = np.linalg.solve(np.vstack([rows, normal]), -values)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(step).max())
        if not np.isfinite(size):
            return None
        if size > 0.5 * before:
            # No nearer: rounding, or no solution.
            return (u, count) if before <= LOOSE else None
        u, before = u + units * step, size
        if size <= SMALL:
            return u, count
    return (u, count) if before <= LOOSE else None


def spot_at(
    system: System,
    u: np.ndarray,
    units: np.ndarray,
    onward: np.ndarray,
    scales: np.ndarray | None = None,
) -> Spot | None:
    """The point of a curve, with the tangent that is nearest to a direction; None if it has no derivative.

    The ``scales`` are those of a point before, if there is one.
    """
    rows = system.jacobian(u) * units
    lengths = row_lengths(rows) if scales is None else np.maximum(row_lengths(rows), scales)
    rows = rows / lengths[:, None]
    if not np.isfinite(rows).all():
        return None
    try:
        along = np.linalg.solve(np.vstack([rows, onward]), np.eye(len(u))[-1])
    except np.linalg.LinAlgError:
        along = np.full(len(u), np.inf)
    if not np.linalg.norm(along) * np.linalg.norm(onward) < 1.0 / LEAST_COSINE**8:
        # The direction has turned by much, or curves cross, where there are more directions.
        _, values, vectors = np.linalg.svd(rows)
        null = vectors[min(int(np.sum(values > LOOSE * values[0])), len(vectors) - 1) :]
        along = null.T @ (null @ onward)
    length = float(np.linalg.norm(along))
    return None if length == 0.0 else Spot(system, u, units, along / length, lengths)


def _rows(system: System, u: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The derivatives in the unknowns in their units, each row of length 1, and the values with them."""
    rows = system.jacobian(u) * units
    lengths = row_lengths(rows)
    return rows / lengths[:, None], system.residual(u) / lengths


def zero_between(spot: Spot, after: Spot, function: Callable[[Spot], float]) -> Spot | None:
    """The point between two where a function changes its sign; None if it is not found."""

    def step(length: float) -> Spot | None:
        made = spot.step(length)
        return None if made is None else made[0]

    found: Spot | None = zero_on_the_way({0.0: spot, spot.distance(after): after}, step, function)
    return found


def at_value(spot: Spot, place: int, value: float) -> Spot | None:
    """The point beside one at which an unknown has a value."""
    guess = spot.u.copy()
    guess[place] = value
    made = corrected(spot.system, guess, spot.units, np.eye(len(guess))[place])
    return None if made is None else spot_at(spot.system, made[0], spot.units, spot.tangent, spot.scales)


def walk(
    spot: Spot, lows: np.ndarray, highs: np.ndarray, most: int, renewed: Callable[[Spot], Spot]
) -> Iterator[Spot | str]:
    """Points along a curve until one of the last unknowns leaves its range; the last item is why it ends.

    Each step begins at the point before it as ``renewed`` gives it, in units that have grown with it.
    """
    length, start, sizes = FIRST_STEP, spot, np.abs(spot.u) + spot.units
    for number in range(most):
        made = spot.step(length)
        while made is None:
            length /= 2.0
            if length < SHORTEST_STEP:
                yield "lost"
                return
            made = spot.step(length)
        if _is_crossed(spot, made[0]):
            # So near to another branch that it may be on that one: the step goes over the place.
            made = spot.step(OVER * length) or made
        after, corrections = made
        values = after.u[-len(lows) :]
        if np.any(values < lows) or np.any(values > highs):
            last = _at_the_edge(spot, after, lows, highs)
            if last is not None:
                yield last
            yield "range"
            return
        if number > 1 and _passes(start, spot, after):
            yield start
            yield "closed"
            return
        yield after
        if np.any(np.abs(after.u) > UNBOUNDED * sizes):
            yield "infinity"
            return
        if corrections <= FEW_CORRECTIONS:
            length = min(LONGEST_STEP, LONGER * length)
        spot = renewed(after)
    yield "most"


def _is_crossed(spot: Spot, after: Spot) -> bool:
    """Whether a step ends near a place where another branch crosses."""
    one, other = (abs(float(np.linalg.det(each.matrix))) for each in (spot, after))
    return other < CROSSED * one


def _at_the_edge(spot: Spot, after: Spot, lows: np.ndarray, highs: np.ndarray) -> Spot | None:
    """The point between two at which the first of the last unknowns leaves its range."""
    found = []
    for i, (low, high) in enumerate(zip(lows, highs, strict=True), start=-len(lows)):
        if not low <= after.u[i] <= high:
            edge = low if after.u[i] < low else high
            last = zero_between(spot, after, partial(_over, i, edge))
            found.append(at_value(last or spot, i, edge))
    return min((each for each in found if each is not None), key=spot.distance, default=None)


def _over(i: int, edge: float, spot: Spot) -> float:
    return float(spot.u[i]) - edge


def _passes(start: Spot, spot: Spot, after: Spot) -> bool:
    """Whether a step passes the first point, in its direction."""
    reach, share = spot.distance(after), spot.distance(start)
    if not 0.0 < share <= reach or start.tangent @ spot.tangent < LEAST_COSINE:
        return False
    made = spot.step(share)
    return made is not None and bool(np.all(np.abs(made[0].u - start.u) <= LOOSE * start.units * 1e2))
