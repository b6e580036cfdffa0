"""The calls behind each picture of a scene, and what the pictures are drawn from."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

import lyapunov
from hybrid.errors import ArgumentError, HybridError
from hybrid.explorer.calls import Call, Written
from hybrid.explorer.scene import BEGIN, JUMPS, PERIOD, Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Job
from hybrid.orbits.continuation.continue_orbit import continue_orbit
from hybrid.orbits.orbit import PeriodicOrbit
from hybrid.orbits.periodic_orbit import periodic_orbit
from hybrid.orbits.sections import Section, poincare_section, stroboscopic_section
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.status import Status, StatusCode
from hybrid.sweep.attractors.basins import basins
from hybrid.system.elements import Guard

# Intervals of the exponents of the scene and of each column of the diagram, and points of a column.
INTERVALS, TRANSIENT = 1000, 200
COLUMN_INTERVALS, COLUMN_TRANSIENT, COLUMN_POINTS = 200, 200, 60
# Columns of the diagram that are computed at once, and sizes of the grids of starts.
AT_ONCE = 4
GRIDS = (24, 96)
# An arc has come back if it is so near, as a share of the distance that it goes away.
NEAR = 0.1


@attrs.frozen(eq=False)
class Points:
    """The section of a scene, where it was taken from a run's jumps or by a section of the library.

    ``values`` gives a component or an output at the points, by its name.
    """

    x: np.ndarray
    mode: np.ndarray
    t_end: float
    x_end: np.ndarray
    mode_end: str | None
    status: Status
    values: Callable[[str], np.ndarray]

    def table(self, names: Sequence[str]) -> np.ndarray:
        """Components and outputs at the points, ``(N, len(names))``."""
        return np.column_stack([self.values(name) for name in names])


@attrs.frozen(eq=False)
class Live:
    """What follows a drag: the section, and an arc."""

    scene: Scene
    points: Points
    arc: HybridArc
    calls: tuple[Call, ...]


def changed(subject: Subject, values: Mapping[str, float]) -> dict[str, float] | None:
    """The parameters that differ from those of the model; None if none does."""
    declared = subject.system.parameters
    return {name: value for name, value in values.items() if value != declared[name]} or None


def start_of(subject: Subject, scene: Scene) -> dict[str, Any]:
    """The keywords that every run of a scene shares."""
    return {"mode": scene.mode or None, "parameters": changed(subject, scene.values)}


def section_call(subject: Subject, scene: Scene) -> Call:
    """The call that takes the section of a scene."""
    shared = start_of(subject, scene)
    system = Written(subject.system, "system")
    if scene.section == PERIOD:
        counts = {"periods": scene.points, "transient": scene.transient}
        return Call("section", stroboscopic_section, (system, scene.x0), {**shared, **counts})
    if scene.section == JUMPS:
        count = scene.points + scene.transient
        end = count * subject.unit_of_time(scene.values)
        return Call(
            "run",
            simulate,
            (system, scene.x0, (0.0, end)),
            {**shared, "samples": [end], "keep_jumps": True, "max_jumps": count},
        )
    counts = {"points": scene.points, "transient": scene.transient}
    return Call(
        "section", poincare_section, (system, scene.x0, surface_of(subject, scene)), {**shared, **counts}
    )


def surface_of(subject: Subject, scene: Scene) -> Written:
    """The guard of a section where a component passes a level upwards."""
    i, level = subject.system.state_names.index(scene.section), scene.level
    text = f"hybrid.Guard(lambda t, x, p: x.{scene.section} - {level!r}, direction=1)"
    return Written(Guard(lambda t, x, p: x[i] - level, direction=1), text)


def points_of(scene: Scene, taken: Section | HybridArc) -> Points:
    """The points of a section, and where the run goes on from."""
    if isinstance(taken, Section):
        if not len(taken):
            return Points(taken.x, taken.mode, 0.0, np.empty(0), None, taken.status, taken.__getitem__)
        end, mode_end = float(taken.t[-1]), str(taken.mode[-1])
        return Points(taken.x, taken.mode, end, taken.x[-1], mode_end, taken.status, taken.__getitem__)
    jumps = taken.jumps
    names = np.array([each.source for each in taken.system.transitions])
    mode = names[jumps.transition_index[scene.transient :]] if len(jumps) else np.empty(0, dtype=str)
    x = jumps.x_minus[scene.transient :]

    def values(name: str) -> np.ndarray:
        return jumps.before(name)[scene.transient :]

    if len(taken.x):
        return Points(x, mode, float(taken.t[-1]), taken.x[-1], str(taken.mode[-1]), taken.status, values)
    if not len(jumps):
        return Points(x, mode, 0.0, np.empty(0), None, taken.status, values)
    last_jump = jumps[-1]
    return Points(x, mode, last_jump.t, last_jump.x_plus, last_jump.target, taken.status, values)


def start_row(subject: Subject, scene: Scene, names: Sequence[str]) -> list[float]:
    """Components and outputs at the start of a scene; nan for outputs where a run cannot start."""
    row = dict(scene.x0)
    if not set(names) <= row.keys():
        x0 = tuple(scene.x0.values())
        try:
            arc = simulate(subject.system, x0, (0.0, 0.0), **start_of(subject, scene))
        except HybridError:
            return [row.get(name, np.nan) for name in names]
        row |= {name: float(arc[name][0]) for name in names if name not in row}
    return [row[name] for name in names]


def arc_call(subject: Subject, scene: Scene, points: Points) -> Call:
    """The call that makes the arc of the portrait, from the start or from the end of the section."""
    system, shared = Written(subject.system, "system"), start_of(subject, scene)
    length = scene.window * subject.unit_of_time(scene.values)
    if scene.part == BEGIN or points.mode_end is None:
        return Call("arc", simulate, (system, scene.x0, (0.0, length)), shared)
    t = points.t_end
    if scene.section != JUMPS:
        x_text, mode_text = "section.x[-1]", "section.mode[-1]"
    elif points.status.code == StatusCode.MAX_JUMPS:
        x_text, mode_text = "run.jumps[-1].x_plus", "run.jumps[-1].target"
    else:
        x_text, mode_text = "run.x[-1]", "run.mode[-1]"
    return Call(
        "arc",
        simulate,
        (system, Written(points.x_end, x_text), (t, t + length)),
        {**shared, "mode": Written(points.mode_end, mode_text)},
    )


def live_job(subject: Subject, scene: Scene, keep: Callable[[Live], None] = lambda live: None) -> Job:
    """Section and arc; ``keep`` gets them in the thread of the worker, for the jobs that follow."""

    def live() -> Live:
        section = section_call(subject, scene)
        points = points_of(scene, section.result())
        arc = arc_call(subject, scene, points)
        found = Live(scene, points, arc.result(), (section, arc))
        keep(found)
        return found

    fields = ("across", "up", "over_time", "over", "low", "high", "columns", "periods")
    return Job("live", _key(scene, without=fields), (live,))


def exponents_job(subject: Subject, scene: Scene) -> Job:
    """The exponents of the scene."""
    call = Call(
        "spectrum",
        lyapunov.lyapunov_spectrum,
        (Written(subject.system, "system"), scene.x0),
        {**start_of(subject, scene), "intervals": INTERVALS, "transient": TRANSIENT},
    )
    return Job("exponents", _key(scene, only=("values", "x0", "mode")), (lambda: (call, call.result()),))


def diagram_call(subject: Subject, scene: Scene) -> Call:
    """The call that makes the bifurcation diagram with the largest exponent below."""
    values = np.linspace(scene.low, scene.high, scene.columns)
    text = f"np.linspace({scene.low!r}, {scene.high!r}, {scene.columns})"
    others = {name: value for name, value in scene.values.items() if name != scene.over}
    known = {PERIOD: None, JUMPS: "jumps"}
    at = known[scene.section] if scene.section in known else surface_of(subject, scene)
    keywords = {
        **start_of(subject, scene.with_(values=others)),
        "intervals": COLUMN_INTERVALS,
        "transient": COLUMN_TRANSIENT,
        "section": COLUMN_POINTS,
        "at": at,
        "outputs": [scene.across] if scene.across in subject.system.outputs else None,
    }
    system = Written(subject.system, "system")
    return Call("diagram", lyapunov.chart, (system, {scene.over: Written(values, text)}, scene.x0), keywords)


def diagram_job(subject: Subject, scene: Scene) -> Job:
    """Columns of the diagram, first a few over the whole range, then those between them."""
    call = diagram_call(subject, scene)
    system, over, x0 = call.arguments
    values = over[scene.over].value

    def some(part: np.ndarray) -> Callable[[], Any]:
        some_call = attrs.evolve(call, arguments=(system, {scene.over: values[part]}, x0))
        return lambda: (scene, some_call.result(progress=False))

    order = coarse_to_fine(scene.columns)
    parts = tuple(some(order[i : i + AT_ONCE]) for i in range(0, len(order), AT_ONCE))
    key = values_key(scene, "columns", "section", "level"), call.keywords["outputs"] and scene.across
    return Job("diagram", key, parts)


def values_key(scene: Scene, *fields: str) -> Hashable:
    """What a picture over the parameter of the diagram depends on: not on the value of that parameter."""
    others = {name: value for name, value in scene.values.items() if name != scene.over}
    return _key(scene.with_(values=others), only=("values", "x0", "mode", "over", "low", "high", *fields))


def coarse_to_fine(count: int) -> np.ndarray:
    """The numbers 0 to ``count - 1``, each next one far from those before."""
    bits = max(1, (count - 1).bit_length())
    turned = [int(f"{i:0{bits}b}"[::-1], 2) for i in range(2**bits)]
    return np.array([each for each in turned if each < count])


def orbit_call(subject: Subject, scene: Scene, live: Live) -> Call:
    """The call that looks for a periodic orbit near the end of the section."""
    system = Written(subject.system, "system")
    shared = start_of(subject, scene)
    points = live.points
    if subject.is_forced:
        x = points.x_end if len(points.x_end) else np.array(list(scene.x0.values()))
        mode = points.mode_end or scene.mode or None
        keywords = {**shared, "mode": mode, "periods": scene.periods}
        if scene.section != PERIOD:
            keywords["t0"] = points.t_end % subject.unit_of_time(scene.values)
        return Call("orbit", periodic_orbit, (system, tuple(map(float, x))), keywords)
    near, at, period = _recurrence(live.arc)
    return Call("orbit", periodic_orbit, (system, near), {**shared, "mode": at, "period": period})


def orbit_job(subject: Subject, scene: Scene, last: Callable[[], Live]) -> Job:
    """The orbit near the end of the section; ``last`` knows the section and the arc."""

    def found() -> Any:
        call = orbit_call(subject, scene, last())
        orbit = call.result()
        return scene, call, orbit, orbit.arc() if orbit.closes else None

    return Job("orbit", (live_job(subject, scene).key, scene.periods), (found,))


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
        raise ArgumentError(
            "Orbit: the arc ends before it can come back. Start elsewhere, or show more of it."
        )
    return tuple(map(float, x)), str(arc.mode[begin]), period


def branch_job(subject: Subject, scene: Scene, last: Callable[[], Live]) -> Job:
    """The branch of the orbit near the end of the section."""

    def followed() -> Any:
        # The orbit that is shown moves on with the parameter, and the branch stays.
        first = attrs.evolve(orbit_call(subject, scene, last()), name="first")
        orbit = first.result()
        if not orbit.closes:
            return (first,), orbit.status, None
        call = Call("branch", continue_orbit, (Written(orbit, "first"), scene.over, (scene.low, scene.high)))
        return (first, call), None, call.result()

    return Job("branch", values_key(scene, "periods"), (followed,))


def basins_call(
    subject: Subject, scene: Scene, across: tuple[float, float], up: tuple[float, float], count: int
) -> Call:
    """The call that paints the basins over the plane of the section."""
    if scene.across == scene.up or not {scene.across, scene.up} <= scene.x0.keys():
        raise ArgumentError("Basins: across and up must be two components of the state; choose another one.")
    over: dict[str, Any] = dict(scene.x0)
    for name, (low, high) in ((scene.across, across), (scene.up, up)):
        text = f"np.linspace({low!r}, {high!r}, {count})"
        over[name] = Written(np.linspace(low, high, count), text)
    # The mode is left to the guards: starts are in all of them.
    parameters = {"parameters": changed(subject, scene.values)}
    return Call("painted", basins, (Written(subject.system, "system"), over), parameters)


def basins_job(subject: Subject, scene: Scene, across: tuple[float, float], up: tuple[float, float]) -> Job:
    """Basins on a coarse grid, then on a fine one."""

    def part(count: int) -> Callable[[], Any]:
        def painted() -> Any:
            call = basins_call(subject, scene, across, up, count)
            return scene, call, call.result(progress=False)

        return painted

    key = (_key(scene, only=("values", "x0", "across", "up")), across, up)
    return Job("basins", key, tuple(map(part, GRIDS)))


def _key(scene: Scene, *, only: tuple[str, ...] = (), without: tuple[str, ...] = ()) -> Hashable:
    """What a picture depends on."""
    names = [each.name for each in attrs.fields(Scene)]
    chosen = [name for name in names if name in only or (not only and name not in without)]
    return tuple((name, _frozen(getattr(scene, name))) for name in chosen)


def _frozen(value: Any) -> Hashable:
    return tuple(value.items()) if isinstance(value, Mapping) else value
