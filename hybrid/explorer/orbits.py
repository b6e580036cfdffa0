"""The periodic orbit near the end of the section, and its branch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.display.tables import counted
from hybrid.errors import ArgumentError, HybridError
from hybrid.explorer.calls import Call, Written
from hybrid.explorer.pictures import Live, live_job, start_of, values_key
from hybrid.explorer.scene import JUMPS, PERIOD, Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Job
from hybrid.orbits.continuation.continue_orbit import continue_orbit
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.orbits.sections import stroboscopic_section
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.status import StatusCode
from hybrid.system.periodicity import closed_change

# A section repeats if it comes back after no more points than these, to this share of the extent of the arc.
MOST_DOTS, SAME = 16, 1e-4
# The extent of a component that rests, as a share of its size: it changes by rounding.
LEAST_EXTENT = 1e-6
# Points at the end of the section that are looked at: the points before may not have settled yet.
LOOKED_AT = 4 * MOST_DOTS
# Numbers of periods that are tried where the section does not repeat.
TURNS = 4
# An orbit that comes so near to the guess is the one that the section shows, as a share of the arc.
PASSES = 1e-2
# Points of an unforced orbit that are compared with the guess.
POINTS = 2000
# An arc has come back if it is so near, as a share of the distance that it goes away.
NEAR = 0.1
# Part of the period between a point of the section and the guess, which should be no point of the section.
APART = 0.382


@attrs.frozen(eq=False)
class Attempt:
    """A call that looked for an orbit, after a number of periods that it is told by; what it found.

    ``distance`` is that of the orbit from the guess, as a share of the extent of the arc.
    """

    what: str
    call: Call
    orbit: PeriodicOrbit | None = None
    distance: float = np.inf
    problem: str = ""

    @property
    def closes(self) -> bool:
        """Whether there is an orbit."""
        return self.orbit is not None and self.orbit.closes

    @property
    def ended(self) -> str:
        """How the search ended."""
        return self.problem if self.orbit is None else str(self.orbit.status)


@attrs.frozen(eq=False)
class Search:
    """All attempts to find the orbit of a scene, and the one that is taken."""

    why: str
    tried: tuple[Attempt, ...]
    found: Attempt | None

    @property
    def is_complete(self) -> bool:
        """Whether no attempt was interrupted."""
        ends = [each.orbit.status.code for each in self.tried if each.orbit is not None]
        return StatusCode.INTERRUPTED not in ends

    @property
    def told(self) -> str:
        """Which periods were tried, and why these."""
        each = ", ".join(f"{attempt.what} ({self._outcome(attempt)})" for attempt in self.tried)
        return f"{self.why}Tried: {each}."

    def _outcome(self, attempt: Attempt) -> str:
        if attempt is self.found:
            return "this orbit"
        if attempt.closes:
            return "an orbit farther away"
        return "refused" if attempt.orbit is None else attempt.orbit.status.code.name


class Finder:
    """Finds orbits near the last section; it is the memory of the jobs that follow one another."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.last: Live | Exception | None = None
        self.known: tuple[Any, Search] | None = None

    def keep(self, live: Live | Exception) -> None:
        """Take the section and the arc that were computed last, or why there are none."""
        self.last = live

    def near(self, scene: Scene) -> tuple[Call, PeriodicOrbit, str]:
        """The orbit near the end of the section, behind the call that found it, and what was tried.

        Raises
        ------
        HybridError
            If there is none; the text says what was tried.
        """
        search = self._search(scene)
        found = search.found
        if found is None or found.orbit is None:
            raise HybridError(f"no orbit was found near here. {search.told} {search.tried[0].ended}")
        return found.call, found.orbit, search.told

    def _search(self, scene: Scene) -> Search:
        """The search for a scene; one that has found something is not done again."""
        if isinstance(self.last, Exception):
            raise self.last
        assert self.last is not None, "the section comes first"
        key = search_key(self.subject, scene)
        if self.known is not None and self.known[0] == key:
            return self.known[1]
        search = searched(self.subject, scene, self.last)
        if search.found is not None and search.is_complete:
            self.known = key, search
        return search


def search_key(subject: Subject, scene: Scene) -> Any:
    """What the search for an orbit depends on."""
    return live_job(subject, scene).key, scene.periods


def searched(subject: Subject, scene: Scene, live: Live) -> Search:
    """Look for the orbit that the end of the section shows.

    Where the section repeats, the orbit closes after as many periods as the section has dots; fewer periods
    are tried only if it does not. Where it does not repeat, the first orbit that closes is taken.
    """
    size = _size(live.arc.x)
    guesses = _forced if subject.is_forced else _unforced
    dots, calls = guesses(subject, scene, live, size)
    tried: list[Attempt] = []
    for what, call in calls:
        attempt = _attempted(subject, what, call, size)
        tried.append(attempt)
        if CTRL_C.is_set():
            break
        if attempt.closes and (dots is None or attempt.distance < PASSES):
            break
    closing = [each for each in tried if each.closes]
    found = min(closing, key=lambda each: each.distance, default=None)
    return Search("" if scene.periods else _why(dots, subject.is_forced), tuple(tried), found)


def _why(dots: int | None, forced: bool) -> str:
    what, unit = ("run", "forcing period") if forced else ("section", "point")
    if dots is None:
        return f"The {what} does not repeat within {counted(MOST_DOTS, unit)}. "
    return f"The {what} repeats after {counted(dots, unit)}. "


def _size(x: np.ndarray) -> np.ndarray:
    """The extent of each component ``(n,)`` on an arc; one that rests has a small share of what it is."""
    size = np.maximum(np.ptp(x, axis=0), LEAST_EXTENT * np.abs(x).max(axis=0))
    return np.where(size > 0.0, size, 1.0)


def _attempted(subject: Subject, what: str, call: Call, size: np.ndarray) -> Attempt:
    guess = np.asarray(call.arguments[1])
    try:
        orbit = call.result()
        near = orbit.x0[None]
        if orbit.closes and not subject.is_forced:
            # Of an unforced orbit any point may be the nearest one.
            arc = orbit.arc()
            near = arc(np.linspace(arc.t[0], arc.t[-1], POINTS))
    except HybridError as error:
        return Attempt(what, call, problem=str(error))
    away = np.abs(_change(subject, near, guess)) / size[: subject.system.tangent_dimension]
    return Attempt(what, call, orbit, float(away.max(axis=1).min()))


def _change(subject: Subject, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Differences of states, with angles up to whole turns, and without counters."""
    k = subject.system.tangent_dimension
    return closed_change(x[..., :k] - y[..., :k], subject.system.turn_lengths[:k])


def _numbers(scene: Scene, dots: int | None) -> Iterable[int]:
    """Numbers of periods to try, in order: those chosen, or as many as there are dots, then fewer."""
    if scene.periods:
        return (scene.periods,)
    return range(1, TURNS + 1) if dots is None else (dots, *range(1, dots))


def _forced(
    subject: Subject, scene: Scene, live: Live, size: np.ndarray
) -> tuple[int | None, Iterator[tuple[str, Call]]]:
    """Points of a forced run that follow by one period each; calls that begin at the last of them."""
    points, shared, t0 = live.points, start_of(subject, scene), 0.0
    x = points.x_end if len(points.x_end) else np.array(list(scene.x0.values()))
    mode, taken = points.mode_end or scene.mode or None, points.x
    if scene.section != PERIOD:
        t0 = points.t_end % subject.unit_of_time(scene.values)
        section = stroboscopic_section(
            subject.system, x, **{**shared, "mode": mode}, periods=LOOKED_AT, t0=t0
        )
        taken = section.x
        if len(section):
            x, mode = section.x[-1], str(section.mode[-1])
    dots = repeats_after(subject, taken, size)
    system, guess = Written(subject.system, "system"), tuple(map(float, x))
    keywords = {**shared, "mode": mode, "t0": t0 or None}
    return dots, (
        (
            counted(count, "forcing period"),
            Call("orbit", periodic_orbit, (system, guess), {**keywords, "periods": count}),
        )
        for count in _numbers(scene, dots)
    )


def _unforced(
    subject: Subject, scene: Scene, live: Live, size: np.ndarray
) -> tuple[int | None, Iterator[tuple[str, Call]]]:
    """Calls whose guesses of the period are times between points of the section, or the return of the arc."""
    points, shared, system = live.points, start_of(subject, scene), Written(subject.system, "system")
    dots = repeats_after(subject, points.x, size)
    if scene.periods >= len(points.t) > 0:
        raise arguments.refusal(
            "periods of the orbit", f"be below {len(points.t)}, the points of the section", scene.periods
        )
    counts = list(_numbers(scene, dots))
    if not len(points.t) or (dots is None and not scene.periods):
        near, at, period = _recurrence(live.arc)
        call = Call("orbit", periodic_orbit, (system, near), {**shared, "mode": at, "period": period})
        return dots, iter([("the time after which the arc comes back", call)])
    times = points.t[-1] - points.t[-1 - np.array(counts)]
    # Not at a point of the section itself, where the orbit may jump.
    begin = simulate(
        subject.system,
        points.x_end,
        (points.t_end, points.t_end + APART * float(times[0])),
        **{**shared, "mode": points.mode_end},
    )
    guess, keywords = tuple(map(float, begin.x[-1])), {**shared, "mode": str(begin.mode[-1])}
    return dots, (
        (
            f"the time of {counted(count, 'point')}",
            Call("orbit", periodic_orbit, (system, guess), {**keywords, "period": float(time)}),
        )
        for count, time in zip(counts, times, strict=True)
    )


def repeats_after(subject: Subject, x: np.ndarray, size: np.ndarray) -> int | None:
    """After how many points the end of a section ``(N, n)`` repeats: its number of dots; None if it does not.

    ``size (n,)`` is the extent of the arc. Angles are compared up to whole turns, and counters are left out.
    """
    tail, least = x[-LOOKED_AT:], SAME * size[: subject.system.tangent_dimension]
    for dots in range(1, min(MOST_DOTS, len(tail) // 2) + 1):
        if (np.abs(_change(subject, tail[dots:], tail[:-dots])) <= least).all():
            return dots
    return None


def _recurrence(arc: HybridArc) -> tuple[tuple[float, ...], str, float]:
    """A state half way along the arc, its mode, and the time after which the arc comes back near to it.

    It has come back where it is nearest in its first return to a tenth of the distance that it goes away; if
    there is none, where it is nearest after it has gone away.
    """
    begin = int(np.searchsorted(arc.t, arc.t[0] + (arc.t[-1] - arc.t[0]) / 2))
    begin = max(0, min(begin, len(arc.t) - 2))
    x, size = arc.x[begin], np.ptp(arc.x, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    times = np.linspace(arc.t[begin], arc.t[-1], 2000)[1:]
    away = np.linalg.norm((arc(times) - x) / size, axis=1)
    left = int(np.argmax(away > NEAR * away.max()))
    near = away[left:] < NEAR * away.max()
    if near.any():
        back = left + int(np.argmax(near))
        again = away[back:] >= NEAR * away.max()
        nearest = back + int(np.argmin(away[back : back + int(np.argmax(again)) if again.any() else None]))
    else:
        nearest = left + int(np.argmin(away[left:]))
    period = float(times[nearest] - arc.t[begin])
    if not period > 0.0:
        raise ArgumentError("the arc ends before it can come back. Start elsewhere, or show more of it.")
    return tuple(map(float, x)), str(arc.mode[begin]), period


def orbit_job(finder: Finder, scene: Scene) -> Job:
    """The orbit near the end of the section."""

    def found() -> Any:
        call, orbit, told = finder.near(scene)
        return scene, call, orbit, orbit.arc(), told

    return Job("orbit", search_key(finder.subject, scene), (found,))


def points_of_orbit(
    subject: Subject, scene: Scene, orbit: PeriodicOrbit, arc: HybridArc, names: Sequence[str]
) -> np.ndarray:
    """Components and outputs where an orbit meets the section of a scene, ``(N, len(names))``."""
    if scene.section == PERIOD:
        period = subject.unit_of_time(scene.values)
        # The arc begins at some phase and lasts a whole number of periods.
        times = period * (np.ceil(arc.t[0] / period) + np.arange(orbit.forcing_periods))
        return np.column_stack([arc(np.minimum(times, arc.t[-1]), name) for name in names])
    if scene.section == JUMPS:
        return np.column_stack([arc.jumps.before(name) for name in names])
    value = arc[scene.section] - scene.level
    # The solver's own points before and after the crossing are near enough for a mark.
    rows = np.flatnonzero((value[:-1] < 0.0) & (value[1:] >= 0.0) & (np.diff(arc.j) == 0))
    return np.column_stack([arc[name][rows] for name in names])


def branch_job(finder: Finder, scene: Scene) -> Job:
    """The branch of the orbit near the end of the section, over the parameter of the diagram.

    The orbit that is shown moves on with that parameter, and the branch stays. Where there was no orbit to
    follow, the branch is tried again with each orbit that is looked for.
    """

    def followed() -> Any:
        found, orbit, _ = finder.near(scene)
        first = attrs.evolve(found, name="first")
        call = Call("branch", continue_orbit, (Written(orbit, "first"), scene.over, (scene.low, scene.high)))
        branch = call.result()
        if len(branch) < 2:
            raise HybridError(f"no other orbit was found than the one that it begins with. {branch.status}")
        return (first, call), branch

    return Job("branch", values_key(scene, "periods"), (followed,), attempt=search_key(finder.subject, scene))
