"""How far an orbit is from a change of its route: smooth functions of the unknowns, zero where it changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import attrs
import numpy as np

from hybrid.orbits.continuation.passing import Pass
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Transition

# Places of a stretch at which a guard is looked at.
PLACES = 129
# The same local extremum of two orbits is at shares of the stretch that differ by less than this.
SAME = 0.1
# A guard that is zero at an end of a stretch by its nature has this share of its size there.
NOTHING = 1e-9
# Shares by which a stretch is looked at beyond an end where it goes on smoothly.
BESIDE = 0.05


@attrs.frozen
class Key:
    """What a measure belongs to.

    ``kind`` is ``"speed"`` of the guard that fires at the end of a stretch; ``"top"``, an extremum of a guard
    within the stretch; ``"rate"`` of the guard that fires, along the field of another mode; ``"when"``, the
    condition of a transition at the end; ``"end"`` and ``"begin"``, the guard of another transition there;
    ``"stay"``, the time in the stretch. ``name`` is that of a transition or a mode, and ``share`` the place
    of an extremum.
    """

    kind: str
    stretch: int
    name: str
    share: float = 0.0


def measures(orbit: Pass) -> dict[Key, float]:
    """All measures of an orbit."""
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
        if stretch.fired:
            found |= dict(_of_landing(orbit, i))
    return found


def _of_guard(orbit: Pass, i: int, transition: Transition) -> Iterable[tuple[Key, float]]:
    # Where a stretch goes on smoothly from the one before, or into the next, an extremum may lie at its end.
    begin = -BESIDE if orbit.landings[i - 1] is None else 0.0
    end = 1.0 + BESIDE if orbit.landings[i] is None else 1.0
    shares = np.linspace(begin, end, PLACES)
    heights = heights_of(orbit, i, transition, shares)
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
    for transition in outgoing:
        key = Key("when", i, transition.name)
        value = _when(key, orbit)
        if np.isfinite(value):
            yield key, value


def _condition(orbit: Pass, transition: Transition, t: float, x: np.ndarray) -> float | None:
    """The value of a transition's condition, if it has one."""
    if transition.guard.when is None:
        return None
    family = orbit.family
    variables = family.system.variables
    p = variables.parameter_view(family.vector(orbit.loop.values))
    value = transition.guard.when(np.float64(t), variables.state_view(x), p)
    # A comparison jumps between two values.
    return (1.0 if value else -1.0) if isinstance(value, (bool, np.bool_)) else float(value)


def heights_of(orbit: Pass, i: int, transition: Transition, shares: np.ndarray) -> np.ndarray | None:
    """A guard at shares ``(N,)`` of a stretch; None if it is not finite, or the stretch takes no time.

    Shares below 0 and above 1 lie in the stretches before and after, which take the same time.
    """
    loop, family, count = orbit.loop, orbit.family, len(orbit.flows)
    if orbit.flows[i].arc is None:
        return None
    states = orbit.whole(i, orbit.flows[i].at(shares))
    for outside, other, shift in (
        (shares < 0.0, (i - 1) % count, 1.0),
        (shares > 1.0, (i + 1) % count, -1.0),
    ):
        if np.any(outside):
            states[outside, : family.n] = orbit.flows[other].at(shares[outside] + shift)
    begin, end = loop.times[i : i + 2]
    times = begin + shares * (end - begin)
    variables, values = family.system.variables, family.vector(loop.values)
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


def top(key: Key, orbit: Pass) -> float:
    """The extremum of a guard near a share of a stretch; nan if there is none."""
    return extremum(key, orbit)[1]


def extremum(key: Key, orbit: Pass) -> tuple[float, float]:
    """Where in its stretch a guard has an extremum near a share, and its height; nan if there is none."""
    from scipy.optimize import minimize_scalar

    transition = _transition(orbit, key)
    i = key.stretch
    low = -2 * BESIDE if orbit.landings[i - 1] is None else 0.0
    high = 1.0 + 2 * BESIDE if orbit.landings[i] is None else 1.0
    near = np.linspace(max(low, key.share - SAME), min(high, key.share + SAME), 33)
    heights = heights_of(orbit, key.stretch, transition, near)
    if heights is None:
        return np.nan, np.nan
    steps = np.diff(heights)
    turns = np.flatnonzero(steps[:-1] * steps[1:] < 0.0) + 1
    if len(turns) == 0:
        return np.nan, np.nan
    j = int(turns[np.argmin(np.abs(near[turns] - key.share))])
    sign = -1.0 if heights[j] > heights[j - 1] else 1.0

    def height(share: float) -> float:
        found = heights_of(orbit, key.stretch, transition, np.array([share]))
        return np.nan if found is None else sign * float(found[0])

    # Brent's method finds the place to the square root of rounding, and the height to rounding.
    best = minimize_scalar(height, bracket=(near[j - 1], near[j], near[j + 1]), tol=1e-9)
    return float(best.x), sign * float(best.fun)


def measure_of(key: Key) -> Callable[[Pass], float]:
    """One measure as a function of the orbit; nan where it has none."""
    return partial(_MEASURES[key.kind], key)


def curve_measure_of(key: Key) -> Callable[[Pass], float]:
    """One measure along a curve on which it is zero: an extremum may move along its stretch."""
    return partial(_lowest, key) if key.kind == "top" else measure_of(key)


def _lowest(key: Key, orbit: Pass) -> float:
    """The extremum of a guard within a stretch that is nearest to zero; nan if there is none."""
    found = [
        height
        for each, height in _of_guard(orbit, key.stretch, _transition(orbit, key))
        if each.kind == "top"
    ]
    return min(found, key=abs, default=np.nan)


def _speed(key: Key, orbit: Pass) -> float:
    return orbit.speed(key.stretch)


def _rate(key: Key, orbit: Pass) -> float:
    loop, i = orbit.loop, key.stretch
    end = orbit.whole(i, orbit.flows[i].end)
    rate = orbit.family.rate(key.name, float(loop.times[i + 1]), end, loop.values)
    return orbit.speed(i, rate)


def _when(key: Key, orbit: Pass) -> float:
    i = key.stretch
    t, x = float(orbit.loop.times[i + 1]), orbit.whole(i, orbit.flows[i].end)
    found = _condition(orbit, _transition(orbit, key), t, x)
    return np.nan if found is None else found


def _at_an_end(key: Key, orbit: Pass) -> float:
    share = np.array([1.0 if key.kind == "end" else 0.0])
    found = heights_of(orbit, key.stretch, _transition(orbit, key), share)
    return np.nan if found is None else float(found[0])


def _stay(key: Key, orbit: Pass) -> float:
    return float(np.diff(orbit.loop.times)[key.stretch])


def _transition(orbit: Pass, key: Key) -> Transition:
    system = orbit.family.system
    return system.transitions[system.transition_index(key.name)]


_MEASURES: dict[str, Callable[[Key, Pass], float]] = {
    "top": top,
    "speed": _speed,
    "rate": _rate,
    "when": _when,
    "end": _at_an_end,
    "begin": _at_an_end,
    "stay": _stay,
}


def changed(before: Pass, after: Pass) -> list[Key]:
    """The measures that have another sign at another orbit, those of touches first."""
    there, here = measures(after), measures(before)
    found = []
    for key, value in here.items():
        if key.kind == "top":
            other = top(key, after)
        else:
            other = there.get(key, np.nan)
        if value * other < 0.0:
            found.append(key)
    order = ("top", "speed", "rate", "when", "end", "begin", "stay")
    return sorted(found, key=lambda key: order.index(key.kind))
