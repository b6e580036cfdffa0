"""Pickling and copying of models; models are immutable, so a copy is the model itself."""

from __future__ import annotations

import io
import pickle
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, Self, TypeVar

import attrs

from hybrid.arguments import shown
from hybrid.errors import ModelError

Made = TypeVar("Made")

# The pickler in C and the one in Python.
PICKLERS = (pickle.Pickler, pickle._Pickler)


class Portable:
    """Base of the model's classes: frozen attrs classes that may hold functions."""

    __slots__ = ()

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        kind: Any = type(self)
        names = [field.name for field in attrs.fields(kind) if field.init]
        return _made_again, (kind, {name: self._stored(name) for name in names})

    def _stored(self, name: str) -> Any:
        value = getattr(self, name)
        if callable(value) and not _can_store(_pickler_at_work(), value):
            own = getattr(self, "name", "")
            owner = f"{type(self).__name__} {own!r}" if own else type(self).__name__
            raise ModelError(
                f"{owner}: {name} cannot be pickled: {shown(value)} cannot be imported by its name. "
                "Define it with def at the top level of a module, or pickle with cloudpickle."
            )
        return value


def made_by(made: Made, function: Callable[..., Any], *arguments: Any) -> Made:
    """The same object, which is pickled as the call that has made it: what a system derives has no name."""
    object.__setattr__(made, "_made_by", (function, *arguments))
    return made


def _made_again(kind: type[Any], fields: dict[str, Any]) -> Any:
    """An object from its fields, validated as usual."""
    return kind(**fields)


def _pickler_at_work() -> type[Any]:
    """Class of the pickler that is calling; ``pickle.Pickler`` itself does not appear on the stack."""
    frame: FrameType | None = sys._getframe()
    while frame is not None:
        caller = frame.f_locals.get("self")
        if isinstance(caller, PICKLERS):
            return type(caller)
        frame = frame.f_back
    return pickle.Pickler


def _can_store(pickler: type[Any], function: Callable[..., Any]) -> bool:
    try:
        pickler(io.BytesIO()).dump(function)
    except Exception:  # each pickler and each callable may raise its own type
        return False
    return True
