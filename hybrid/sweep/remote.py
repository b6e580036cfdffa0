"""A sweep on an executor: processes of this machine, or a cluster through Dask."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.compiler.interrupts import CTRL_C
from hybrid.errors import HybridError
from hybrid.simulation.extra import needed
from hybrid.status import StatusCode
from hybrid.sweep.job import Job, computed
from hybrid.sweep.outcome import UNFINISHED, Part
from hybrid.sweep.store import sees_store, write_part

# Seconds of work in a chunk, at least so many for each worker, and how many chunks wait for each worker. The
# scheduler and the client need about 10 ms per chunk: many workers must not ask for chunks faster than that.
SECONDS_OF_A_CHUNK = 2.0
SECONDS_PER_WORKER = 0.02
CHUNKS_PER_WORKER = 3
LARGEST_CHUNK = 20_000
# Seconds between two looks for Ctrl-C.
LOOK = 0.2
WANTED = "be None, a number of threads, a concurrent.futures.Executor or a dask.distributed.Client"


def as_executor(executor: object) -> tuple[Executor, int]:
    """The executor as concurrent.futures knows it, and its number of workers."""
    if isinstance(executor, Executor):
        return executor, int(getattr(executor, "_max_workers", None) or 1)
    if hasattr(executor, "get_executor") and hasattr(executor, "nthreads"):
        # The scheduler gives the chunks of a dead worker to others.
        return executor.get_executor(pure=False), max(sum(executor.nthreads().values()), 1)
    raise arguments.refusal("executor", WANTED, executor)


def run_on(
    executor: object,
    job: Job,
    keep: Callable[[Part], None],
    report: Callable[[int], object],
    target: Target | None = None,
) -> bool:
    """Compute all missing points; False if Ctrl-C ended it early.

    Workers that see the folder of the ``target`` write there, so results pass neither scheduler nor network.
    """
    pool, workers = as_executor(executor)
    payload = needed("cloudpickle", "executor=").dumps(job.task)
    chunks = _Chunks(job, workers)
    running: dict[Future[Any], list[list[int]]] = {}
    refused: BaseException | None = None
    with CTRL_C:
        while True:
            while len(running) < CHUNKS_PER_WORKER * workers and refused is None:
                chunk = chunks.next()
                if chunk is None:
                    break
                try:
                    given = (payload, *chunks.packed(chunk), _place(target, chunk))
                    future = pool.submit(run_chunk, *given)
                except (BrokenExecutor, RuntimeError) as failure:
                    refused = failure
                    keep(_lost(chunk, chunks, failure))
                    break
                running[future] = chunk
            if not running:
                break
            done, _ = wait(running, timeout=LOOK, return_when=FIRST_COMPLETED)
            if CTRL_C.is_set():
                for future in running:
                    future.cancel()
                return False
            for future in done:
                chunk = running.pop(future)
                count = 0
                try:
                    seconds, files, parts = future.result()
                except HybridError:
                    raise
                except (Exception, CancelledError) as failure:
                    keep(_lost(chunk, chunks, failure))
                    continue
                for name, rows in files:
                    if target is not None:
                        target.receive(name, rows)
                    count += len(rows)
                for part in parts:
                    keep(part)
                    count += len(part.rows)
                chunks.learn(chunk, seconds)
                report(count)
    if refused is not None:
        rest = list(iter(chunks.next_unit, None))
        if rest:
            keep(_lost(rest, chunks, refused))
    return True


@attrs.frozen(eq=False)
class Target:
    """A store for workers to write into: its folder, its seal, the key of each row, and who reads a file."""

    path: str
    seal: str
    keys: Sequence[bytes]
    receive: Callable[[str, np.ndarray], None]


# Folder and seal of a store, and the keys of the rows of a chunk.
Place = tuple[str, str, dict[int, bytes]]


def _place(target: Target | None, chunk: list[list[int]]) -> Place | None:
    if target is None:
        return None
    return target.path, target.seal, {row: target.keys[row] for line in chunk for row in line}


def run_chunk(
    payload: bytes,
    names: tuple[str, ...],
    rows: list[list[int]],
    values: np.ndarray,
    wanted: set[int] | None,
    place: Place | None = None,
) -> tuple[float, list[tuple[str, np.ndarray]], list[Part]]:
    """Compute points in a worker: seconds taken, files written with their rows, results in no file."""
    begin = perf_counter()
    task = _task_of(payload)
    ends = np.cumsum([len(line) for line in rows])[:-1]
    lines = list(zip(rows, [each.tolist() for each in np.split(values, ends)], strict=True))
    with _no_interrupt():
        parts = list(computed(task, names, lines, wanted, lambda: False))
        files: list[tuple[str, np.ndarray]] = []
        if place is not None and sees_store(Path(place[0]), place[1]):
            parts = [part for part in parts if not _is_written(part, place, files)]
    return perf_counter() - begin, files, parts


def _is_written(part: Part, place: Place, files: list[tuple[str, np.ndarray]]) -> bool:
    """Whether all of a part was written into the store; the client writes what was not."""
    if np.isin(part.codes, UNFINISHED).any():
        return False
    try:
        files.append(write_part(Path(place[0]), part, place[2]))
    except OSError:
        return False
    return True


def _task_of(payload: bytes) -> Any:
    """The task, with what it has compiled; one thread of a worker prepares it for all."""
    with _LOCK:
        return _prepared(payload)


_LOCK = threading.Lock()


@lru_cache(4)
def _prepared(payload: bytes) -> Any:
    task = needed("cloudpickle", "executor=").loads(payload)
    if hasattr(task, "prepare"):
        task.prepare()
    return task


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Ctrl-C in a terminal reaches the workers too; the chunk in hand is still completed."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        with suppress(TypeError):
            signal.signal(signal.SIGINT, before)


class _Chunks:
    """Cuts the missing points into chunks of a few seconds of work."""

    def __init__(self, job: Job, workers: int) -> None:
        self.job, self.workers = job, workers
        units = job.units()
        self.units, self.left = iter(units), len(units)
        self.wanted = None if job.lines is None else set(job.rows.tolist())
        self.seconds_per_unit: float | None = None

    def next_unit(self) -> list[int] | None:
        """The next points that must be computed one after the other."""
        self.left -= 1
        return next(self.units, None)

    def next(self) -> list[list[int]] | None:
        """The next chunk; the first ones are small, because nothing is known about the work yet."""
        size = 1
        if self.seconds_per_unit is not None:
            fair = max(self.left // (CHUNKS_PER_WORKER * self.workers), 1)
            seconds = max(SECONDS_OF_A_CHUNK, SECONDS_PER_WORKER * self.workers)
            size = max(1, min(LARGEST_CHUNK, fair, int(seconds / self.seconds_per_unit)))
        chunk = [unit for _ in range(size) if (unit := self.next_unit()) is not None]
        return chunk or None

    def packed(self, chunk: list[list[int]]) -> tuple[Any, ...]:
        """A chunk as the arguments of run_chunk."""
        rows = [row for line in chunk for row in line]
        wanted = None if self.wanted is None else self.wanted.intersection(rows)
        return self.job.points.names, chunk, self.job.points.values[rows], wanted

    def learn(self, chunk: list[list[int]], seconds: float) -> None:
        """Adapt the size of chunks; the first call of a worker also compiles, so the least time counts."""
        found = max(seconds / len(chunk), 1e-6)
        known = self.seconds_per_unit
        self.seconds_per_unit = found if known is None else min(found, 1.25 * known)


def _lost(chunk: list[list[int]], chunks: _Chunks, failure: BaseException) -> Part:
    """The points of a chunk that no worker has finished."""
    rows = [row for line in chunk for row in line if chunks.wanted is None or row in chunks.wanted]
    text = f"No worker finished this point: {type(failure).__name__}: {failure} Call again to compute it."
    return Part(
        rows=np.array(rows, dtype=np.int64),
        schema=None,
        columns=[],
        codes=np.full(len(rows), StatusCode.NOT_RUN, dtype=np.int16),
        messages=[text] * len(rows),
    )
