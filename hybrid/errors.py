"""Errors of the library; a text names the part, what is wrong, what is allowed and the next step."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable
from math import log10


class _Short(reprlib.Repr):
    """Short representations; an integer that Python refuses to write in digits is rounded."""

    def repr_int(self, x: int, level: int) -> str:
        # Python refuses texts of more than 4300 digits, and a conversion takes quadratic time.
        if x.bit_length() > 1000:
            digits = int(x.bit_length() * log10(2))
            return f"{'-' if x < 0 else ''}10**{digits}, roughly"
        return super().repr_int(x, level)


_short = _Short()
_short.maxstring = _short.maxother = 100


class HybridError(Exception):
    """Base of every error this library raises on purpose.

    Examples
    --------
    >>> import hybrid, models
    >>> try:
    ...     hybrid.simulate(models.bouncing_ball(), (1.0,), (0.0, 1.0))
    ... except hybrid.HybridError as error:
    ...     print(type(error).__name__)
    ArgumentError
    """


class ModelError(HybridError, ValueError):
    """A model, or a call that uses it, is invalid; the text says how to fix it.

    Examples
    --------
    >>> import hybrid
    >>> try:
    ...     hybrid.Guard(lambda t, x, p: x.q, direction=2)
    ... except hybrid.ModelError as error:
    ...     print(error)
    Guard: direction must be -1 (falling), 0 (both) or +1 (rising); got 2.
    """


class ArgumentError(ModelError):
    """An argument of a call is out of range or of the wrong shape for the model it is used with.

    Examples
    --------
    >>> import hybrid, models
    >>> try:
    ...     hybrid.simulate(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), parameters={"E": 0.5})
    ... except hybrid.ArgumentError as error:
    ...     print(error)
    parameters: Parameter 'E' does not exist. Parameters: g, e.
    """


def shown(value: object) -> str:
    """A value as error texts show it; long values are shortened, and a ``repr`` may fail."""
    return _short.repr(value)


def unknown_name(what: str, name: object, allowed: Iterable[str], kind: str) -> str:
    """Error text for an unknown name: lists the existing names and suggests the closest one.

    ``what`` opens the sentence (``"Transition 'impact': target mode"``), ``kind`` heads the list.
    """
    known = list(allowed)
    text = f"{what} {shown(name)} does not exist. {kind}: {', '.join(known) if known else '(none)'}."
    close = difflib.get_close_matches(name, known, n=1) if isinstance(name, str) else []
    return f"{text} Did you mean {close[0]!r}?" if close else text
