"""The branch that crosses another one, or begins on it: an orbit of it, and which way it goes."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import Place
from hybrid.orbits.continuation.real import is_real
from hybrid.orbits.continuation.route import Loop

# The first orbit is this far from where the branches meet, in units of its size, or nearer. There is one half
# way, too: it begins there. The other branch goes on across the first, aside by so many times this distance.
DISTANCE = 0.02
NEAREST = 1e-6
ASIDE = 8.0
# Distance at which the parameter of a fold is compared with that at the fold.
APART = 1e-3


def crossing(place: Place, times: int) -> Pass | None:
    """An orbit of the other branch, which passes that of a place so many times; None if none is found.

    At a flip the equations of the orbit passed twice are singular in two directions: along the branch, and
    along the eigenvector of the multiplier -1. At a branch point those of one pass are. The other branch
    begins in the direction across the first one (Seydel 2010, section 5.6).
    """
    repeated = _repeated(place, times)
    if repeated is None:
        return None
    orbit, units, (along,) = repeated.orbit, repeated.units, repeated.tangents
    one, other = np.linalg.svd(repeated.matrix)[2][-2:]
    direction = one * (other @ along) - other * (one @ along)
    direction /= np.linalg.norm(direction)

    def near(change: np.ndarray, reach: float) -> Pass | None:
        """The real orbit within reach of one that is so far away, in units."""
        guess = orbit.loop.plus(units * change)
        found = repeated.family.corrected(guess, orbit, units, direction[None], reach)
        return None if found is None or not is_real(found[0]) else found[0]

    distance = DISTANCE
    while distance > NEAREST:
        made = near(distance * direction, ASIDE * distance)
        if made is not None:
            change = (made.loop.flat - orbit.loop.flat) / units
            if near(0.5 * change, 0.25 * float(np.abs(change).max())) is not None:
                return made
        distance /= 4.0
    return None


def _repeated(place: Place, times: int) -> Place | None:
    """An orbit that is passed several times, and the tangent of its branch."""
    family, loop = place.family, place.orbit.loop
    first, last = loop.x.size, loop.x.size + len(loop.times)
    change = place.units * place.tangents[0]
    moved, longer = change[first:last], change[last - 1] - change[first]
    shift = np.where(family.system.is_cyclic[: family.n], place.orbit.change, 0.0)
    again = Loop(
        np.concatenate([loop.x + k * shift for k in range(times)]),
        np.concatenate([loop.times[:1], *(loop.times[1:] + k * loop.period for k in range(times))]),
        loop.values,
    )
    route = tuple(
        attrs.evolve(each, counters=tuple(np.add(each.counters, k * family.counted).tolist()))
        for k in range(times)
        for each in family.route
    )
    orbit = attrs.evolve(
        family, periods=times * family.periods, route=route, counted=times * family.counted
    ).around(again)
    if orbit is None:
        return None
    onward = np.concatenate(
        [
            np.tile(change[:first], times),
            moved[:1],
            *(moved[1:] + k * longer for k in range(times)),
            change[last:],
        ]
    ) / orbit.units(place.sizes)
    return Place(orbit, onward[None] / np.linalg.norm(onward), place.sizes)


def fold_coefficient(place: Place) -> float | None:
    """``c`` of ``p = p0 + c s^2`` at a fold, ``s`` being the largest change of a state in its units."""
    made = [place.step(np.array([sign * APART])) for sign in (1.0, -1.0)]
    if made[0] is None or made[1] is None:
        return None
    ends = [each[0] for each in made if each is not None]
    middle = 0.5 * (ends[0].value + ends[1].value) - place.value
    sizes = np.where(place.orbit.own_scale > 0.0, place.orbit.own_scale, 1.0)
    change = float(np.abs(0.5 * (ends[0].orbit.loop.x - ends[1].orbit.loop.x) / sizes).max())
    return float(middle / change**2) if change > 0.0 else None


def flip_coefficient(place: Place, doubled: Pass) -> float:
    """``c`` of ``p = p0 + c s^2`` for orbits of twice the period, whose halves differ by ``2 s``."""
    x = doubled.loop.x
    half = len(x) // 2
    sizes = np.where(place.orbit.own_scale > 0.0, place.orbit.own_scale, 1.0)
    s = 0.5 * np.abs((x[half:] - x[:half]) / sizes).max()
    return float((doubled.loop.values[0] - place.value) / s**2)


def is_supercritical(place: Place, coefficient: float) -> bool:
    """Whether the orbits of twice the period are stable: single ones are on the other side alone.

    That is exact near the flip, where one multiplier alone decides (Kuznetsov 2023, section 4.5).
    """
    for sign in (1.0, -1.0):
        made = place.step(np.array([sign * APART]))
        if made is None:
            return False
        if made[0].orbit.stable == ((made[0].value - place.value) * coefficient > 0.0):
            return False
    return True
