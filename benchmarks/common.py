"""Helpers of the benchmarks: machine and date, tables, times, fresh processes."""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import NamedTuple

# Shortest turn of a comparison, in seconds.
TURN = 0.004
ROOT = Path(__file__).parents[1]
PACKAGES = ("numpy", "scipy", "numba")


def options(description: str | None) -> argparse.ArgumentParser:
    """A command line that says where pictures go: by default to a folder that git ignores."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--output", type=Path, default=Path("pictures"), help="folder of the picture")
    return parser


def file_in(folder: Path, name: str) -> Path:
    """Path of a picture in a folder, which is made if it does not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    return folder / name


def heading(question: str) -> None:
    """Print the question, the machine, the versions and the date."""
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in PACKAGES)
    print(question)
    machine = f"{processor()}, {os.cpu_count()} cores"
    print(f"{machine}; Python {platform.python_version()}, {versions}; {date.today()}")
    print()


def processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a Markdown table."""
    widths = [max(map(len, column)) for column in zip(columns, *rows, strict=True)]
    rule = ["-" * width for width in widths]
    for row in (columns, rule, *rows):
        print("| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |")
    print()


def least_time(work: Callable[[], object], repeats: int = 7) -> float:
    """Least of several processor times in seconds, to reduce the effect of other load on the machine."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def least_in_turns(runs: Sequence[Callable[[], object]], turns: int) -> list[float]:
    """Seconds of processor time of each run: the least of turns that alternate."""
    best = [math.inf] * len(runs)
    for run in runs:
        run()
    for _ in range(turns):
        for i, run in enumerate(runs):
            begin, count = time.process_time(), 0
            while time.process_time() - begin < TURN:
                run()
                count += 1
            best[i] = min(best[i], (time.process_time() - begin) / count)
    return best


class Process(NamedTuple):
    """Wall-clock and processor time in seconds, and the text on standard output and standard error."""

    wall: float
    processor: float
    output: str
    messages: str


def fresh_process(code: str, environment: Mapping[str, str] | None = None) -> Process:
    """Run ``code`` in a new interpreter."""
    start, before = time.perf_counter(), os.times()
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={**os.environ, **(environment or {})},
        capture_output=True,
        text=True,
        check=True,
    )
    wall, after = time.perf_counter() - start, os.times()
    used = after.children_user - before.children_user + after.children_system - before.children_system
    return Process(wall, used, done.stdout.strip(), done.stderr.strip())


def fastest_process(code: str, environment: Mapping[str, str] | None = None, repeats: int = 5) -> Process:
    """The run with the least wall-clock time."""
    return min(fresh_process(code, environment) for _ in range(repeats))
