"""Sweeps on executors: processes, a Dask cluster, workers that die."""

import os
import signal
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from hybrid import HybridError, StatusCode, sweep
from hybrid.sweep import job, remote
from hybrid.sweep.points import as_points
from hybrid.sweep.store import Store

pytest.importorskip("cloudpickle")

SHORT = {"intervals": 40, "transient": 10, "solver": hybrid.DOP853(rtol=1e-7, atol=1e-9)}


@pytest.fixture(scope="module")
def pool():
    # Fresh interpreters, because the tests have threads.
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        yield executor


def np_sin(p):
    return {"y": np.sin(p["a"])}


def same(one, other):
    return one.drop_attrs().identical(other.drop_attrs())


def test_processes_give_what_threads_give(pool):
    def task(p):
        if p["a"] == 3.0:
            raise ValueError("three")
        return {"y": np.sin(p["a"]), "both": np.array(list(p.values()))}

    over = {"a": np.arange(50.0), "b": [1.0, 2.0]}
    assert same(sweep(task, over, executor=pool), sweep(task, over))


@pytest.mark.parametrize("continue_from", [None, "A"])
def test_charts_travel_with_their_models(pool, continue_from, tmp_path):
    """Fields and guards of this model are functions without a name that could be imported."""
    over = {"A": [0.9, 1.0, 1.1], "r": [0.7, 0.8]}
    make = partial(
        lyapunov.chart,
        models.impact_oscillator(),
        over,
        (0.0, 0.0),
        continue_from=continue_from,
        section=2,
        **SHORT,
    )
    assert same(make(executor=pool), make())
    pytest.importorskip("zarr")
    stored = make(executor=pool, store=tmp_path / "s")
    assert same(stored, make())
    assert same(stored, hybrid.open(tmp_path / "s"))


def test_workers_write_into_a_store_that_they_see(pool, tmp_path, monkeypatch):
    pytest.importorskip("zarr")
    writers = []
    monkeypatch.setattr(Store, "write", lambda self, part: writers.append(len(part.rows)))
    over = {"a": np.arange(30.0)}
    whole = sweep(np_sin, over, store=tmp_path / "s", executor=pool)
    assert not writers
    assert same(whole, sweep(np_sin, over))
    assert same(whole, hybrid.open(tmp_path / "s"))
    # A worker on a machine where the folder is another one sends its results back.
    monkeypatch.setattr(Store, "seal", lambda self: "of another store")
    sweep(np_sin, {"a": np.arange(40.0)}, store=tmp_path / "s", executor=pool)
    assert sum(writers) == 10


def test_a_broken_pool_is_said_and_the_rest_is_computed_later(tmp_path):
    pytest.importorskip("zarr")
    flag = tmp_path / "die"
    flag.touch()

    def task(p):
        if p["a"] == 20.0 and flag.exists():
            os.kill(os.getpid(), signal.SIGKILL)
        return {"y": p["a"] ** 2}

    over = {"a": np.arange(40.0)}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        part = sweep(task, over, executor=executor, store=tmp_path / "s")
    lost = part.status == StatusCode.NOT_RUN
    assert 0 < lost.sum() < 40
    assert "No worker finished this point: BrokenProcessPool" in part.message.values[20]
    np.testing.assert_array_equal(part.y[~lost], part.a[~lost] ** 2)
    flag.unlink()
    assert same(sweep(task, over, store=tmp_path / "s"), sweep(task, over))


def test_the_extra_is_named(pool, monkeypatch):
    monkeypatch.setitem(sys.modules, "cloudpickle", None)
    with pytest.raises(HybridError, match=r"executor= needs the package cloudpickle.*hybrid-systems\[grid\]"):
        sweep(lambda p: {"y": 1.0}, {"a": [1.0]}, executor=pool)


@pytest.fixture
def client():
    distributed = pytest.importorskip("distributed")
    settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(**settings, processes=True, silence_logs=50) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_dies_has_its_chunks_done_by_others(client, tmp_path):
    pytest.importorskip("zarr")

    def task(p):
        time.sleep(0.02)
        return {"y": np.sin(p["a"]), "by": float(os.getpid())}

    over = {"a": np.arange(200.0)}
    victims = list(client.run(os.getpid).values())
    threading.Timer(1.0, os.kill, (victims[0], signal.SIGKILL)).start()
    swept = sweep(task, over, executor=client, store=tmp_path / "s")
    assert (swept.status == StatusCode.SUCCESS).all()
    np.testing.assert_array_equal(swept.y, np.sin(over["a"]))
    assert len(set(swept.by.values)) >= 2
    assert same(swept, hybrid.open(tmp_path / "s"))


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
