"""Structures on several processes; a run that does not end is ended, counted and left out."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from benchmarks.adversarial.trial import METHODS, Part, trial

# Seconds after which a run is taken never to end; runs take milliseconds.
LIMIT = 20.0
# After so many such runs the rest of a structure's is left out.
MOST_HUNG = 3
POLL = 0.05
CONTEXT = multiprocessing.get_context("fork")


class Hung(NamedTuple):
    """A run that did not end; ``run`` is -1 for the rest of a method's runs, given up."""

    index: int
    method: str
    run: int


class _Job:
    """One structure in a process of its own."""

    def __init__(self, seed: int, index: int, samples: int, methods: tuple[str, ...]) -> None:
        self.seed, self.index, self.samples = seed, index, samples
        self.methods = list(methods)
        self.left_out: dict[str, set[int]] = {}
        self.launch()

    def launch(self) -> None:
        self.reader, writer = CONTEXT.Pipe(duplex=False)
        # Place of the method, run, and when the run began; zero where none is under way.
        self.beat = CONTEXT.Array("d", 3, lock=False)
        arguments = (self.seed, self.index, self.samples, self.methods, self.left_out, self.beat, writer)
        self.process = CONTEXT.Process(target=_work, args=arguments, daemon=True)
        self.process.start()
        writer.close()

    def news(self) -> Iterator[Part | Hung]:
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
            name = METHODS[int(method)]
            hung = self.left_out.setdefault(name, set())
            hung.add(int(run))
            yield Hung(self.index, name, int(run))
            if len(hung) >= MOST_HUNG:
                self.methods.remove(name)
                yield Hung(self.index, name, -1)
            self.launch()

    @property
    def done(self) -> bool:
        if self.process.is_alive() or self.reader.poll():
            return False
        if self.process.exitcode:
            raise RuntimeError(
                f"Structure {self.index} ended with exit code {self.process.exitcode}; its message is above. "
                f"Run it alone with --structure {self.index}."
            )
        return True


def _work(
    seed: int,
    index: int,
    samples: int,
    methods: list[str],
    left_out: dict[str, set[int]],
    beat: Any,
    writer: Any,
) -> None:
    def begin(method: str, run: int) -> None:
        beat[:] = METHODS.index(method), run, time.monotonic()

    for part in trial(seed, index, samples, tuple(methods), begin, left_out):
        beat[2] = 0.0
        writer.send(part)
    writer.close()


def parts(
    seed: int,
    indices: list[int],
    samples: int,
    processes: int,
    methods: tuple[str, ...],
    finished: Callable[[int], None],
) -> Iterator[Part | Hung]:
    """What comes of some structures, as it comes."""
    waiting, active = list(indices), []
    while waiting or active:
        while waiting and len(active) < processes:
            active.append(_Job(seed, waiting.pop(0), samples, methods))
        for job in list(active):
            yield from job.news()
            if job.done:
                yield from job.news()
                active.remove(job)
                finished(job.index)
        time.sleep(POLL)
