"""Ctrl-C as a question that is asked between bursts of steps, so that what was computed is kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import Any, Protocol

from hybrid.kernels.types import codes
from hybrid.status import Status, StatusCode

# Steps of the first burst, which takes less than a millisecond for most models, and how long later ones take:
# a step may become ten times slower from one burst to the next, where numbers leave the normal range.
FIRST_BURST = 256
SECONDS = 0.02


class Stop(Protocol):
    """Who may ask a run to stop; asked for longer runs only, inside ``with``."""

    def is_set(self) -> bool:
        """Whether to stop."""
        ...

    def __enter__(self) -> Any: ...

    def __exit__(self, *failure: object) -> None: ...


# The stop of a thread, if it works for a sweep.
_OF_THREAD = threading.local()


@contextmanager
def stopped_by(stop: threading.Event) -> Iterator[None]:
    """Let the runs in this thread end early when ``stop`` is set, as if Ctrl-C had been pressed there."""
    before = getattr(_OF_THREAD, "stop", None)
    _OF_THREAD.stop = stop
    try:
        yield
    finally:
        _OF_THREAD.stop = before


class CtrlC:
    """Ctrl-C while the main thread is inside ``with``: asked for between bursts, not raised anywhere.

    The question may be nested; whoever is outermost decides how long an interrupt holds. A second Ctrl-C is
    raised at once, and so is one that nobody has asked for. Elsewhere, and where the program has a handler
    of its own, Ctrl-C stays as it is. A thread inside :func:`stopped_by` is asked for its own stop.
    """

    def __init__(self) -> None:
        self.depth = 0
        self.heard = self.noticed = False

    def is_set(self) -> bool:
        """Whether Ctrl-C was pressed since the outermost ``with`` began."""
        if self.heard and _in_main_thread():
            self.noticed = True
            return True
        stop = getattr(_OF_THREAD, "stop", None)
        return stop is not None and stop.is_set()

    def __enter__(self) -> None:
        if _in_main_thread():
            self.depth += 1
            if self.depth == 1 and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
                signal.signal(signal.SIGINT, self._hear)

    def __exit__(self, *failure: object) -> None:
        if not _in_main_thread():
            return
        self.depth -= 1
        if self.depth:
            return
        if signal.getsignal(signal.SIGINT) == self._hear:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        lost = self.heard and not self.noticed and failure[0] is None
        self.heard = self.noticed = False
        if lost:
            raise KeyboardInterrupt

    def _hear(self, number: int, frame: object) -> None:
        if self.heard:
            raise KeyboardInterrupt
        self.heard = True


CTRL_C = CtrlC()


class Bursts:
    """How many steps kernels may take before Python asks whether to stop: 20 ms of them.

    Where a burst ends has no influence on what is computed.

    Parameters
    ----------
    runs
        The trajectories that the kernel takes further; the first one has the limit of steps and the stop.
    """

    def __init__(self, runs: Sequence[Any]) -> None:
        self.runs, self.stop, self.limit = runs, runs[0].stop, runs[0].max_steps
        self.steps = FIRST_BURST
        self.begin = perf_counter()

    def most(self) -> int:
        """Limit of steps for the burst that begins now, counted from the start of the first run."""
        self.begin = perf_counter()
        return min(self.limit, self.runs[0].steps + self.steps)

    def judged(self, code: int) -> int:
        """The code of a kernel: GO_ON if only the burst has ended, INTERRUPTED if the run is to stop."""
        seconds = perf_counter() - self.begin
        ended = code == codes.MAX_STEPS and all(run.steps < self.limit for run in self.runs)
        # A kernel that has done its work before the end of the burst does not tell how long a burst takes.
        if ended and seconds < SECONDS:
            self.steps *= 2
        elif seconds > 2 * SECONDS:
            self.steps = max(1, int(self.steps * SECONDS / seconds))
        if code != codes.DONE and not ended:
            return code
        if self.stop.is_set():
            return StatusCode.INTERRUPTED
        return codes.GO_ON if ended else code


def _in_main_thread() -> bool:
    return threading.get_ident() == threading.main_thread().ident


def interrupted_status(what: str) -> Status:
    """Status of a result that Ctrl-C has cut short; ``what`` it holds."""
    return Status(
        StatusCode.INTERRUPTED, f"Interrupted; the result holds {what}.", "Call again for the whole of it."
    )
