"""How far an orbit is from a touch: the speed of guards that fire, the highest value of the others."""

from __future__ import annotations

from collections.abc import Mapping

import attrs
import numpy as np

from hybrid.orbits.shots import Family, Shot
from hybrid.system.derivatives import evaluate
from hybrid.system.elements import Transition

# Places between two jumps at which a guard is looked at.
PLACES = 129
# Touches farther ahead than this many of the last steps are not what ends the branch.
FARTHEST = 3.0

Key = tuple[str, int, str]


@attrs.frozen(eq=False)
class Touch:
    """A measure that is zero at a touch, and how far along the branch that is.

    ``key`` names the measure: a jump of the orbit, or a guard in a stretch between two jumps.
    """

    key: Key
    value: float
    way_left: float

    @property
    def told(self) -> str:
        """What happens, in words."""
        kind, number, name = self.key
        if kind == "speed":
            return f"{name!r}, jump {number + 1} of the orbit, loses its speed through its guard"
        return f"the orbit touches the guard of {name!r}, which does not fire, after jump {number}"


def touch_ahead(
    there: Mapping[Key, float], here: Mapping[Key, float], length: float, key: Key | None = None
) -> Touch | None:
    """The touch that comes first beyond two orbits, or that of one measure, on the line through both.

    ``there`` and ``here`` are the measures of both, ``length`` is how far they are apart along the branch.
    """
    touches = [
        Touch(each, value, -value * length / (value - there[each]))
        for each, value in here.items()
        if each in there and key in (None, each) and (value - there[each]) * value < 0.0
    ]
    near = [touch for touch in touches if key is not None or touch.way_left < FARTHEST * length]
    return min(near, key=lambda touch: touch.way_left, default=None)


def measures(family: Family, shot: Shot) -> dict[Key, float]:
    """Speeds of the guards that fire, and the highest values of those that do not, by what they belong to."""
    jumps, found = shot.arc.jumps, dict[Key, float]()
    for jump in jumps:
        found["speed", jump.j, jump.transition] = abs(jump.transversality)
    times = np.concatenate([[shot.point.t], jumps.t, [shot.point.t + shot.point.period]])
    modes = [shot.point.mode, *(jump.target for jump in jumps)]
    for j, mode in enumerate(modes):
        for transition in family.system.transitions:
            if transition.source != mode or transition.guard.at_start:
                continue
            value = _highest(family, shot, transition, times[j], times[j + 1])
            if value is not None:
                found["value", j, transition.name] = value
    return found


def _highest(family: Family, shot: Shot, transition: Transition, begin: float, end: float) -> float | None:
    """The highest local maximum of a guard, in its direction, between two times; None if there is none."""
    from scipy.optimize import minimize_scalar

    variables, guard = family.system.variables, transition.guard
    values = family.values(shot.point.value)

    def along(times: np.ndarray) -> np.ndarray:
        states = shot.arc(times)[:, :-1]
        pairs = zip(times, states, strict=True)
        found = [evaluate(variables, guard.function, t, x, values) for t, x in pairs]
        return np.array([np.nan if each is None else each[0] for each in found])

    times = np.linspace(begin, end, PLACES)[1:-1]
    sampled = along(times)
    if not np.all(np.isfinite(sampled)):
        return None
    sign = float(guard.direction) or -float(np.sign(sampled[len(sampled) // 2])) or 1.0
    heights = sign * sampled
    best = None
    for i in np.flatnonzero((heights[1:-1] >= heights[:-2]) & (heights[1:-1] >= heights[2:])) + 1:
        top = minimize_scalar(
            lambda t: -sign * float(along(np.array([t]))[0]),
            bounds=(times[i - 1], times[i + 1]),
            method="bounded",
            options={"xatol": 1e-9 * (end - begin)},
        )
        if guard.when is not None:
            allowed = evaluate(variables, guard.when, top.x, shot.arc(top.x)[:-1], values)
            if allowed is None or not allowed[0] > 0.0:
                continue
        if best is None or -top.fun > best:
            best = -float(top.fun)
    return best if best is not None and best < 0.0 else None
