"""A task over grids and tables: labels, failures, interrupts, threads and lines."""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import xarray

import hybrid
import models
from hybrid import ArgumentError, Status, StatusCode, sweep

ROOT = Path(__file__).parents[3]
GRID = {"a": [1.0, 2.0, 3.0], "b": [4.0, 5.0]}


def product(p):
    return {"product": p["a"] * p["b"], "pair": np.array([p["a"], p["b"]]), "name": f"{p['a']:.0f}"}


def same(one, other):
    """Whether two datasets are the same to the last bit, but for dates."""
    return one.drop_attrs().identical(other.drop_attrs())


def test_a_grid_of_any_number_of_axes():
    swept = sweep(product, GRID)
    assert swept["product"].dims == ("a", "b")
    assert swept.pair.dims == ("a", "b", "pair_0")
    np.testing.assert_array_equal(swept["product"], np.outer(GRID["a"], GRID["b"]))
    assert swept.name.sel(a=2.0, b=5.0) == "2"
    assert (swept.status == StatusCode.SUCCESS).all()
    assert sweep(
        lambda p: {"sum": sum(p.values())}, {name: [1.0, 2.0] for name in "abcd"}
    ).sizes == dict.fromkeys("abcd", 2)


@pytest.mark.parametrize(
    "over",
    [
        [{"a": 1.0, "b": 4.0}, {"b": 5.0, "a": 2.0}],
        xarray.Dataset({"a": ("point", [1.0, 2.0]), "b": ("point", [4.0, 5.0])}),
    ],
)
def test_a_table_of_points(over):
    swept = sweep(product, over)
    assert swept["product"].dims == ("point",)
    np.testing.assert_array_equal(swept["product"], [4.0, 10.0])
    np.testing.assert_array_equal(swept.b, [4.0, 5.0])


def test_units_of_the_axes_are_kept():
    omega = xarray.DataArray([1.0, 2.0], dims="w", attrs={"units": "rad/s"})
    assert sweep(lambda p: {"w2": p["w"] ** 2}, {"w": omega}).w.attrs == {"units": "rad/s"}


def test_a_task_may_return_a_dataset():
    def task(p):
        levels = xarray.DataArray([p["a"], p["a"] ** 2], dims="power", coords={"power": [1, 2]})
        return xarray.Dataset({"level": levels.assign_attrs(units="m"), "top": p["a"]})

    swept = sweep(task, {"a": [2.0, 3.0]})
    assert swept.level.dims == ("a", "power")
    assert swept.level.sel(a=3.0, power=2) == 9.0
    assert swept.level.attrs == {"units": "m"}


def test_a_failing_point_fails_alone():
    def task(p):
        return {"inverse": 1.0 / (p["a"] - 2.0)} if p["a"] < 3 else {"inverse": [1.0, 2.0]}

    swept = sweep(task, {"a": [1.0, 2.0, 3.0]})
    np.testing.assert_array_equal(swept.inverse, [-1.0, math.nan, math.nan])
    assert swept.status.values.tolist() == [StatusCode.SUCCESS, StatusCode.FAILED, StatusCode.FAILED]
    assert swept.message.values[1] == "ZeroDivisionError: float division by zero"
    assert "returned inverse (2,) real, and at the first point inverse () real" in swept.message.values[2]


def test_a_status_that_the_task_returns_is_that_of_the_point():
    bad = Status(StatusCode.MAX_STEPS, "Too long.", "Wait.")
    swept = sweep(lambda p: {"x": p["a"], "status": bad}, {"a": [1.0]})
    assert (int(swept.status[0]), swept.message.values[0]) == (StatusCode.MAX_STEPS, "Too long. Wait.")
    assert swept.x[0] == 1.0


@pytest.mark.parametrize(
    "returned", [None, 3.0, {"status": 1.0}, {3: 1.0}, {"x": object()}, {"x": [[1], [1, 2]]}]
)
def test_nothing_but_named_numbers_is_a_result(returned):
    swept = sweep(lambda p: returned, {"a": [1.0]})
    assert swept.status[0] == StatusCode.FAILED
    assert swept.message.values[0].startswith("task")


def test_a_result_cannot_have_the_name_of_an_axis():
    with pytest.raises(ArgumentError, match="the result 'a' has the name of an axis"):
        sweep(lambda p: {"a": 1.0}, {"a": [1.0]})


def test_attributes_say_what_made_it():
    ball = models.bouncing_ball()

    def task(p):
        return {"x": hybrid.simulate(ball, (1.0, 0.0), (0.0, 0.1), parameters=p).x[-1, 0]}

    made_by = sweep(task, {"e": [0.5]}).attrs
    assert made_by["task"].endswith("task")
    assert made_by["model"] == ball.name
    assert made_by["hybrid_version"] == hybrid.__version__
    assert {"task_hash", "model_hash", "model_parameters", "python_version", "date"} <= made_by.keys()


@pytest.mark.parametrize("executor", [1, 3, ThreadPoolExecutor(2)])
def test_the_number_of_threads_does_not_matter(executor):
    assert same(sweep(product, GRID, executor=executor), sweep(product, GRID))


class Sum:
    """Each point adds its value to the sum of those before it on its line."""

    along = "a"

    def carry(self, point, state):
        if point["a"] == 2.0:
            raise ArithmeticError("lost")
        return (state or 0.0) + point["a"]

    def __call__(self, point, state):
        return {"before": state or 0.0, "b2": point["b"]}


@pytest.mark.parametrize("executor", [1, 3])
def test_lines_are_followed(executor):
    swept = sweep(Sum(), {"a": [1.0, 3.0, 2.0, 4.0], "b": [4.0, 5.0]}, executor=executor)
    np.testing.assert_array_equal(swept.before, np.outer([0.0, 1.0, 4.0, 0.0], [1.0, 1.0]))


def test_an_interrupt_keeps_the_points_done():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    begin = time.perf_counter()
    try:
        swept = sweep(lambda p: time.sleep(0.01) or {"a2": p["a"]}, {"a": np.arange(2000.0)}, executor=2)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.perf_counter() - begin < 5.0
    done = swept.status == StatusCode.SUCCESS
    assert 10 <= int(done.sum()) < 1000
    np.testing.assert_array_equal(swept.a2[done], swept.a[done])
    assert (swept.status[~done] == StatusCode.NOT_RUN).all()
    assert "The sweep ended before this point was complete" in swept.message.values[-1]


def test_an_interrupt_ends_the_run_in_hand():
    """A run inside a task that takes minutes ends with the sweep, and its point counts as not run."""
    system = models.impact_oscillator()
    pressed = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))

    def task(p):
        # Not before there is a run in hand, however long the machine takes to get there.
        if not pressed.ident:
            pressed.start()
        arc = hybrid.simulate(system, (0.0, 0.0), (0.0, 1e9), parameters=p, samples=[1e9], max_jumps=10**9)
        return {"t": arc.steps}

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    begin = time.process_time()
    try:
        swept = sweep(task, {"c": [0.1, 0.2, 0.3]}, executor=1)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.process_time() - begin < 10.0
    assert (swept.status == StatusCode.NOT_RUN).all()


def test_an_interrupt_is_heard_while_the_interpreter_is_busy():
    """The interrupt comes while a task keeps the interpreter for itself, longer than between two looks."""
    system = models.impact_oscillator()

    def task(p):
        # The main thread waits by now.
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(3 * 10**7))
        arc = hybrid.simulate(system, (0.0, 0.0), (0.0, 1e8), parameters=p, samples=[1e8], max_jumps=10**9)
        return {"t": arc.steps}

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    begin = time.process_time()
    try:
        swept = sweep(task, {"c": [0.1, 0.2]}, executor=1)
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.process_time() - begin < 10.0
    assert (swept.status == StatusCode.NOT_RUN).all()


def test_a_bar_shows_the_time_left(capsys):
    sweep(lambda p: {"a2": p["a"]}, {"a": np.arange(20.0)}, progress=True)
    assert "Sweep" in capsys.readouterr().err
    sweep(lambda p: {"a2": p["a"]}, {"a": np.arange(20.0)})
    assert capsys.readouterr().err == ""


def test_xarray_is_imported_by_the_first_sweep():
    program = (
        "import sys, hybrid; assert 'xarray' not in sys.modules; "
        "hybrid.sweep(lambda p: {'y': p['x']}, {'x': [1.0]}); assert 'zarr' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=True)


@pytest.mark.parametrize(
    ("over", "message"),
    [
        (None, "over must map names to values"),
        ({}, "over must map names to values"),
        ("ab", "over must map names to values"),
        ([], "over must map names to values"),
        ([{}], "over must map names to values"),
        ([1.0], r"over\[0\] must map names to numbers"),
        ([{"a": 1.0}, {"b": 1.0}], r"over\[1\] must have the names of over\[0\], a; got b"),
        ([{"a": "x"}], "over: 'a' must be a list of finite numbers"),
        ({"a": 1.0}, r"over\['a'\] must be a list of finite numbers, one or more; got shape \(\)"),
        ({"a": [math.nan]}, r"over\['a'\] must be a list of finite numbers"),
        ({3: [1.0]}, "over: each name must be a text; got 3"),
        ({"status": [1.0]}, "over: 'status' is the name of a result"),
        (xarray.Dataset(), "over must have one dimension"),
        (xarray.Dataset(coords={"a": [1.0]}), "over must have variables"),
    ],
)
def test_bad_points(over, message):
    with pytest.raises(ArgumentError, match=message):
        sweep(product, over)


@pytest.mark.parametrize("executor", [0, True, 1.5, "a", object(), {}])
def test_bad_executors(executor):
    with pytest.raises(ArgumentError, match="executor must be"):
        sweep(product, GRID, executor=executor)


def test_a_task_that_calls_nothing_of_the_library_is_given_up_after_ctrl_c():
    """The task waits until the sweep has returned: with the point in hand, the sweep would never end."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    returned, begun = threading.Event(), threading.Event()

    def task(point):
        if point["a"] > 0.0:
            begun.set()
            returned.wait(60.0)
        return {"twice": 2.0 * point["a"]}

    def press():
        begun.wait(60.0)
        os.kill(os.getpid(), signal.SIGINT)

    try:
        threading.Thread(target=press).start()
        found = hybrid.sweep(task, {"a": [0.0, 1.0, 2.0]}, executor=1)
    finally:
        returned.set()
        signal.signal(signal.SIGINT, before)
    assert found.status.values.tolist() == [StatusCode.SUCCESS, StatusCode.NOT_RUN, StatusCode.NOT_RUN]
    assert found.twice.values[0] == 0.0


def test_a_task_of_many_runs_ends_at_its_next_run_after_ctrl_c():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    ended, ball = threading.Event(), models.bouncing_ball()

    def task(point):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(10**9):
                hybrid.simulate(ball, (1.0, 0.0), (0.0, 1.0))
        finally:
            ended.set()

    try:
        found = hybrid.sweep(task, {"a": [0.0, 1.0]}, executor=1)
    finally:
        signal.signal(signal.SIGINT, before)
    assert (found.status == StatusCode.NOT_RUN).all()
    assert ended.wait(60.0)
