"""The calls behind each picture of a scene, and what the pictures are drawn from."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

import lyapunov
from hybrid.errors import HybridError
from hybrid.explorer.calls import Call, Written
from hybrid.explorer.scene import BEGIN, JUMPS, PERIOD, Scene
from hybrid.explorer.subject import Subject
from hybrid.explorer.worker import Job
from hybrid.orbits.sections import Section, poincare_section, stroboscopic_section
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.simulate import simulate
from hybrid.status import Status, StatusCode
from hybrid.system.elements import Guard

# Intervals of the exponents of the scene.
INTERVALS, TRANSIENT = 1000, 200


# Time, state and mode at the end of a section, and of one without points.
Place = tuple[float, np.ndarray, str | None]
NOWHERE: Place = (0.0, np.empty(0), None)


@attrs.frozen(eq=False)
class Points:
    """The section of a scene, where it was taken from a run's jumps or by a section of the library.

    ``values`` gives a component or an output at the points, by its name.
    """

    t: np.ndarray
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
        t, x, mode = taken.t, taken.x, taken.mode
        end: Place = (float(t[-1]), x[-1], str(mode[-1])) if len(taken) else NOWHERE
        return Points(t, x, mode, *end, taken.status, taken.__getitem__)
    jumps, before = taken.jumps, scene.transient
    names = np.array([each.source for each in taken.system.transitions])
    mode = names[jumps.transition_index[before:]] if len(jumps) else np.empty(0, dtype=str)
    if len(taken.x):
        end = float(taken.t[-1]), taken.x[-1], str(taken.mode[-1])
    else:
        last = jumps[-1] if len(jumps) else None
        end = NOWHERE if last is None else (last.t, last.x_plus, last.target)

    def values(name: str) -> np.ndarray:
        return jumps.before(name)[before:]

    return Points(jumps.t[before:], jumps.x_minus[before:], mode, *end, taken.status, values)


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


def live_job(
    subject: Subject, scene: Scene, keep: Callable[[Live | Exception], None] = lambda found: None
) -> Job:
    """Section and arc; ``keep`` gets them, or the error, in the thread of the worker, for what follows."""

    def live() -> Live:
        try:
            section = section_call(subject, scene)
            points = points_of(scene, section.result())
            arc = arc_call(subject, scene, points)
            found = Live(scene, points, arc.result(), (section, arc))
        except Exception as error:
            keep(error)
            raise
        keep(found)
        return found

    fields = ("across", "up", "over_time", "over", "low", "high", "columns", "periods")
    return Job("live", key_of(scene, without=fields), (live,))


def exponents_job(subject: Subject, scene: Scene) -> Job:
    """The exponents of the scene."""
    call = Call(
        "spectrum",
        lyapunov.lyapunov_spectrum,
        (Written(subject.system, "system"), scene.x0),
        {**start_of(subject, scene), "intervals": INTERVALS, "transient": TRANSIENT},
    )
    return Job("exponents", key_of(scene, only=("values", "x0", "mode")), (lambda: (call, call.result()),))


def values_key(scene: Scene, *fields: str) -> Hashable:
    """What a picture over the parameter of the diagram depends on: not on the value of that parameter."""
    others = {name: value for name, value in scene.values.items() if name != scene.over}
    return key_of(scene.with_(values=others), only=("values", "x0", "mode", "over", "low", "high", *fields))


def key_of(scene: Scene, *, only: tuple[str, ...] = (), without: tuple[str, ...] = ()) -> Hashable:
    """What a picture depends on."""
    names = [each.name for each in attrs.fields(Scene)]
    chosen = [name for name in names if name in only or (not only and name not in without)]
    return tuple((name, _frozen(getattr(scene, name))) for name in chosen)


def _frozen(value: Any) -> Hashable:
    return tuple(value.items()) if isinstance(value, Mapping) else value
