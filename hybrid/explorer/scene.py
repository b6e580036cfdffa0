"""The state of a page: everything that decides its pictures, as values that an address can hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any

import attrs

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.explorer.subject import Subject

# Where the section is taken; any component of the state may stand there too.
PERIOD, JUMPS = "once per period", "at each jump"
# Which part of a run the portrait shows.
SETTLED, BEGIN = "after the section", "from the start"
# What a page is asked for should be drawn in a moment.
MOST_POINTS, MOST_UNITS, MOST_VALUES = 100_000, 1000.0, 3000


@attrs.frozen(eq=False)
class Scene:
    """What a page shows.

    Attributes
    ----------
    values, x0, mode
        Parameters, start by component, and the mode there (empty: the mode that the start allows).
    across, up
        Components or outputs of the portrait and of the section.
    over_time
        Component or output of the time series.
    section, level
        ``"once per period"``, ``"at each jump"``, or the component that passes the level upwards.
    points, transient
        Points of the section, and points before them.
    part, window
        Part of the run that the portrait shows, and its length in forcing periods or typical times.
    over, low, high, columns
        Parameter of the diagram, its ends, and the number of values.
    periods
        Forcing periods of the orbit that is looked for, or points of the section of an unforced system; 0:
        as many as the section has dots.
    """

    values: Mapping[str, float]
    x0: Mapping[str, float]
    mode: str
    across: str
    up: str
    over_time: str
    section: str
    part: str
    over: str
    low: float
    high: float
    level: float = 0.0
    points: int = 2000
    transient: int = 200
    window: float = 10.0
    columns: int = 300
    periods: int = 0

    def with_(self, **changed: Any) -> Scene:
        """The scene with other values."""
        return attrs.evolve(self, **changed)


def first_scene(subject: Subject) -> Scene:
    """What a page shows when it opens."""
    names, parameters = subject.system.own_names, list(subject.values)
    forced = subject.is_forced
    # Of a forced system the second half of the state is usually the speeds.
    second = names[len(names) // 2] if len(names) > 1 else names[0]
    over = parameters[0] if parameters else ""
    for name in parameters:
        if forced and subject.unit_of_time({**subject.values, name: _moved(subject, name)}) != (
            subject.unit_of_time(subject.values)
        ):
            over = name
    low, high = subject.ranges.get(over, (0.0, 1.0))
    return Scene(
        values=dict(subject.values),
        x0=dict(subject.x0),
        mode=subject.mode or "",
        across=names[0],
        up=second,
        over_time=names[0],
        section=PERIOD if forced else (JUMPS if subject.system.transitions else names[0]),
        part=SETTLED if forced else BEGIN,
        transient=200 if forced else 0,
        window=10.0 if forced else 100.0,
        over=over,
        low=low,
        high=high,
    )


def over_parameter(subject: Subject, scene: Scene, name: str) -> Scene:
    """The scene with the diagram over a parameter, from end to end of its slider."""
    low, high = subject.ranges.get(name, (0.0, 1.0))
    return scene.with_(over=name, low=low, high=high)


def _moved(subject: Subject, name: str) -> float:
    low, high = subject.ranges[name]
    return 0.75 * high + 0.25 * low


# What the text of a value must be: of a part of an address, or of what is typed.
Check = Callable[[str, str], Any]


def to_query(subject: Subject, scene: Scene) -> dict[str, str]:
    """The parts of an address that lead back to a scene: what differs from the first one."""
    opened = first_scene(subject)
    first = over_parameter(subject, opened, scene.over)
    query = {f"p.{name}": repr(value) for name, value in scene.values.items() if value != first.values[name]}
    query |= {f"x.{name}": repr(value) for name, value in scene.x0.items() if value != first.x0[name]}
    for field in attrs.fields(Scene):
        value = getattr(scene, field.name)
        # The ends of the diagram are compared with those of its parameter, which is told where it is another.
        known = opened.over if field.name == "over" else getattr(first, field.name)
        if field.name not in ("values", "x0") and value != known:
            query[field.name] = value if isinstance(value, str) else repr(value)
    return query


def from_query(subject: Subject, query: Mapping[str, str]) -> tuple[Scene, list[str]]:
    """The scene of an address, and what in it was not understood. Nothing in it is evaluated."""
    scene, refused = first_scene(subject), []
    checks = checks_of(subject)
    # The parameter of the diagram decides its ends, unless they are given too.
    for name, text in sorted(query.items(), key=lambda part: part[0] != "over"):
        try:
            if name[:2] == "p.":
                arguments.known("Parameter", name[2:], subject.values, "Parameters")
                scene = scene.with_(values={**scene.values, name[2:]: _number(name, text)})
            elif name[:2] == "x.":
                arguments.known("Component", name[2:], scene.x0, "State components")
                scene = scene.with_(x0={**scene.x0, name[2:]: _number(name, text)})
            else:
                check = checks[arguments.known("Part", name, checks, "Parts")]
                value = check(name, text)
                if name == "over":
                    scene = over_parameter(subject, scene, value)
                else:
                    scene = scene.with_(**{name: value})
        except ArgumentError as error:
            refused.append(f"Address: {error}")
    if not scene.low < scene.high:
        refused.append(f"Address: low must be below high; got {scene.low} and {scene.high}.")
        scene = over_parameter(subject, scene, scene.over)
    return scene, refused


def checks_of(subject: Subject) -> dict[str, Check]:
    """How the text of each value is read, in an address and on the page: both have the same limits."""
    component = _one_of(subject.system.quantity_names)
    return {
        "mode": _one_of(("", *dict.fromkeys(each.part_of or each.name for each in subject.system.modes))),
        "across": component,
        "up": component,
        "over_time": component,
        "section": _one_of(section_names(subject)),
        "part": _one_of((SETTLED, BEGIN)),
        "over": _one_of(tuple(subject.values)),
        "low": _number,
        "high": _number,
        "level": _number,
        "points": _count(1, MOST_POINTS),
        "transient": _count(0, MOST_POINTS),
        "window": _up_to(MOST_UNITS),
        "columns": _count(2, MOST_VALUES),
        "periods": _count(0, 1000),
    }


def section_names(subject: Subject) -> tuple[str, ...]:
    """Where a section of the system can be taken."""
    period = (PERIOD,) if subject.is_forced else ()
    jumps = (JUMPS,) if subject.system.transitions else ()
    return (*period, *jumps, *subject.system.own_names)


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise arguments.refusal(name, "be a finite number", text)
    return value


def _one_of(allowed: tuple[str, ...]) -> Check:
    return lambda name, text: arguments.known(name, text, allowed, "Allowed")


def _count(least: int, most: int) -> Check:
    def check(name: str, text: str) -> int:
        if not (text.isdecimal() and text.isascii() and least <= int(text[:18]) <= most):
            raise arguments.refusal(name, f"be a whole number from {least} to {most}", text)
        return int(text)

    return check


def _up_to(most: float) -> Check:
    def check(name: str, text: str) -> float:
        value = _number(name, text)
        if not 0.0 < value <= most:
            raise arguments.refusal(name, f"be above 0 and at most {most:g}", text)
        return value

    return check
