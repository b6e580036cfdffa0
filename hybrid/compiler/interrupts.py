"""Ctrl-C while code is compiled.

Python raises ``KeyboardInterrupt`` wherever the main thread is. Inside of destructors, and of LLVM's calls
back into Python, it is printed and lost, and LLVM's objects may be left half made.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any


@contextmanager
def between_passes() -> Iterator[None]:
    """Within this block Ctrl-C is raised between two passes of the compiler, or at the end.

    Where the program has a handler of its own, and in other threads, Ctrl-C stays as it is.
    """
    if threading.current_thread() is not threading.main_thread() or (
        signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    ):
        yield
        return
    pressed: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
    try:
        with _passes_ask(pressed):
            yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if pressed:
            raise KeyboardInterrupt


def _passes_ask(pressed: list[int]) -> AbstractContextManager[Any]:
    """Raise Ctrl-C between two passes of numba within this block; LLVM's alone are short."""
    if "numba" not in sys.modules:
        return nullcontext()
    from hybrid.kernels.types.numba_door import session

    def ask() -> None:
        if pressed and threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt

    asked: AbstractContextManager[Any] = session.between_passes(ask)
    return asked
