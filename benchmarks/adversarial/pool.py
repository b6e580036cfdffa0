"""Runs structures on several processes; a run that does not end is killed, counted and skipped."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

# Seconds after which a run counts as hung; normal runs take milliseconds.
LIMIT = 20.0
# After this many hung runs the method's remaining runs of the structure are skipped.
MOST_HUNG = 3
POLL = 0.05
# Forked children share the kernels that the parent has loaded.
CONTEXT = multiprocessing.get_context("fork")
Begin = Callable[[str, int], None]
# Maps a structure and methods to one part per method.
Work = Callable[[int, Iterable[str], Begin, Mapping[str, set[int]]], Iterator[Any]]


class Hung(NamedTuple):
    """A run that did not end; ``run`` is -1 if the method's remaining runs are skipped."""

    index: int
    method: str
    run: int


class _Job:
    """One structure in its own process."""

    def __init__(self, work: Work, index: int, methods: tuple[str, ...]) -> None:
        self.work, self.index, self.names = work, index, methods
        self.methods = list(methods)
        self.left_out: dict[str, set[int]] = {}
        self.launch()

    def launch(self) -> None:
        self.reader, writer = CONTEXT.Pipe(duplex=False)
        # Index of the method, run, and start time of the run, which is zero if no run is active.
        self.beat = CONTEXT.Array("d", 3, lock=False)
        self.process = CONTEXT.Process(target=self._inside, args=(writer,), daemon=True)
        self.process.start()
        writer.close()

    def _inside(self, writer: Any) -> None:
        def begin(method: str, run: int) -> None:
            self.beat[:] = self.names.index(method), run, time.monotonic()

        for part in self.work(self.index, tuple(self.methods), begin, self.left_out):
            self.beat[2] = 0.0
            writer.send(part)
        writer.close()

    def news(self) -> Iterator[Any]:
        while self.reader.poll():
            try:
                part = self.reader.recv()
            except EOFError:
                break
            self.methods.remove(part.method)
            yield part
        method, run, began = self.beat[:]
        if self.process.is_alive() and began and time.monotonic() - began > LIMIT:
            self.process.kill()
            self.process.join()
            name = self.names[int(method)]
            hung = self.left_out.setdefault(name, set())
            hung.add(int(run))
            yield Hung(self.index, name, int(run))
            if len(hung) >= MOST_HUNG:
                self.methods.remove(name)
                yield Hung(self.index, name, -1)
            self.launch()

    @property
    def done(self) -> bool:
        if self.process.is_alive():
            return False
        if self.process.exitcode:
            raise RuntimeError(
                f"Structure {self.index} ended with exit code {self.process.exitcode}; its message is above. "
                f"Run it alone with --structure {self.index}."
            )
        return True


def parts(
    work: Work, indices: list[int], methods: tuple[str, ...], processes: int, title: str
) -> Iterator[Any]:
    """Yield the results of structures as they arrive: one part per method, and one `Hung` per hung run."""
    waiting, active, done, began = list(indices), [], 0, time.perf_counter()
    while waiting or active:
        while waiting and len(active) < processes:
            active.append(_Job(work, waiting.pop(0), methods))
        for job in list(active):
            yield from job.news()
            if job.done:
                # Parts sent since the last poll.
                yield from job.news()
                active.remove(job)
                done += 1
                if done % 10 == 0 or done == len(indices):
                    seconds = time.perf_counter() - began
                    print(f"{title}: {done} of {len(indices)}, {seconds:.0f} s", flush=True)
        time.sleep(POLL)
