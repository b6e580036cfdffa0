"""Charts compared with single spectra for any number of threads, and their content when rows fail."""

import os
import signal
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import xarray

import hybrid
import lyapunov
import models
from hybrid import StatusCode
from lyapunov.chart import Exponents
from lyapunov.estimates import Estimates
from models.one_impact import one_impact_orbits

SHORT = {"intervals": 60, "transient": 20, "solver": hybrid.DOP853(rtol=1e-7, atol=1e-9)}
REST = (0.0, 0.0)


def assert_same(one, other):
    assert one.drop_attrs().identical(other.drop_attrs())


def ok(chart):
    return (chart.status == StatusCode.SUCCESS).values


def duffing():
    """Two wells: a weakly driven orbit stays in its well."""
    return hybrid.HybridSystem(
        state=("x", "v"),
        parameters={"A": 0.05, "tilt": 0.0},
        modes=[hybrid.Mode("on", lambda t, x, p: (x.v, x.x - x.x**3 - 0.3 * x.v + p.tilt + p.A * np.cos(t)))],
        period=2 * np.pi,
    )


@pytest.mark.parametrize(("period", "forced"), [(2.0, "yes"), (None, "no")])
def test_what_decides_the_results_of_a_chart(period, forced):
    made = SimpleNamespace(
        rows=SimpleNamespace(facts=lambda: {"solver": "s"}),
        system=SimpleNamespace(period=period),
        **{"k": 2, "intervals": 30, "interval": 0.5, "transient": 4, "points": 7},
    )
    settings = {"k": 2, "intervals": 30, "interval": 0.5, "transient": 4}
    assert Exponents.facts.fget(made) == {"solver": "s", **settings, "section": 7, "forced": forced}


def test_rows_are_the_spectra_one_by_one():
    values = np.linspace(0.7, 0.9, 5)
    chart = lyapunov.chart(models.impact_oscillator(), {"r": values}, REST, k=2, executor=3, **SHORT)
    assert chart.exponents.shape == (5, 2)
    for i, r in enumerate(values):
        row = lyapunov.lyapunov_spectrum(models.impact_oscillator(), REST, parameters={"r": r}, **SHORT)
        np.testing.assert_array_equal(chart.exponents[i], row.exponents)
        np.testing.assert_array_equal(chart.standard_error[i], row.standard_error)
        np.testing.assert_array_equal(chart.x_end[i], row.x)
        assert (chart.sum_rule[i], chart.jumps_per_interval[i]) == (row.sum_rule, row.jumps_per_interval)
        assert (chart.mode_end[i], chart.status[i]) == (row.mode, row.status.code)


@pytest.mark.parametrize("section", [0, 3])
def test_a_row_leaves_nothing_to_the_next(section):
    """Rows take over memory and model of the rows before, also of those that fail or start elsewhere."""
    tank = hybrid.HybridSystem(
        state=("h", "s"),
        parameters={"c": 0.3, "w": 2.0},
        modes=[hybrid.Mode("on", lambda t, x, p: (np.cos(p.w * t) - p.c * x.h * x.s, np.sin(x.h) - x.s))],
        transitions=[
            hybrid.Transition(
                "on",
                "on",
                hybrid.Guard(lambda t, x, p: np.sin(x.h) - p.c, 1),
                hybrid.Reset(lambda t, x, p: (x.h - 0.5, x.s)),
            )
        ],
        period=lambda p: 2 * np.pi / p.w,
    )
    options = {"transient": 2, "intervals": 6, "k": 2, "section": section, "executor": 1}
    over = {"c": [0.3, 0.0, 0.7], "w": [2.0, 0.0, 3.0], "h": [0.0, 2.0]}
    forth = lyapunov.chart(tank, over, (0.0, 0.1), **options)
    back = lyapunov.chart(tank, {name: values[::-1] for name, values in over.items()}, (0.0, 0.1), **options)
    assert_same(forth, back.isel({name: slice(None, None, -1) for name in over}))
    assert (forth.status.sel(w=0.0) == StatusCode.FAILED).all()
    assert ok(forth.sel(w=[2.0, 3.0])).any()
    single = lyapunov.lyapunov_spectrum(
        tank, (2.0, 0.1), parameters={"c": 0.7, "w": 3.0}, transient=2, intervals=6
    )
    found = forth.exponents.sel(c=0.7, w=3.0, h=2.0)
    np.testing.assert_allclose(found, single.exponents, rtol=1e-12)


def test_a_chart_follows_the_closed_form():
    """The larger multiplier of the orbits with one impact per period, as the damping varies."""
    values = np.array([0.1, 0.15, 0.2, 0.3])
    system = models.impact_oscillator()
    chart = lyapunov.chart(system, {"c": values}, REST, k=None, intervals=1000, transient=100)
    for c, row in zip(values, chart.exponents.values, strict=True):
        (orbit, *_) = one_impact_orbits(**{**system.parameters, "c": c})
        exact = np.log(np.abs(orbit.multipliers)) / (2 * np.pi)
        np.testing.assert_allclose(np.sort(row), np.sort(exact), atol=1e-4)


@pytest.mark.parametrize("continue_from", [None, "previous"])
def test_the_number_of_threads_does_not_matter(continue_from):
    over = {"r": [0.7, 0.8], "A": np.linspace(0.9, 1.1, 4)}
    one, three = (
        lyapunov.chart(
            models.impact_oscillator(),
            over,
            REST,
            section=7,
            executor=threads,
            continue_from=continue_from,
            **SHORT,
        )
        for threads in (1, 3)
    )
    assert one.exponents.shape == (2, 4, 1)
    assert one.section.shape == (2, 4, 7, 2)
    assert one.status.shape == (2, 4)
    assert np.isfinite(one.section).all()
    assert_same(one, three)


def test_the_grid_is_in_the_order_of_the_parameters():
    values = np.array([0.1, 0.2, 0.4])
    chart = lyapunov.chart(
        models.impact_oscillator(), {"c": values, "r": [0.6, 0.8]}, REST, k=2, **SHORT | {"intervals": 200}
    )
    exact = -values[:, None] + 2 * np.log([0.6, 0.8]) / (2 * np.pi) * chart.jumps_per_interval.values
    np.testing.assert_allclose(chart.sum_rule, exact, atol=1e-3)


def test_the_attractor_is_carried_forward():
    """With a tilt of 0.6 only the right well exists; without tilt the start is in the left well."""
    over = {"tilt": np.linspace(0.6, 0.0, 7)}
    fresh = lyapunov.chart(duffing(), over, (-1.2, 0.0), **SHORT)
    carried = lyapunov.chart(duffing(), over, (-1.2, 0.0), continue_from="previous", **SHORT)
    assert np.sign(fresh.x_end.values[[0, -1], 0]).tolist() == [1, -1]
    assert (carried.x_end[:, 0] > 0).all()


def test_the_mode_of_the_attractor_is_carried_forward():
    """A switch that is never undone: the second row goes on in the mode where the first one ended."""
    switch = hybrid.HybridSystem(
        state=("x",),
        parameters={"c": 1.0},
        modes=[
            hybrid.Mode("slow", lambda t, x, p: (p.c - x.x,)),
            hybrid.Mode("fast", lambda t, x, p: (3.0 * (p.c - x.x),)),
        ],
        transitions=[hybrid.Transition("slow", "fast", hybrid.Guard(lambda t, x, p: x.x - 0.9, +1))],
    )
    options = {"mode": "slow", "intervals": 20, "interval": 0.5, "transient": 20}
    over = {"c": [1.0, 0.5]}
    alone = lyapunov.chart(switch, over, (0.0,), **options)
    np.testing.assert_allclose(alone.exponents[:, 0], [-3.0, -1.0], atol=1e-9)
    carried = lyapunov.chart(switch, over, (0.0,), continue_from="c", **options)
    np.testing.assert_allclose(carried.exponents[:, 0], [-3.0, -3.0], atol=1e-9)


def test_each_line_of_a_grid_is_carried_by_itself():
    over = {"A": [0.02, 0.05], "tilt": np.linspace(0.2, -0.2, 4)}
    grid = lyapunov.chart(duffing(), over, (1.2, 0.0), continue_from="previous", **SHORT)
    for i, A in enumerate(over["A"]):
        line = lyapunov.chart(
            duffing(),
            {"tilt": over["tilt"]},
            (1.2, 0.0),
            parameters={"A": A},
            continue_from="previous",
            **SHORT,
        )
        np.testing.assert_array_equal(grid.exponents[i], line.exponents)


def test_the_carried_state_is_that_after_the_transient():
    """The second row starts at the end of the first row's transient of whole periods, at the phase of t0."""
    system, t0 = models.impact_oscillator(), 1.0
    two = lyapunov.chart(
        system, {"A": [1.0, 1.05]}, (0.1, 0.0), t0=t0, transient=3, intervals=5, continue_from="previous"
    )
    state = hybrid.simulate(system, (0.1, 0.0), (t0, t0 + 6 * np.pi), parameters={"A": 1.0}).x[-1]
    row = lyapunov.lyapunov_spectrum(
        system, state, t0=t0, k=1, parameters={"A": 1.05}, transient=3, intervals=5
    )
    np.testing.assert_allclose(two.x_end[1], row.x, atol=1e-8)


def test_the_section_is_that_of_the_orbit():
    system = models.impact_oscillator()
    chart = lyapunov.chart(system, {"A": [1.0]}, REST, section=4, **SHORT)
    strobe = hybrid.stroboscopic_section(system, REST, periods=4, transient=80, solver=SHORT["solver"])
    np.testing.assert_allclose(chart.section[0], strobe.x, atol=1e-5)


def test_a_row_that_breaks_off_keeps_its_status():
    """The field is nan beyond x = a; with a = 0.5 the orbit reaches it."""
    system = hybrid.HybridSystem(
        state=("x",),
        parameters={"a": 9.0},
        modes=[hybrid.Mode("only", lambda t, x, p: (1.0 + 1e-9 * np.sqrt(p.a - x.x),))],
    )
    options = {"interval": 0.1, "intervals": 10, "transient": 0}
    chart = lyapunov.chart(system, {"a": [9.0, 0.5, 9.0]}, (0.0,), **options)
    found = chart.status.values.tolist()
    assert found == [StatusCode.SUCCESS, StatusCode.NON_FINITE, StatusCode.SUCCESS]
    assert ok(chart).tolist() == [True, False, True]
    carried = lyapunov.chart(
        system, {"a": [9.0, 0.5, 9.0]}, (0.0,), continue_from="previous", **options | {"transient": 1}
    )
    assert ok(carried).tolist() == [True, False, True]


def test_a_row_that_starts_beyond_a_guard_says_so():
    """With the stop at -1 the state at rest is beyond the stop."""
    chart = lyapunov.chart(models.impact_oscillator(), {"d": [1.0, -1.0]}, REST, **SHORT)
    assert chart.status[0] == StatusCode.SUCCESS
    assert "The start lies beyond the guard of 'impact'" in chart.message.values[1]


def test_a_row_that_cannot_start_where_the_one_before_led_starts_anew():
    over = {"d": [1.0, 0.5]}
    carried = lyapunov.chart(models.impact_oscillator(), over, REST, continue_from="previous", **SHORT)
    assert ok(carried).all()


def test_an_interrupt_keeps_the_rows_done():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    system = models.impact_oscillator()
    lyapunov.chart(system, {"A": [1.0]}, REST, **SHORT)
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        chart = lyapunov.chart(system, {"A": np.linspace(0.9, 1.1, 4000)}, REST, **SHORT)
    finally:
        signal.signal(signal.SIGINT, before)
    done = ok(chart)
    assert 3 <= done.sum() < 4000
    assert np.isfinite(chart.exponents.values[done]).all()
    assert np.isnan(chart.exponents.values[~done]).all()
    assert set(chart.status.values[~done]) == {StatusCode.NOT_RUN}
    assert "ended before this point was complete" in chart.message.values[~done][0]


def test_an_error_in_a_row_is_that_of_the_row(monkeypatch):
    def broken(self, *_):
        raise ZeroDivisionError("a slip of the pen")

    monkeypatch.setattr(Estimates, "status", broken)
    chart = lyapunov.chart(models.impact_oscillator(), {"A": np.linspace(0.9, 1.1, 50)}, REST, **SHORT)
    assert set(chart.message.values) == {"ZeroDivisionError: a slip of the pen"}


def test_three_axes_and_starts_as_an_axis():
    over = {"A": [0.02, 0.05], "x": [-1.2, 1.2], "tilt": [0.0, 0.1]}
    chart = lyapunov.chart(duffing(), over, {"v": 0.0}, **SHORT)
    assert chart.exponents.dims == ("A", "x", "tilt", "exponent")
    assert (np.sign(chart.x_end.sel(state="x", tilt=0.0)) == np.sign(chart.x)).all()
    alone = lyapunov.chart(duffing(), {"tilt": [0.1]}, (1.2, 0.0), parameters={"A": 0.05}, **SHORT)
    np.testing.assert_array_equal(chart.exponents.sel(A=0.05, x=1.2, tilt=[0.1]), alone.exponents)


def test_the_attractor_is_followed_along_any_axis():
    over = {"tilt": np.linspace(0.6, 0.0, 7), "A": [0.02, 0.05]}
    chart = lyapunov.chart(duffing(), over, (-1.2, 0.0), continue_from="tilt", **SHORT)
    line = lyapunov.chart(
        duffing(), {"tilt": over["tilt"]}, (-1.2, 0.0), parameters={"A": 0.05}, continue_from="tilt", **SHORT
    )
    np.testing.assert_array_equal(chart.exponents.sel(A=0.05), line.exponents)
    assert (chart.x_end.sel(state="x") > 0).all()


def test_a_table_of_points():
    points = [{"A": 1.0, "r": 0.7}, {"A": 1.1, "r": 0.8}]
    table = lyapunov.chart(models.impact_oscillator(), points, REST, **SHORT)
    grid = lyapunov.chart(models.impact_oscillator(), {"A": [1.0, 1.1], "r": [0.7, 0.8]}, REST, **SHORT)
    np.testing.assert_array_equal(table.exponents[1], grid.exponents.sel(A=1.1, r=0.8))


def test_sections_of_an_autonomous_system():
    """Each apex of the ball is e^2 times the one before; at each jump it is on the ground."""
    ball, free = models.bouncing_ball(), {"intervals": 2, "interval": 0.01, "transient": 0}
    apex = hybrid.Guard(lambda t, x, p: x.v, -1)
    over = {"e": [0.5, 0.8]}
    at_apex = lyapunov.chart(ball, over, (1.0, 0.0), section=4, at=apex, **free)
    at_jumps = lyapunov.chart(ball, over, (1.0, 0.0), section=4, at="jumps", **free)
    for e in over["e"]:
        heights = at_apex.section.sel(e=e, state="q").values
        np.testing.assert_allclose(heights, e ** (2 * np.arange(1, 5)), rtol=1e-9)
        np.testing.assert_allclose(at_jumps.section.sel(e=e, state="q"), 0.0, atol=1e-12)
        speeds = at_jumps.section.sel(e=e, state="v").values
        np.testing.assert_allclose(speeds[1:] / speeds[:-1], e, rtol=1e-9)


def test_a_section_of_a_forced_system_by_a_guard():
    rising = hybrid.Guard(lambda t, x, p: x.v, +1)
    system = models.impact_oscillator()
    chart = lyapunov.chart(system, {"A": [1.0]}, REST, section=6, at=rising, **SHORT)
    found = hybrid.poincare_section(system, REST, rising, points=500, solver=SHORT["solver"])
    distances = np.abs(found.x[:, None, 0] - chart.section.values[0, :, 0]).min(axis=0)
    np.testing.assert_allclose(chart.section[0, :, 1], 0.0, atol=1e-9)
    assert distances.max() < 1e-2


def test_a_chart_is_stored_taken_up_and_refused_by_name(tmp_path):
    pytest.importorskip("zarr")
    system, path = models.impact_oscillator(), tmp_path / "run.zarr"
    call = {"over": {"A": [1.0, 1.1]}, "x0": REST, "section": 2, **SHORT}
    first = lyapunov.chart(system, **call, store=path)
    assert first.identical(lyapunov.chart(system, **call, store=path))
    finer = {**call, "over": {"A": [1.0, 1.05, 1.1]}}
    assert_same(lyapunov.chart(system, **finer, store=path), lyapunov.chart(system, **finer))
    assert_same(hybrid.open_store(path), lyapunov.chart(system, **finer))
    for change, message in (
        ({"intervals": 61}, "intervals was '60', and is now '61'"),
        ({"parameters": {"c": 0.2}}, r"parameter_c was '\(none\)', and is now '0.2'"),
        ({"x0": (0.0, 0.1)}, "x0 was .*'v': 0.0.* now .*'v': 0.1"),
        ({"system": duffing(), "over": {"A": [1.0]}}, "model was 'impact"),
    ):
        with pytest.raises(hybrid.ArgumentError, match=message):
            lyapunov.chart(**{"system": system, **call, **change}, store=path)


def test_attributes_say_what_made_it():
    made_by = lyapunov.chart(
        models.impact_oscillator(), {"A": [1.0]}, REST, parameters={"c": 0.2}, **SHORT
    ).attrs
    assert made_by["task"] == "lyapunov.chart.Exponents"
    assert made_by["model"] == "impact oscillator"
    assert (made_by["parameter_c"], made_by["intervals"]) == (0.2, 60)
    assert "DOP853" in made_by["solver"]


def test_autonomous_systems_have_charts_too():
    """The exponent over integer times is exactly b."""
    values = np.array([0.3, 0.4, 0.5])
    chart = lyapunov.chart(
        models.solvable_oscillator(),
        {"b": values},
        (0.3, 0.0),
        mode="plus",
        interval=1.0,
        intervals=100,
        transient=10,
    )
    np.testing.assert_allclose(chart.exponents[:, 0], values, atol=2e-2)


def test_spectra_in_threads_of_the_user_are_those_computed_alone():
    """The first thread compiles a model, and each run has its own memory."""
    values = np.linspace(0.9, 1.1, 6)
    found = {}

    def compute(A):
        found[A] = lyapunov.lyapunov_spectrum(system, REST, parameters={"A": A}, **SHORT)

    system = models.impact_oscillator()
    together = [threading.Thread(target=compute, args=(A,)) for A in values]
    for thread in together:
        thread.start()
    for thread in together:
        thread.join()
    parallel = dict(found)
    system = models.impact_oscillator()
    for A in values:
        compute(A)
        np.testing.assert_array_equal(parallel[A].exponents, found[A].exponents)
        np.testing.assert_array_equal(parallel[A].growths, found[A].growths)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"over": {}}, "over must map names to values"),
        ({"over": {"A": 1.0}}, r"over\['A'\] must be a list of finite numbers, one or more; got shape \(\)"),
        ({"over": {"A": [1.0, np.nan]}}, r"over\['A'\] must be a list of finite numbers"),
        ({"over": {"a": [1.0]}}, "Parameter 'a' does not exist"),
        ({"parameters": {"A": 2.0}}, "Parameter 'A' is given twice: in over and in parameters"),
        ({"parameters": {"B": 2.0}}, "Parameter 'B' does not exist"),
        ({"k": 3}, "k must be a whole number from 1 to 2"),
        ({"section": -1}, "section must be a whole number of at least 0; got -1"),
        ({"executor": 0}, "executor must be a whole number of at least 1; got 0"),
        ({"at": "apex"}, "at must be None, a Guard or"),
        ({"over": {"x": [1.0]}, "continue_from": "x"}, "continue_from must be an axis of parameters"),
        ({"continue_from": "next"}, 'continue_from must be None, "previous" or "A"; got \'next\''),
        ({"continue_from": "previous", "transient": 0}, "transient must be a whole number of at least 1"),
        ({"mode": "fligth"}, "Mode 'fligth' does not exist"),
        ({"x0": (0.0,)}, r"x0 has shape \(1,\)"),
    ],
)
def test_bad_arguments(arguments, message):
    call = {"over": {"A": [1.0]}, "x0": REST} | arguments
    with pytest.raises(hybrid.ModelError, match=message):
        lyapunov.chart(models.impact_oscillator(), **call)


def test_a_section_needs_a_period():
    with pytest.raises(hybrid.ArgumentError, match="per forcing period, but the system declares no period"):
        lyapunov.chart(models.bouncing_ball(), {"e": [0.8]}, (1.0, 0.0), section=5)
    still = hybrid.HybridSystem(
        state=("q",), parameters={"a": 1.0}, modes=[hybrid.Mode("m", lambda t, x, p: (-p.a * x.q,))]
    )
    with pytest.raises(
        hybrid.ArgumentError, match=r"at=.jumps. takes a point at each jump, but the system has"
    ):
        lyapunov.chart(still, {"a": [1.0]}, (1.0,), section=5, at="jumps")


def test_without_a_period_the_second_row_starts_where_the_transient_of_the_first_ends():
    """A focus with the rate ``a``: the state turns by one radian per unit of time and shrinks."""
    focus = hybrid.HybridSystem(
        state=("q", "v"),
        parameters={"a": 0.1},
        modes=[hybrid.Mode("on", lambda t, x, p: (-p.a * x.q - x.v, x.q - p.a * x.v))],
    )
    two = lyapunov.chart(
        focus, {"a": [0.1, 0.2]}, (1.0, 0.0), interval=0.5, transient=3, intervals=4, continue_from="previous"
    )
    # Then the second row's own transient and intervals: 3.5 units of time at its own rate.
    size = np.exp(-0.1 * 1.5 - 0.2 * 3.5)
    np.testing.assert_allclose(two.x_end[1], size * np.array([np.cos(5.0), np.sin(5.0)]), atol=1e-8)


def test_a_chart_without_sections_can_be_opened_again(tmp_path):
    system = hybrid.HybridSystem(
        state=("q",),
        parameters={"w": 1.0},
        modes=[hybrid.Mode("on", lambda t, x, p: (np.cos(p.w * t) - x.q,))],
        period=lambda p: 2 * np.pi / p.w,
    )
    made = lyapunov.chart(system, {"w": [1.0, 1.2]}, (0.0,), intervals=5, transient=1)
    made.to_netcdf(tmp_path / "chart.nc")
    with xarray.open_dataset(tmp_path / "chart.nc") as read:
        np.testing.assert_array_equal(read.exponents, made.exponents)
        assert "section" not in read
