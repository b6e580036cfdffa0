"""How a property fails, and how an example is passed over."""

from __future__ import annotations

from typing import NoReturn

from hypothesis.errors import UnsatisfiedAssumption


class PropertyError(AssertionError):
    """A property that a system should have fails; the message gives the case and the likely cause.

    Attributes
    ----------
    time
        The time on the run at which it fails; None if it is not known.
    """

    def __init__(self, text: str, time: float | None = None) -> None:
        super().__init__(text)
        self.time = time


def discard(reason: str) -> NoReturn:
    """Discard an example that cannot be judged; Hypothesis then draws another one."""
    raise UnsatisfiedAssumption(reason)
