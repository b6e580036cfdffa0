"""One start of one random system, solved by the reference and by its split."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from benchmarks.piecewise_affine.families import Family
from hybrid import ArgumentError, StatusCode, Taylor, simulate
from tests.reference.piecewise_affine import Mode, System, solve

SPAN = 4.0
# Orbits end this much before a place that the reference calls undecided, where both are compared.
BEFORE = 1e-6
# Events closer than this count as one.
TOGETHER = 1e-9
# Differences above this count as disagreements.
TOLERANCE = 1e-7
SOLVER = Taylor(rtol=1e-12, atol=1e-14)
SAMPLES = np.linspace(0.0, SPAN, 9)


@attrs.frozen
class Outcome:
    """What a comparison found.

    Attributes
    ----------
    status
        How the reference ended.
    ended
        How the split ended.
    events, sliding
        Events compared, and how many of the modes compared slide on one, two and more surfaces.
    difference
        What differs first; empty if nothing does.
    times, states
        The largest differences of times of events and of states.
    """

    status: str
    ended: StatusCode
    events: int
    sliding: tuple[int, int, int]
    difference: str
    times: float
    states: float


def start_of(rng: np.random.Generator, system: System) -> np.ndarray:
    """A start near the origin of the original coordinates; one in eight lies on a surface."""
    n = system.normals.shape[1]
    x = rng.normal(size=n)
    if rng.random() < 0.125:
        k = rng.integers(len(system.normals))
        normal = system.normals[k]
        x += normal * (system.offsets[k] - normal @ x) / (normal @ normal)
        # In the coordinates of the family the surface is met exactly.
        if np.count_nonzero(normal) == 1:
            x[np.flatnonzero(normal)[0]] = system.offsets[k]
    return x


def path_of(family: Family, arc: Any) -> tuple[list[float], list[Mode]]:
    """Times of the events of an arc and the sides between them; jumps at one instant are one event."""
    system = arc.system
    names = {transition.name: transition for transition in system.transitions}
    sides = {name: family.sides(name, system.notes) for name in system.mode_names}
    times: list[float] = []
    modes: list[Mode] = []
    first = None
    for t, name in zip(arc.jumps.t, arc.jumps.transition, strict=True):
        transition = names[str(name)]
        first = first or transition.source
        target = sides[transition.target or transition.source]
        if not times and t - arc.t[0] < TOGETHER:
            first = transition.target or transition.source
            continue
        if times and t - times[-1] < TOGETHER:
            modes[-1] = target
        else:
            times.append(float(t))
            modes.append(target)
    start = sides[first or str(arc.mode[0])]
    return times, [start, *modes]


def compare(family: Family, system: System, x0: np.ndarray) -> Outcome:
    """Solve with both and compare up to where the reference decides."""
    reference = solve(system, x0, SPAN, SAMPLES)
    try:
        arc = simulate(family.system, x0, (0.0, SPAN), parameters=family.parameters(system), solver=SOLVER)
    except ArgumentError as error:
        if "in more than one mode" not in str(error):
            raise
        difference = "" if not reference.modes else f"refuses the start, not {reference.modes[0]}"
        return Outcome(reference.status, StatusCode.NOT_RUN, 0, (0, 0, 0), difference, 0.0, 0.0)
    end = SPAN if reference.status == "ended" else reference.t - BEFORE
    expected = [t for t in reference.times if t < end]
    modes = reference.modes[: len(expected) + 1]
    times, path = path_of(family, arc)
    found = [t for t in times if t < end]
    path = path[: len(found) + 1]
    sliding = [mode.count(0) for mode in modes]
    counts = sliding.count(1), sliding.count(2), sum(each > 2 for each in sliding)

    def outcome(difference: str, late: float = 0.0, apart: float = 0.0) -> Outcome:
        return Outcome(reference.status, arc.status.code, len(expected), counts, difference, late, apart)

    if not modes:
        return outcome("")
    if not (_same(path[0], modes[0])):
        return outcome(f"starts in {path[0]}, not {modes[0]}")
    for t, mode, s, other in zip(expected, modes[1:], found, path[1:], strict=False):
        if abs(t - s) > TOLERANCE:
            return outcome(f"event at {s:.9f}, not {t:.9f}")
        if not _same(other, mode):
            return outcome(f"goes on in {other}, not {mode}, at {t:.9f}")
    if len(expected) != len(found):
        return outcome(f"{len(found)} events, not {len(expected)}")
    reached = float(arc.t[-1])
    if reached < end - TOLERANCE:
        return outcome(f"ends at {reached:.9f}, not {end:.9f}")
    late = max((abs(t - s) for t, s in zip(expected, found, strict=True)), default=0.0)
    apart = 0.0
    for t, x in zip(SAMPLES, reference.states, strict=True):
        if t < end and np.isfinite(x).all():
            apart = max(apart, float(np.abs(arc(t) - x).max()))
    return outcome("" if apart <= TOLERANCE else f"states differ by {apart:.1e}", late, apart)


def _same(mode: Mode, other: Mode) -> bool:
    """Whether two modes have the same sides; a cell without a side of a surface extends across it."""
    return all(one is None or one == two for one, two in zip(mode, other, strict=True))
