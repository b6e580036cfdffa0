"""Progress of long computations."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Progress(Protocol):
    """Receiver of the progress of a long computation."""

    def update(self, n: float = 1) -> object:
        """Count ``n`` more units as done."""


class _Silent:
    def update(self, n: float = 1) -> None:
        pass


SILENT = _Silent()


def silent() -> Progress:
    """The receiver that shows nothing."""
    return SILENT


# Seconds before a bar appears that nobody has asked for.
PATIENCE = 2.0


@contextmanager
def progress_bar(
    total: int | None, title: str, shown: bool | None, unit: str = "interval", done: int = 0
) -> Iterator[Progress]:
    """A progress bar with the time left, on standard error or in a notebook; a silent stand-in if False.

    With None a bar appears in a terminal or a notebook after two seconds. ``done`` units are done already.
    If nobody knows the ``total`` (None), the bar counts.
    """
    if shown is False or (shown is None and not is_watched()):
        yield SILENT
        return
    with warnings.catch_warnings():
        # Without ipywidgets a notebook gets the bar of a terminal.
        warnings.simplefilter("ignore")
        from tqdm.auto import tqdm

    delay = PATIENCE if shown is None else 0.0
    with tqdm(total=total, initial=done, desc=title, unit=unit, leave=False, delay=delay) as bar:
        yield bar


def is_watched() -> bool:
    """Whether standard error is a terminal, or the program a notebook."""
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
