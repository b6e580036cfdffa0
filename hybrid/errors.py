"""Errors of the library; a text names the part, what is wrong, what is allowed and the next step."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class HybridError(Exception):
    """Base of every error this library raises on purpose."""


class ModelError(HybridError, ValueError):
    """A model, or a call that uses it, is invalid; the text says how to fix it."""


class ArgumentError(ModelError):
    """An argument of a call is out of range or of the wrong shape for the model it is used with."""


def unknown_name(what: str, name: object, allowed: Iterable[str], kind: str) -> str:
    """Error text for an unknown name: lists the existing names and suggests the closest one.

    ``what`` opens the sentence (``"Transition 'impact': target mode"``), ``kind`` heads the list.
    """
    known = list(allowed)
    text = f"{what} {name!r} does not exist. {kind}: {', '.join(known) if known else '(none)'}."
    close = difflib.get_close_matches(str(name), known, n=1)
    return f"{text} Did you mean {close[0]!r}?" if close else text
