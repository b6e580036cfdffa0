"""Errors that say what is wrong, which part, what was given, what is allowed and what to do."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class HybridError(Exception):
    """Base of every error this library raises on purpose."""


class ModelError(HybridError, ValueError):
    """A model, or what a call asks of it, does not make sense; the text says how to mend it."""


class ArgumentError(ModelError):
    """An argument of a call is out of range or of the wrong shape for the model it is used with."""


def unknown_name(what: str, name: object, allowed: Iterable[str], kind: str) -> str:
    """Text for a name that does not exist: lists those that do and the nearest of them.

    ``what`` opens the sentence (``"Transition 'impact': target mode"``), ``kind`` heads the list.
    """
    known = list(allowed)
    text = f"{what} {name!r} does not exist. {kind}: {', '.join(known) if known else '(none)'}."
    close = difflib.get_close_matches(str(name), known, n=1)
    return f"{text} Did you mean {close[0]!r}?" if close else text
