"""Runs that start beyond a guard of their mode."""

import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate


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
