"""Progress of long work, shown only where it was asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Progress(Protocol):
    """What long work reports to."""

    def update(self, n: float = 1) -> object:
        """Count ``n`` more units as done."""


class _Silent:
    def update(self, n: float = 1) -> None:
        pass


@contextmanager
def progress_bar(total: int, title: str, shown: bool, unit: str = "interval") -> Iterator[Progress]:
    """A progress bar on standard error, or something as silent as it is cheap."""
    if not shown:
        yield _Silent()
        return
    from tqdm import tqdm

    with tqdm(total=total, desc=title, unit=unit, leave=False) as bar:
        yield bar
