"""Pseudo-arclength steps along a family of orbits, and what happens between two of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial

import attrs
import numpy as np

from hybrid.continuation.touch import Key, Touch, measures, touch_ahead
from hybrid.orbits.shots import Family, Shot

# Lengths of steps along the branch, in units of the sizes of the orbit and of the range of the parameter.
FIRST_STEP = 0.01
LONGEST_STEP = 0.05
SHORTEST_STEP = 1e-7
# A step may turn by this angle (its cosine), and is lengthened after few corrections.
LEAST_COSINE = 0.95
FEW_CORRECTIONS = 3
LONGER = 1.5
# An orbit that is larger than the first one by this factor, the square root of rounding, grows without bound.
UNBOUNDED = 2.0**26
# A touch is approached by this share of the way that is left. Then the unknowns are extrapolated as
# polynomials of the measure, until two of them agree to this, in units of the unknowns.
APPROACH = 0.6
AGREE = 1e-11
MOST_APPROACHES = 40
LAST_PLACES = 6


@attrs.frozen(eq=False)
class Place:
    """An orbit on the branch, and the unit tangent ``(n + 2,)`` of the branch there, in scaled unknowns.

    The unknowns are the state, the period and the parameter.
    """

    shot: Shot
    tangent: np.ndarray
    _measures: dict[Key, float] = attrs.field(factory=dict, init=False)

    def measures(self, walk: Walk) -> dict[Key, float]:
        """How far the orbit is from each touch."""
        if not self._measures:
            self._measures.update(measures(walk.family, self.shot))
        return self._measures

    @property
    def value(self) -> float:
        """The parameter."""
        return self.shot.point.value


@attrs.frozen(eq=False)
class Event:
    """A bifurcation between two places: its kind, the place itself, and what is known of it."""

    kind: str
    place: Place
    message: str


@attrs.frozen(eq=False)
class Walk:
    """A walk along the branch of a family. ``size`` is the range of the parameter."""

    family: Family
    size: float

    def units(self, shot: Shot) -> np.ndarray:
        """Units ``(n + 2,)`` of the unknowns."""
        return np.append(shot.scale, [shot.point.period, self.size])

    def begin(self, shot: Shot) -> Place | None:
        """The place of an orbit, with the tangent towards larger values of the parameter."""
        found = self.family.at_value(shot.point, shot, self.units(shot)) if shot.whole else None
        return None if found is None else self._place(found, np.eye(len(shot.gap) + 2)[-1])

    def step(self, place: Place, length: float) -> tuple[Place, int] | None:
        """The place at a distance along the tangent, and how many corrections it took; or None."""
        units = self.units(place.shot)
        guess = self.family.along(place.shot.point, length * units * place.tangent)
        if guess is None:
            return None
        corrected = self.family.corrected(guess, place.shot, units)
        if corrected is None:
            return None
        found = self._place(corrected[0], place.tangent)
        return None if found.tangent @ place.tangent < LEAST_COSINE else (found, corrected[1])

    def _place(self, shot: Shot, onward: np.ndarray) -> Place:
        """The place of a shot, with the tangent that goes on in a direction ``(n + 2,)``."""
        matrix, _ = self.family.equations(shot, shot, self.units(shot))
        tangent = np.linalg.svd(matrix)[2][-1]
        return Place(shot, -tangent if tangent @ onward < 0.0 else tangent)

    def with_quiet_section(self, place: Place) -> Place:
        """The same orbit from a point away from its jumps."""
        units = self.units(place.shot)
        point, turned = self.family.moved(place.shot, units * place.tangent)
        shot = self.family.shoot(point)
        return self._place(shot, turned / self.units(shot)) if shot.whole else place

    def walk(self, place: Place, low: float, high: float, most: int) -> Iterator[Place | Event | str]:
        """Places along the branch with the events between them; the last item is why it ends."""
        length, start, before = FIRST_STEP, place, None
        for _ in range(most):
            made = self.step(place, length)
            if made is None:
                touched = None if before is None else self.touched(before, place, length)
                if touched is not None:
                    yield touched[0]
                    yield touched[1]
                    yield "grazing"
                    return
                length /= 2.0
                if length < SHORTEST_STEP:
                    yield "lost"
                    return
                continue
            after, corrections = made
            if not low <= after.value <= high:
                edge = low if after.value < low else high
                last = self._at(place, after, length, partial(_beyond, edge))
                if last is not None:
                    yield from self._between(place, last, length)
                    yield last
                yield "range"
                return
            yield from self._between(place, after, length)
            yield after
            if np.any(after.shot.scale > UNBOUNDED * start.shot.scale):
                yield "infinity"
                return
            if self._closes(start, place, after):
                yield "closed"
                return
            if corrections <= FEW_CORRECTIONS:
                length = min(LONGEST_STEP, LONGER * length)
            before, place = place, after
            if self.family.is_near_section(place.shot):
                before, place = None, self.with_quiet_section(place)
        yield "most"

    def _closes(self, start: Place, before: Place, after: Place) -> bool:
        """Whether the step has passed the start of the walk."""
        units = self.units(start.shot)[[*range(len(start.shot.gap)), -1]]

        def apart(place: Place) -> np.ndarray:
            point, first = place.shot.point, start.shot.point
            if point.t != first.t:
                return np.full(len(units), np.inf)
            return np.append(point.x - first.x, point.value - first.value) / units

        one, other = apart(before), apart(after)
        if before is start or not np.all(np.isfinite([*one, *other])):
            return False
        chord = other - one
        length = float(np.linalg.norm(chord))
        share = -one @ chord / length**2 if length > 0.0 else -1.0
        return bool(0.0 <= share <= 1.0 and np.linalg.norm(one + share * chord) < 0.1 * length)

    def _at(
        self, place: Place, after: Place, length: float, function: Callable[[Place], float | None]
    ) -> Place | None:
        """The place between two where a function of places changes its sign."""
        from scipy.optimize import brentq

        known = {0.0: place, length: after}

        def value(s: float) -> float:
            made = self.step(place, s) if s not in known else (known[s], 0)
            if made is None:
                raise ArithmeticError
            known[s] = made[0]
            return function(made[0]) or 0.0

        try:
            root = brentq(value, 0.0, length, xtol=1e-14, rtol=4e-16 * 4, maxiter=60)
        except (ArithmeticError, ValueError):
            return None
        return known.get(root) or min(known.items(), key=lambda each: abs(each[0] - root))[1]

    def _between(self, place: Place, after: Place, length: float) -> Iterator[Event]:
        """The smooth bifurcations between two places."""
        for kind, function in TESTS.items():
            one, other = function(self, place), function(self, after)
            if one is None or other is None or one * other >= 0.0:
                continue
            found = self._at(place, after, length, partial(function, self))
            if found is None:
                continue
            message = told(kind, self.multipliers(found))
            if message:
                yield Event(kind, found, message)

    def multipliers(self, place: Place) -> np.ndarray:
        """Multipliers without the one along an autonomous orbit."""
        values = place.shot.multipliers
        if self.family.forced:
            return values
        return np.delete(values, int(np.argmin(np.abs(values - 1.0))))

    def distance(self, one: Place, other: Place) -> float:
        """How far another place is along the branch, for two places nearby with the same section."""
        first, second = one.shot.point, other.shot.point
        change = np.append(second.x - first.x, [second.period - first.period, second.value - first.value])
        if self.family.forced:
            change[-2] = 0.0
        return float(np.linalg.norm(change / self.units(one.shot)))

    def touched(self, before: Place, place: Place, length: float) -> tuple[Place, Event] | None:
        """The touch that comes within a step: the last place before it, and the event; None if none comes.

        Near a touch the unknowns are smooth functions of the speed of the guard that fires, or of the highest
        value of the one that does not; they are extrapolated to where that is zero.
        """
        touch = self._touch_ahead(before, place)
        if touch is None or not touch.way_left < 2.0 * length:
            return None
        key, near = touch.key, [before, place]
        for _ in range(MOST_APPROACHES):
            made = self.step(place, APPROACH * touch.way_left)
            if made is None:
                touch = attrs.evolve(touch, way_left=touch.way_left / 2.0)
                continue
            before, place = place, made[0]
            near = [*near, place][-LAST_PLACES:]
            found, error = self._extrapolated(near, key)
            if error < AGREE:
                return place, Event("grazing", found, touch.told)
            ahead = self._touch_ahead(before, place, key)
            if ahead is None:
                return None
            touch = ahead
        return None

    def _touch_ahead(self, before: Place, place: Place, key: Key | None = None) -> Touch | None:
        length = self.distance(before, place)
        return touch_ahead(before.measures(self), place.measures(self), length, key)

    def _extrapolated(self, places: list[Place], key: Key) -> tuple[Place, float]:
        """The place where a measure is zero, from polynomials of it through places nearby; and the error."""
        point, units = places[-1].shot.point, self.units(places[-1].shot)
        values = np.array([each.measures(self)[key] for each in places])
        unknowns = np.array([[*each.shot.point.x, each.shot.point.period, each.value] for each in places])
        ends = [_at_zero(values[i:], unknowns[i:]) for i in (0, 1)]
        error = float(np.max(np.abs(ends[0] - ends[1]) / units)) if len(places) > 2 else np.inf
        x, period, value = ends[0][:-2], float(ends[0][-2]), float(ends[0][-1])
        moved = attrs.evolve(point, x=x, period=period, value=value)
        return attrs.evolve(places[-1], shot=attrs.evolve(places[-1].shot, point=moved)), error


def _at_zero(values: np.ndarray, unknowns: np.ndarray) -> np.ndarray:
    """The polynomial of ``values (k,)`` through ``unknowns (k, n)``, at zero (Neville's scheme)."""
    table = unknowns.copy()
    for step in range(1, len(values)):
        left, right = values[:-step, None], values[step:, None]
        table = (right * table[:-1] - left * table[1:]) / (right - left)
    return np.asarray(table[0])


def _beyond(edge: float, place: Place) -> float:
    return place.value - edge


def _fold(walk: Walk, place: Place) -> float:
    return float(place.tangent[-1])


def _flip(walk: Walk, place: Place) -> float:
    return float(np.prod(walk.multipliers(place) + 1.0).real)


def _torus(walk: Walk, place: Place) -> float | None:
    values = walk.multipliers(place)
    n = len(values)
    if n < 2:
        return None
    pairs = [values[i] * values[j] - 1.0 for i in range(n) for j in range(i)]
    return float(np.prod(pairs).real)


def _branch_point(walk: Walk, place: Place) -> float:
    matrix, _ = walk.family.equations(place.shot, place.shot, walk.units(place.shot))
    return float(np.linalg.det(np.vstack([matrix, place.tangent])))


TESTS: dict[str, Callable[[Walk, Place], float | None]] = {
    "fold": _fold,
    "flip": _flip,
    "torus": _torus,
    "branch point": _branch_point,
}


def told(kind: str, multipliers: np.ndarray) -> str:
    """What happens at a bifurcation, in words; empty if the multipliers say that it is none."""
    if kind == "torus":
        on_circle = [m for m in multipliers if abs(m.imag) > 1e-6 and abs(abs(m) - 1.0) < 1e-4]
        if not on_circle:
            return ""
        angle = max(abs(math.atan2(m.imag, m.real)) for m in on_circle)
        return f"a pair of multipliers crosses the unit circle at the angle {angle:.6g}"
    if kind == "flip":
        return "a multiplier is -1: an orbit of twice the period begins"
    if kind == "fold":
        return "the branch turns back in the parameter: a multiplier is 1"
    return "a multiplier is 1, and another branch crosses"
