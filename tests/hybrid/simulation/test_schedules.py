"""Schedules: times in any order, amounts that resets read, what can be a table, bad input."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest

import hybrid
from hybrid import ArgumentError, At, Every, Guard, HybridSystem, Mode, ModelError, Reset, Transition
from hybrid.testing import Case, check_jumps, check_saltation, check_ticks

DOSES = {"t": [24.0, 0.0, 48.0, 24.0], "amount": [2.0, 4.0, 1.0, 0.5]}
K = 0.1


def body(schedule, change=None, **options):
    """One compartment with elimination at the rate ``k``."""
    change = change or (lambda t, x, p: {"c": x.c + schedule["amount"]})
    return HybridSystem(
        state=("c",),
        modes=[Mode("body", lambda t, x, p: (-p.k * x.c,))],
        transitions=[Transition("body", "body", schedule, Reset(change), name="dose")],
        **{"parameters": {"k": K}} | options,
    )


def left(amounts, times, end, k=K):
    """What is left at the end of amounts at times, the start before all of them."""
    return float(np.sum(np.asarray(amounts) * np.exp(-k * (end - np.asarray(times)))))


@pytest.mark.parametrize("tangent", [None, np.eye(1)])
@pytest.mark.parametrize("period", [None, 10.0])
def test_rows_fire_in_the_order_of_their_times(tangent, period):
    arc = hybrid.simulate(body(At.table(DOSES), period=period), (0.0,), (-1.0, 60.0), tangent=tangent)
    assert arc.jumps.t.tolist() == [0.0, 24.0, 24.0, 48.0]
    assert arc.jumps.row.tolist() == [1, 0, 3, 2] == [jump.row for jump in arc.jumps]
    np.testing.assert_allclose((arc.jumps.x_plus - arc.jumps.x_minus)[:, 0], [4.0, 2.0, 0.5, 1.0], rtol=1e-13)
    assert arc.x[-1, 0] == pytest.approx(left(DOSES["amount"], DOSES["t"], 60.0), rel=1e-12)


def records():
    return [dict(zip(DOSES, row, strict=True)) for row in zip(*DOSES.values(), strict=True)]


@pytest.mark.parametrize(
    "frame",
    [
        pd.DataFrame(DOSES),
        pd.DataFrame(DOSES).set_index("t"),
        records(),
        iter(records()),
        np.array([*zip(*DOSES.values(), strict=True)], dtype=[("t", float), ("amount", float)]),
        {name: np.array(column) for name, column in DOSES.items()},
        {name: pd.Series(column, index=[7, 5, 3, 1]) for name, column in DOSES.items()},
    ],
    ids=["frame", "indexed", "records", "iterator", "structured", "arrays", "series"],
)
def test_what_can_be_a_table(frame):
    schedule = At.table(frame)
    assert schedule.times == tuple(DOSES["t"])
    assert schedule.columns["amount"].tolist() == DOSES["amount"]


def test_each_equal_time_fires_once_whatever_the_resets_do():
    """The saltation matrices are the factors, whether they are computed with the run or afterwards."""
    cuts = At.table({"t": [1.0, 1.0, 0.5, 1.0], "by": [0.5, 0.25, 3.0, 4.0]})
    system = body(cuts, lambda t, x, p: {"c": x.c * cuts["by"]}, parameters={"k": 0.0})
    for tangent in (None, np.eye(1)):
        arc = hybrid.simulate(system, (1.0,), (0.0, 2.0), tangent=tangent)
        assert arc.jumps.saltation[:, 0, 0].tolist() == [3.0, 0.5, 0.25, 4.0]
        assert arc.x[-1, 0] == pytest.approx(1.5, rel=1e-14)
    assert hybrid.saltation_matrix(system, "dose", 0.5, (1.0,)) == 3.0


def test_a_mode_that_is_entered_at_equal_times_sees_all_of_them():
    """The transition that is listed first leads into the mode whose schedule has three rows then."""
    schedule = At.table({"t": [0.5, 1.0, 1.0, 1.0], "by": [1.0, 10.0, 100.0, 1000.0]})
    add = Reset(lambda t, x, p: {"n": x.n + schedule["by"]})
    system = HybridSystem(
        state=("n",),
        modes=[Mode("wait", lambda t, x, p: (0.0,)), Mode("count", lambda t, x, p: (0.0,))],
        transitions=[Transition("wait", "count", At([1.0])), Transition("count", "count", schedule, add)],
        start="wait",
    )
    assert hybrid.simulate(system, (0.0,), (0.0, 2.0)).x[-1, 0] == 1110.0
    assert hybrid.simulate(system, (0.0,), (1.0, 2.0), mode="count").x[-1, 0] == 0.0


def test_a_condition_reads_the_row_too():
    schedule = At.table(DOSES, when=lambda t, x, p: schedule["amount"] > 0.75)
    arc = hybrid.simulate(body(schedule), (0.0,), (-1.0, 60.0))
    assert arc.jumps.row.tolist() == [1, 0, 2]


def test_the_row_is_right_where_another_schedule_ticks_at_the_same_instant():
    one = At.table({"t": [1.0, 2.0], "by": [1.0, 2.0]})
    two = At.table({"t": [2.0, 1.0], "by": [10.0, 20.0]})
    system = HybridSystem(
        state=("n",),
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[
            Transition("m", "m", one, Reset(lambda t, x, p: {"n": x.n + one["by"]}), name="one"),
            Transition("m", "m", Guard(lambda t, x, p: t - 0.5, +1), name="mark"),
            Transition("m", "m", two, Reset(lambda t, x, p: {"n": x.n * two["by"]}), name="two"),
        ],
    )
    for tangent in (None, np.eye(1)):
        arc = hybrid.simulate(system, (0.0,), (0.0, 3.0), tangent=tangent)
        assert arc.x[-1, 0] == (1.0 * 20.0 + 2.0) * 10.0
        assert [jump.row for jump in arc.jumps["mark"]] == [None]


@pytest.mark.parametrize(("a", "b"), [(10.0, 20.0), (20.0, 10.0), (15.0, 15.0)])
def test_times_that_are_parameters_may_pass_each_other(a, b):
    schedule = At.table({"t": ["a", "b", 5.0], "amount": [1.0, 3.0, 2.0]})
    system = body(schedule, parameters={"k": K, "a": 0.0, "b": 0.0})
    given = {"a": a, "b": b}
    arc = hybrid.simulate(system, (0.0,), (0.0, 30.0), parameters=given, sensitivities=("a", "b"))
    assert arc.x[-1, 0] == pytest.approx(left([1.0, 3.0, 2.0], [a, b, 5.0], 30.0), rel=1e-12)
    slopes = [K * left([amount], [time], 30.0) for amount, time in ((1.0, a), (3.0, b))]
    np.testing.assert_allclose(arc.sensitivity, [slopes], rtol=1e-10)
    own = {0: [1.0, 0.0], 1: [0.0, 1.0], 2: [0.0, 0.0]}
    assert arc.jumps.t_sensitivity.tolist() == [own[row] for row in arc.jumps.row.tolist()]


def test_ticks_of_two_periods_at_one_instant_move_each_with_its_own():
    system = HybridSystem(
        state=("a",),
        parameters={"S": 2.0, "T": 3.0},
        modes=[Mode("m", lambda t, x, p: (1.0,))],
        transitions=[Transition("m", "m", Every(name), name=name) for name in "ST"],
    )
    arc = hybrid.simulate(system, (0.0,), (0.0, 7.0), sensitivities=("S", "T"))
    assert arc.jumps.t_sensitivity.tolist() == [[1, 0], [0, 1], [2, 0], [3, 0], [0, 2]]


def test_many_runs_of_one_schedule_in_threads():
    rng = np.random.default_rng(5)
    times, amounts = rng.uniform(0.0, 50.0, 400), rng.uniform(0.0, 1.0, 400)
    system = body(At.table({"t": times, "amount": amounts}))
    exact = left(amounts, times, 60.0)
    with ThreadPoolExecutor(2) as pool:
        ends = [*pool.map(lambda _: hybrid.simulate(system, (0.0,), (-1.0, 60.0)).x[-1, 0], range(16))]
    np.testing.assert_allclose(ends, exact, rtol=1e-12)
    starts = np.linspace(0.0, 3.0, 40)[:, None]
    many = hybrid.simulate_many(system, starts, (-1.0, 60.0))
    ends = many["x_end"].to_numpy()[:, 0]
    np.testing.assert_allclose(ends, exact + starts[:, 0] * np.exp(-6.1), rtol=1e-11)


def test_the_laws_hold_for_a_schedule():
    schedule = At.table({"t": [0.4, 0.1, 0.4], "amount": [2.0, 1.0, 5.0]})
    system = body(schedule)
    case = Case(system, system.parameters, "body", (1.0,), 0.0, 0.6)
    for check in (check_jumps, check_ticks):
        check(case)
    check_saltation(Case(system, system.parameters, "body", (1.0,), 0.0, 0.3))


def by_amount(schedule):
    return lambda t, x, p: {"c": x.c + schedule["amount"]}


def test_a_schedule_is_pickled_with_its_columns():
    schedule = At.table(DOSES)
    again = pickle.loads(pickle.dumps(schedule))
    assert again.times == schedule.times
    assert again.columns["amount"].tolist() == DOSES["amount"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: At.table({"time": [1.0]}), r"column 't' does not exist. Columns: time"),
        (lambda: At.table(pd.DataFrame({"a": [1.0]})), r"index has no name"),
        (lambda: At.table({"t": [1.0, 2.0], "a": [1.0]}), r"'a' must hold one entry for each of the 2 rows"),
        (lambda: At.table([{"t": 1.0}, {"t": 2.0, "a": 1.0}]), r"frame\[1\].*differ in 'a'"),
        (lambda: At.table([3.0]), r"frame\[0\] must be a record"),
        (lambda: At.table(3), "frame must be a data frame, a mapping of columns, or a list of records"),
        (lambda: At.table([]), "at least one row"),
        (lambda: At.table({"t": []}), "at least one row"),
        (lambda: At.table({"t": [None]}), r"times\[0\] must be a finite number"),
    ],
)
def test_what_is_no_table_is_refused(make, message):
    with pytest.raises(ModelError, match=message):
        make()


def test_columns_are_read_where_their_rows_fire_alone():
    schedule = At.table({**DOSES, "drug": ["A"] * 4, "rate": [1.0, np.nan, 1.0, 1.0]})
    with pytest.raises(ModelError, match="has a value only where a row fires"):
        schedule["amount"]
    with pytest.raises(ModelError, match="has a value only where a row fires"):
        body(Every(1.0), by_amount(schedule))
    with pytest.raises(ModelError, match="has a value only where a row fires"):
        body(At.table(DOSES), by_amount(schedule))
    for name, message in {
        "drug": "must hold finite numbers.*'A' in row 0",
        "rate": "must hold finite numbers.*nan in row 1",
        "amout": "column 'amout' does not exist.*amount",
    }.items():
        with pytest.raises(ModelError, match=message):
            body(schedule, lambda t, x, p, name=name: {"c": x.c + schedule[name]})


def test_a_time_that_is_not_finite_is_refused_at_the_run():
    system = body(At([1.0, "a"]), lambda t, x, p: {}, parameters={"k": K, "a": 2.0, "b": 0.0})
    with pytest.raises(ModelError):
        hybrid.simulate(system, (0.0,), (0.0, 1.0), parameters={"a": np.nan})
    system = body(At([1.0, lambda p: 1.0 / p.b]), lambda t, x, p: {}, parameters={"k": K, "b": 1.0})
    with pytest.raises(ArgumentError, match=r"'dose': At: times\[1\] must be finite"):
        hybrid.simulate(system, (0.0,), (0.0, 1.0), parameters={"b": 1e-310})


def test_a_schedule_goes_through_a_split():
    """A block under dry friction: kicks at 0.5, twice at 1, and at 2.5."""
    kicks = At.table({"t": [1.0, 0.5, 1.0, 2.5], "by": [1.0, 2.0, 4.0, 8.0]})
    system = HybridSystem(
        state=("v",),
        parameters={"mu": 0.5},
        modes=[Mode("slide", lambda t, x, p: (-p.mu * np.sign(x.v),))],
        transitions=[
            Transition("slide", "slide", kicks, Reset(lambda t, x, p: {"v": x.v - kicks["by"]}), name="kick")
        ],
    )
    arc = hybrid.simulate(hybrid.split(system), (1.0,), (0.0, 4.0))
    assert arc.jumps.row.tolist() == [1, 0, 2, 3]
    assert arc.x[-1, 0] == pytest.approx(-12.5, rel=1e-14)


def test_a_state_without_names_reads_columns_too():
    kicks = At.table({"t": [1.0, 1.0], "by": [1.0, 2.0]})
    system = HybridSystem(
        state=2,
        modes=[Mode("m", lambda t, x, p: (0.0, 0.0))],
        transitions=[Transition("m", "m", kicks, Reset(lambda t, x, p: (x[0] + kicks["by"], x[1])))],
    )
    assert hybrid.simulate(system, (1.0, 5.0), (0.0, 2.0)).x[-1] == pytest.approx([4.0, 5.0], rel=1e-14)


def test_the_jumps_of_a_schedule_as_a_dataset_have_rows():
    arc = hybrid.simulate(body(At.table(DOSES)), (0.0,), (-1.0, 60.0))
    assert arc.jumps.to_xarray()["row"].values.tolist() == [1, 0, 3, 2]
    other = hybrid.simulate(body(Every(7.0), lambda t, x, p: {"c": 1.0}), (0.0,), (0.0, 20.0))
    assert "row" not in other.jumps.to_xarray()


def test_a_long_schedule_is_shown_in_short():
    assert repr(At([2.0, "a"])) == "At(times=[2.0, 'a'], when=None)"
    assert len(repr(At(np.arange(1e5)))) < 100
