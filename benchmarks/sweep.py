"""What a sweep costs: ``python -m benchmarks.sweep``, with joblib and a bare loop beside it.

Each section is a function; ``--only overhead`` runs one of them. Needs the extra ``grid``, and joblib for the
comparison.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import hybrid
import models
from benchmarks.common import heading, table
from hybrid import Taylor, simulate_many
from hybrid.simulation.trajectory import start
from hybrid.sweep.outcome import Batch, Outcome, Part, outcome_of
from hybrid.sweep.points import as_points
from hybrid.sweep.store import Store

ROW = 1e-3
DONE = hybrid.Status(hybrid.StatusCode.SUCCESS, "")


class Spin:
    """Work of about 1 ms that holds no lock: rows of a kernel, as a chart has them."""

    def __init__(self) -> None:
        system = models.impact_oscillator()
        self.trajectory_of = lambda: start(system, (0.1, 0.0), 0.0, solver=Taylor())
        self.facts, self.cycles = {"work": "spin"}, 1
        for _ in range(4):
            seconds = min(times(lambda: self({"a": 0.0}))[0] for _ in range(50))
            self.cycles = max(1, round(self.cycles * ROW / seconds))

    def __call__(self, point: dict[str, float]) -> dict[str, float]:
        trajectory = self.trajectory_of()
        trajectory.advance_to(self.cycles, 0.0, trajectory.no_record())
        return {"y": point["a"]}


@contextmanager
def scratch() -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp())
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def times(work: Callable[[], object]) -> tuple[float, float]:
    """Wall-clock time and processor time in seconds."""
    clock, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - clock, time.process_time() - processor


def overhead(rows: int) -> None:
    """Time per row beyond that of a bare loop over the same rows, in one thread; ways in turns."""
    spin = Spin()
    over = {"a": np.arange(float(rows))}
    points = [{"a": value} for value in over["a"]]
    ways: dict[str, Callable[[], object]] = {
        "bare loop": lambda: [spin(point) for point in points],
        "sweep": lambda: hybrid.sweep(spin, over, executor=1, progress=False),
    }
    try:
        from joblib import Parallel, delayed

        ways["joblib, threads"] = lambda: Parallel(1, prefer="threads")(delayed(spin)(p) for p in points)
    except ImportError:
        print("joblib is not installed")
    with scratch() as folder:
        ways["sweep with a store"] = lambda: hybrid.sweep(
            spin, over, executor=1, progress=False, store=folder / f"{time.perf_counter_ns()}.zarr"
        )
        measured: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(7):
            for name, work in ways.items():
                measured[name].append(times(work)[1])
    bare = np.array(measured["bare loop"])
    heading(f"{rows} rows in one thread; processor time, median of 7 turns")
    table(
        ["way", "per row", "beyond the bare loop"],
        [
            [name, f"{1e3 * np.median(found) / rows:.3f} ms", f"{100 * np.median(found / bare - 1):.1f} %"]
            for name, found in ((name, np.array(each)) for name, each in measured.items())
        ],
    )
    nothing = outcome_alone(rows)
    print(f"\nThe sweep alone, with a task that does nothing: {1e6 * nothing:.1f} us per row.")


def outcome_alone(rows: int) -> float:
    """Processor time per row of a sweep whose task does nothing."""
    over = {"a": np.arange(float(rows))}
    result = {"y": 1.0}
    best = min(
        times(lambda: hybrid.sweep(lambda p: result, over, executor=1, progress=False))[1] for _ in range(5)
    )
    return best / rows


def threads(rows: int) -> None:
    """The same rows in one thread and in two: share of two cores, and of what the machine had free."""
    spin, found = Spin(), []
    over = {"a": np.arange(float(rows))}
    for _ in range(5):
        one = times(lambda: hybrid.sweep(spin, over, executor=1, progress=False))
        two = times(lambda: hybrid.sweep(spin, over, executor=2, progress=False))
        found.append((one[0] / (2 * two[0]), two[1] / two[0] / 2, two[1] / one[1]))
    speed, busy, processor = np.median(found, axis=0)
    heading(f"{rows} rows of 1 ms in two threads; median of 5 turns")
    print(
        f"{100 * speed:.0f} % of twice the speed of one thread. The two threads were running "
        f"{100 * busy:.0f} % of the time, and took {processor:.2f} times the processor time of one."
    )


def many(starts: int) -> None:
    """Starts of 100 periods by simulate_many, compared with the kernel alone."""
    heading(f"{starts} starts of 100 periods each, one thread, processor time; median of 5 turns")
    rows = []
    for system in (models.impact_oscillator(), models.vibroimpact()):
        random = np.random.default_rng(0)
        x0 = 1e-3 * random.uniform(-1, 1, (starts, system.dimension))
        if system.dimension == 4:
            x0[:, 1] += 0.05
        span = (0.0, 100 * system.forcing_period())
        ratios = []
        for _ in range(5):
            call = times(lambda: simulate_many(system, x0, span, executor=1))[1]  # noqa: B023
            kernel = 0.0
            for state in x0:
                trajectory = start(system, state, 0.0)
                record = trajectory.no_record()
                begin = time.process_time()
                trajectory.advance_to(100, 0.0, record)
                kernel += time.process_time() - begin
            ratios.append((call / starts, kernel / starts))
        per_call, per_kernel = np.median(ratios, axis=0)
        rows.append(
            [
                system.name,
                f"{1e6 * per_call:.0f} us",
                f"{1e6 * per_kernel:.0f} us",
                f"{np.median([kernel / call for call, kernel in ratios]):.2f}",
            ]
        )
    table(["model", "per start", "the driver alone", "share of its speed"], rows)


def memory(side: int) -> None:
    """Memory of the parent over a sweep of side x side rows with two numbers each."""
    task = Two()
    heading(f"{side} x {side} rows of two numbers, with a store")
    with scratch() as folder:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        values = np.linspace(0.0, 1.0, side)
        path = folder / "run.zarr"
        clock, processor = times(lambda: hybrid.sweep(task, {"a": values, "b": values}, store=path))
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        opened = min(times(lambda: hybrid.open_store(path))[0] for _ in range(3))
        files = sum(1 for each in path.rglob("*") if each.is_file())
        size = sum(each.stat().st_size for each in path.rglob("*") if each.is_file())
    print(
        f"{side * side} rows: {clock:.0f} s ({1e6 * processor / side**2:.0f} us of processor time per row), "
        f"largest memory {after / 1024:.0f} MB (before: {before / 1024:.0f} MB), {files} files, "
        f"{size / 1e6:.0f} MB on disk. Opened in {opened:.2f} s."
    )


class Two:
    """A task that returns two exponents."""

    def __init__(self) -> None:
        self.facts = {"work": "two numbers"}

    def __call__(self, point: dict[str, float]) -> dict[str, object]:
        return {"exponents": np.array([point["a"], point["b"]])}


def opening(side: int) -> None:
    """Opening a store of side x side rows, made without computing: as it is while a sweep runs, and after."""
    heading(f"A store of {side} x {side} rows, in parts of 20 000 rows")
    values = np.linspace(0.0, 1.0, side)
    points = as_points({"a": values, "b": values})
    with scratch() as folder:
        path = folder / "run.zarr"
        from hybrid.simulation.identity import attributes_of, facts_of
        from hybrid.sweep.sheet import Labels, Sheet

        task = Two()
        store, sheet = Store(path, facts_of(task), points, None), Sheet(points)
        made_by = attributes_of(task)
        store.begin(sheet, "today", Labels(), made_by)
        for first in range(0, len(points), 20_000):
            part = made(points.values, range(first, min(first + 20_000, len(points))))
            store.write(part)
            sheet.put(part)
        running = times(lambda: hybrid.open_store(path))[0]
        store.finish(sheet.dataset(Labels(), made_by), True)
        finished = min(times(lambda: hybrid.open_store(path))[0] for _ in range(3))
        again = times(lambda: hybrid.sweep(task, {"a": values, "b": values}, store=path))[0]
    print(
        f"Opened while the sweep runs in {running:.2f} s, when it has ended in {finished:.2f} s; the same "
        f"call again, which computes nothing, takes {again:.1f} s."
    )


def made(values: np.ndarray, rows: range) -> Part:
    batch = Batch()
    for row in rows:
        outcome: Outcome = outcome_of({"exponents": values[row]})
        batch.add(row, outcome)
    (part,) = batch.taken()
    return part


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", choices=["overhead", "threads", "many", "memory", "opening"])
    parser.add_argument("--rows", type=int, default=2000)
    parser.add_argument("--starts", type=int, default=2000)
    parser.add_argument("--side", type=int, default=1000)
    arguments = parser.parse_args()
    sections: dict[str, Callable[[], None]] = {
        "overhead": lambda: overhead(arguments.rows),
        "threads": lambda: threads(arguments.rows),
        "many": lambda: many(arguments.starts),
        "memory": lambda: memory(arguments.side),
        "opening": lambda: opening(arguments.side),
    }
    for name, section in sections.items():
        if arguments.only in (None, name):
            section()


if __name__ == "__main__":
    main()
