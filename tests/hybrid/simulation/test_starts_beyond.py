"""Runs that start beyond a guard of their mode."""

import numpy as np
import pytest

import hybrid
import lyapunov
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate


def test_the_only_mode_needs_no_name():
    ball = HybridSystem(
        state=("q", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -10.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, -x.v)),
                name="bounce",
            )
        ],
    )
    # It rises through the floor after 1/5 s, and falls on it at 1 s.
    arc = simulate(ball, (-1.0, 6.0), (0.0, 1.5))
    assert arc.status.ok
    assert "'bounce'" in arc.status.message
    assert arc.jumps.t == pytest.approx([1.0])


@pytest.mark.parametrize(("start", "fired"), [(3.0, "to a"), (1.5, "to a"), (-1.0, "to b")])
def test_a_transition_at_the_start_that_fires_is_not_said_to_wait(start, fired):
    system = HybridSystem(
        state=("q",),
        modes=[
            Mode("m", lambda t, x, p: (1.0,)),
            Mode("a", lambda t, x, p: (2.0,)),
            Mode("b", lambda t, x, p: (0.0,)),
        ],
        transitions=[
            Transition("m", "a", Guard(lambda t, x, p: x.q - 1.0, +1, at_start=True), name="to a"),
            Transition("m", "b", Guard(lambda t, x, p: (x.q - 2.0) * x.q, +1, at_start=True), name="to b"),
        ],
    )
    arc = simulate(system, (start,), (0.0, 1.0), mode="m")
    assert [jump.transition for jump in arc.jumps] == [fired]
    assert arc.status.message == "Reached the end."


GUARDS_OF_THE_START = {
    "none": None,
    "the same": Guard(lambda t, x, p: x.q - 2.0, +1),
    "falling": Guard(lambda t, x, p: x.q - 2.0, -1),
    "both ways": Guard(lambda t, x, p: x.q - 2.0, 0),
    "mirrored": Guard(lambda t, x, p: 4.0 - 2.0 * x.q, -1),
    "at the start": Guard(lambda t, x, p: x.q - 2.0, +1, at_start=True),
    "refused": Guard(lambda t, x, p: x.q - 2.0, +1, when=lambda t, x, p: x.q > 100.0),
}


@pytest.mark.parametrize("name", GUARDS_OF_THE_START)
@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize(("start", "fired"), [(1.5, ["ab"]), (2.0, ["ab", "bc"]), (2.5, ["ab", "bc"])])
def test_a_guard_of_a_mode_that_excludes_the_start_decides_nothing_in_the_next_one(name, first, start, fired):
    """A start beyond the guard of ``ab`` belongs to mode ``b``, whatever other guards leave mode ``a``."""
    guard = GUARDS_OF_THE_START[name]
    if first and start > 2.0 and name == "at the start":
        # Mode ``a`` excludes the start by this guard too, and it is listed first.
        fired = ["ac"]
    other = [] if guard is None else [Transition("a", "c", guard, name="ac")]
    ab = [Transition("a", "b", Guard(lambda t, x, p: x.q - 1.0, +1, at_start=True), name="ab")]
    bc = Transition("b", "c", Guard(lambda t, x, p: x.q - 2.0, +1), name="bc")
    system = HybridSystem(
        state=("q",),
        modes=[Mode(each, lambda t, x, p: (1.0,)) for each in "abc"],
        transitions=[*(other + ab if first else ab + other), bc],
    )
    arc = simulate(system, (start,), (0.0, 0.1), mode="a")
    assert [(jump.t, jump.transition) for jump in arc.jumps] == [(0.0, each) for each in fired]
    assert arc.status.message == "Reached the end."


@pytest.mark.parametrize("start", [1.0, 2.0, 2.5])
def test_a_guard_that_has_fired_at_the_start_does_not_fire_again_in_the_next_mode(start):
    """The guard of ``bc`` is that of ``cd``: the run has passed it once."""
    ab = Transition("a", "b", Guard(lambda t, x, p: x.q - 0.5, +1, at_start=True), name="ab")
    above = Guard(lambda t, x, p: x.q - 1.0, +1)
    system = HybridSystem(
        state=("q",),
        modes=[Mode(each, lambda t, x, p: (1.0,)) for each in "abcd"],
        transitions=[ab, Transition("b", "c", above, name="bc"), Transition("c", "d", above, name="cd")],
    )
    arc = simulate(system, (start,), (0.0, 1.0), mode="a")
    assert [jump.transition for jump in arc.jumps] == ["ab", "bc"]


def test_a_guard_that_the_start_is_beyond_is_told_where_the_run_stays_in_its_mode():
    system = HybridSystem(
        state=("q", "n"),
        modes=[Mode("a", lambda t, x, p: (1.0, 0.0)), Mode("c", lambda t, x, p: (1.0, 0.0))],
        transitions=[
            Transition(
                "a",
                "a",
                Guard(lambda t, x, p: x.q - 1.0, +1, at_start=True),
                Reset(lambda t, x, p: {"n": x.n + 1.0}),
                name="aa",
            ),
            Transition("a", "c", Guard(lambda t, x, p: x.q - 2.0, +1), name="ac"),
        ],
    )
    arc = simulate(system, (2.5, 0.0), (0.0, 0.1), mode="a")
    assert arc.mode[-1] == "a"
    assert arc.status.code == StatusCode.START_BEYOND
    assert "'ac'" in arc.status.message


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(
    ("start", "above"),
    [((2.0, 2.0, 0.0), "qv"), ((2.0, 0.0, 0.0), "q"), ((0.0, 2.0, 0.0), "v"), ((0.0,) * 3, "")],
)
def test_each_guard_of_the_start_that_it_lies_beyond_fires(start, above, order):
    """Each appends its digit to a number, in the order in which they are listed."""
    first = Guard(lambda t, x, p: x.q - 1.0, +1, at_start=True)
    second = Guard(lambda t, x, p: x.v - 1.0, +1, at_start=True)
    transitions = [
        Transition("m", "m", first, Reset(lambda t, x, p: {"n": 10 * x.n + 1}), name="q"),
        Transition("m", "m", second, Reset(lambda t, x, p: {"n": 10 * x.n + 2}), name="v"),
    ]
    system = HybridSystem(
        state=("q", "v", "n"),
        modes=[Mode("m", lambda t, x, p: (1.0, 1.0, 0.0))],
        transitions=transitions[::order],
    )
    arc = simulate(system, start, (0.0, 3.0), tangent=True)
    fired = [each for each in "qv"[::order] if each in above]
    assert [jump.transition for jump in arc.jumps] == fired
    assert arc["n"][-1] == int("0" + "".join("12"["qv".index(each)] for each in fired))
    assert arc.fundamental[2, 2] == 10.0 ** len(fired)


def test_a_reset_that_takes_the_start_back_leaves_the_next_guard_alone():
    system = HybridSystem(
        state=("q",),
        modes=[Mode("m", lambda t, x, p: (0.0,))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.q - 1.0, +1, at_start=True), Reset(lambda t, x, p: (0.5,))
            ),
            Transition("m", None, Guard(lambda t, x, p: x.q - 1.0, +1, at_start=True), name="out"),
        ],
    )
    arc = simulate(system, (2.0,), (0.0, 1.0))
    assert arc.status.ok
    assert len(arc.jumps) == 1


def relay(**options):
    """A heater that switches off at the temperature 1 and on at 0; on, it tends to ``p.hot``."""
    return HybridSystem(
        state=("T",),
        parameters={"hot": 2.0},
        modes=[Mode("on", lambda t, x, p: (p.hot - x.T,)), Mode("off", lambda t, x, p: (-1.0 - x.T,))],
        transitions=[
            Transition("on", "off", Guard(lambda t, x, p: x.T - 1.0, +1), name="switch off"),
            Transition("off", "on", Guard(lambda t, x, p: x.T, -1), name="switch on"),
        ],
        **options,
    )


def test_a_guard_beyond_which_a_run_starts_and_that_never_fires_is_a_status():
    arc = simulate(relay(), (1.5,), (0.0, 5.0), mode="on")
    assert arc.x[-1, 0] == pytest.approx(2.0 - 0.5 * np.exp(-5.0))
    assert arc.status.code == StatusCode.START_BEYOND
    assert "The start lies beyond the guard of 'switch off'" in arc.status.message


@pytest.mark.parametrize(("start", "mode"), [(0.5, "on"), (0.5, "off"), (1.5, None), (1.5, "off")])
def test_a_start_before_its_guards_is_no_such_status(start, mode):
    arc = simulate(relay(), (start,), (0.0, 5.0), mode=mode)
    assert arc.status.ok
    assert len(arc.jumps) > 0


def test_a_start_beyond_a_guard_that_fires_later_is_told_in_a_note():
    swinging = HybridSystem(
        state=("q", "v"),
        modes=[Mode("m", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition(
                "m", "m", Guard(lambda t, x, p: x.q - 0.5, +1), Reset(lambda t, x, p: (0.5, x.v)), name="up"
            )
        ],
    )
    early, late = (simulate(swinging, (1.0, 0.0), (0.0, end)) for end in (3.0, 6.0))
    assert early.status.code == StatusCode.START_BEYOND
    assert late.status.ok
    assert late.jumps.t == pytest.approx([2.0 * np.pi - np.pi / 3.0])
    assert "The start lies beyond the guard of 'up'" in late.status.message


def test_all_results_from_such_a_start_say_so():
    many = hybrid.simulate_many(relay(), [[0.5], [1.5]], (0.0, 5.0), mode="on")
    assert many.status.values.tolist() == [StatusCode.SUCCESS, StatusCode.START_BEYOND]
    assert lyapunov.lyapunov_spectrum(relay(), (1.5,), mode="on", interval=1.0, intervals=5).status.code == (
        StatusCode.START_BEYOND
    )
    chart = lyapunov.chart(
        relay(), {"hot": [1.2, 2.0], "T": [0.5, 1.5]}, (0.0,), mode="on", interval=1.0, intervals=5
    )
    assert (chart.status.values == [[StatusCode.SUCCESS, StatusCode.START_BEYOND]] * 2).all()
    assert "lies beyond the guard of 'switch off'" in str(chart.message.values[0, 1])


def test_the_picture_of_a_chart_names_the_status():
    chart = lyapunov.chart(relay(), {"T": [0.5, 0.7, 1.5]}, (0.0,), mode="on", interval=1.0, intervals=5)
    (ax,) = hybrid.plot.plot(chart)
    assert [text.get_text() for text in ax.get_legend().get_texts()][-1] == "START_BEYOND, see chart.message"
    assert ax.lines[-1].get_xdata().tolist() == [1.5]
