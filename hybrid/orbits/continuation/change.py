"""Where the route of an orbit changes: which change it is, exactly where, and which orbit goes on beyond."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property, partial

import attrs
import numpy as np

from hybrid.orbits.continuation.clearances import Key, changed, clearance_of
from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.grazing import kick, square_root_coefficient, what_follows
from hybrid.orbits.continuation.onward import Onward, onward_of
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import (
    BESIDE,
    Place,
    distance,
    interpolated_zero,
)
from hybrid.orbits.continuation.real import is_real, slides
from hybrid.orbits.continuation.route import Route
from hybrid.orbits.continuation.seams import is_same_motion

# The change is enclosed by so many halvings of a step, each time before it is asked what changes.
HALVINGS = 6
MOST_HALVINGS = 60
# Two places this near on the branch are the same to rounding.
SHORTEST = 1e-13
# A clearance that has vanished is this share of what it was at a real place nearby.
VANISHED = 1e-3
# A change found from its two sides has the same parameter, to this share of the range.
CLOSE = 1e-2


TANGENT = ("top", "speed")
# Events that meet; in the others a field is along a surface.
AT_A_CORNER = ("when", "end", "begin", "stay")


@attrs.frozen(eq=False)
class Exact:
    """The same change from its side of fewer jumps: the orbit, its clearance, a real place before it."""

    place: Place
    key: Key
    before: Place


@attrs.frozen(eq=False)
class Change:
    """Where the route changes.

    Attributes
    ----------
    place
        The orbit there, on the route before.
    key
        The clearance that is zero there.
    before
        A real place before it.
    onward
        What comes beyond.
    exact
        The place, the clearance and a real place from the side of fewer jumps.
    """

    place: Place
    key: Key
    before: Place
    onward: Onward
    exact: Exact = attrs.field()

    @exact.default
    def _itself(self) -> Exact:
        return Exact(self.place, self.key, self.before)

    @property
    def routes(self) -> tuple[Route, ...]:
        """The routes before and beyond it."""
        onward = self.onward.place
        return (self.place.family.route, *(() if onward is None else (onward.family.route,)))

    @cached_property
    def alters(self) -> bool:
        """Whether the motion is another one beyond it: not if a seam within one smooth field is met."""
        beyond = self.onward.place
        return beyond is None or not is_same_motion(self.before.orbit, beyond.orbit)

    @cached_property
    def kind(self) -> str:
        """Kind of the bifurcation."""
        exact = self.exact
        if exact.key.kind not in AT_A_CORNER:
            collides = exact.key.kind in TANGENT and kick(exact.place.orbit, exact.key) is not None
            sliding = None if collides else self._sliding
            if sliding is not None:
                return sliding
            if self._is_tangent:
                return "grazing"
        return "corner" if len({_modes(each) for each in self._around}) == 1 else "border"

    @property
    def _is_tangent(self) -> bool:
        """Whether a guard is reached without speed."""
        return bool({self.key.kind, self.exact.key.kind} & set(TANGENT))

    @property
    def _sliding(self) -> str | None:
        """Which of the four changes of sliding it is, if it is one."""
        passing, i = self.onward.passing, self.onward.stretch
        if passing is None or i is None:
            adds = self._is_tangent and slides(self.place.orbit, self.key.stretch)
            return "adding-sliding" if adds else None
        count = len(passing.family.route)
        if slides(passing, i):
            return "grazing-sliding" if self._is_tangent else "crossing-sliding"
        if slides(passing, (i - 1) % count):
            return "adding-sliding"
        return "switching-sliding" if slides(passing, (i + 1) % count) else None

    @property
    def _around(self) -> list[Pass]:
        """The orbits before, at and beyond it, as far as they are known."""
        beyond, passing = self.onward.place, self.onward.passing
        known = (self.before.orbit, self.exact.place.orbit, None if beyond is None else beyond.orbit, passing)
        return [each for each in known if each is not None]

    @cached_property
    def coefficient(self) -> np.ndarray | None:
        """The square-root coefficient ``(n,)`` of a grazing; None where there is none."""
        if self.kind != "grazing":
            return None
        return square_root_coefficient(self.exact.place.orbit, self.exact.key)

    @property
    def told(self) -> str:
        """What happens, in words."""
        key, names = self.key, self.place.family.route[self.key.stretch].fired
        within = key.kind == "when" and key.share != 1.0
        fires = "its guard is reached" if within else f"{_listed(names)} fires"
        told = {
            "top": f"the orbit touches the guard of {key.name!r}, which does not fire",
            "speed": f"{key.name!r} loses its speed through its guard",
            "rate": f"where {fires}, the field of {key.name!r} is along the surface",
            "when": f"the condition of {key.name!r} changes where {fires}",
            "end": f"the guard of {key.name!r} is reached where {fires}",
            "begin": f"a stretch begins on the guard of {key.name!r}",
            "stay": f"the time in {key.name!r} becomes zero",
        }[key.kind]
        if self.onward.place is None:
            return f"{told}, and no orbit is found beyond"
        goes = "goes on" if self.onward.same_way else "turns back in the parameter"
        before, after = (
            "+".join(_listed(each) for each in jumps) or "no jump" for jumps in self.onward.jumps
        )
        beyond = f"{told}; the orbit {goes} with {after} in place of {before}"
        stays = self.onward.same_way and self.onward.place.orbit.stable
        if key.kind != "top" or stays or self.coefficient is None:
            return beyond
        follows = what_follows(self.place.orbit.free_multipliers)
        return f"{beyond}; Nordmark's map leaves {follows}" if follows else beyond


def _modes(orbit: Pass) -> frozenset[str]:
    """Names of the modes in which an orbit is for some time."""
    lasting = np.diff(orbit.loop.times) > CLOSED * orbit.loop.period
    pairs = zip(orbit.family.route, lasting, strict=True)
    return frozenset(mode for stretch, lasts in pairs if lasts for mode in (stretch.mode, stretch.end_mode))


def _listed(names: tuple[str, ...]) -> str:
    return " and ".join(repr(name) for name in names)


def located(place: Place, after: Place) -> Change | None:
    """The first change between a real place and one that is not; None if no clearance explains it."""
    base, near, far, share = place, place, after, 0.5
    for number in range(MOST_HALVINGS):
        length = distance(near, far)
        if not length > SHORTEST:
            break
        made = near.towards(far).step(np.array([share * length]))
        if made is None:
            # It is reached from nearer.
            share /= 2.0
            continue
        share = 0.5
        if is_real(made[0].orbit):
            near = made[0]
        else:
            far = made[0]
        if number % HALVINGS != HALVINGS - 1:
            continue
        # The nearer place may be the very one where a clearance is zero, and then has no sign.
        for real in dict.fromkeys((near, base)):
            for found, key in _explained(real, near, far):
                return _simplest(Change(found, key, real, onward_of(near, found, key)))
        base = near
    keys = changed(near.orbit, far.orbit)
    # What jumps has no zero: it is between two places that are the same to rounding.
    return Change(near, keys[0], near, onward_of(near, near, keys[0])) if keys else None


def _simplest(change: Change) -> Change:
    """A change with the place found from its side of fewer jumps, if that is the other one.

    On the side of more jumps some of them come to the same instant, and the equations are singular there.
    """
    onward = change.onward.place
    if onward is None or len(onward.family.route) >= len(change.place.family.route):
        return change
    back = attrs.evolve(onward, tangents=-onward.tangents)
    reached = abs(onward.value - change.place.value) + SHORTEST
    for length in reached / float(onward.sizes[0]) * np.array([2.0, 8.0, 32.0]):
        made = back.step(np.array([length]))
        if made is None or is_real(made[0].orbit):
            continue
        for found, key in _explained(back, back, made[0]):
            if abs(found.value - change.place.value) < CLOSE * float(onward.sizes[0]):
                return attrs.evolve(change, exact=Exact(found, key, back))
    return change


def _explained(base: Place, near: Place, far: Place) -> Iterator[tuple[Place, Key]]:
    """Clearances that are zero between two places, each with the place where it is.

    They have another sign at a real place ``base``, the nearer one or one before it.
    """
    ahead, base = distance(base, far), base.towards(far)
    for key in changed(base.orbit, far.orbit):
        clearance = partial(_clearance_at, clearance_of(key))
        found = interpolated_zero(base, clearance, (0.0, ahead))
        if found is None or abs(clearance(found)) > VANISHED * abs(clearance(base)):
            continue
        if distance(base, found) >= distance(base, near) - BESIDE * ahead:
            yield found, key


def _clearance_at(clearance: Callable[[Pass], float], place: Place) -> float:
    return clearance(place.orbit)
