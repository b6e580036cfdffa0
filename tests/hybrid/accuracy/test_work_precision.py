"""Known errors are measured correctly; a controlled clock shows how times are measured."""

import itertools
import math
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest

import models
from hybrid import (
    DOP853,
    Answer,
    ArgumentError,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Taylor,
    Transition,
    work_precision,
)
from hybrid.plot import plot, plot_work_precision
from tests.reference.load import reference

E = 0.5
FIRST = math.sqrt(2 / 9.81)
# Dropped from 1 m and observed at t = 1; the second bounce is at 2 FIRST (0.5 + E).
FALL = (models.bouncing_ball(), (1.0, 0.0), (0.0, 0.8))
SPEED = 9.81 * FIRST
SINCE = 0.8 - FIRST
EXACT = (E * SPEED * SINCE - 9.81 * SINCE**2 / 2, E * SPEED - 9.81 * SINCE)
HALF = {"parameters": {"e": E}}


def decay():
    return HybridSystem(state=("x", "y"), modes=[Mode("only", lambda t, x, p: (-x.x, -2 * x.y))])


class Clock:
    """A clock that advances only when a method advances it."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def test_errors_of_the_solvers_are_those_of_exact_answers():
    found = work_precision(
        *FALL, **HALF, reference=Answer(EXACT, times=[FIRST]), tolerances=(1e-6, 1e-10), repeats=1
    )
    assert found.methods == ("Taylor", "DOP853", "Tsit5")
    assert found.tolerance.tolist() == [1e-6, 1e-10] * 3
    assert set(found.error) == {"state", "times"}
    assert np.all(found.error["state"] < 1e-12)
    assert np.all(found.error["times"] < 1e-13)
    assert found.events.tolist() == [1.0] * 6
    assert set(found.status) == {"SUCCESS"}
    assert 0 < found.reference_error["state"] < 1e-15


def test_a_callable_is_off_by_what_it_is_off_by():
    shift = np.array([3e-4, -5e-4])
    saltation = np.array([[[-E, 0.0], [3.0, -E]]])
    truth = Answer(EXACT, times=[FIRST], saltation=saltation, fundamental=np.diag([4.0, 1.0]))
    methods = {
        "state alone": lambda tolerance: EXACT + shift,
        "all of it": lambda tolerance: Answer(
            EXACT,
            times=[FIRST + tolerance],
            saltation=saltation + 3e-3,
            fundamental=np.diag([4.0, 1.0 + 8e-3]),
            steps=7,
        ),
        "an event too many": lambda tolerance: Answer(EXACT, times=[FIRST, 0.7]),
    }
    found = work_precision(*FALL, methods=methods, reference=truth, tolerances=[1e-5], repeats=1)
    error = found.error
    np.testing.assert_allclose(error["state"], [5e-4, 0, 0], rtol=1e-10)
    np.testing.assert_allclose(error["times"], [np.nan, 1e-5, np.inf], rtol=1e-8)
    np.testing.assert_allclose(error["saltation"], [np.nan, 1e-3, np.nan], rtol=1e-10)
    np.testing.assert_allclose(error["fundamental"], [np.nan, 2e-3, np.nan], rtol=1e-10)
    np.testing.assert_allclose(error["exponents"], [np.nan, math.log(1.008) / 0.8, np.nan], rtol=1e-10)
    np.testing.assert_array_equal(found.steps, [np.nan, 7, np.nan])
    np.testing.assert_array_equal(found.events, [np.nan, 1, 2])


def test_fundamental_matrix_and_exponents_of_a_linear_system():
    T = 2.0
    truth = Answer(np.exp([-T, -2 * T]), fundamental=np.diag(np.exp([-T, -2 * T])), exponents=(-1.0, -2.0))
    methods = {"DOP853": DOP853()}
    found = work_precision(
        decay(),
        (1.0, 1.0),
        (0.0, T),
        methods=methods,
        reference=truth,
        tangent=True,
        tolerances=(1e-4, 1e-10),
    )
    loose, tight = found.error["exponents"]
    assert 1e-13 < tight < 1e-9 < loose < 1e-3
    assert found.error["fundamental"][1] < 1e-9


def test_annihilated_directions_do_not_differ():
    cut = Transition(
        "only", "only", Guard(lambda t, x, p: t - 0.5), Reset(lambda t, x, p: (x.x, 0.0)), name="cut"
    )
    system = HybridSystem(
        state=("x", "y"), modes=[Mode("only", lambda t, x, p: (-x.x, -2 * x.y))], transitions=[cut]
    )
    truth = Answer((math.exp(-1), 0.0), exponents=(-1.0, -math.inf))
    found = work_precision(
        system, (1.0, 1.0), (0.0, 1.0), methods={"T": Taylor()}, reference=truth, tangent=True, repeats=1
    )
    assert np.all(found.error["exponents"] < 1e-13)
    assert np.isfinite(found.reference_error["exponents"])


def test_the_default_reference_says_how_good_it_is():
    arc = reference("impact_oscillator")["flight"]
    run = (models.impact_oscillator(), arc["x0"], (0.0, arc["t_end"]))
    found = work_precision(*run, methods={"exact": lambda tolerance: Answer(arc["x_end"], times=arc["t"])})
    assert found.error["state"].max() <= 2 * found.reference_error["state"] + 1e-13
    assert found.error["times"].max() <= 2 * found.reference_error["times"] + 1e-12
    assert 0 < found.reference_error["times"] < 1e-11


@pytest.mark.parametrize("gap", ["0", "0.05"])
def test_the_founding_system_against_fifty_digits(gap):
    facts = reference("founding_system")["transients"][gap]
    system = models.vibroimpact()
    found = work_precision(
        system,
        facts["x0"],
        (0.0, 10 * system.forcing_period()),
        methods={"Taylor": Taylor()},
        tolerances=(1e-6, 1e-9, 1e-11, 1e-12, 3e-13),
        parameters={"D": float(gap)},
        mode="free",
        reference=Answer(facts["x10"], times=facts["times10"], fundamental=facts["fundamental10"]),
        tangent=True,
        repeats=1,
    )
    assert np.all(found.error["state"] < found.tolerance)
    # In a contact a tangent vector and its error grow about a thousandfold and shrink again.
    assert np.all(found.error["fundamental"] < 50 * found.tolerance)
    assert found.error["times"][-1] < 1e-11
    assert found.events.tolist() == [len(facts["times10"])] * 5


def test_times_are_the_median_of_the_later_runs_and_the_first_apart():
    clock, turns = Clock(), itertools.cycle([10.0, 1.0, 5.0, 2.0])

    def method(tolerance):
        clock.now += next(turns)
        return EXACT

    found = work_precision(
        *FALL, methods={"m": method}, reference=EXACT, tolerances=(1e-3, 1e-6), repeats=3, clock=clock
    )
    assert found.seconds.tolist() == [2.0, 2.0]
    assert found.compile_seconds.tolist() == [8.0, 8.0]


@pytest.mark.parametrize(
    ("repeats", "seconds", "calls"),
    [
        # One run to compile, and those that are measured.
        (1, 1e-3, 2),
        (1, 1.0, 2),
        (3, 1.0, 4),
        (3, 1.0 / 64, 5),
        (3, 1.0 / 1024, 53),
        (3, 0.0, 1001),
        (2000, 0.0, 2001),
    ],
)
def test_short_runs_are_repeated_until_their_times_add_up(repeats, seconds, calls):
    clock, made = Clock(), []

    def method(tolerance):
        made.append(tolerance)
        clock.now += seconds
        return EXACT

    options = {"reference": EXACT, "tolerances": [1e-3], "repeats": repeats, "clock": clock}
    work_precision(*FALL, methods={"m": method}, **options)
    assert len(made) == calls


def test_a_method_may_bring_its_own_time():
    methods = {"m": lambda tolerance: Answer(EXACT, seconds=3.0)}
    found = work_precision(*FALL, methods=methods, reference=EXACT, tolerances=[1e-3])
    assert (found.seconds[0], found.compile_seconds[0]) == (3.0, 0.0)


def test_after_a_run_that_took_too_long_finer_tolerances_are_left_out():
    clock, calls = Clock(), []

    def method(tolerance):
        calls.append(tolerance)
        clock.now += 1e-2 / tolerance
        return EXACT

    found = work_precision(
        *FALL,
        methods={"m": method},
        reference=EXACT,
        tolerances=(1e-6, 1e-2, 1e-4),
        longest=10.0,
        clock=clock,
    )
    assert found.tolerance.tolist() == [1e-2, 1e-4]
    assert calls.count(1e-4) == 2


@pytest.mark.parametrize(
    ("error", "status", "calls"),
    [
        (KeyboardInterrupt, "INTERRUPTED", 1),
        (KeyboardInterrupt, "INTERRUPTED", 2),
        (RuntimeError("no"), "RuntimeError: no", 2),
    ],
)
def test_a_method_that_ends_early_has_the_time_of_its_last_run(error, status, calls):
    """The first run also compiles: if it fails, so does the second one."""
    clock, made = Clock(), []
    clock.now = 100.0

    def method(tolerance):
        made.append(tolerance)
        clock.now += 3.0 * len(made)
        if len(made) == calls:
            raise error
        return EXACT

    found = work_precision(*FALL, methods={"m": method}, reference=EXACT, tolerances=[1e-3], clock=clock)
    assert (found.status[0], found.seconds[0]) == (status, 3.0 * calls)


def test_a_method_that_raises_has_a_row_that_says_so():
    def method(tolerance):
        if tolerance < 1e-4:
            raise RuntimeError("too stiff")
        return EXACT

    found = work_precision(*FALL, methods={"m": method}, reference=EXACT, tolerances=(1e-3, 1e-6), repeats=1)
    assert found.status.tolist() == ["SUCCESS", "RuntimeError: too stiff"]
    assert found.error["state"][0] == 0
    assert np.isnan(found.error["state"][1])


def test_a_run_that_ends_early_has_its_status_and_no_error():
    found = work_precision(
        *FALL[:2],
        (0.0, 5.0),
        methods={"Taylor": Taylor()},
        reference=(0.0, 0.0),
        tolerances=[1e-6],
        repeats=1,
    )
    assert found.status.tolist() == ["ACCUMULATION"]
    assert np.isnan(found.error["state"][0])


@pytest.fixture(scope="module")
def lines():
    """Two methods whose time and error follow power laws."""
    clock = Clock()

    def method(factor, order):
        def run(tolerance):
            clock.now += factor * tolerance ** (-1 / order)
            return Answer(np.add(EXACT, (tolerance, 0.0)))

        return run

    return work_precision(
        *FALL,
        methods={"quick": method(1e-3, 8), "slow": method(1e-3, 2)},
        tolerances=(1e-2, 1e-4, 1e-6),
        reference=EXACT,
        longest=math.inf,
        clock=clock,
    )


def test_seconds_at_an_error_between_the_rows_and_beyond(lines):
    assert lines.seconds_at("slow", 1e-3) == pytest.approx(1e-3 * 1e-3**-0.5, rel=1e-6)
    assert lines.seconds_at("quick", 1e-5) == pytest.approx(1e-3 * 1e-5**-0.125, rel=1e-6)
    assert math.isnan(lines.seconds_at("slow", 1e-9))
    assert lines.seconds_at("slow", 1.0) == pytest.approx(1e-2)
    with pytest.raises(ArgumentError, match=r"Method 'quik' does not exist.*Did you mean 'quick'"):
        lines.seconds_at("quik", 1e-3)
    with pytest.raises(ArgumentError, match="Quantity 'times' does not exist"):
        lines.seconds_at("quick", 1e-3, "times")


def test_the_table_and_the_columns(lines):
    head, *rows, last = str(lines).splitlines()
    assert re.split(r"  +", head)[:4] == ["method", "tolerance", "error: state", "ms"]
    assert [row.split()[0] for row in rows] == ["quick"] * 3 + ["slow"] * 3
    assert rows[3].split()[1:4] == ["1e-02", "1.0e-02", "10.000"]
    assert last.startswith("the reference")
    assert {len(column) for column in lines.columns.values()} == {6}
    assert list(lines.columns)[:4] == ["method", "tolerance", "error_state", "seconds"]
    assert repr(lines) == "<WorkPrecision of quick, slow, 6 rows>"


def test_the_plot_has_a_line_a_method_and_its_name(lines):
    axes = plot(lines)
    drawn = [line.get_xydata() for line in axes.get_lines()]
    np.testing.assert_allclose(drawn[1], np.column_stack([lines.seconds[3:], lines.error["state"][3:]]))
    assert [text.get_text() for text in axes.texts] == ["quick", "slow"]
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert axes.get_ylim()[0] < lines.reference_error["state"]
    with pytest.raises(ArgumentError, match="Quantities: state"):
        plot_work_precision(lines, quantity="exponents")
    plt.close("all")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"methods": {}}, "methods must hold at least one"),
        ({"methods": {"T": Taylor}}, r"Method 'T' must be a solver, Taylor\(\) say"),
        ({"methods": {"T": 3}}, "Method 'T' must be a solver"),
        (
            {"methods": {"m": lambda tolerance: (1.0,)}},
            r"Method 'm': what it returns: the state must have shape",
        ),
        (
            {"methods": {"m": lambda tolerance: "no"}},
            "what it returns must be the state at the end",
        ),
        ({"tolerances": ()}, "tolerances must be positive"),
        ({"tolerances": (1e-3, -1.0)}, "tolerances must be positive"),
        ({"repeats": 0}, "repeats must be a whole number of at least 1"),
        ({"reference": (1.0, 2.0, 3.0)}, "^reference: the state must have shape"),
        ({"reference_error": {"sate": 1e-9}}, "Quantity 'sate' does not exist"),
    ],
)
def test_arguments_that_do_not_fit(options, text):
    with pytest.raises(ArgumentError, match=text):
        work_precision(*FALL, **{"reference": EXACT, **options})


def test_no_error_is_said_to_be_zero():
    """The exact series is the reference, too: what it is off by is not known."""
    found = work_precision(*FALL, **HALF, tolerances=(1e-6,), repeats=1)
    assert "below the reference's" in str(found)
    assert "0.0e+00" not in str(found).rpartition("the reference ")[0]
