"""Progress of long computations, shown only on request."""

from __future__ import annotations

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


@contextmanager
def progress_bar(total: int, title: str, shown: bool, unit: str = "interval") -> Iterator[Progress]:
    """A progress bar on standard error, or a silent stand-in if not ``shown``."""
    if not shown:
        yield _Silent()
        return
    from tqdm import tqdm

    with tqdm(total=total, desc=title, unit=unit, leave=False) as bar:
        yield bar
