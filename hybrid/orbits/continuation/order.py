"""Whether the derivative of an orbit depends on which of two events of one instant comes first.

On neighbouring orbits the events come one after the other. Where each order has its own derivative, the orbit
has no common one: its multipliers are those of one order.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import attrs
import numpy as np

from hybrid.errors import ArgumentError
from hybrid.orbits.continuation.equations import CLOSED
from hybrid.orbits.continuation.passing import Pass
from hybrid.simulation.simulate import simulate
from hybrid.status import Status, StatusCode

# Neighbouring orbits are asked at this share of the shortest stretch before and after the instant.
BESIDE = 1e-5
# Two derivatives are the same if they agree to this share.
SAME = 1e-6


@attrs.frozen(eq=False)
class Meeting:
    """Events that meet at one instant.

    Attributes
    ----------
    names
        Names of the transitions.
    before, after
        The stretches before and after the instant.
    slopes
        Derivatives ``(events, n)`` of the times of the events in the state before the instant.
    map, state
        The derivative ``(n, n)`` across the instant, and the state ``(n,)`` after it.
    """

    names: tuple[str, ...]
    before: int
    after: int
    slopes: np.ndarray
    map: np.ndarray
    state: np.ndarray


def order_status(orbit: Pass) -> Status | None:
    """The status of an orbit without a common derivative; None if it has one or its order is meant."""
    if orbit.family.system.listed_order:
        return None
    for meeting in _meetings(orbit):
        if _order_matters(orbit, meeting):
            names = " and ".join(map(repr, meeting.names[:2]))
            t = orbit.loop.times[meeting.before + 1]
            return Status(
                StatusCode.AMBIGUOUS_ORDER,
                f"The orbit closes. At t = {t:.9g} the guards of {names} are reached together. Each order "
                "has a derivative of its own: the multipliers are those of the order in orbit.transitions.",
                "Runs with tangent= from starts beside the orbit show both derivatives. If the order is "
                "meant, declare HybridSystem(listed_order=True).",
            )
    return None


def _meetings(orbit: Pass) -> Iterator[Meeting]:
    """The instants of an orbit at which more than one guard is reached."""
    count, n, stays = len(orbit.flows), orbit.family.n, np.diff(orbit.loop.times)
    lasting = stays > CLOSED * orbit.loop.period
    for i in range(count):
        if not lasting[i] or orbit.landings[i] is None:
            continue
        names, slopes, product, k = list[str](), list[np.ndarray](), np.eye(n), i
        state = orbit.flows[i].end
        while True:
            landing = orbit.landings[k]
            if landing is None:
                break
            # A guard that is touched has slopes without bound, and so has what comes after it.
            with np.errstate(all="ignore"):
                slopes.append(-landing.gradient[:n] @ product / orbit.speed(k))
                product = orbit.saltations[k] @ product
            names.append(orbit.family.route[k].fired[0])
            state = landing.after
            k = (k + 1) % count
            if lasting[k]:
                break
        for name, slope in _others(orbit, i):
            names.append(name)
            slopes.append(slope)
        if len(names) > 1 and np.all(np.isfinite(slopes)):
            yield Meeting(tuple(names), i, k, np.array(slopes), product, state)


def _others(orbit: Pass, i: int) -> Iterator[tuple[str, np.ndarray]]:
    """Other guards of the mode that are reached at the end of a stretch, with derivatives of the times."""
    family, values, stretch, n = orbit.family, orbit.loop.values, orbit.family.route[i], orbit.family.n
    t, x = float(orbit.loop.times[i + 1]), np.append(orbit.flows[i].end, orbit.flows[i].counters)
    sizes = np.append(np.append(orbit.scale, np.abs(x[n:])), orbit.loop.period)
    for transition in family.system.transitions:
        if transition.source != stretch.end_mode or transition.name in stretch.fired[:1]:
            continue
        if transition.guard.at_start or (transition.target == transition.source and transition.reset is None):
            continue
        height = family.height(transition.name, t, x, values)
        gradient = family.gradient(transition.name, t, x, values)
        if not abs(height) <= CLOSED * float(np.abs(gradient) @ np.append(sizes[:n], sizes[-1])):
            continue
        speed = gradient[:n] @ orbit.flows[i].last_rate + gradient[-1]
        if float(transition.guard.direction or np.sign(speed)) * speed > 0.0:
            yield transition.name, -gradient[:n] / speed


def _order_matters(orbit: Pass, meeting: Meeting) -> bool:
    """Whether some order of the events leads elsewhere, or has another derivative."""
    units, stays = orbit.scale, np.diff(orbit.loop.times)
    near = BESIDE * float(min(stays[meeting.before], stays[meeting.after]))
    for one, other in combinations(meeting.slopes, 2):
        apart = (one - other) * units
        length = float(np.linalg.norm(apart))
        if not length > SAME * float(np.linalg.norm(np.concatenate([one, other]) * np.tile(units, 2))):
            continue
        shift = units * apart / length**2
        shift *= 0.5 / max(1.0, float(np.abs(meeting.slopes @ shift).max()))
        if any(_differs(orbit, meeting, near, sign * shift) for sign in (1.0, -1.0)):
            return True
    return False


def _differs(orbit: Pass, meeting: Meeting, near: float, shift: np.ndarray) -> bool:
    """Whether neighbours that are shifted so much per unit of time have another state or derivative after it.

    What runs at two distances show is extrapolated to none.
    """
    found = [_beside(orbit, meeting, part * near, part * near * shift) for part in (1.0, 0.5)]
    if found[0] is None or found[1] is None:
        return True
    limit = 2.0 * found[1] - found[0]
    units = orbit.scale
    wanted = np.column_stack([meeting.map * units, meeting.state]) / units[:, None]
    limit = np.column_stack([limit[:, :-1] * units, limit[:, -1]]) / units[:, None]
    return not np.all(np.abs(limit - wanted) <= SAME * max(1.0, float(np.abs(wanted).max())))


def _beside(orbit: Pass, meeting: Meeting, near: float, shift: np.ndarray) -> np.ndarray | None:
    """Derivatives and state ``(n, n + 1)`` across the instant of a neighbour; None if it ends elsewhere."""
    family, flow, t = orbit.family, orbit.flows[meeting.before], float(orbit.loop.times[meeting.before + 1])
    x = flow.end - near * flow.last_rate + shift
    try:
        arc = simulate(
            family.system,
            np.append(x, flow.counters),
            (t - near, t + near),
            mode=family.route[meeting.before].end_mode,
            parameters=family.all_parameters(orbit.loop.values),
            solver=family.solver,
            tangent=np.eye(family.n),
        )
    except ArgumentError:
        return None
    if not arc.status.ok or str(arc.mode[-1]) != family.route[meeting.after].mode:
        return None
    assert arc.fundamental is not None
    return np.column_stack([arc.fundamental, arc.x[-1, : family.n]])
