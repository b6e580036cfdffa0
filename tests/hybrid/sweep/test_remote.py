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


@pytest.mark.as_given
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
    assert same(stored, hybrid.open_store(tmp_path / "s"))


def test_workers_write_into_a_store_that_they_see(pool, tmp_path, monkeypatch):
    pytest.importorskip("zarr")
    writers = []
    monkeypatch.setattr(Store, "write", lambda self, part: writers.append(len(part.rows)))
    over = {"a": np.arange(30.0)}
    whole = sweep(np_sin, over, store=tmp_path / "s", executor=pool)
    assert not writers
    assert same(whole, sweep(np_sin, over))
    assert same(whole, hybrid.open_store(tmp_path / "s"))
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
    with pytest.raises(HybridError, match=r"executor= needs the package cloudpickle.*'\.\[grid\]'"):
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
    assert same(swept, hybrid.open_store(tmp_path / "s"))
