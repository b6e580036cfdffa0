"""Labels of axes: the names of components, outputs and parameters, or what a caller says for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import attrs

from hybrid import arguments
from hybrid.display.tables import with_unit
from hybrid.errors import ArgumentError


@attrs.define
class Labels:
    """What a caller says for names, and the names that pictures have asked for."""

    given: Mapping[str, str]
    outer: Labels | None
    asked: dict[str, None] = attrs.field(factory=dict)

    def check(self) -> None:
        """Raise an ArgumentError if a name was on no axis of the picture."""
        for name in self.given:
            if name in self.asked:
                continue
            there = (
                f"Names on its axes: {', '.join(self.asked)}." if self.asked else "Its axes have no names."
            )
            raise ArgumentError(f"labels: {arguments.shown(name)} is on no axis of this picture. {there}")


_labels: ContextVar[Labels | None] = ContextVar("labels", default=None)


def is_text(value: object) -> bool:
    """Whether a value is a text that can be drawn."""
    return isinstance(value, str) and value.replace("\n", "").isprintable()


def as_labels(value: object) -> dict[str, str]:
    """A mapping of names to texts."""
    wanted = "map names to texts of printable letters"
    found: dict[Any, Any] = arguments.mapping("labels", value, wanted)
    if not all(isinstance(name, str) and is_text(said) for name, said in found.items()):
        raise arguments.refusal("labels", wanted, value)
    return found


@contextmanager
def labelled(given: Mapping[str, str]) -> Iterator[Labels]:
    """Pictures that are drawn within have these labels."""
    record = Labels(given, _labels.get())
    token = _labels.set(record)
    try:
        yield record
    finally:
        _labels.reset(token)


def label_of(name: str, unit: str | None = None) -> str:
    """The label of an axis: the name, or what stands for it, with the unit."""
    said, record = None, _labels.get()
    while record is not None:
        record.asked[name] = None
        # The innermost label counts.
        if said is None:
            said = record.given.get(name)
        record = record.outer
    return with_unit(name if said is None else said, unit)
