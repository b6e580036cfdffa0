"""A second process compiles kernels into the same cache while this process compiles others.

A thread would not do, since compilation holds the interpreter lock. If the second process fails, this process
compiles the missing kernels itself.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from collections.abc import Callable, Sequence

from hybrid.compiler.cache.folder import PACKAGE, cache_directory
from hybrid.compiler.interrupts import CTRL_C

# Seconds between two looks at what the second process has done.
LOOK = 0.02
_helpers: list[subprocess.Popen[bytes]] = []


def start(program: str, modules: Sequence[str]) -> None:
    """Run a program that compiles kernel modules in a second process, if a second processor is available."""
    interpreter = bool(sys.executable) and not getattr(sys, "frozen", False)
    if not modules or not interpreter or processors() < 2:
        return
    try:
        helper = subprocess.Popen(
            [sys.executable, "-c", program, *modules],
            env=environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return
    atexit.register(helper.kill)
    _helpers.append(helper)


def wait_for(is_done: Callable[[], bool]) -> None:
    """Wait until something is done, or until the second process, if there is one, has ended."""
    while _helpers and not is_done():
        CTRL_C.raise_if_set()
        try:
            _helpers[-1].wait(LOOK)
        except subprocess.TimeoutExpired:
            continue
        atexit.unregister(_helpers.pop().kill)


def environment() -> dict[str, str]:
    """Environment variables for a process that uses the same cache and the same import path."""
    package = str(PACKAGE.parent)
    return {
        **os.environ,
        "HYBRID_CACHE_DIR": str(cache_directory().absolute()),
        "PYTHONPATH": os.pathsep.join([package, *filter(None, sys.path)]),
    }


def processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
