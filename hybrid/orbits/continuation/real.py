"""Whether the system itself makes the run that a solution of the equations of an orbit stands for."""

from __future__ import annotations

from itertools import pairwise

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.passing import Pass
from hybrid.orbits.continuation.place import moment
from hybrid.orbits.continuation.route import from_limits, with_effect
from hybrid.simulation.simulate import simulate

# A run jumps where the equations say so if the times agree to this share of the period.
SAME_TIME = 1e-6

# A run that is compared with the equations goes on while errors have grown by this factor at most.
LITTLE_GROWTH = 10.0


def slides(orbit: Pass, i: int) -> bool:
    """Whether the motion in a stretch stays on the guard through which it came into its mode."""
    family, count = orbit.family, len(orbit.flows)
    before = [family.route[(i - k) % count].fired for k in range(1, count + 1)]
    name = next((fired[0] for fired in before if fired), None)
    if name is None:
        return False
    # Half way through a short contact its guard stands still, too. At the start most stretches tell.
    moments = (moment(orbit, i, share) for share in (0.0, 0.25, 0.5, 0.75))
    return all(family.is_along(name, family.route[i].mode, *each, orbit.loop.values) for each in moments)


def is_real(orbit: Pass) -> bool:
    """Whether the system itself goes this way.

    Each guard fires in its direction, and runs from the middle of one stretch to that of another jump as the
    equations say. A run goes on over stretches along which errors hardly grow. It does not begin or end on a
    surface that the motion stays on, in a chatter, or between events that meet at one instant.
    """
    route, stays = orbit.family.route, np.diff(orbit.loop.times)
    least = CLOSED * orbit.loop.period
    if np.any(stays < -least) or not all(map(orbit.fires_in_direction, range(len(route)))):
        return False
    lasting = [i for i, stretch in enumerate(route) if stays[i] > least and not stretch.within]
    free = [i for i in lasting if not slides(orbit, i)] or [0]
    return all(_goes(orbit, i, after) for i, after in pairwise(_ends_of_runs(orbit, free)))


def _ends_of_runs(orbit: Pass, free: list[int]) -> list[int]:
    """Stretches among some from whose middles runs lead around; at last the first one, a period later."""
    count, scale = len(orbit.flows), orbit.scale
    ends, growing = [free[0]], np.eye(len(scale))
    for begin, end in pairwise([*free, free[0] + count]):
        across = np.eye(len(scale))
        # Where a guard is touched errors grow without bound.
        with np.errstate(all="ignore"):
            for k in range(begin, end):
                across = orbit.maps[k % count] / scale[:, None] * scale @ across
            growing = across @ growing
        if not np.linalg.norm(growing) <= LITTLE_GROWTH:
            if begin != ends[-1]:
                ends.append(begin)
            growing = across
    return [*ends, free[0] + count]


def _goes(orbit: Pass, first: int, last: int) -> bool:
    """Whether a run from the middle of one stretch to that of another takes the transitions in between."""
    family, loop, route = orbit.family, orbit.loop, orbit.family.route
    count = len(route)
    # Where all stretches chatter or stay on a surface, from the begin of one.
    share = 0.0 if route[first].within else 0.5
    begin, x = moment(orbit, first, share)
    end, _ = moment(orbit, last % count, share)
    end += last // count * loop.period
    try:
        arc = simulate(
            family.system,
            x,
            (begin, end),
            mode=route[first].mode,
            parameters=family.all_parameters(loop.values),
            solver=family.solver,
        )
    except ArgumentError:
        # The model has no such parameters, such as a restitution below zero.
        return False
    passed = from_limits(family.system).union(*(stretch.within for stretch in route))
    jumps = [
        _Event(float(jump.t), (jump.transition,), jump.target)
        for jump in with_effect(family.system, arc.jumps)
        if jump.transition not in passed
    ]
    wanted = [
        _Event(
            float(loop.times[i % count + 1] + i // count * loop.period), names, route[(i + 1) % count].mode
        )
        for i in range(first, last)
        if (names := tuple(name for name in route[i % count].fired if name not in passed))
    ]
    least = CLOSED * loop.period
    instants = [_instants(jumps, least), _instants(wanted, least)]
    if not arc.status.ok or len(instants[0]) != len(instants[1]):
        return False
    return all(
        abs(one[0].t - other[0].t) <= SAME_TIME * loop.period and _same(one, other)
        for one, other in zip(*instants, strict=True)
    )


@attrs.frozen
class _Event:
    """Transitions that fire at a time, and the mode after them."""

    t: float
    names: tuple[str, ...]
    mode: str | None


def _instants(events: list[_Event], least: float) -> list[list[_Event]]:
    """The events by instants, which are more than a time apart."""
    groups: list[list[_Event]] = []
    for event in events:
        if groups and event.t - groups[-1][-1].t <= least:
            groups[-1].append(event)
        else:
            groups.append([event])
    return groups


def _same(made: list[_Event], wanted: list[_Event]) -> bool:
    """Whether the jumps of an instant are those wanted.

    Events that meet there may come in any order, then by as many other transitions to the same mode. One that
    rounding has undone, as where a contact opens, is made again.
    """
    names = [[*dict.fromkeys(name for event in events for name in event.names)] for events in (made, wanted)]
    meet = len(wanted) > 1 and len(names[0]) == len(names[1])
    return names[0] == names[1] or (meet and made[-1].mode == wanted[-1].mode)
