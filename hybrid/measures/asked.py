"""What functions of a caller say of an arc, with errors that name the function and the place."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hybrid.errors import ArgumentError, HybridError
from hybrid.simulation.arc import HybridArc


class Unmeasured(ArgumentError):
    """A function of a caller has raised an error, or has given no number."""


def answer(title: str, function: Callable[[HybridArc], Any], arc: HybridArc, where: str) -> Any:
    """What a function says of an arc; ``title`` names it, and ``where`` says which run it is asked of.

    Raises
    ------
    Unmeasured
        If the function raises an error.
    """
    try:
        return function(arc)
    except HybridError as error:
        raise Unmeasured(f"{title}: {str(error).removesuffix('.')}, at {where}.") from error
    except Exception as error:
        raise Unmeasured(f"{title} raised {told(error)} at {where}.") from error


def told(error: Exception) -> str:
    """The kind of an error with its text."""
    said = str(error).removesuffix(".")
    return f"{type(error).__name__} ({said})" if said else type(error).__name__
