"""The newest wish comes first, and nothing that is shown is shown twice."""

import threading
import time

import pytest

from hybrid import ArgumentError, simulate
from hybrid.explorer.worker import Job, Worker
from models import impact_oscillator


@pytest.fixture
def worker():
    made = Worker(lambda outcome: made.shown.append(outcome))
    made.shown = []
    yield made
    made.close()


def told(worker):
    return [(each.job.picture, each.job.key, each.part) for each in worker.shown]


def test_jobs_are_done_in_order_part_by_part(worker):
    worker.want([Job("first", 1, (lambda: "a", lambda: "b")), Job("second", 1, (lambda: "c",))])
    assert worker.wait(10)
    assert told(worker) == [("first", 1, 0), ("first", 1, 1), ("second", 1, 0)]
    assert [each.result for each in worker.shown] == ["a", "b", "c"]
    assert [each.is_last for each in worker.shown] == [False, True, True]


def test_what_has_not_changed_is_not_done_again(worker):
    for key in (1, 1, 2):
        worker.want([Job("first", key, (lambda: None,)), Job("second", 1, (lambda: None,))])
        assert worker.wait(10)
    assert told(worker) == [("first", 1, 0), ("second", 1, 0), ("first", 2, 0)]


def test_what_is_forgotten_is_done_again(worker):
    for _ in range(2):
        worker.want([Job("first", 1, (lambda: None,))])
        assert worker.wait(10)
        worker.forget("first")
    assert len(worker.shown) == 2


def test_long_work_gives_way_and_goes_on_where_it_was(worker):
    """The part that was interrupted is done again; the parts before it are not."""
    begun = threading.Event()
    calls = []

    def part(number):
        def run():
            calls.append(number)
            begun.set()
            if number == 1 and calls.count(1) == 1:
                # Ends when the worker asks for it.
                return simulate(impact_oscillator(), (0.0, 0.0), (0.0, 1e9), samples=[1e9]).status.code
            return number

        return run

    slow = Job("slow", 1, tuple(map(part, range(3))))
    worker.want([slow])
    assert begun.wait(30)
    while 1 not in calls:
        time.sleep(0.01)
    worker.want([Job("fast", 1, (lambda: "now",)), slow])
    assert worker.wait(60)
    assert told(worker) == [("slow", 1, 0), ("fast", 1, 0), ("slow", 1, 1), ("slow", 1, 2)]
    assert calls == [0, 1, 1, 2]


def test_a_picture_moves_while_its_key_changes_fast(worker):
    """Each part is shown though it is no longer the newest: a slider that is dragged never stands still."""
    for key in range(20):
        worker.want([Job("live", key, (lambda: time.sleep(0.02),))])
        time.sleep(0.01)
    assert worker.wait(10)
    keys = [each.job.key for each in worker.shown]
    assert len(keys) >= 2
    assert keys == sorted(keys)
    assert keys[-1] == 19


def test_errors_are_words(worker, capsys):
    def refused():
        raise ArgumentError("x0 must be finite.")

    def broken():
        raise ZeroDivisionError("by nothing")

    worker.want([Job("first", 1, (refused, refused)), Job("second", 1, (broken,))])
    assert worker.wait(10)
    problems = [each.problem for each in worker.shown]
    assert [each.partition("): ")[2] for each in problems] == [
        *("x0 must be finite.", "ZeroDivisionError: by nothing"),
    ]
    assert all(each.startswith(__file__) for each in problems)
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_a_closed_worker_ends():
    made = Worker(lambda outcome: None)
    made.want([Job("first", 1, (lambda: time.sleep(0.05),))])
    made.close()
    assert not made.thread.is_alive()


def test_who_closes_a_worker_need_not_wait():
    """A part may take long, and the thread that shows results must go on."""
    begun, end = threading.Event(), threading.Event()
    made = Worker(lambda outcome: None)
    made.want([Job("first", 1, (lambda: (begun.set(), end.wait(10)),))])
    assert begun.wait(10)
    made.close(wait=False)
    assert made.thread.is_alive()
    end.set()
    made.thread.join(10)
    assert not made.thread.is_alive()
