"""Where the route of an orbit changes: which change it is, exactly where, and which orbit goes on beyond."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property, partial

import attrs
import numpy as np

from hybrid.orbits.continuation.clearances import MOVING, Key, changed, clearance_of
from hybrid.orbits.continuation.family import Family
from hybrid.orbits.continuation.grazing import kick, square_root_coefficient, what_follows
from hybrid.orbits.continuation.instants import is_repeated
from hybrid.orbits.continuation.parts import holding
from hybrid.orbits.continuation.passing import CLOSED, Pass
from hybrid.orbits.continuation.place import (
    BESIDE,
    Place,
    distance,
    interpolated_zero,
    moment,
    place_of,
    start_of,
)
from hybrid.orbits.continuation.real import is_real, slides
from hybrid.orbits.continuation.route import Route, from_limits, rotations
from hybrid.orbits.continuation.seams import is_same_motion
from hybrid.simulation.holding import drawn_back
from hybrid.simulation.simulate import simulate

# The change is enclosed by so many halvings of a step, each time before it is asked what changes.
HALVINGS = 6
MOST_HALVINGS = 60
# Two places this near on the branch are the same to rounding.
SHORTEST = 1e-13
# A clearance that has vanished is this share of what it was at a real place nearby.
VANISHED = 1e-3
# A change found from its two sides has the same parameter, to this share of the range.
CLOSE = 1e-2
# A stretch shorter than this share of the longest may take no time at the change.
SHARE_OF_A_STAY = 0.02
# Distances from the orbit at a change at which the system itself is asked for its way, in their units.
FARTHER = (1e-5, 1e-4, 1e-3, 1e-2)

# An orbit that holds what another one holds is so many of these distances away at most.
NEIGHBOURHOOD = 5.0
# The parameter stands still if it changes by this share of its range.
STILL = 1e-8

TANGENT = ("top", "speed")
# Events that meet; in the others a field is along a surface.
AT_A_CORNER = ("when", "end", "begin", "stay")


@attrs.frozen(eq=False)
class Onward:
    """What the system does just beyond a change.

    Attributes
    ----------
    place
        An orbit of the new route, with the tangent away from the change; None if there is none.
    jumps
        Names of what fires around the change, at instants, before and beyond it.
    passing
        A real orbit, or one near it, with more jumps there than the other; and the stretch of it that takes
        no time at the change, None if each does.
    same_way
        Whether the parameter goes on as before.
    """

    place: Place | None
    jumps: tuple[list[tuple[str, ...]], list[tuple[str, ...]]]
    passing: Pass | None
    stretch: int | None
    same_way: bool


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
                return _simplest(Change(found, key, real, _onward(near, found, key)))
        base = near
    keys = changed(near.orbit, far.orbit)
    # What jumps has no zero: it is between two places that are the same to rounding.
    return Change(near, keys[0], near, _onward(near, near, keys[0])) if keys else None


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


def _onward(near: Place, at: Place, key: Key) -> Onward:
    """What comes beyond: the system is asked which other ways it goes from states around the orbit there."""
    slope = np.sign(near.tangents[0, -1])
    known = Onward(None, ([], []), None, None, True)
    # The orbit itself, seen from a later start, is none beyond.
    itself = rotations(at.family.route)
    for farther in FARTHER:
        for asked in _asked(near, at, key, farther):
            family, first, jumps, stretch = asked
            if family.route in itself:
                continue
            more = len(jumps[1]) >= len(jumps[0])
            known = Onward(None, jumps, first if more else near.orbit, stretch, True)
            units = first.units(near.sizes)
            if near.family.held is not None:
                # Until it holds them, at the same parameter.
                units[-len(near.sizes) :] = np.finfo(float).tiny
            corrected = family.corrected(first.loop, first, units)
            if corrected is not None and near.family.held is not None:
                orbit = holding(corrected[0], near.family.held, near.sizes)
                units, reach = orbit.units(near.sizes), NEIGHBOURHOOD * farther
                corrected = orbit.family.corrected(orbit.loop, orbit, units, reach=reach)
            if corrected is None:
                continue
            onward = np.eye(len(corrected[0].loop.flat))[-len(near.sizes) :]
            place = place_of(corrected[0], onward, near.sizes)
            found = None if place is None else _away(place, at, farther)
            # A shorter orbit, passed more than once, is one of another branch.
            if found is not None and not is_repeated(found.orbit) > is_repeated(at.orbit):
                same_way = bool(np.sign(found.tangents[0, -1]) == slope)
                return attrs.evolve(known, place=found, same_way=same_way)
    return known


def _away(place: Place, at: Place, length: float) -> Place | None:
    """A real place at a distance from one near a change, with the tangent away from the change."""
    found = []
    for sign in (1.0, -1.0):
        made = place.step(np.array([sign * length]))
        if made is not None and is_real(made[0].orbit) and not made[0].orbit.is_point:
            found.append(attrs.evolve(made[0], tangents=sign * made[0].tangents))
    moved = {id(each): abs(each.value - at.value) for each in found}
    if max(moved.values(), default=0.0) <= STILL * float(at.sizes[0]):
        # In a family at one value of the parameter the states tell.
        sizes = at.orbit.scale
        moved = {
            id(each): float(np.abs((each.orbit.extremes - at.orbit.extremes) / sizes).max()) for each in found
        }
    return max(found, key=lambda each: moved[id(each)], default=None)


Asked = tuple[Family, Pass, tuple[list[tuple[str, ...]], list[tuple[str, ...]]], int | None]


def _asked(near: Place, place: Place, key: Key, farther: float) -> Iterator[Asked]:
    """Other ways around from states at a distance from the orbit; only those that come around.

    With each: a pass along it, what fires around the change here and there, and the stretch between two of
    these that takes the least time.
    """
    orbit, family, loop = place.orbit, place.family, place.orbit.loop
    j, share = _quiet(orbit, key)
    mode = family.route[j].mode
    ends = [i for i, stretch in enumerate(family.route) if stretch.fired]
    turned = [i for i in ends if i >= j] + [i for i in ends if i < j]
    old = [family.route[i].fired for i in turned]
    starting = {each.name for each in family.system.transitions if each.guard.at_start}
    starting -= from_limits(family.system)
    for t, x, values, period in _around(near, place, j, share, farther):
        arc = simulate(
            family.system,
            drawn_back(family.system, mode, t, x, family.vector(values)),
            (t, t + period),
            mode=mode,
            parameters=family.all_parameters(values),
            solver=family.solver,
        )
        if not arc.status.ok or str(arc.mode[-1]) != mode:
            continue
        if starting & {str(name) for name in arc.jumps.transition}:
            continue
        started = start_of(family, arc, period, values)
        first = None if started is None else started[0].around(started[1])
        if first is None:
            continue
        # The route of a run begins after its first jump, which ends the last stretch.
        theirs = [i for i, stretch in enumerate(first.family.route) if stretch.fired]
        theirs = [*theirs[-1:], *theirs[:-1]]
        new = [first.family.route[i].fired for i in theirs]
        same, last = _common(old, new)
        local = old[same : len(old) - last], new[same : len(new) - last]
        if local[0] == local[1]:
            continue
        more = len(local[1]) >= len(local[0])
        count, times = (len(first.loop.x), first.loop.times) if more else (len(loop.x), loop.times)
        passed = (theirs if more else turned)[same : same + max(map(len, local))]
        between = [(i + 1) % count for i in passed[:-1]]
        yield first.family, first, local, min(between, key=lambda i: np.diff(times)[i], default=None)


def _around(
    near: Place, place: Place, j: int, share: float, farther: float
) -> Iterator[tuple[float, np.ndarray, np.ndarray, float]]:
    """Time, state, parameters and period around a change: farther along the equations, then to all sides."""
    made = near.step(np.array([distance(near, place) + farther]))
    if made is not None:
        beyond = made[0].orbit
        yield *moment(beyond, j, share), beyond.loop.values, beyond.loop.period
    t, x = moment(place.orbit, j, share)
    aside = np.eye(place.family.n, len(x)) * place.orbit.scale[:, None]
    for shift in farther * np.vstack([aside, -aside]):
        yield t, x + shift, place.orbit.loop.values, place.orbit.loop.period


def _quiet(orbit: Pass, key: Key) -> tuple[int, float]:
    """A long stretch whose states may be moved to all sides, and a share of its time far from the change."""
    stays = np.diff(orbit.loop.times)
    lasting = [i for i in range(len(stays)) if stays[i] > SHARE_OF_A_STAY * stays.max()]
    free = [i for i in lasting if not slides(orbit, i)] or lasting
    j = max(free, key=lambda i: stays[i])
    if j == key.stretch and key.kind in MOVING and key.share != 1.0:
        return j, key.share / 2 if key.share > 0.5 else (1.0 + key.share) / 2
    return j, 0.5


def _common(one: list[tuple[str, ...]], other: list[tuple[str, ...]]) -> tuple[int, int]:
    """How many items two lists have in common at their begins, and of the others at their ends."""
    least = min(len(one), len(other))
    same = next((k for k in range(least) if one[k] != other[k]), least)
    rest = least - same
    return same, next((k for k in range(rest) if one[-1 - k] != other[-1 - k]), rest)
