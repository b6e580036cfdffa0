"""Ctrl-C as a question that is asked between bursts of steps, and between two passes of the compiler.

What was computed is kept where there is anything to keep. Python itself raises ``KeyboardInterrupt`` wherever
the main thread is. Inside of destructors, and of LLVM's calls back into Python, it is printed and lost, and
LLVM's objects may be left half made.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Protocol

# Seconds after which Ctrl-C is raised if nobody has asked for it.
PATIENCE = 0.6


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
def stopped_by(stop: threading.Event, *, dropped: bool = False) -> Iterator[None]:
    """Let the runs in this thread end early when ``stop`` is set, as if Ctrl-C had been pressed there.

    If what the thread is at is ``dropped`` then, no new run begins and nothing is compiled: both raise
    KeyboardInterrupt.
    """
    before = getattr(_OF_THREAD, "stop", None), getattr(_OF_THREAD, "dropped", False)
    _OF_THREAD.stop, _OF_THREAD.dropped = stop, dropped
    try:
        yield
    finally:
        _OF_THREAD.stop, _OF_THREAD.dropped = before


def raise_if_dropped() -> None:
    """Raise KeyboardInterrupt in a thread whose work is no longer wanted."""
    if getattr(_OF_THREAD, "dropped", False) and _OF_THREAD.stop.is_set():
        raise KeyboardInterrupt


class CtrlC:
    """Ctrl-C while the main thread is inside ``with``: asked for between bursts, not raised anywhere.

    The question may be nested; whoever is outermost decides how long an interrupt holds. A second Ctrl-C is
    raised at once, but for one while code is compiled. One that nobody has asked for is raised too: soon, by
    a second one of our own, or at the end. Elsewhere, and where the program has a handler of its own, Ctrl-C
    stays as it is. A thread inside :func:`stopped_by` is asked for its own stop.
    """

    def __init__(self) -> None:
        self.depth = self.compiling = 0
        self.heard = self.noticed = False
        self.watch: threading.Timer | None = None

    def is_set(self) -> bool:
        """Whether Ctrl-C was pressed since the outermost ``with`` began."""
        if self.heard and _in_main_thread():
            self.noticed = True
            return True
        stop = getattr(_OF_THREAD, "stop", None)
        return stop is not None and stop.is_set()

    def raise_if_set(self) -> None:
        """Raise KeyboardInterrupt if Ctrl-C was pressed: where there is no result yet that could be kept."""
        if _in_main_thread() and self.is_set():
            raise KeyboardInterrupt
        raise_if_dropped()

    @contextmanager
    def ending(self) -> Iterator[None]:
        """End the block where Ctrl-C is raised in it: what the block has found so far is kept."""
        try:
            yield
        except KeyboardInterrupt:
            if not self.is_set():
                raise

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
        if self.watch is not None:
            self.watch.cancel()
            self.watch = None
        lost = self.heard and not self.noticed and failure[0] is None
        self.heard = self.noticed = False
        if lost:
            raise KeyboardInterrupt

    def _hear(self, number: int, frame: object) -> None:
        if not self.heard:
            self.heard = True
            self.watch = threading.Timer(PATIENCE, self._insist)
            self.watch.daemon = True
            self.watch.start()
        elif not self.compiling:
            raise KeyboardInterrupt

    def _insist(self) -> None:
        """Press Ctrl-C again if nobody has asked for it: the main thread is in code that does not ask."""
        if self.heard and not self.noticed:
            _thread.interrupt_main()


CTRL_C = CtrlC()


@contextmanager
def between_passes() -> Iterator[None]:
    """Within this block Ctrl-C is raised between two passes of the compiler, or at the end.

    Where the program has a handler of its own Ctrl-C stays as it is. A thread that works for a sweep raises
    its own stop.
    """
    with CTRL_C:
        main = _in_main_thread()
        CTRL_C.compiling += main
        try:
            with _passes_ask():
                yield
        finally:
            CTRL_C.compiling -= main


def _passes_ask() -> AbstractContextManager[Any]:
    """Raise Ctrl-C between two passes of numba within this block; LLVM's alone are short."""
    if "numba" not in sys.modules:
        return nullcontext()
    from hybrid.kernels.types.numba_door import session

    asked: AbstractContextManager[Any] = session.between_passes(CTRL_C.raise_if_set)
    return asked


def _in_main_thread() -> bool:
    return threading.get_ident() == threading.main_thread().ident
