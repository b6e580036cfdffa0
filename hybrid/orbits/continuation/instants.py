"""The instants at which an orbit jumps: whether two passes are one orbit, and its halves."""

from __future__ import annotations

import numpy as np

from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import Place, moment, share_of
from hybrid.system.periodicity import whole_turns

# Parts of an orbit are the same if they differ by this share of its size.
SAME = 1e-7
# An orbit that does not jump is asked whether it is one that is passed so often at most.
MOST_PASSES = 8

Names = tuple[tuple[tuple[str, ...], str], ...]


def instants_of(orbit: Pass) -> tuple[Names, np.ndarray, np.ndarray]:
    """What fires at each instant and the mode after it, with states ``(E, n)`` after them and times ``(E,)``.

    The start is the only instant of an orbit that does not jump.
    """
    route, loop = orbit.family.route, orbit.loop
    ends = [i for i, stretch in enumerate(route) if stretch.fired] or [len(route) - 1]
    after = [(i + 1) % len(route) for i in ends]
    names = tuple((route[i].fired, route[j].mode) for i, j in zip(ends, after, strict=True))
    return names, loop.x[after], loop.times[1:][ends]


def passes_by(start: Place, before: Place, after: Place) -> float | None:
    """The share of a step at which it passes the start of a walk; None if it does not.

    Whole turns of angles, shifts along cyclic components, whole forcing periods and the choice of the first
    jump make no other orbit.
    """
    wanted, names = (instants_of(each.orbit)[0] for each in (start, after))
    if instants_of(before.orbit)[0] != names:
        return None
    turned = [first for first in range(len(names)) if names[first:] + names[:first] == wanted]
    shares = (_passes_by(start, before, after, first) for first in turned)
    return next((share for share in shares if share is not None), None)


def _passes_by(start: Place, before: Place, after: Place, first: int) -> float | None:
    """The share at which it does so where the first instant of the start is a later one of the step."""
    family, sizes = start.family, np.append(start.orbit.scale, start.orbit.loop.period)
    _, x, times = instants_of(start.orbit)
    turns = family.system.turn_lengths[: family.n]
    there, here = (_from(each.orbit, first) for each in (before, after))
    moved = np.mean(here[:, :-1] - x, axis=0)
    around = np.where(_cyclic(start.orbit), moved, turns * whole_turns(moved, turns))
    late = float(np.mean(here[:, -1] - times))
    if family.forced:
        forcing = family.period(start.values) / family.periods
        late = round(late / forcing) * forcing
    again = np.column_stack([x + around, times + late])

    def away(table: np.ndarray, place: Place) -> np.ndarray:
        states = (table - again) / sizes / np.sqrt(len(x))
        return np.append(states.ravel(), (place.values - start.values) / start.sizes)

    one, other = away(there, before), away(here, after)
    chord = other - one
    length = float(np.linalg.norm(chord))
    share = float(-one @ chord) / length**2 if length > 0.0 else -1.0
    near = 0.0 <= share <= 1.0 and np.linalg.norm(one + share * chord) < 0.1 * length
    return share if near else None


def _from(orbit: Pass, first: int) -> np.ndarray:
    """States and times ``(E, n + 1)`` of the instants from one of them on, over a period."""
    _, x, times = instants_of(orbit)
    table = np.column_stack([x, times])
    later = table[:first] + np.append(orbit.change, orbit.loop.period)
    return np.vstack([table[first:], later])


def halves(orbit: Pass, count: int = 2) -> np.ndarray | None:
    """How far the second half of an orbit is from the first ``(E n / 2,)``; None if they differ in jumps.

    Or by how much its parts are apart that follow each other, of so many. Shifts do not count.
    """
    names, x, _ = instants_of(orbit)
    part = len(names) // count
    if len(names) % count or names[part:] != names[:-part]:
        return None
    apart = np.where(_cyclic(orbit), 0.0, x[part:] - x[:-part])
    return np.asarray((apart / orbit.scale).ravel())


def _returns(orbit: Pass, count: int) -> bool:
    """Whether an orbit that does not jump is back after such a part of its period."""
    loop = orbit.loop
    _, x = moment(orbit, *share_of(orbit, float(loop.times[0] + loop.period / count)))
    away = (x - orbit.whole(0, loop.x[0]))[: orbit.family.n] / orbit.scale
    return bool(np.linalg.norm(np.where(_cyclic(orbit), 0.0, away)) <= SAME)


def _cyclic(orbit: Pass) -> np.ndarray:
    """Whether each component ``(n,)`` is cyclic."""
    return np.asarray(orbit.family.system.is_cyclic[: orbit.family.n])


def is_repeated(orbit: Pass) -> bool:
    """Whether it is a shorter orbit that is passed more than once."""
    if not any(stretch.fired for stretch in orbit.family.route):
        return not orbit.is_point and any(_returns(orbit, count) for count in range(2, MOST_PASSES + 1))
    parts = (halves(orbit, count) for count in range(2, len(instants_of(orbit)[0]) + 1))
    return any(each is not None and np.linalg.norm(each) <= SAME for each in parts)
