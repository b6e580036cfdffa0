"""Whether two orbits of different routes make one motion: a mode may end where its field goes on smoothly."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import attrs
import numpy as np

from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.family import ALONG
from hybrid.orbits.continuation.passing import Pass


@attrs.frozen
class Motion:
    """What an orbit does from one change of its field to the next: the mode, and what fires at its end."""

    mode: str
    fired: tuple[str, ...]


def is_same_motion(one: Pass, other: Pass) -> bool:
    """Whether two orbits have the same fields in turn, with the same jumps between them."""
    here, there = _motions(one), _motions(other)
    return len(here) == len(there) and any(
        all(_is_same(one, *pair) for pair in zip(here, there[k:] + there[:k], strict=True))
        for k in range(max(1, len(there)))
    )


def _motions(orbit: Pass) -> list[Motion]:
    """The motions of an orbit in turn, without modes that take no time and seams within one field."""
    found = list[Motion]()
    stays = np.diff(orbit.loop.times)
    for stretch, stay in zip(orbit.family.route, stays, strict=True):
        if found and not stay > CLOSED * orbit.loop.period:
            found[-1] = attrs.evolve(found[-1], fired=found[-1].fired + stretch.fired)
        else:
            found.append(Motion(stretch.mode, stretch.fired))
    changes = [
        _resets(orbit, each) != () or not _is_one_field(orbit, each.mode, after.mode)
        for each, after in zip(found, found[1:] + found[:1], strict=True)
    ]
    return [each for each, ends in zip(found, changes, strict=True) if ends]


def _is_same(orbit: Pass, one: Motion, other: Motion) -> bool:
    """Whether two motions have the same field, and end on the same guards with the same resets."""
    pairs = list(zip(one.fired, other.fired, strict=False))
    return (
        len(one.fired) == len(other.fired)
        and [id(each) for each in _resets(orbit, one)] == [id(each) for each in _resets(orbit, other)]
        and _is_one_field(orbit, one.mode, other.mode)
        and all(_is_one_guard(orbit, *pair) for pair in pairs)
    )


def _resets(orbit: Pass, motion: Motion) -> tuple[object, ...]:
    """The resets of the jumps at the end of a motion."""
    system = orbit.family.system
    resets = [system.transitions[system.transition_index(name)].reset for name in motion.fired]
    return tuple(each for each in resets if each is not None)


def _is_one_field(orbit: Pass, one: str, other: str) -> bool:
    """Whether two modes have one field."""
    family, values = orbit.family, orbit.loop.values
    return one == other or _agree(
        orbit, *(lambda t, x, mode=mode: family.rate(mode, t, x, values) for mode in (one, other))
    )


def _is_one_guard(orbit: Pass, one: str, other: str) -> bool:
    """Whether two transitions have one guard."""
    family, values = orbit.family, orbit.loop.values
    return one == other or _agree(
        orbit, *(lambda t, x, name=name: family.height(name, t, x, values) for name in (one, other))
    )


def _agree(orbit: Pass, *functions: Callable[[float, np.ndarray], np.ndarray | float]) -> bool:
    """Whether two functions are one, as states on an orbit and to all its sides show."""
    for t, x in _around(orbit):
        with np.errstate(all="ignore"):
            one, other = (np.asarray(function(t, x)) for function in functions)
            if not np.all(np.abs(one - other) <= ALONG * np.abs(one).max()):
                return False
    return True


def _around(orbit: Pass) -> Iterator[tuple[float, np.ndarray]]:
    """Times and whole states on an orbit, and beside it by the size of each component."""
    n, loop = orbit.family.n, orbit.loop
    for i, t in enumerate(loop.times[:-1].tolist()):
        x = orbit.whole(i, loop.x[i])
        aside = np.eye(n, len(x)) * orbit.scale[:, None]
        yield from ((t, x + shift) for shift in (np.zeros(len(x)), *aside, *-aside))
