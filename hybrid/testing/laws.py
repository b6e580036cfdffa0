"""What the author of a model knows: quantities that stay non-negative, and quantities that never change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.system.elements import Function
from hybrid.system.graph import HybridSystem
from hybrid.system.labels import named
from hybrid.testing.case import Case, as_case, discard

# A value may differ by this share of the sizes of its terms.
TOLERANCE = 1e-7
# The sizes of the terms are told by a relative change of the state this large.
NUDGE = 1e-3


@attrs.frozen
class Law:
    """A function of ``(t, x, p)`` with a name, in one mode or, with None, in all of them."""

    name: str
    mode: str | None
    function: Function

    def holds_in(self, mode: str) -> bool:
        """Whether it says something of a mode."""
        return self.mode in (None, mode)


def as_laws(argument: str, system: HybridSystem, given: object) -> tuple[Law, ...]:
    """The laws of an argument: functions by name, or by mode mappings of names to functions.

    Raises
    ------
    ArgumentError
        If a mode does not exist, or a value is not a function.
    """
    found: list[Law] = []
    for name, value in named(argument, given, "map names to functions of (t, x, p)").items():
        if isinstance(value, Mapping):
            arguments.known(f"{argument}: Mode", name, system.mode_names, "Modes")
            pairs = [
                (each, name, function) for each, function in named(f"{argument}[{name!r}]", value).items()
            ]
        else:
            pairs = [(name, None, value)]
        for each, mode, function in pairs:
            arguments.instance(f"{argument}: a name", each, str)
            if not callable(function):
                raise ArgumentError(
                    f"{argument}: {each!r} must be a function of (t, x, p); got {arguments.shown(function)}."
                )
            found.append(Law(each, mode, function))
    return tuple(found)


def starts_within(laws: tuple[Law, ...], case: Case, mode: str) -> bool:
    """Whether the start of a case, in a mode, is where the laws are non-negative."""
    wanted = [law for law in laws if law.holds_in(mode)]
    return all(float(case.evaluate(law.function, case.t0, case.x0)[0]) >= 0.0 for law in wanted)


def check_invariant(case: Case, law: Law) -> None:
    """A quantity is non-negative on the whole run, before and after each jump.

    It finds a wall that lets the state through: a guard with the wrong sign or direction, a reset that leaves
    the state on the wrong side, a transition that was forgotten.

    Raises
    ------
    PropertyError
        If the quantity is negative by more than rounding.
    """
    places = [place for place in _places(as_case(case)) if law.holds_in(place[1])]
    found = [_value(case, law, t, x) for _, _, t, x in places]
    size = max((size for _, size in found), default=0.0)
    for (where, mode, t, x), (value, _) in zip(places, found, strict=True):
        if value < -TOLERANCE * size:
            case.fail(
                told(law, "non-negative"),
                f"got {value:.8g} {where}, in mode {mode!r} at t = {t:.8g}, {case.state_told(x)}",
                hint="a guard that lets the state through (its sign, its direction, or a transition that is "
                "missing), or a reset that leaves the state on the wrong side.",
            )


def check_conserved(case: Case, law: Law) -> None:
    """A quantity has one value on the whole run, before and after each jump.

    It finds a force with a wrong sign or factor, a component that a reset forgets, and a loss where none is
    meant.

    Raises
    ------
    PropertyError
        If the quantity changes by more than the tolerances explain.
    """
    first: tuple[float, float] | None = None
    for where, mode, t, x in _places(as_case(case)):
        if not law.holds_in(mode):
            first = None
            continue
        value, size = _value(case, law, t, x)
        if first is None:
            first = value, size
        elif abs(value - first[0]) > TOLERANCE * max(size, first[1]):
            case.fail(
                told(law, "conserved"),
                f"got {value:.8g} for {first[0]:.8g} {where}, in mode {mode!r} at t = {t:.8g}, "
                f"{case.state_told(x)}",
                hint=f"the field of mode {mode!r}, if it changed on the way, or the reset of the transition "
                "named: a wrong sign or factor, or a component that is not written.",
            )


def told(law: Law, what: str) -> str:
    """The property in words."""
    return f"{law.name!r} is {what}" + (f" in mode {law.mode!r}" if law.mode else "")


def checks(
    kind: str, laws: tuple[Law, ...], check: Callable[[Case, Law], None]
) -> dict[str, Callable[[Case], None]]:
    """A property for each law, by its words."""
    return {told(law, kind): lambda case, law=law: check(case, law) for law in laws}  # type: ignore[misc]


def _places(case: Case) -> Iterator[tuple[str, str, float, np.ndarray]]:
    """Where a run is looked at: its steps, and both sides of each jump."""
    arc = case.whole
    if arc is None:
        discard("no mode allows the start")
    for t, j, x, mode in zip(arc.t, arc.j, arc.x, arc.mode, strict=True):
        lands = j > 0 and t == arc.jumps.t[j - 1]
        yield f"after {str(arc.jumps.transition[j - 1])!r}" if lands else "on the way", str(mode), float(t), x


def _value(case: Case, law: Law, t: float, x: Any) -> tuple[float, float]:
    """The value of a law, and the size of its terms."""
    value = float(case.evaluate(law.function, t, x)[0])
    size = abs(value)
    for i in range(len(x)):
        aside = np.array(x, dtype=float)
        aside[i] *= 1.0 + NUDGE
        size = max(size, abs(float(case.evaluate(law.function, t, aside)[0]) - value) / NUDGE)
    return value, size
