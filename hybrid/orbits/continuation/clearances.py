"""How far an orbit is from a change of its route: smooth functions of the unknowns, zero where it changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise

import attrs
import numpy as np

from hybrid.orbits.continuation.conditions import comparisons
from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.passing import Pass
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Transition

# Places of a stretch at which a guard is looked at.
PLACES = 129
# The same local extremum of two orbits is at shares of the stretch that differ by less than this.
SAME = 0.1
# A guard that is zero at an end of a stretch by its nature has this share of its size there.
NOTHING = 1e-9
# An extremum is enclosed by so many places, and again between those beside it: then it is a parabola's.
NARROWING = (33, 17, 17, 17)
# Kinds of clearances whose places may move along a stretch.
MOVING = ("top", "when")
# Shares by which a stretch is looked at beyond an end where it goes on smoothly.
BESIDE = 0.05


@attrs.frozen
class Key:
    """What a clearance belongs to.

    ``kind`` is ``"speed"`` of the guard that fires at the end of a stretch; ``"top"``, an extremum of a guard
    within the stretch; ``"rate"`` of the guard that fires, along the field of another mode; ``"when"``, a
    comparison in the condition of a transition, where its guard is reached; ``"end"`` and ``"begin"``, the
    guard of another transition there; ``"stay"``, the time in the stretch. ``name`` is that of a transition
    or a mode. ``share`` is the place of an extremum, or of where the guard is reached. ``part`` is the number
    of the comparison; 0 is the condition itself, 1 where it holds and -1 where it does not.
    """

    kind: str
    stretch: int
    name: str
    share: float = 0.0
    part: int = 0


def clearances(orbit: Pass) -> dict[Key, float]:
    """All clearances of an orbit."""
    found: dict[Key, float] = {}
    system, route = orbit.family.system, orbit.family.route
    for i, stretch in enumerate(route):
        found[Key("stay", i, stretch.mode)] = float(np.diff(orbit.loop.times)[i])
        outgoing = [
            each for each in system.transitions if each.source == stretch.mode and not each.guard.at_start
        ]
        if not stretch.within:
            for transition in outgoing:
                found |= dict(_of_guard(orbit, i, transition))
        for transition in outgoing:
            found |= dict(_of_condition(orbit, i, transition))
        if stretch.fired:
            found |= dict(_of_landing(orbit, i))
    return found


def _of_guard(orbit: Pass, i: int, transition: Transition) -> Iterable[tuple[Key, float]]:
    shares = _looked_at(orbit, i)
    begin, end = shares[[0, -1]]
    heights = None if orbit.flows[i].arc is None else heights_of(orbit, i, transition, shares)
    if heights is None:
        return
    size, name = float(np.abs(heights).max()), transition.name
    if end == 1.0 and name not in orbit.family.route[i].fired[:1] and abs(heights[-1]) > NOTHING * size:
        yield Key("end", i, name), float(heights[-1])
    if begin == 0.0 and abs(heights[0]) > NOTHING * size:
        yield Key("begin", i, name), float(heights[0])
    if not np.ptp(heights) > NOTHING * size:
        return
    steps = np.diff(heights)
    for j in np.flatnonzero(steps[:-1] * steps[1:] < 0.0) + 1:
        key = Key("top", i, name, float(shares[j]))
        yield key, top(key, orbit)


def _of_landing(orbit: Pass, i: int) -> Iterable[tuple[Key, float]]:
    system, stretch = orbit.family.system, orbit.family.route[i]
    speed = orbit.speed(i)
    yield Key("speed", i, stretch.fired[0]), speed
    outgoing = [each for each in system.transitions if each.source == stretch.end_mode]
    for mode in dict.fromkeys(each.target for each in outgoing):
        if mode is not None and mode != stretch.end_mode:
            key = Key("rate", i, mode)
            rate = _rate(key, orbit)
            if abs(rate) > NOTHING * abs(speed):
                yield key, rate


def _of_condition(orbit: Pass, i: int, transition: Transition) -> Iterable[tuple[Key, float]]:
    if transition.guard.when is None:
        return
    for share in _reached(orbit, i, transition):
        for part, value in enumerate(_asked(orbit, i, transition, share)):
            yield Key("when", i, transition.name, share, part), value


def _reached(orbit: Pass, i: int, transition: Transition) -> list[float]:
    """Shares of a stretch at which a guard is reached, in its direction; 0 and 1 are its ends."""
    stretch, count = orbit.family.route[i], len(orbit.flows)
    found = []
    if stretch.fired and transition.source == stretch.end_mode and _is_reached(orbit, i, transition, 1.0):
        found.append(1.0)
    if orbit.family.route[(i - 1) % count].fired and _is_reached(orbit, i, transition, 0.0):
        found.append(0.0)
    shares = _looked_at(orbit, i)
    heights = None if stretch.within else heights_of(orbit, i, transition, shares)
    if heights is None:
        return found
    sides = np.where(np.abs(heights) > NOTHING * np.abs(heights).max(), np.sign(heights), 0.0)
    certain = np.flatnonzero(sides)
    for j, k in pairwise(certain):
        if sides[j] != sides[k] and transition.guard.direction in (0, sides[k]):
            found.append(_root(orbit, i, transition, shares[j], shares[k]))
    return found


def _root(orbit: Pass, i: int, transition: Transition, low: float, high: float) -> float:
    """The share of a stretch, between two, at which a guard is zero."""
    from scipy.optimize import brentq

    def height(share: float) -> float:
        found = heights_of(orbit, i, transition, np.array([share]))
        return np.nan if found is None else float(found[0])

    return float(brentq(height, low, high, xtol=1e-15))


def _is_reached(orbit: Pass, i: int, transition: Transition, share: float) -> bool:
    """Whether a guard is zero at a share of a stretch, to rounding."""
    family, values, name = orbit.family, orbit.loop.values, transition.name
    t, x = _moment(orbit, i, share)
    sizes = np.append(orbit.scale, orbit.loop.period)
    least = CLOSED * float(np.abs(family.gradient(name, t, x, values)) @ sizes)
    return abs(family.height(name, t, x, values)) <= least


def _asked(orbit: Pass, i: int, transition: Transition, share: float) -> np.ndarray:
    """The condition of a transition at a share of a stretch, as 1 or -1, and its comparisons."""
    when, variables = transition.guard.when, orbit.family.system.variables
    assert when is not None
    t, whole = _moment(orbit, i, share)
    p, x = variables.parameter_view(orbit.family.vector(orbit.loop.values)), variables.state_view(whole)
    with np.errstate(all="ignore"):
        truth, heights = (function(t, x, p) for function in (when, comparisons(transition, variables)))
    return np.array([1.0 if truth > 0 else -1.0, *heights], dtype=float)


def _looked_at(orbit: Pass, i: int) -> np.ndarray:
    """Shares of a stretch at which a guard is looked at.

    Where a stretch goes on smoothly from the one before, or into the next, an extremum may lie at its end.
    """
    begin = -BESIDE if orbit.landings[i - 1] is None else 0.0
    end = 1.0 + BESIDE if orbit.landings[i] is None else 1.0
    return np.linspace(begin, end, PLACES)


def heights_of(orbit: Pass, i: int, transition: Transition, shares: np.ndarray) -> np.ndarray | None:
    """A guard at shares ``(N,)`` of a stretch; None if it is not finite.

    Shares below 0 and above 1 lie in the stretches before and after, which take the same time.
    """
    times, states = _moments(orbit, i, shares)
    variables, values = orbit.family.system.variables, orbit.family.vector(orbit.loop.values)
    try:
        with np.errstate(all="ignore"):
            p = variables.parameter_view(values)
            found = transition.guard.function(times, variables.state_view(states.T), p)
        found = np.broadcast_to(np.asarray(found, dtype=float), times.shape)
    except Exception:  # a function that takes no arrays is called at each place
        pairs = zip(times, states, strict=True)
        each = [evaluate(variables, transition.guard.function, t, x, values) for t, x in pairs]
        found = np.array([np.nan if value is None else value[0] for value in each])
    return found if np.all(np.isfinite(found)) else None


def _moment(orbit: Pass, i: int, share: float) -> tuple[np.float64, np.ndarray]:
    """Time and whole state at a share of a stretch: at its ends exactly."""
    (t,), (x,) = _moments(orbit, i, np.array([share]))
    exact = {0.0: orbit.loop.x[i], 1.0: orbit.flows[i].end}.get(share)
    return t, x if exact is None else orbit.whole(i, exact)


def _moments(orbit: Pass, i: int, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times ``(N,)`` and whole states ``(N, n)`` at shares of a stretch."""
    loop, family, count = orbit.loop, orbit.family, len(orbit.flows)
    states = orbit.whole(i, orbit.flows[i].at(shares))
    for outside, other, shift in (
        (shares < 0.0, (i - 1) % count, 1.0),
        (shares > 1.0, (i + 1) % count, -1.0),
    ):
        if np.any(outside):
            states[outside, : family.n] = orbit.flows[other].at(shares[outside] + shift)
    begin, end = loop.times[i : i + 2]
    return begin + shares * (end - begin), states


def top(key: Key, orbit: Pass) -> float:
    """The extremum of a guard near a share of a stretch; nan if there is none."""
    return extremum(key, orbit)[1]


def extremum(key: Key, orbit: Pass) -> tuple[float, float]:
    """Where in its stretch a guard has an extremum near a share, and its height; nan if there is none."""
    found = np.nan, np.nan
    transition = _transition(orbit, key)
    i = key.stretch
    low = -2 * BESIDE if orbit.landings[i - 1] is None else 0.0
    high = 1.0 + 2 * BESIDE if orbit.landings[i] is None else 1.0
    low, high, near = max(low, key.share - SAME), min(high, key.share + SAME), key.share
    for places in NARROWING:
        shares = np.linspace(low, high, places)
        heights = heights_of(orbit, i, transition, shares)
        if heights is None:
            return np.nan, np.nan
        steps = np.diff(heights)
        turns = np.flatnonzero(steps[:-1] * steps[1:] < 0.0) + 1
        if len(turns) == 0:
            # Rounding is all that is left, or there is none at first.
            break
        j = int(turns[np.argmin(np.abs(shares[turns] - near))])
        low, near, high = shares[j - 1 : j + 2].tolist()
        found = _vertex(shares[j - 1 : j + 2], heights[j - 1 : j + 2])
    return found


def _vertex(shares: np.ndarray, heights: np.ndarray) -> tuple[float, float]:
    """The vertex of the parabola through three points at equal distances."""
    one, other = np.diff(heights)
    late = 0.5 * (one + other) / (one - other)
    return float(shares[1] + late * (shares[1] - shares[0])), float(heights[1] + 0.25 * late * (one + other))


def clearance_of(key: Key) -> Callable[[Pass], float]:
    """One clearance as a function of the orbit; nan where it has none."""
    return partial(_CLEARANCES[key.kind], key)


def curve_clearance_of(key: Key) -> Callable[[Pass], float]:
    """One clearance along a curve on which it is zero: its place may move along its stretch."""
    return partial(_lowest, key) if key.kind in MOVING else clearance_of(key)


def _lowest(key: Key, orbit: Pass) -> float:
    """The clearance nearest to zero of those that differ only in their places; nan if there is none."""
    found = _of_guard if key.kind == "top" else _of_condition
    each = found(orbit, key.stretch, _transition(orbit, key))
    same = [value for other, value in each if attrs.evolve(other, share=key.share) == key]
    return min(same, key=abs, default=np.nan)


def _speed(key: Key, orbit: Pass) -> float:
    return orbit.speed(key.stretch)


def _rate(key: Key, orbit: Pass) -> float:
    loop, i = orbit.loop, key.stretch
    end = orbit.whole(i, orbit.flows[i].end)
    rate = orbit.family.rate(key.name, float(loop.times[i + 1]), end, loop.values)
    return orbit.speed(i, rate)


def _when(key: Key, orbit: Pass) -> float:
    transition = _transition(orbit, key)
    near = (each for each in _reached(orbit, key.stretch, transition) if abs(each - key.share) < SAME)
    share = min(near, key=lambda each: abs(each - key.share), default=None)
    return np.nan if share is None else float(_asked(orbit, key.stretch, transition, share)[key.part])


def _at_an_end(key: Key, orbit: Pass) -> float:
    share = np.array([1.0 if key.kind == "end" else 0.0])
    found = heights_of(orbit, key.stretch, _transition(orbit, key), share)
    return np.nan if found is None else float(found[0])


def _stay(key: Key, orbit: Pass) -> float:
    return float(np.diff(orbit.loop.times)[key.stretch])


def _transition(orbit: Pass, key: Key) -> Transition:
    system = orbit.family.system
    return system.transitions[system.transition_index(key.name)]


_CLEARANCES: dict[str, Callable[[Key, Pass], float]] = {
    "top": top,
    "speed": _speed,
    "rate": _rate,
    "when": _when,
    "end": _at_an_end,
    "begin": _at_an_end,
    "stay": _stay,
}


def changed(before: Pass, after: Pass) -> list[Key]:
    """The clearances that have another sign at another orbit, those of touches first.

    A comparison counts if its condition changes.
    """
    there, here = clearances(after), clearances(before)
    found = []
    for key, value in here.items():
        other = clearance_of(key)(after) if key.kind in MOVING else there.get(key, np.nan)
        if value * other < 0.0:
            found.append(key)
    order = ("top", "speed", "rate", "when", "end", "begin", "stay")
    found = [key for key in found if attrs.evolve(key, part=0) in found]
    return sorted(found, key=lambda key: (order.index(key.kind), key.part == 0))
