"""One thread that computes what a page shows: what was asked last comes first."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Hashable, Sequence
from time import perf_counter
from typing import Any

import attrs

from hybrid.compiler.interrupts import stopped_by
from hybrid.errors import HybridError
from hybrid.explorer.faults import told

# Seconds after which a part is told to end with what it has, and after which it gives way to a newer job for
# the same picture. Before that it is shown, so that a picture moves while a slider does.
LONGEST_PART, PATIENCE = 60.0, 0.1
# The jobs behind the first one begin when nothing new has been wanted for so many seconds: a slider that is
# dragged tells its next value sooner.
QUIET = 0.05


@attrs.frozen(eq=False)
class Job:
    """Something to compute.

    Attributes
    ----------
    picture
        Name of what it fills; there is one job per picture at a time.
    key
        What the result depends on: a job with the key of the last one is not done again.
    parts
        Functions to call one after the other; the page shows the result of each.
    attempt
        What decides besides whether the job can be done: one that failed is done again when this changes.
    """

    picture: str
    key: Hashable
    parts: Sequence[Callable[[], Any]]
    attempt: Hashable = None


@attrs.frozen(eq=False)
class Outcome:
    """The result of a part of a job, or the error that ended it."""

    job: Job
    part: int
    result: Any
    problem: str
    seconds: float

    @property
    def is_last(self) -> bool:
        """Whether the job has no further parts."""
        return self.part + 1 == len(self.job.parts)


class Worker:
    """Does jobs in their order, and leaves those that are no longer wanted.

    Parameters
    ----------
    show
        Called with each :class:`Outcome`, from the thread of the worker; returns when it has been shown.
    """

    def __init__(self, show: Callable[[Outcome], None]) -> None:
        self.show = show
        self.wanted: list[Job] = []
        self.asked = 0.0
        # By picture: the last job, how many of its parts are done, and whether it failed.
        self.done: dict[str, tuple[Job, int, bool]] = {}
        self.current: Job | None = None
        # Whether the part that is computed is no longer wanted.
        self.superseded = False
        self.stop, self.closed = threading.Event(), False
        self.changed = threading.Condition(threading.RLock())
        self.thread = threading.Thread(target=self._work, name="hybrid explore", daemon=True)
        self.thread.start()

    def want(self, jobs: Sequence[Job]) -> None:
        """Have these jobs done, the first one first; the part that is being computed ends if it must wait."""
        with self.changed:
            self.wanted, self.asked = list(jobs), perf_counter()
            now, following = self.current, self._next()
            if now is None:
                self.changed.notify_all()
            elif following is None or following.picture != now.picture:
                self._give_way(now)
            elif following.key != now.key:
                patience = threading.Timer(PATIENCE, self._give_way, [now])
                patience.daemon = True
                patience.start()

    def _give_way(self, job: Job) -> None:
        with self.changed:
            if self.current is job:
                self.superseded = True
                self.stop.set()

    def wait(self, seconds: float) -> bool:
        """Wait until all jobs are done and shown; False if they take longer."""
        with self.changed:
            return self.changed.wait_for(lambda: self.current is None and self._next() is None, seconds)

    def forget(self, picture: str) -> None:
        """Do the job of a picture again when it is wanted next."""
        with self.changed:
            self.done.pop(picture, None)

    def close(self, *, wait: bool = True) -> None:
        """End the thread; ``wait`` until it has ended."""
        with self.changed:
            self.closed = True
            self.stop.set()
            self.changed.notify_all()
        if wait:
            self.thread.join()

    def _next(self) -> Job | None:
        """The first job that has parts left."""
        return next((job for job in self.wanted if self._parts_done(job) < len(job.parts)), None)

    def _parts_done(self, job: Job) -> int:
        """How many parts of a job need not be done again; all of a job that would fail as it has."""
        last, parts, failed = self.done.get(job.picture, (None, 0, False))
        if last is None or last.key != job.key:
            return 0
        if failed:
            return len(job.parts) if last.attempt == job.attempt else 0
        return parts

    def _awaited(self) -> Job | None:
        """The next job, as soon as its turn has come; None when the worker is closed."""
        while not self.closed:
            job = self._next()
            quiet = perf_counter() - self.asked
            if job is not None and (job is self.wanted[0] or quiet >= QUIET):
                return job
            self.current = None
            self.changed.notify_all()
            self.changed.wait(None if job is None else QUIET - quiet)
        return None

    def _work(self) -> None:
        while True:
            with self.changed:
                job = self._awaited()
                if job is None:
                    return
                self.current = job
                self.stop.clear()
                self.superseded = False
                part = self._parts_done(job)
            outcome = self._outcome(job, part)
            with self.changed:
                if self.closed:
                    return
                # A part that was told to end for another job is done again when its turn comes.
                if self.superseded:
                    continue
                self.done[job.picture] = (job, part + 1, bool(outcome.problem))
            self.show(outcome)

    def _outcome(self, job: Job, part: int) -> Outcome:
        late = threading.Timer(LONGEST_PART, self.stop.set)
        late.daemon = True
        begin, result, problem = perf_counter(), None, ""
        late.start()
        try:
            with stopped_by(self.stop):
                result = job.parts[part]()
        except Exception as error:  # a fault in a user's function must not end the page
            problem = told(error)
            if not isinstance(error, HybridError):
                traceback.print_exc()
        finally:
            late.cancel()
        return Outcome(job, part, result, problem, perf_counter() - begin)
