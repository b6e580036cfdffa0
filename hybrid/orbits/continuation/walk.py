"""Pseudo-arclength steps along a branch of orbits, and what happens between two of them."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import numpy as np

from hybrid.orbits.continuation.change import Change, located
from hybrid.orbits.continuation.event import Event
from hybrid.orbits.continuation.family import ROUNDING
from hybrid.orbits.continuation.hopf import hopf_end
from hybrid.orbits.continuation.instants import SAME, halves, passes_by
from hybrid.orbits.continuation.monitors import Monitors
from hybrid.orbits.continuation.place import (
    SHORTEST_STEP,
    Place,
    at_value,
    distance,
    interpolated_zero,
    refined,
    zero_between,
)
from hybrid.orbits.continuation.real import is_real
from hybrid.orbits.continuation.route import Route
from hybrid.orbits.continuation.smooth import TESTS, branch_point, changes, told
from hybrid.simulation.simulate import simulate

# Lengths of steps along the branch, in units of the sizes of the orbit and of the range of the parameter.
FIRST_STEP = 0.01
LONGEST_STEP = 0.05
# A step is lengthened after few corrections, but not after one that was too long.
FEW_CORRECTIONS = 3
LONGER = 1.5
# An orbit that is larger than the first one by this factor, the square root of rounding, grows without bound.
UNBOUNDED = 2.0**26
# Along the last part of a walk, of this length, the parameter stands still if it changes by this share of its
# range. The period grows without bound, or becomes zero, if it changes by this factor there.
LAST_PART = 0.1
STILL = 1e-8
GROWN = 1.05
# Another branch crosses near a place where the equations are this near to singular; a step that ends there is
# taken longer.
CROSSED = 3e-3
OVER = 1.5
# How far ahead of a place where no orbit is found the system is asked what it does.
AHEAD = 1e-4
# A change of the route this near to the one before, in the range of the parameter, is the same one.
SAME_CHANGE = 1e-7
# What is this near to a change, as a share of the step to it, belongs to the change.
SHY = 1e-3


def walk(
    place: Place, low: float, high: float, most: int, monitors: Monitors
) -> Iterator[Place | Event | str]:
    """Places along a branch with the events between them; the last item is why it ends."""
    monitors.start(place)
    length, start, passed = FIRST_STEP, place, list[tuple[tuple[Route, ...], float]]()
    trace: list[tuple[float, float, float]] = []
    shortened = False
    for _ in range(most):
        made = place.step(np.array([length]))
        if made is None:
            length, shortened = length / 2.0, True
            if length < SHORTEST_STEP:
                yield "chatter" if _chatter_ends(place) else "lost"
                return
            continue
        if _is_crossed(made[0]) and not _is_crossed(place):
            # So near to another branch that it may be on that one: the step goes over the place.
            made = place.step(np.array([OVER * length])) or made
        after, corrections = made
        real = is_real(after.orbit)
        change = None if real else located(place, after)
        if change is None and not real:
            yield "lost"
            return
        last = after if change is None else change.place
        if last.orbit.is_point or _turned(place, last):
            end = hopf_end(place)
            if end is not None and low <= end.value <= high:
                yield Event("Hopf", end, "the orbits shrink to an equilibrium: this branch begins here")
                yield end
            yield "equilibrium"
            return
        if _comes_to_its_half(place, last):
            yield from _to_its_half(place, last, low, high, monitors)
            yield "flip"
            return
        if not low <= last.value <= high:
            yield from _to_the_edge(place, last, low, high, monitors)
            yield "range"
            return
        if change is not None:
            onward = yield from _past(change, place, (low, high), monitors, passed)
            if isinstance(onward, str):
                yield onward
                return
            place, length = onward, min(length, FIRST_STEP)
            yield place
            continue
        share = None if place is start else passes_by(start, place, after)
        closing = None if share is None else place.step(np.array([share * length]))
        if closing is not None:
            yield from _between(place, closing[0], monitors)
            yield start
            yield "closed"
            return
        yield from _between(place, after, monitors)
        yield after
        if np.any(after.orbit.scale > UNBOUNDED * start.orbit.scale):
            yield "infinity"
            return
        trace.append((distance(place, after), after.value, after.orbit.loop.period))
        why = _stands_still(trace, after)
        if why:
            yield why
            return
        if corrections <= FEW_CORRECTIONS and not shortened:
            length = min(LONGEST_STEP, LONGER * length)
        shortened = False
        place = refined(after)
    yield "most"


def _past(
    change: Change,
    place: Place,
    span: tuple[float, float],
    monitors: Monitors,
    passed: list[tuple[tuple[Route, ...], float]],
) -> Generator[Place | Event, None, Place | str]:
    """What is met from a place to a change of the route; returns the orbit beyond, or why the walk ends.

    The changes that have been ``passed`` are listed; a walk does not go on past one of them again.
    """
    (low, high), last, beyond = span, change.place, change.onward.place
    near = SAME_CHANGE * float(place.sizes[0])
    yield from _up_to(place, last, monitors)
    met = (change.routes, last.value)
    again = any(routes == met[0] and abs(value - met[1]) < near for routes, value in passed)
    if not again and change.alters:
        yield Event(change.kind, last, change.told, change)
    if beyond is None or again:
        return change.kind
    if not low <= beyond.value <= high:
        edge = at_value(beyond, low if beyond.value < low else high)
        if edge is not None and is_real(edge.orbit):
            yield from monitors.between(last, edge)
            yield edge
        return "range"
    passed.append(met)
    yield from monitors.between(last, beyond)
    return beyond


def _stands_still(trace: list[tuple[float, float, float]], place: Place) -> str:
    """Why a branch ends along whose last part the parameter stands still; empty if it does not.

    The trace has the length of each step, with the parameter and the period after it.
    """
    while sum(length for length, *_ in trace[1:]) > LAST_PART:
        trace.pop(0)
    lengths, values, periods = np.array(trace).T
    if lengths.sum() < LAST_PART or np.ptp(values) > STILL * float(place.sizes[0]):
        return ""
    if place.family.forced or periods[0] <= GROWN * periods[-1] <= GROWN**2 * periods[0]:
        return "family"
    return "homoclinic" if periods[-1] > periods[0] else "instant"


def _chatter_ends(place: Place) -> bool:
    """Whether jumps accumulate on the orbit, and no more on a run a little farther on."""
    if not any(stretch.within for stretch in place.family.route):
        return False
    loop = place.orbit.loop.plus(AHEAD * place.units * place.tangents[0])
    arc = simulate(
        place.family.system,
        place.orbit.whole(0, loop.x[0]),
        (float(loop.times[0]), float(loop.times[-1])),
        mode=place.family.route[0].mode,
        parameters=place.family.all_parameters(loop.values),
        solver=place.family.solver,
    )
    return "limit" not in {jump.kind for jump in arc.jumps}


def _is_crossed(place: Place) -> bool:
    """Whether another branch crosses here, to a few digits."""
    return abs(branch_point(place)) < CROSSED


def _to_the_edge(
    place: Place, after: Place, low: float, high: float, monitors: Monitors
) -> Iterator[Place | Event]:
    edge = low if after.value < low else high
    last = at_value(zero_between(place, after, lambda each: each.value - edge) or place, edge)
    if last is not None:
        yield from _between(place, last, monitors)
        yield last


def _up_to(place: Place, last: Place, monitors: Monitors) -> list[Event]:
    """What is met between a place and a change of the route, in order.

    At the change a guard may have no speed, and the tests mean nothing: smooth bifurcations are looked for up
    to just before it. Where the parameter stands still there, that is no fold.
    """
    reach, slope = distance(place, last), abs(float(place.tangents[0, -1]))
    away = min(SAME_CHANGE / max(slope, ROUNDING), SHY * reach)
    made = place.towards(last).step(np.array([reach - away]))
    near = SAME_CHANGE * float(place.sizes[0])
    smooth = _smooth(place, last if made is None else made[0])
    found = [each for each in smooth if abs(each.place.value - last.value) > near]
    return _in_order(place, [*found, *monitors.between(place, last)])


def _between(place: Place, after: Place, monitors: Monitors) -> list[Event]:
    """The smooth bifurcations between two places and the zeros of other functions, in order."""
    return _in_order(place, [*_smooth(place, after), *monitors.between(place, after)])


def _in_order(place: Place, events: list[Event]) -> list[Event]:
    return sorted(events, key=lambda each: distance(place, each.place))


def _smooth(place: Place, after: Place) -> Iterator[Event]:
    """The smooth bifurcations between two places."""
    changed = [kind for kind, function in TESTS.items() if changes(function(place), function(after))]
    if "branch point" in changed and "fold" in changed:
        # A branch that crosses another one at its turn, as the arms of a pitchfork do.
        changed.remove("fold")
    for kind in changed:
        found = zero_between(place, after, TESTS[kind])
        if found is None:
            # The equations are singular there.
            found = interpolated_zero(place, TESTS[kind], (0.0, distance(place, after)))
        if found is not None and kind == "fold" and not _is_extreme(place, found, after):
            continue
        message = "" if found is None else told(kind, found)
        if found is not None and message:
            yield Event(kind, found, message)


def _is_extreme(place: Place, found: Place, after: Place) -> bool:
    """Whether the parameter has turned back at a place between two."""
    return (found.value - place.value) * (found.value - after.value) > 0.0


def _turned(place: Place, after: Place) -> bool:
    """Whether an autonomous orbit without jumps has passed a point: its field goes the other way."""
    if place.family.forced or len(place.family.route) > 1 or place.family.route[0].fired:
        return False
    rates = [each.orbit.flows[0].first_rate / place.orbit.scale for each in (place, after)]
    return bool(rates[0] @ rates[1] < 0.0)


def _comes_to_its_half(place: Place, after: Place) -> bool:
    """Whether an orbit becomes one of half the period, or a step ends on the branch of these."""
    here, there = halves(place.orbit), halves(after.orbit)
    if here is None or there is None or np.linalg.norm(here) <= SAME:
        return False
    return bool(here @ there < 0.0 or np.linalg.norm(there) <= SAME)


def _to_its_half(place: Place, after: Place, low: float, high: float, monitors: Monitors) -> Iterator[Event]:
    """What is met up to where the orbit becomes one of half the period."""
    half = _halved(place, after)
    if half is not None and low <= half.value <= high:
        yield from monitors.between(place, half)
        yield Event("flip", half, "the orbit has half the period: this branch begins here")


def _halved(place: Place, after: Place) -> Place | None:
    """The place near two where the orbit becomes one of half the period."""
    here = halves(place.orbit)
    assert here is not None

    def along(each: Place) -> float:
        found = halves(each.orbit)
        return 0.0 if found is None else float(here @ found)

    reach = distance(place, after)
    return interpolated_zero(place, along, (0.0, reach)) or interpolated_zero(
        place, along, (0.0, 2.0 * reach)
    )
