"""Errors of a user's code as sentences that name file and line there, without the library's own frames."""

from __future__ import annotations

import linecache
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from traceback import walk_tb

from hybrid.errors import HybridError

# Where code lies that is not the user's: this library, installed packages, Python itself.
OTHERS = tuple(
    {
        *(str(Path(__file__).parents[2] / name) for name in ("hybrid", "lyapunov", "models")),
        *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")),
    }
)


def told(error: Exception) -> str:
    """An error as a sentence; if the user's code is the cause, with its file, line and text.

    An error of the library is told as it is, since its text says what is wrong; other errors with their kind.
    """
    text = str(error) if isinstance(error, HybridError) else f"{type(error).__name__}: {error}"
    if isinstance(error, SyntaxError):
        text = f"{type(error).__name__}: {error.msg}"
    place = place_in_users_code(error)
    if place is None:
        return text
    file, line, code = place
    return f"{file}, line {line}{f' ({code})' if code else ''}: {text}"


def place_in_users_code(error: BaseException) -> tuple[str, int, str] | None:
    """File, line and code of the user's that an error comes from; None if it comes from elsewhere."""
    return next((place for each in _chain(error) for place in _places(each)), None)


def _chain(error: BaseException) -> Iterator[BaseException]:
    """The error, with the cause of all first: there the user's code is entered deepest."""
    cause = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    if cause is not None:
        yield from _chain(cause)
    yield error


def _places(error: BaseException) -> list[tuple[str, int, str]]:
    """File, line and code of the user's frames that an error has passed, the innermost first."""
    found = []
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        found.append((error.filename, error.lineno, (error.text or "").strip()))
    frames = [(frame.f_code.co_filename, line) for frame, line in walk_tb(error.__traceback__)]
    for file, line in reversed(frames):
        if _is_users(file):
            # The file may have been edited since it was read last.
            linecache.checkcache(file)
            found.append((file, line, linecache.getline(file, line).strip()))
    return found


def _is_users(file: str) -> bool:
    return not file.startswith(("<", *OTHERS))
