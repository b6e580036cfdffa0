"""Work for executors rule by rule: its chunks, what a worker gets, and points that nobody finished."""

from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.errors import ArgumentError, HybridError
from hybrid.status import StatusCode
from hybrid.sweep import job, remote
from hybrid.sweep.points import as_points


@pytest.mark.parametrize(("workers", "points"), [(2, 20), (200, 40)])
def test_chunks_grow_with_the_number_of_workers(workers, points):
    """A row of 0.1 s: two seconds of work, and 20 ms for each worker."""
    count = 3 * workers * points
    over = as_points({"a": np.arange(float(count))})
    chunks = remote._Chunks(job.Job(None, over, np.arange(count), None), workers)
    chunks.learn([[0]], 0.1)
    assert len(chunks.next()) == points


def test_lines_stay_whole_in_chunks():
    """A line whose last points are there is computed up to its last missing point."""
    points = as_points({"a": [1.0, 2.0, 3.0], "b": [1.0, 2.0]})
    found = job.Job(None, points, np.array([1, 2]), points.lines("a")).units()
    assert found == [[0, 2], [1]]


class TestChunks:
    """Three lines of four points along ``a``; of the second line nothing is missing."""

    points = as_points({"a": [1.0, 2.0, 3.0, 4.0], "b": [1.0, 2.0, 3.0]})
    missing = np.array([0, 3, 5, 9])

    def made(self, along, workers=1):
        lines = self.points.lines("a") if along else None
        return remote._Chunks(job.Job(None, self.points, self.missing, lines), workers)

    @pytest.mark.parametrize(
        ("along", "wanted"), [(True, [[0, 3, 6, 9], [2, 5]]), (False, [[0], [3], [5], [9]])]
    )
    def test_units_are_points_or_lines(self, along, wanted):
        chunks = self.made(along)
        assert chunks.left == len(wanted)
        assert [chunks.next() for _ in wanted] == [[each] for each in wanted]
        assert chunks.left == 0
        assert chunks.next() is None

    @pytest.mark.parametrize(("count", "workers", "size"), [(400, 1, 133), (400, 4, 33), (3, 1, 1)])
    def test_each_worker_gets_three_chunks_of_what_is_left(self, count, workers, size):
        points = as_points({"a": np.arange(float(count))})
        chunks = remote._Chunks(job.Job(None, points, np.arange(count), None), workers)
        assert len(chunks.next()) == 1
        chunks.learn([[0]], 0.0)
        assert len(chunks.next()) == size

    @pytest.mark.parametrize("along", [True, False])
    def test_what_a_worker_gets(self, along):
        chunks = self.made(along)
        chunk = chunks.next()
        names, units, values, wanted = chunks.packed(chunk)
        assert (names, units) == (("a", "b"), chunk)
        np.testing.assert_array_equal(values, self.points.values[chunk[0]])
        assert wanted == ({0, 3, 9} if along else None)

    def test_the_least_time_counts_and_may_grow_by_a_quarter(self):
        chunks = self.made(False)
        for seconds, known in ((9.0, 3.0), (1.5, 0.5), (3.0, 0.625), (0.0, 1e-6)):
            chunks.learn([[0], [3], [5]], seconds)
            assert chunks.seconds_per_unit == pytest.approx(known)

    @pytest.mark.parametrize("along", [True, False])
    def test_points_that_nobody_finished(self, along):
        """Of a line, those that were there before are not lost."""
        part = remote._lost([[0, 3, 6, 9], [2, 5]], self.made(along), MemoryError("too many."))
        assert part.rows.tolist() == ([0, 3, 9, 5] if along else [0, 3, 6, 9, 2, 5])
        assert part.codes.tolist() == [StatusCode.NOT_RUN] * len(part.rows)
        text = "No worker finished this point: MemoryError: too many. Call again to compute it."
        assert part.messages == [text] * len(part.rows)
        assert (part.schema, part.columns) == (None, [])


def part_of(rows):
    """Results of so many rows."""
    return remote.Part(np.array(rows), None, [], np.zeros(len(rows), dtype=np.int16), [""] * len(rows))


class Pool:
    """An executor that computes each chunk at once, but for those that it loses or refuses.

    ``lost`` chunks fail with an error, or are cancelled; from the number ``refused`` on none is taken.
    """

    def __init__(self, *, lost=None, refused=None):
        self.lost, self.refused, self.given, self.open, self.most = lost or {}, refused, [], 0, 0

    def submit(self, function, payload, names, chunk, values, wanted, place):
        assert function is remote.run_chunk
        if len(self.given) == self.refused:
            raise BrokenExecutor("gone.")
        self.given.append((payload, chunk, place))
        self.open += 1
        self.most = max(self.most, self.open)
        future = Future()
        rows = [row for line in chunk for row in line]
        failure = self.lost.get(rows[0])
        if isinstance(failure, Exception):
            future.set_exception(failure)
        elif rows[0] == 5:
            # The worker has written this part itself.
            future.set_result((1e9, [("a file", np.array(rows))], []))
        else:
            future.set_result((1e9, [], [part_of([row]) for row in rows]))
        return future


class Stopped(nullcontext):
    """Ctrl-C once something is the case."""

    def is_set(self):
        return self.enter_result()


def run_on(monkeypatch, *, workers=1, count=7, target=None, stopped=None, **options):
    """Points one by one: whether the run is complete, the rows kept, the rows lost, and the reports."""
    points = as_points({"a": np.arange(float(count))})
    pool, kept, lost, reports = Pool(**options), [], [], []

    def wait(running, timeout, return_when):
        assert (timeout, return_when) == (remote.LOOK, "FIRST_COMPLETED")
        first = next(iter(running))
        pool.open -= 1
        return {first}, None

    def keep(part):
        missing = part.codes == StatusCode.NOT_RUN
        kept.extend(part.rows[~missing].tolist())
        lost.extend(part.rows[missing].tolist())

    monkeypatch.setattr(remote, "as_executor", lambda executor: (executor, workers))
    monkeypatch.setattr(
        remote, "needed", lambda *given: SimpleNamespace(dumps=lambda task: f"bytes of {task}")
    )
    monkeypatch.setattr(remote, "wait", wait)
    if stopped is not None:
        monkeypatch.setattr(remote, "CTRL_C", Stopped(lambda: len(kept) >= stopped))
    work = job.Job("task", points, np.arange(count), None)
    complete = remote.run_on(pool, work, keep, reports.append, target)
    assert all(payload == "bytes of task" for payload, *_ in pool.given)
    return complete, kept, lost, reports, pool


@pytest.mark.parametrize("workers", [1, 2])
def test_all_points_are_computed_and_three_chunks_wait_for_each_worker(workers, monkeypatch):
    """The part of row 5 came in a file, which only a target reads."""
    complete, kept, lost, reports, pool = run_on(monkeypatch, workers=workers)
    assert (complete, kept, lost, reports) == (True, [0, 1, 2, 3, 4, 6], [], [1] * 7)
    assert pool.most == 3 * workers
    assert [place for *_, place in pool.given] == [None] * 7


def test_a_target_receives_the_files_of_the_workers(monkeypatch):
    received = []
    keys = [bytes([i]) for i in range(7)]
    target = remote.Target("folder", "seal", keys, lambda name, rows: received.append((name, rows.tolist())))
    complete, kept, lost, reports, pool = run_on(monkeypatch, target=target)
    assert (complete, kept, lost, reports) == (True, [0, 1, 2, 3, 4, 6], [], [1] * 7)
    assert received == [("a file", [5])]
    assert [place for *_, place in pool.given] == [("folder", "seal", {i: bytes([i])}) for i in range(7)]


def test_chunks_that_a_worker_loses_are_told_and_the_others_go_on(monkeypatch):
    lost = {1: ValueError("odd"), 3: MemoryError("full")}
    complete, kept, found, reports, _ = run_on(monkeypatch, lost=lost)
    assert (complete, kept, found, reports) == (True, [0, 2, 4, 6], [1, 3], [1] * 5)
    with pytest.raises(HybridError, match="of the model"):
        run_on(monkeypatch, lost={2: HybridError("of the model")})


@pytest.mark.parametrize("refused", [0, 2, 4, 6])
def test_an_executor_that_takes_no_more_loses_the_rest(refused, monkeypatch):
    """What it has taken is still awaited; no chunk is offered twice."""
    complete, kept, lost, reports, pool = run_on(monkeypatch, refused=refused)
    assert complete
    assert kept == [row for row in range(refused) if row != 5]
    assert (lost, reports) == ([*range(refused, 7)], [1] * refused)
    assert len(pool.given) == refused


def test_ctrl_c_cancels_what_waits(monkeypatch):
    complete, kept, lost, reports, pool = run_on(monkeypatch, stopped=2)
    assert (complete, kept, lost, reports) == (False, [0, 1], [], [1, 1])
    assert len(pool.given) == 5


@pytest.mark.parametrize(("most", "workers"), [(None, 1), (0, 1), (1, 1), (8, 8)])
def test_workers_of_an_executor(most, workers):
    class Own(Executor):
        _max_workers = most

    pool = Own()
    assert remote.as_executor(pool) == (pool, workers)


@pytest.mark.parametrize(("threads", "workers"), [({}, 1), ({"a": 2, "b": 3}, 5)])
def test_workers_of_a_cluster(threads, workers):
    client = SimpleNamespace(get_executor=lambda pure: ("pool", pure), nthreads=lambda: threads)
    assert remote.as_executor(client) == (("pool", False), workers)
    for wrong in (3.5, SimpleNamespace(nthreads=dict), SimpleNamespace(get_executor=dict)):
        with pytest.raises(ArgumentError, match="executor must be None, a number of threads"):
            remote.as_executor(wrong)


class TestWritten:
    """Which parts a worker writes into the store."""

    place = ("folder", "seal", {3: b"three"})

    def written(self, monkeypatch, codes=(0,), failure=None):
        asked, files = [], []

        def write(path, part, keys):
            asked.append((str(path), keys))
            if failure is not None:
                raise failure
            return "name", part.rows

        monkeypatch.setattr(remote, "write_part", write)
        part = remote.Part(np.array([3]), None, [], np.array(codes, dtype=np.int16), [""])
        found = remote._is_written(part, self.place, files)
        assert all(each == ("folder", {3: b"three"}) for each in asked)
        return found, [name for name, _ in files], len(asked)

    def test_complete_and_failed_points(self, monkeypatch):
        for code in (StatusCode.SUCCESS, StatusCode.FAILED, StatusCode.NON_FINITE):
            assert self.written(monkeypatch, [code]) == (True, ["name"], 1)

    def test_points_to_be_computed_again_are_sent_back(self, monkeypatch):
        for code in (StatusCode.NOT_RUN, StatusCode.INTERRUPTED):
            assert self.written(monkeypatch, [StatusCode.SUCCESS, code]) == (False, [], 0)

    def test_a_folder_that_cannot_be_written(self, monkeypatch):
        assert self.written(monkeypatch, failure=OSError("full")) == (False, [], 1)


@pytest.mark.parametrize("sees", [None, False, True])
def test_a_worker_sends_back_what_it_has_not_written(sees, monkeypatch):
    """None: there is no store. The row 2 cannot be written."""
    points = as_points({"a": np.arange(5.0)})
    monkeypatch.setattr(remote, "_task_of", lambda payload: lambda p: {"y": p["a"] ** 2})
    monkeypatch.setattr(remote, "sees_store", lambda path, seal: (str(path), seal) == ("f", "s") and sees)

    def is_written(part, place, files):
        files.append(("name", part.rows))
        return True

    monkeypatch.setattr(remote, "_is_written", is_written)
    place = None if sees is None else ("f", "s", {})
    seconds, files, parts = remote.run_chunk(
        b"payload", points.names, [[1], [2]], points.values[[1, 2]], None, place
    )
    assert seconds >= 0.0
    rows = [row for part in parts for row in part.rows.tolist()]
    written = [row for _, each in files for row in each.tolist()]
    assert (rows, written) == (([], [1, 2]) if sees else ([1, 2], []))
    if not sees:
        values = [value for part in parts for value in part.columns[0].tolist()]
        assert values == [1.0, 4.0]
