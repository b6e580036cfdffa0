"""What comes beyond a change: the system is asked for its way from states around the orbit there."""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import numpy as np

from hybrid.orbits.continuation.clearances import MOVING, Key
from hybrid.orbits.continuation.family import Family
from hybrid.orbits.continuation.instants import is_repeated
from hybrid.orbits.continuation.parts import holding
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import (
    Place,
    distance,
    moment,
    place_of,
    start_of,
)
from hybrid.orbits.continuation.real import is_real, slides
from hybrid.orbits.continuation.route import from_limits, rotations
from hybrid.simulation.holding import drawn_back
from hybrid.simulation.simulate import simulate

# A stretch shorter than this share of the longest may take no time at the change.
SHARE_OF_A_STAY = 0.02

# Distances from the orbit at a change at which the system itself is asked for its way, in their units.
FARTHER = (1e-5, 1e-4, 1e-3, 1e-2)

# An orbit that holds what another one holds is so many of these distances away at most.
NEIGHBOURHOOD = 5.0

# The parameter stands still if it changes by this share of its range.
STILL = 1e-8


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


def onward_of(near: Place, at: Place, key: Key) -> Onward:
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
