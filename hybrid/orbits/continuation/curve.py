"""Curves of bifurcations in two parameters: where a test function is zero on the surface of orbits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations

import attrs
import numpy as np

from hybrid.orbits.continuation.instants import passes_by
from hybrid.orbits.continuation.place import Place
from hybrid.orbits.continuation.real import is_real
from hybrid.orbits.continuation.smooth import changes, flip, singular, torus
from hybrid.orbits.zeros import zero_on_the_way

Test = Callable[[Place], float]

# Lengths of steps along a curve, in units of the sizes of the orbit and of the ranges of the parameters.
FIRST_STEP = 0.01
LONGEST_STEP = 0.05
SHORTEST_STEP = 1e-6
LONGER = 1.5
# A step may turn by this angle (its cosine).
LEAST_COSINE = 0.9
# The slope of the test function is a difference over this distance.
APART = 1e-4
# A correction this small is the last: what it leaves is its product with the one before, which is rounding.
SMALL = 1e-8
MOST_CORRECTIONS = 8
# What is beside a touch is asked for at this distance from it.
BESIDE = 1e-3
# The parameters stand still at a cusp, to this share of their speed nearby.
STANDS = 1e-3

SMOOTH: dict[str, Test] = {"fold": singular, "flip": flip, "torus": torus}
# A second multiplier like that of the bifurcation: what is added to it, and the kind.
DOUBLE = {"fold": (-1.0, "1:1 resonance"), "flip": (1.0, "1:2 resonance")}
# An orbit that is larger than the first one by this factor grows without bound.
UNBOUNDED = 2.0**26
# Sums of a pair on the unit circle where a torus is resonant; where it is strongly so, the pair becomes real.
RESONANCES = {"1:4 resonance": 0.0, "1:3 resonance": -1.0}
STRONG = {"1:1 resonance": 2.0, "1:2 resonance": -2.0}

# The multiplier of a kind, and how near one is to it.
AT = {"fold": 1.0, "flip": -1.0}
MEETS = 1e-3


@attrs.frozen(eq=False)
class Spot:
    """A place on the curve.

    Attributes
    ----------
    place
        The orbit, with two tangents to the surface of orbits.
    slope
        Derivatives ``(2,)`` of the test function along them.
    way
        Unit direction ``(2,)`` of the curve, along them.
    """

    place: Place
    slope: np.ndarray
    way: np.ndarray

    @property
    def along(self) -> np.ndarray:
        """Unit tangent ``(m + 2,)`` of the curve, in scaled unknowns."""
        return np.asarray(self.way @ self.place.tangents)


@attrs.frozen(eq=False)
class Special:
    """A point of codimension two: its kind, the place, and what happens there."""

    kind: str
    spot: Spot
    message: str


@attrs.frozen(eq=False)
class Curve:
    """The equation of a curve: the test function that is zero on it.

    ``side`` is the sign of the function where the orbits are real; 0 if they are on both sides.
    ``has_multipliers`` is False where a guard has no speed, so that the tangent map has no bound.
    """

    kind: str
    test: Test
    side: float = 0.0
    has_multipliers: bool = True

    def begin(self, place: Place) -> Spot | None:
        """The spot nearest to a place, with the way to larger values of the first parameter."""
        found = self._corrected(place, np.zeros(2), None)
        return None if found is None else self._spot(found, np.eye(len(found.units))[-2])

    def step(self, spot: Spot, length: float) -> Spot | None:
        """The spot at a distance along the curve."""
        found = self._corrected(spot.place, length * spot.way, spot.slope)
        if found is None:
            return None
        made = self._spot(found, np.sign(length) * spot.along)
        if made is None or np.sign(length) * (made.along @ spot.along) < LEAST_COSINE:
            return None
        return attrs.evolve(made, way=-made.way) if length < 0.0 else made

    def is_real(self, spot: Spot) -> bool:
        """Whether the system goes this way, on the side of a touch where there is an orbit."""
        if self.side == 0.0:
            return is_real(spot.place.orbit)
        inwards = self.side * spot.slope / np.linalg.norm(spot.slope)
        made = spot.place.step(BESIDE * inwards)
        return made is not None and is_real(made[0].orbit)

    def _corrected(self, place: Place, lengths: np.ndarray, slope: np.ndarray | None) -> Place | None:
        """The place near one at these distances along its tangents where the test function is zero."""
        if slope is None:
            slope = self._slope(place)
            if slope is None:
                return None
        across = slope / np.linalg.norm(slope)
        rate, shift, before, last = float(np.linalg.norm(slope)), 0.0, None, False
        near = place
        for _ in range(MOST_CORRECTIONS):
            made = near.step(lengths + shift * across)
            if made is None or last:
                return None if made is None else made[0]
            near = place.towards(made[0])
            height = self.test(made[0])
            if before is not None and shift != before[0] and height != before[1]:
                rate = (height - before[1]) / (shift - before[0])
            change = -height / rate
            if not np.isfinite(change) or abs(change) > LONGEST_STEP:
                return None
            before, shift, last = (shift, height), shift + change, abs(change) < SMALL
        return None

    def _slope(self, place: Place) -> np.ndarray | None:
        here, found = self.test(place), np.empty(2)
        for j, direction in enumerate(np.eye(2)):
            made = place.step(APART * direction)
            if made is None:
                return None
            found[j] = (self.test(made[0]) - here) / APART
        return found if np.all(np.isfinite(found)) and np.any(found) else None

    def _spot(self, place: Place, onward: np.ndarray) -> Spot | None:
        slope = self._slope(place)
        if slope is None:
            return None
        way = np.array([-slope[1], slope[0]]) / np.linalg.norm(slope)
        return Spot(place, slope, -way if way @ place.tangents @ onward < 0.0 else way)


def along_curve(
    curve: Curve, spot: Spot, lows: np.ndarray, highs: np.ndarray, most: int
) -> Iterator[Spot | Special | str]:
    """Spots along a curve with the special points between them; the last item is why it ends."""
    length, start = FIRST_STEP, spot
    for _ in range(most):
        after = curve.step(spot, length)
        if after is None:
            length /= 2.0
            if length < SHORTEST_STEP:
                yield "lost"
                return
            continue
        ended = _ended(curve, after, lows, highs)
        if ended:
            last = _zero(curve, spot, after, lambda each: max(_excess(curve, each, lows, highs).values()))
            if last is not None and curve.is_real(last):
                excess = _excess(curve, last, lows, highs)
                ended = max(excess, key=lambda each: excess[each])
            else:
                ended = ended if last is None else "change"
                last = _last(curve, spot, length, lambda each: _ended(curve, each, lows, highs) == "")
            yield from _between(curve, spot, last)
            if last is not spot:
                yield last
            if ended == "change":
                yield Special(f"{curve.kind} at a change", last, "beyond it the orbit has other transitions")
            elif ended == "strong resonance":
                yield Special(_nearest_resonance(last), last, "the multipliers of the torus become real")
            yield ended
            return
        yield from _between(curve, spot, after)
        yield after
        if spot is not start and passes_by(start.place, spot.place, after.place) is not None:
            yield "closed"
            return
        if np.any(after.place.orbit.scale > UNBOUNDED * start.place.orbit.scale):
            yield "infinity"
            return
        spot, length = after, min(LONGEST_STEP, LONGER * length)
    yield "most"


def _ended(curve: Curve, spot: Spot, lows: np.ndarray, highs: np.ndarray) -> str:
    """Why the curve has ended at a spot; empty if it has not."""
    excess = _excess(curve, spot, lows, highs)
    if max(excess.values()) > 0.0:
        return max(excess, key=lambda each: excess[each])
    return "" if curve.is_real(spot) else "change"


def _excess(curve: Curve, spot: Spot, lows: np.ndarray, highs: np.ndarray) -> dict[str, float]:
    """How far a spot is beyond each end of its curve; negative on the curve."""
    excess = {"range": _outside(lows, highs, spot)}
    if curve.kind == "torus":
        excess["strong resonance"] = abs(_sum_of_pair(spot)) - 2.0
    return excess


def _outside(lows: np.ndarray, highs: np.ndarray, spot: Spot) -> float:
    """How far a spot is out of the ranges, as a share of them; negative within."""
    values = spot.place.values
    return float((np.maximum(lows - values, values - highs) / (highs - lows)).max())


def _ahead(spot: Spot, after: Spot) -> float:
    """How far a spot is ahead of another along the tangent of that."""
    change = after.place.orbit.loop.flat - spot.place.orbit.loop.flat
    return float(spot.along @ (change / spot.place.units))


def _zero(curve: Curve, spot: Spot, after: Spot, function: Callable[[Spot], float]) -> Spot | None:
    """The spot between two where a function of spots changes its sign."""
    known = {0.0: spot, _ahead(spot, after): after}
    found: Spot | None = zero_on_the_way(known, partial(curve.step, spot), function)
    return found


def _last(curve: Curve, spot: Spot, length: float, inside: Callable[[Spot], bool]) -> Spot:
    """The last spot of a step that is inside, to rounding of the step."""
    low, high, found = 0.0, length, spot
    while high - low > 1e-9 * length:
        middle = 0.5 * (low + high)
        made = curve.step(spot, middle)
        if made is not None and inside(made):
            low, found = middle, made
        else:
            high = middle
    return found


def _sum_of_pair(spot: Spot) -> float:
    """The sum of the two multipliers whose product is nearest to 1; on the unit circle twice their cosine."""
    pairs = np.array([*combinations(spot.place.orbit.free_multipliers, 2)])
    return float(pairs[np.argmin(np.abs(pairs.prod(axis=1) - 1.0))].sum().real)


def _nearest_resonance(spot: Spot) -> str:
    total = _sum_of_pair(spot)
    return min(STRONG, key=lambda each: abs(STRONG[each] - total))


def _between(curve: Curve, spot: Spot, after: Spot) -> list[Special]:
    """The points of codimension two between two spots, in their order."""
    if not curve.has_multipliers:
        return []
    special = []
    for kind, function, message in _tests(curve.kind, spot):
        if not changes(function(spot), function(after)):
            continue
        found = _zero(curve, spot, after, function)
        if found is None:
            continue
        if _is_proved(kind, spot, found):
            special.append(Special(kind, found, message))
    return sorted(special, key=lambda each: _ahead(spot, each.spot))


def _is_proved(kind: str, spot: Spot, found: Spot) -> bool:
    """Whether what a test function shows is there: near a touch multipliers have no bound."""
    if kind == "cusp":
        return bool(np.linalg.norm(found.along[-2:]) < STANDS * np.linalg.norm(spot.along[-2:]))
    values = found.place.orbit.free_multipliers
    wanted = [value for name, value in AT.items() if name in kind]
    return all(np.abs(values - value).min() < MEETS for value in wanted)


def _tests(kind: str, spot: Spot) -> Iterator[tuple[str, Callable[[Spot], float], str]]:
    """Functions that are zero at points of codimension two, with their kinds and what happens."""
    if kind == "torus":
        for name, total in RESONANCES.items():
            away = partial(_from_resonance, total)
            yield name, away, "the multipliers of the torus are roots of 1"
        return
    if kind in DOUBLE:
        sign, name = DOUBLE[kind]
        yield name, partial(_others, sign), f"another multiplier is {-sign:.0f} too"
    if kind == "fold":
        # Along the curve both parameters stop and turn back.
        yield "cusp", lambda other: float(spot.along[-2:] @ other.along[-2:]), "two curves of folds meet"
    for other in ("fold", "flip"):
        if other != kind:
            name = "fold-flip" if {other, kind} == {"fold", "flip"} else f"{kind}-{other}"
            yield name, partial(_at_spot, SMOOTH[other]), f"there is a {other} too"


def _others(sign: float, spot: Spot) -> float:
    """The product of ``-sign - mu`` over the multipliers but for the one that is ``-sign``.

    It is the slope of the characteristic polynomial there, which rounding does not split as it does roots.
    """
    polynomial = np.poly(spot.place.orbit.free_multipliers)
    return float(np.polyval(np.polyder(polynomial), -sign).real)


def _from_resonance(total: float, spot: Spot) -> float:
    return _sum_of_pair(spot) - total


def _at_spot(test: Test, spot: Spot) -> float:
    return test(spot.place)
