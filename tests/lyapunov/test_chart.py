"""Charts compared with single spectra for any number of threads, and their content when rows fail."""

import contextlib
import importlib
import threading

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from hybrid import StatusCode
from lyapunov.spectrum import Estimate
from models.one_impact import one_impact_orbits

SHORT = {"intervals": 60, "transient": 20, "solver": hybrid.DOP853(rtol=1e-7, atol=1e-9)}
ARRAYS = ("exponents", "standard_error", "sum_rule", "jumps_per_interval", "x", "mode", "section")
REST = (0.0, 0.0)


def assert_same(one, other):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.status.tolist() == other.status.tolist()


def duffing():
    """Two wells: a weakly driven orbit stays in its well."""
    return hybrid.HybridSystem(
        state=("x", "v"),
        parameters={"A": 0.05, "tilt": 0.0},
        modes=[hybrid.Mode("on", lambda t, x, p: (x.v, x.x - x.x**3 - 0.3 * x.v + p.tilt + p.A * np.cos(t)))],
        period=2 * np.pi,
    )


def test_rows_are_the_spectra_one_by_one():
    values = np.linspace(0.7, 0.9, 5)
    chart = lyapunov.chart(models.impact_oscillator(), {"r": values}, REST, k=2, threads=3, **SHORT)
    assert chart.exponents.shape == (5, 2)
    for i, r in enumerate(values):
        row = lyapunov.lyapunov_spectrum(models.impact_oscillator(), REST, parameters={"r": r}, **SHORT)
        np.testing.assert_array_equal(chart.exponents[i], row.exponents)
        np.testing.assert_array_equal(chart.standard_error[i], row.standard_error)
        np.testing.assert_array_equal(chart.x[i], row.x)
        assert (chart.sum_rule[i], chart.jumps_per_interval[i]) == (row.sum_rule, row.jumps_per_interval)
        assert (chart.mode[i], chart.status[i]) == (row.mode, row.status)


def test_a_chart_follows_the_closed_form():
    """The larger multiplier of the orbits with one impact per period, as the damping varies."""
    values = np.array([0.1, 0.15, 0.2, 0.3])
    system = models.impact_oscillator()
    chart = lyapunov.chart(system, {"c": values}, REST, k=None, intervals=1000, transient=100)
    for c, row in zip(values, chart.exponents, strict=True):
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
            threads=threads,
            continue_from=continue_from,
            **SHORT,
        )
        for threads in (1, 3)
    )
    assert one.exponents.shape == (2, 4, 1)
    assert one.section.shape == (2, 4, 7, 2)
    assert one.ok.shape == (2, 4)
    assert np.isfinite(one.section).all()
    assert_same(one, three)


def test_the_grid_is_in_the_order_of_the_parameters():
    values = np.array([0.1, 0.2, 0.4])
    chart = lyapunov.chart(
        models.impact_oscillator(), {"c": values, "r": [0.6, 0.8]}, REST, k=2, **SHORT | {"intervals": 200}
    )
    exact = -values[:, None] + 2 * np.log([0.6, 0.8]) / (2 * np.pi) * chart.jumps_per_interval
    np.testing.assert_allclose(chart.sum_rule, exact, atol=1e-3)


def test_the_attractor_is_carried_forward():
    """With a tilt of 0.6 only the right well exists; without tilt the start is in the left well."""
    over = {"tilt": np.linspace(0.6, 0.0, 7)}
    fresh = lyapunov.chart(duffing(), over, (-1.2, 0.0), **SHORT)
    carried = lyapunov.chart(duffing(), over, (-1.2, 0.0), continue_from="previous", **SHORT)
    assert np.sign(fresh.x[[0, -1], 0]).tolist() == [1, -1]
    assert (carried.x[:, 0] > 0).all()


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
    state = (0.1, 0.0)
    for A in (1.0, 1.05):
        arc = hybrid.simulate(system, state, (t0, t0 + 6 * np.pi), parameters={"A": A})
        state = arc.x[-1]
    row = lyapunov.lyapunov_spectrum(
        system, state, t0=t0, k=1, parameters={"A": 1.05}, transient=3, intervals=5
    )
    np.testing.assert_allclose(two.x[1], row.x, atol=1e-8)


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
    found = [status.code for status in chart.status]
    assert found == [StatusCode.SUCCESS, StatusCode.NON_FINITE, StatusCode.SUCCESS]
    assert chart.ok.tolist() == [True, False, True]
    assert repr(chart) == "<Chart over a, 3 rows: 2 SUCCESS, 1 NON_FINITE>"
    carried = lyapunov.chart(
        system, {"a": [9.0, 0.5, 9.0]}, (0.0,), continue_from="previous", **options | {"transient": 1}
    )
    assert carried.ok.tolist() == [True, False, True]


def test_a_row_that_cannot_start_says_so():
    """With the stop at -1 the state at rest is beyond the stop."""
    chart = lyapunov.chart(models.impact_oscillator(), {"d": [1.0, -1.0]}, REST, **SHORT)
    assert chart.status[0].ok
    assert chart.status[1].code == StatusCode.NOT_RUN
    assert "could not start. x0 = (0.0, 0.0) is allowed in no mode" in str(chart.status[1])
    assert np.isnan(chart.exponents[1, 0])


def test_a_row_that_cannot_start_where_the_one_before_led_starts_anew():
    over = {"d": [1.0, 0.5]}
    carried = lyapunov.chart(models.impact_oscillator(), over, REST, continue_from="previous", **SHORT)
    assert carried.ok.all()


def test_an_interrupt_keeps_the_rows_done(monkeypatch):
    """The interrupt arrives with the report of the third row, as in a terminal."""
    rows = []

    class Bar:
        def update(self, n=1):
            rows.append(n)
            if len(rows) == 3:
                raise KeyboardInterrupt

    module = importlib.import_module("lyapunov.chart")
    monkeypatch.setattr(module, "progress_bar", lambda *_: contextlib.nullcontext(Bar()))
    chart = lyapunov.chart(models.impact_oscillator(), {"A": np.linspace(0.9, 1.1, 400)}, REST, **SHORT)
    done = chart.ok
    assert 3 <= done.sum() < 400
    assert np.isfinite(chart.exponents[done]).all()
    assert np.isnan(chart.exponents[~done]).all()
    assert {status.code for status in chart.status[~done]} == {StatusCode.NOT_RUN}
    assert "The chart was interrupted before this row was complete" in str(chart.status[~done][0])


def test_an_error_in_a_thread_is_raised(monkeypatch):
    def broken(self, *_):
        raise ZeroDivisionError("a slip of the pen")

    monkeypatch.setattr(Estimate, "run", broken)
    with pytest.raises(ZeroDivisionError, match="slip"):
        lyapunov.chart(models.impact_oscillator(), {"A": np.ones(50)}, REST, **SHORT)


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
        ({"over": {}}, "over must map one or two parameter names to values; got {}"),
        ({"over": {"A": 1, "c": 1, "r": 1}}, "over must map one or two parameter names"),
        ({"over": {"A": 1.0}}, r"over\['A'\] must be a list of finite numbers, one or more; got shape \(\)"),
        ({"over": {"A": [1.0, np.nan]}}, r"over\['A'\] must be a list of finite numbers"),
        ({"over": {"a": [1.0]}}, "Parameter 'a' does not exist"),
        ({"parameters": {"A": 2.0}}, "Parameter 'A' is given twice: in over and in parameters"),
        ({"parameters": {"B": 2.0}}, "Parameter 'B' does not exist"),
        ({"k": 3}, "k must be a whole number from 1 to 2"),
        ({"section": -1}, "section must be a whole number of at least 0; got -1"),
        ({"threads": 0}, "threads must be a whole number of at least 1; got 0"),
        ({"continue_from": "next"}, "continue_from must be None or \"previous\"; got 'next'"),
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
