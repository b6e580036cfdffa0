"""Sweeps in threads, rule by rule: how many threads, what they report, and lines with carried states."""

import os
import threading
from queue import Empty
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.sweep import local
from hybrid.sweep.job import Job
from hybrid.sweep.points import as_points

POINTS = as_points({"a": [0.0, 1.0], "b": [0.0, 1.0, 2.0, 3.0]})


def test_cores_are_those_of_the_process(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 5, 8}, raising=False)
    assert local.cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    for count, cores in ((6, 6), (None, 1)):
        monkeypatch.setattr(os, "cpu_count", lambda count=count: count)
        assert local.cores() == cores


@pytest.mark.parametrize(
    ("threads", "rows", "workers"),
    [(None, 8, 5), (None, 3, 3), (2, 8, 2), (7, 3, 3), (7, 8, 7), (None, 0, 1)],
)
def test_there_are_no_more_threads_than_cores_or_points(threads, rows, workers, monkeypatch):
    asked = []
    monkeypatch.setattr(local, "cores", lambda: 5)
    monkeypatch.setattr(local._Run, "run", lambda self, pool, workers, report: asked.append((pool, workers)))
    job = Job(None, POINTS, np.arange(rows), None)
    local.run_in_threads(job, None, None, stored=False, threads=threads)
    [(pool, found)] = asked
    assert (found, pool._max_workers) == (workers, workers)


def test_a_given_pool_is_used_with_its_own_workers(monkeypatch):
    asked = []
    monkeypatch.setattr(local._Run, "run", lambda self, pool, workers, report: asked.append((pool, workers)))
    pool = SimpleNamespace(_max_workers=9)
    local.run_in_threads(Job(None, POINTS, np.arange(3), None), None, None, stored=False, pool=pool)
    assert asked == [(pool, 9)]


class Line:
    """A queue that is empty at its end, instead of waiting for more."""

    def __init__(self, *items):
        self.items = list(items)

    def put(self, item):
        self.items.append(item)

    def get(self, timeout=None):
        if not self.items:
            raise IndexError("nothing comes")
        item = self.items.pop(0)
        if item is Empty:
            raise Empty
        return item


class TestReports:
    def run(self, *news, workers=2):
        """What is reported, and what becomes of the run, if the workers say this."""
        run = local._Run(Job(None, POINTS, np.arange(8), None), None, stored=False)
        run.reports, reported, ended = Line(*news), [], []
        run.source = SimpleNamespace(end=lambda: ended.append(run.stop.is_set()))
        submitted = []
        pool = SimpleNamespace(submit=submitted.append)
        try:
            done = run.run(pool, workers, reported.append)
        except ZeroDivisionError as failure:
            done = failure
        assert submitted == [run._work] * workers
        assert ended
        assert all(ended)
        return reported, done, run.reports.items

    def test_points_are_reported_until_all_workers_have_ended(self):
        assert self.run(None, 3, Empty, 0, 4, None, 5) == ([3, 4], True, [5])
        assert self.run(3, None, workers=1) == ([3], True, [])

    def test_the_first_error_is_raised_when_all_workers_have_ended(self):
        first, second = ZeroDivisionError("first"), ZeroDivisionError("second")
        assert self.run(3, first, None, second, 2, None, 7) == ([3, 2], first, [7])

    def test_a_failed_report_stops_the_workers(self):
        with pytest.raises(IndexError, match="nothing comes"):
            self.run(None)


class Chain:
    """Each point has the states carried to it; carrying fails at a certain ``b``."""

    along = "b"

    def __init__(self, broken=None):
        self.broken = broken

    def carry(self, point, state):
        if point["b"] == self.broken:
            raise ValueError("broken")
        return 10.0 * (state or 0.0) + point["b"] + 1.0

    def __call__(self, point, state):
        return {"seen": -1.0 if state is None else state}


class TestInLine:
    def line(self, rows, task=None):
        job = Job(task or Chain(), POINTS, np.array(rows, dtype=int), np.arange(8).reshape(2, 4))
        source = local._InLine(job, threading.Event())
        waiting = Line()
        while not source.queue.empty():
            waiting.put(source.queue.get())
        source.queue = waiting
        return source

    def seen(self, rows, task=None):
        source = self.line(rows, task)
        found = {row: float(outcome.values[0]) for row, outcome in source.outcomes()}
        assert source.left == 0
        assert all(item is None for item in source.queue.items)
        return found

    def test_states_are_carried_to_every_missing_point(self):
        assert self.seen(range(8)) == {0: -1, 1: 1, 2: 12, 3: 123, 4: -1, 5: 1, 6: 12, 7: 123}
        assert self.seen([2, 5]) == {2: 12, 5: 1}
        assert self.seen([4]) == {4: -1}

    def test_a_line_starts_anew_where_its_task_fails(self):
        assert self.seen([1, 2, 3], Chain(broken=1.0)) == {1: 1, 2: -1, 3: 3}

    def test_nothing_is_carried_beyond_the_last_missing_point(self):
        assert self.seen([1], Chain(broken=1.0)) == {1: 1}

    def test_without_points_the_workers_end_at_once(self):
        assert self.seen([]) == {}

    def test_a_stop_ends_the_workers(self):
        source = self.line(range(8))
        source.stop.set()
        assert list(source.outcomes()) == []
        assert source.queue.items[-1] is None
        assert len(source.queue.items) == 2
