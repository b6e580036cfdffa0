"""Sweeps on disk: killed, full, shared, refused, extended; always the results of an uninterrupted run."""

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import hybrid
from hybrid import ArgumentError, HybridError, StatusCode, sweep
from hybrid.sweep import job, parts, store

pytest.importorskip("zarr")
import xarray

ROOT = Path(__file__).parents[3]


class Calls:
    """The points that were computed; without attributes, so that a task that uses it stays the same task."""

    __slots__ = ("made",)

    def append(self, point):
        self.made.append(point)

    def __iter__(self):
        return iter(self.made)

    def __len__(self):
        return len(self.made)


CALLS = Calls()
WORK = """
import sys, time
import numpy as np
import hybrid, xarray, zarr
from hybrid.sweep import job
def task(p):
    time.sleep(0.002)
    if p["a"] == 7.0:
        raise ValueError("seven")
    return {"y": np.sin(p["a"]) * p["b"], "both": np.array([p["a"], p["b"]]), "name": str(p["a"])}
over = {"a": np.arange(40.0), "b": [0.1, 0.2, 0.3, 0.4, 0.5]}
"""
PROGRAM = f"""{WORK}
hybrid.sweep(lambda p: {{"y": 1.0}}, {{"a": [1.0]}}, store=sys.argv[1] + "-first")
job.BETWEEN_WRITES = 0.01
print("ready", flush=True)
found = hybrid.sweep(task, over, store=sys.argv[1], executor=2)
print(int((found.status != 102).sum()), flush=True)
"""


@pytest.fixture(autouse=True)
def _no_calls_yet(monkeypatch):
    CALLS.made = []
    monkeypatch.setattr(job, "BETWEEN_WRITES", 0.0)


def task(p):
    CALLS.append((p["a"], p["b"]))
    if p["a"] == 3.0:
        raise ValueError("three")
    return {"y": np.sin(p["a"]) * p["b"], "both": np.array([p["a"], p["b"]]), "name": f"{p['a']}"}


GRID = {"a": [1.0, 2.0, 3.0], "b": [0.1, 0.2]}


def same(one, other):
    return one.drop_attrs().identical(other.drop_attrs())


def test_what_was_saved_comes_back(tmp_path):
    path = tmp_path / "run.zarr"
    swept = sweep(task, GRID, store=path)
    assert swept.identical(hybrid.open_store(path).load())
    assert same(swept, sweep(task, GRID))
    with xarray.open_zarr(path) as plain:
        np.testing.assert_array_equal(plain.y, swept.y)
    swept.to_netcdf(tmp_path / "run.nc")
    with hybrid.open_store(tmp_path / "run.nc") as other:
        np.testing.assert_array_equal(other.y, swept.y)


def test_what_another_attempt_has_left_is_no_obstacle(tmp_path):
    """Folders are removed; what cannot be removed so, as a file, stays."""
    path = tmp_path / "run.zarr"
    swept = sweep(task, GRID, store=path)
    (path / ".new-folder").mkdir()
    (path / ".new-file").touch()
    store._lay_out(swept, path)
    assert same(swept, hybrid.open_store(path).load())
    assert [each.name for each in path.glob(".new-*")] == [".new-file"]


def test_the_same_call_computes_nothing(tmp_path):
    first = sweep(task, GRID, store=tmp_path / "s")
    CALLS.made = []
    assert first.identical(sweep(task, GRID, store=tmp_path / "s"))
    assert not CALLS.made


def test_more_points_and_a_finer_grid_use_what_is_there(tmp_path):
    sweep(task, GRID, store=tmp_path / "s")
    CALLS.made = []
    finer = {"a": [1.0, 1.5, 2.0, 3.0, 4.0], "b": [0.2, 0.1]}
    assert same(sweep(task, finer, store=tmp_path / "s"), hybrid.open_store(tmp_path / "s").load())
    assert {a for a, _ in CALLS} == {1.5, 4.0}
    swept = hybrid.open_store(tmp_path / "s").load()
    CALLS.made = []
    assert same(swept, sweep(task, finer))
    CALLS.made = []
    points = [{"b": 0.1, "a": 1.5}, {"a": 1.0, "b": 0.2}]
    np.testing.assert_array_equal(sweep(task, points, store=tmp_path / "s").name, ["1.5", "1.0"])
    assert not CALLS.made


def test_what_is_asked_last_is_laid_out_though_nothing_is_computed(tmp_path):
    sweep(task, GRID, store=tmp_path / "s")
    CALLS.made = []
    fewer = sweep(task, {"a": [2.0, 1.0], "b": [0.2]}, store=tmp_path / "s")
    assert same(fewer, hybrid.open_store(tmp_path / "s").load())
    written = (tmp_path / "s" / store.GROUP).stat().st_mtime_ns
    sweep(task, {"a": [2.0, 1.0], "b": [0.2]}, store=tmp_path / "s")
    assert (tmp_path / "s" / store.GROUP).stat().st_mtime_ns == written
    assert not CALLS.made


def test_points_that_occur_twice(tmp_path):
    over = {"a": [1.0, 2.0, 1.0], "b": [0.1]}
    for _ in range(2):
        np.testing.assert_array_equal(
            sweep(task, over, store=tmp_path / "s").name[:, 0], ["1.0", "2.0", "1.0"]
        )


@pytest.mark.parametrize(
    ("other", "over", "message"),
    [
        (lambda p: {"y": 1.0}, GRID, "task was '.*task', and is now '.*lambda.*'; code of the task"),
        (task, {**GRID, "c": [1.0]}, "names in over was 'a, b', and is now 'a, b, c'"),
    ],
)
def test_another_call_is_refused_by_name(tmp_path, other, over, message):
    sweep(task, GRID, store=tmp_path / "s")
    with pytest.raises(ArgumentError, match=message):
        sweep(other, over, store=tmp_path / "s")


def test_a_folder_of_something_else_is_refused(tmp_path):
    (tmp_path / "letter").write_text("dear")
    with pytest.raises(ArgumentError, match="is not empty, and is not the store of a sweep"):
        sweep(task, GRID, store=tmp_path)
    with pytest.raises(ArgumentError, match="path must be the store of a sweep or a file"):
        hybrid.open_store(tmp_path)
    with pytest.raises(ArgumentError, match="store must be the path of a folder; got 3"):
        sweep(task, GRID, store=3)


def test_an_empty_folder_becomes_a_store(tmp_path):
    assert same(sweep(task, GRID, store=tmp_path), hybrid.open_store(tmp_path).load())


def test_an_interrupted_sweep_goes_on(tmp_path, monkeypatch):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    over = {"a": np.arange(10.0), "b": [0.1]}

    def slow(p):
        time.sleep(0.02)
        if p["a"] == 4.0 and len(CALLS) == 4:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.3)
        return task(p)

    try:
        part = sweep(slow, over, store=tmp_path / "s", executor=1)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (part.status == StatusCode.NOT_RUN).sum() == 6
    assert same(part, hybrid.open_store(tmp_path / "s").load())
    CALLS.made = []
    whole = sweep(slow, over, store=tmp_path / "s", executor=1)
    assert len(CALLS) == 6
    assert same(whole, sweep(slow, over))


def run_program(path):
    command = [sys.executable, "-c", PROGRAM, str(path)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)


def alone():
    """What the program computes, in this process and without a store."""
    names = {}
    exec(WORK, names)
    return sweep(names["task"], names["over"])


def test_killed_at_any_instant(tmp_path):
    """After each kill the store can be read, and holds at least what it held before."""
    counts = []
    parts = tmp_path / "s" / store.INSIDE / store.PARTS
    for least in (0, 3, 12):
        child = run_program(tmp_path / "s")
        child.stdout.readline()
        while child.poll() is None and len(list(parts.glob("*.part"))) < least:
            time.sleep(0.001)
        child.kill()
        child.communicate()
        try:
            counts.append(int((hybrid.open_store(tmp_path / "s").status != StatusCode.NOT_RUN).sum()))
        except ArgumentError:  # killed before the store was made
            counts.append(0)
    assert counts == sorted(counts)
    assert counts[-1] > 0
    child = run_program(tmp_path / "s")
    assert child.communicate(timeout=60)[0].split() == ["ready", "200"]
    assert same(hybrid.open_store(tmp_path / "s").load(), alone())


def test_two_processes_on_one_store(tmp_path):
    children = [run_program(tmp_path / "s") for _ in range(2)]
    for child in children:
        assert child.communicate(timeout=60)[0].split() == ["ready", "200"]
    assert same(hybrid.open_store(tmp_path / "s").load(), alone())


def test_a_full_disk_is_said_and_loses_nothing(tmp_path, monkeypatch):
    fsync, left = os.fsync, [9]

    def full(handle):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(28, "No space left on device")
        fsync(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(HybridError, match=r"cannot be written: .*No space left on device.*call again"):
        sweep(task, GRID, store=tmp_path / "s", executor=1)
    monkeypatch.undo()
    done = int((hybrid.open_store(tmp_path / "s").status != StatusCode.NOT_RUN).sum())
    assert 0 < done < 6
    CALLS.made = []
    whole = sweep(task, GRID, store=tmp_path / "s")
    assert len(CALLS) == 6 - done
    assert same(whole, sweep(task, GRID))
    assert not list(tmp_path.rglob("*.tmp"))


def test_a_damaged_part_is_said(tmp_path):
    sweep(task, GRID, store=tmp_path / "s", executor=1)
    part = next((tmp_path / "s" / store.INSIDE / store.PARTS).iterdir())
    content = bytearray(part.read_bytes())
    content[len(content) // 2] ^= 1
    part.write_bytes(content)
    with pytest.raises(HybridError, match=f"{part.name}' is damaged: its checksum does not match. Delete"):
        sweep(task, GRID, store=tmp_path / "s")
    part.unlink()
    assert same(sweep(task, GRID, store=tmp_path / "s"), sweep(task, GRID))


def test_parts_keep_every_bit(tmp_path):
    values = np.array([0.1, -0.0, np.nan, np.inf, 5e-324])
    swept = sweep(
        lambda p: {"v": values * p["a"], "c": 1j * p["a"]}, {"a": [1.0, 1e-9]}, store=tmp_path / "s"
    )
    again = sweep(
        lambda p: {"v": values * p["a"], "c": 1j * p["a"]}, {"a": [1.0, 1e-9]}, store=tmp_path / "s"
    )
    assert swept.v.values.tobytes() == again.v.values.tobytes()
    assert again.c.dtype == complex


def test_failures_of_the_machine_are_tried_again(tmp_path):
    failing = [True]

    def fragile(p):
        if failing:
            failing.clear()
            raise MemoryError("no room")
        return {"y": p["a"]}

    first = sweep(fragile, {"a": [1.0]}, store=tmp_path / "s")
    assert first.status[0] == StatusCode.NOT_RUN
    assert "MemoryError: no room. Call again" in first.message.values[0]
    failing.append(True)
    assert sweep(fragile, {"a": [1.0]}, store=tmp_path / "s").status[0] == StatusCode.NOT_RUN


def test_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(HybridError, match=r"store= needs the package zarr.*pip install '\.\[grid\]'"):
        sweep(task, GRID, store=tmp_path / "s")


def test_a_chain_of_points_depends_on_its_beginning(tmp_path):
    class Sum:
        along = "a"
        facts = {"kind": "sum"}  # noqa: RUF012

        def carry(self, point, state):
            return (state or 0.0) + point["a"]

        def __call__(self, point, state):
            CALLS.append(point["a"])
            return {"before": state or 0.0}

    sweep(Sum(), {"a": [1.0, 2.0, 3.0]}, store=tmp_path / "s", executor=1)
    CALLS.made = []
    swept = sweep(Sum(), {"a": [1.0, 2.0, 3.0, 4.0]}, store=tmp_path / "s", executor=1)
    assert list(CALLS) == [4.0]
    np.testing.assert_array_equal(swept.before, [0.0, 1.0, 3.0, 6.0])
    CALLS.made = []
    sweep(Sum(), {"a": [1.0, 2.5, 3.0]}, store=tmp_path / "s", executor=1)
    assert list(CALLS) == [2.5, 3.0]


def test_readers_and_writers_at_once(tmp_path):
    """A store is read while it is written; every look finds a consistent state."""
    looks, stop = [], threading.Event()

    def look():
        while not stop.is_set():
            if (tmp_path / "s" / store.INSIDE / store.LATEST).exists():
                found = hybrid.open_store(tmp_path / "s").load()
                done = (found.status == StatusCode.SUCCESS).values
                if not done.any():
                    continue
                np.testing.assert_array_equal(found.y2[done], found.a[done] ** 2)
                looks.append(int(done.sum()))

    reader = threading.Thread(target=look)
    reader.start()
    sweep(lambda p: time.sleep(0.005) or {"y2": p["a"] ** 2}, {"a": np.arange(60.0)}, store=tmp_path / "s")
    stop.set()
    reader.join()
    assert looks == sorted(looks)


def test_a_part_that_is_cut_short(tmp_path):
    (tmp_path / "p").write_bytes(b"")
    with pytest.raises(parts.DamagedError):
        parts.read_part(tmp_path / "p")


def test_the_seal_of_a_store_is_what_its_folder_says(tmp_path):
    kept = store.Store.__new__(store.Store)
    kept.path = tmp_path
    assert kept.seal() == ""
    (tmp_path / store.INSIDE).mkdir()
    (tmp_path / store.INSIDE / store.MADE_BY).write_text("a seal")
    assert kept.seal() == "a seal"
    assert store.sees_store(tmp_path, "a seal")
    assert not store.sees_store(tmp_path, "another")
    assert not store.sees_store(tmp_path, "")


def test_a_file_of_a_worker_goes_into_the_sheet(tmp_path, monkeypatch):
    """One that cannot be seen yet is read later."""
    kept, put, asked = store.Store.__new__(store.Store), [], []
    kept.path, kept.seen = tmp_path, set()
    sheet = SimpleNamespace(put=put.append)
    kept.receive("no such", np.array([4, 2]), sheet)
    assert (kept.seen, put) == (set(), [])

    def read_part(path):
        asked.append(path)
        return [], SimpleNamespace(at=lambda rows, places: (rows.tolist(), places.tolist()))

    monkeypatch.setattr(store, "read_part", read_part)
    kept.receive("part", np.array([4, 2]), sheet)
    assert asked == [tmp_path / store.INSIDE / store.PARTS / "part"]
    assert (kept.seen, put) == ({"part"}, [([4, 2], [0, 1])])


def damaged(content, how):
    if how == "half":
        return content[: len(content) // 2]
    if how == "other bits" and content:
        middle = len(content) // 2
        return content[:middle] + bytes([content[middle] ^ 4]) + content[middle + 1 :]
    return {"other bits": b"", "another": b'{"a": 1}'}[how]


@pytest.mark.parametrize("how", ["gone", "half", "other bits", "another"])
def test_whatever_file_is_damaged_the_results_are_right_or_said_to_be_lost(tmp_path, how):
    """The zarr group has no checksums of its own: a chunk that was lost read as zeros, status included."""
    whole, path = tmp_path / "whole", tmp_path / "s"
    grid = {"a": [1.0, 2.0], "b": [0.1]}
    wanted = sweep(task, grid, store=whole, executor=1)
    names = [each.relative_to(whole) for each in sorted(whole.rglob("*")) if each.is_file()]
    assert len(names) > 8
    for name in names:
        shutil.copytree(whole, path)
        content = (path / name).read_bytes()
        (path / name).unlink()
        if how != "gone":
            (path / name).write_bytes(damaged(content, how))
        for call in (lambda: hybrid.open_store(path), lambda: sweep(task, grid, store=path, executor=1)):
            try:
                found = call()
            except HybridError:
                continue
            lost = found.status == StatusCode.NOT_RUN
            assert (lost | (found.y == wanted.y) & (found.status == wanted.status)).all(), name
        shutil.rmtree(path)


def test_parts_without_what_made_them_are_not_taken(tmp_path):
    sweep(task, GRID, store=tmp_path / "s", executor=1)
    (tmp_path / "s" / store.INSIDE / store.MADE_BY).unlink()
    with pytest.raises(
        HybridError, match=r"made_by.json' is damaged or missing, so it is not known what made"
    ):
        sweep(task, GRID, store=tmp_path / "s", executor=1)


def test_a_copy_of_the_zarr_group_alone_is_read_or_said_to_be_damaged(tmp_path):
    wanted = sweep(task, GRID, store=tmp_path / "s", executor=1)
    shutil.rmtree(tmp_path / "s" / store.INSIDE)
    assert (hybrid.open_store(tmp_path / "s").y == wanted.y)[:2].all()
    next(each for each in (tmp_path / "s/y/c").rglob("0") if each.is_file()).write_bytes(b"nothing")
    with pytest.raises(HybridError, match=r"the variable 'y' of the folder .* cannot be read"):
        hybrid.open_store(tmp_path / "s")


def test_a_copy_of_the_zarr_group_without_a_chunk_is_refused(tmp_path):
    sweep(task, GRID, store=tmp_path / "s", executor=1)
    shutil.rmtree(tmp_path / "s" / store.INSIDE)
    next(each for each in (tmp_path / "s/y/c").rglob("0") if each.is_file()).unlink()
    with pytest.raises(HybridError, match=r"path .* is not what was saved: 'y' is damaged or changed"):
        hybrid.open_store(tmp_path / "s")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.7, 0.95])
def test_a_file_that_is_cut_short_is_named(tmp_path, share):
    sweep(task, GRID, executor=1).to_netcdf(tmp_path / "s.nc")
    whole = (tmp_path / "s.nc").read_bytes()
    (tmp_path / "s.nc").write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(HybridError, match=r"the (variable '\w+' of the )?file .*s\.nc' cannot be read"):
        hybrid.open_store(tmp_path / "s.nc")
