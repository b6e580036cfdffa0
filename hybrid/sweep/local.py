"""A sweep in the threads of one process: kernels release the interpreter lock, so they run in parallel."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from queue import Empty, Queue, SimpleQueue
from time import perf_counter
from typing import Any

import attrs
import numpy as np

from hybrid.compiler.interrupts import CTRL_C, stopped_by
from hybrid.kernels.types.codes import ABREAST
from hybrid.simulation.crew import TOGETHER
from hybrid.sweep.job import Job, Rhythm, carried
from hybrid.sweep.outcome import Batch, Outcome, Part, attempt, attempts

# Seconds between two looks for Ctrl-C, and how long workers may take to end after it: a task that calls
# nothing of the library is not told, and its point is given up.
LOOK, GRACE = 0.05, 0.4


def cores() -> int:
    """Number of cores available to this process."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_in_threads(
    job: Job,
    keep: Callable[[Part], None],
    report: Callable[[int], object],
    *,
    stored: bool,
    pool: ThreadPoolExecutor | None = None,
    threads: int | None = None,
) -> bool:
    """Compute all missing points; False if Ctrl-C ended it early. ``keep`` is called from any thread."""
    if pool is not None:
        return _Run(job, keep, stored, pool._max_workers).run(pool, report)
    workers = min(threads or cores(), max(len(job.rows), 1))
    own = ThreadPoolExecutor(workers, thread_name_prefix="sweep")
    try:
        return _Run(job, keep, stored, workers).run(own, report)
    finally:
        # The workers have ended by now, or have been given up.
        own.shutdown(wait=False)


class _Run:
    def __init__(self, job: Job, keep: Callable[[Part], None], stored: bool, workers: int) -> None:
        self.job, self.keep, self.stored, self.workers = job, keep, stored, workers
        self.stop = threading.Event()
        self.lock, self.is_over = threading.Lock(), False
        # What the workers have computed and not passed on yet.
        self.batches: list[Batch] = []
        # Numbers of points that were kept, an error, or None from a worker that has ended.
        # A SimpleQueue waits without end if its time is over when it has heard a signal.
        self.reports: Queue[int | BaseException | None] = Queue()
        self.source: _Alone | _InLine = _Alone(job, workers) if job.lines is None else _InLine(job, self.stop)

    def run(self, pool: ThreadPoolExecutor, report: Callable[[int], object]) -> bool:
        """Start the workers and wait for them."""
        failure, working, latest = None, self.workers, math.inf
        with CTRL_C:
            try:
                for _ in range(self.workers):
                    pool.submit(self._work)
                while working and perf_counter() < latest:
                    try:
                        news = self.reports.get(timeout=LOOK)
                    except Empty:
                        news = 0
                    if CTRL_C.is_set():
                        self._halt()
                        latest = min(latest, perf_counter() + GRACE)
                    if news is None:
                        working -= 1
                    elif isinstance(news, BaseException):
                        failure = failure or news
                        self._halt()
                    elif news:
                        report(news)
            finally:
                self._halt()
                with self.lock:
                    self.is_over = True
                    # Those of workers that have been given up.
                    for part in (part for batch in self.batches for part in batch.taken()):
                        self.keep(part)
            if failure is not None:
                raise failure
            return not CTRL_C.is_set()

    def _halt(self) -> None:
        """Let the workers end after the points in hand."""
        self.stop.set()
        self.source.end()

    def _work(self) -> None:
        """Compute points until there are none, or until the sweep stops."""
        batch, rhythm = Batch(), Rhythm(self.stored)
        self.batches.append(batch)
        try:
            try:
                with stopped_by(self.stop, dropped=True):
                    for row, outcome in self.source.outcomes():
                        # A point that was computed while the sweep stopped may be incomplete.
                        if self.stop.is_set():
                            break
                        with self.lock:
                            if not self.is_over:
                                batch.add(row, outcome)
                        if rhythm.is_due():
                            self._pass_on(batch)
            except KeyboardInterrupt:
                # The point in hand is dropped; the others are kept.
                if not self.stop.is_set():
                    raise
            self._pass_on(batch)
        except BaseException as failure:
            self.reports.put(failure)
        finally:
            if self.stop.is_set():
                self.source.end()
            self.reports.put(None)

    def _pass_on(self, batch: Batch) -> None:
        with self.lock:
            count = batch.count
            for part in batch.taken():
                self.keep(part)
        self.reports.put(count)


class _Alone:
    """Points that do not depend on one another."""

    def __init__(self, job: Job, workers: int) -> None:
        self.job = job
        # Shared by the threads; each row is handed out once.
        self.rows = iter(job.rows.tolist())
        # Threads end at about the same time.
        self.at_once = max(ABREAST, min(TOGETHER, len(job.rows) // (2 * workers)))

    def outcomes(self) -> Iterator[tuple[int, Outcome]]:
        """Rows and outcomes, computed when asked for."""
        task, points = self.job.task, self.job.points
        if hasattr(task, "together"):
            while rows := list(islice(self.rows, self.at_once)):
                yield from zip(rows, attempts(task, [*map(points.at, rows)], [None] * len(rows)), strict=True)
        for row in self.rows:
            yield row, attempt(task, points.at(row))

    def end(self) -> None:
        """Nothing waits here."""


@attrs.frozen(eq=False)
class _Link:
    """The point at a place of a line, to which the state must be carried next."""

    line: list[int]
    place: int
    state: Any


class _InLine:
    """Points that depend on the one before.

    The states are carried ahead of the results, so that the points of one line also run in parallel.
    """

    def __init__(self, job: Job, stop: threading.Event) -> None:
        self.job, self.stop = job, stop
        self.queue: SimpleQueue[_Link | tuple[int, Any] | None] = SimpleQueue()
        self.wanted = np.zeros(len(job.points), dtype=bool)
        self.wanted[job.rows] = True
        units = job.units()
        self.left = sum(map(len, units))
        self.lock = threading.Lock()
        for line in units:
            self.queue.put(_Link(line, 0, None))
        if not units:
            self.end()

    def outcomes(self) -> Iterator[tuple[int, Outcome]]:
        """Rows and outcomes, computed when asked for."""
        task: Any = self.job.task
        points = self.job.points
        while (item := self.queue.get()) is not None and not self.stop.is_set():
            if isinstance(item, _Link):
                row = item.line[item.place]
                if item.place + 1 < len(item.line):
                    state = carried(task, points.at(row), item.state)
                    self.queue.put(_Link(item.line, item.place + 1, state))
                if self.wanted[row]:
                    self.queue.put((row, item.state))
                    continue
            else:
                row, state = item
                yield row, attempt(task, points.at(row), state)
            with self.lock:
                self.left -= 1
                if not self.left:
                    self.end()
        # The next worker also ends.
        self.queue.put(None)

    def end(self) -> None:
        """Wake the workers that wait."""
        self.queue.put(None)
