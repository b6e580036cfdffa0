"""The model of a file, which is read again when the file has changed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hybrid.explorer.faults import told
from hybrid.explorer.subject import Subject

# Gives the model of a page that is opened, and why it is not the one that the user's file holds now.
Subjects = Callable[[], tuple[Subject, str]]


class Source:
    """The subject of the pages about a file: each page that is opened shows what the file holds then.

    If the file cannot be read any more, pages show the model as it was before, and say why.

    Parameters
    ----------
    file
        The file; None if there is none that could change.
    made
        Reads the file, and makes the subject of it.
    """

    def __init__(self, file: Path | None, made: Callable[[], Subject]) -> None:
        self.file, self.made = file, made
        self.seen = self._stamp()
        self.subject, self.problem = made(), ""

    def __call__(self) -> tuple[Subject, str]:
        """The subject, and why it is not what the file holds now."""
        stamp = self._stamp()
        if stamp != self.seen:
            self.seen = stamp
            try:
                self.subject, self.problem = self.made(), ""
            except Exception as error:  # whatever the user's file raises
                self.problem = f"{told(error)} The page shows the model as it was before this edit."
        return self.subject, self.problem

    def _stamp(self) -> tuple[int, int] | None:
        """What changes with the contents of the file; None without a file."""
        try:
            known = self.file.stat() if self.file else None
        except OSError:
            return None
        return known and (known.st_mtime_ns, known.st_size)
