"""What the arguments of a system may be: each becomes the form that the system keeps, or is refused."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import attrs

from hybrid import arguments
from hybrid.system.elements import Mode, Transition
from hybrid.system.growth import grows
from hybrid.system.laws import Laws
from hybrid.system.watched import Watched


def as_modes(value: Iterable[Mode]) -> tuple[Mode, ...]:
    """The modes as a tuple."""
    return tuple(arguments.items("HybridSystem: modes", value, "be a list of Mode objects"))


def as_transitions(value: Iterable[Transition]) -> tuple[Transition, ...]:
    """The transitions as a tuple."""
    return tuple(arguments.items("HybridSystem: transitions", value, "be a list of Transition objects"))


def as_under_way(value: Any) -> tuple[str, ...]:
    """Names of components as a tuple."""
    wanted = "be left out: a Delay gives it"
    names = tuple(arguments.items("HybridSystem: under_way", value, wanted))
    if isinstance(value, str) or not all(isinstance(name, str) for name in names):
        raise arguments.refusal("HybridSystem: under_way", wanted, value)
    return names


def as_listed_order(value: object) -> bool:
    """True or False."""
    return arguments.flag("HybridSystem: listed_order", value)


def as_period(value: Any) -> Any:
    """A function of p, a positive number, or None."""
    if value is None or callable(value):
        return value
    return arguments.positive("HybridSystem: period", value, "be a positive time or a function of p")


def as_notes(value: Iterable[str]) -> tuple[str, ...]:
    """Lines of text as a tuple."""
    lines = arguments.items("HybridSystem: notes", value, "be a list of lines of text")
    return tuple(arguments.instance(f"HybridSystem: notes[{i}]", line, str) for i, line in enumerate(lines))


def check_growth(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    """ArgumentError unless it is what makes further modes."""
    if value is not None and not grows(value):
        raise arguments.refusal(
            "HybridSystem: growth", "be left out: split and from_equations give it", value
        )


def check_derived_from(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    """ArgumentError unless it is what was read."""
    if not isinstance(value, Watched):
        raise arguments.refusal(
            "HybridSystem: derived_from", "be left out: split and filippov give it", value
        )


def check_laws(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    """ArgumentError unless these are laws."""
    arguments.instance("HybridSystem: laws", value, Laws, "Write Laws(invariant={...}).")


def check_name(instance: Any, attribute: attrs.Attribute[Any], value: object) -> None:
    """ArgumentError unless it is a text."""
    arguments.instance(f"{type(instance).__name__}: {attribute.name}", value, str)
