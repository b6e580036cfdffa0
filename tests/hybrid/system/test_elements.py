"""Guards, resets, modes and transitions: their defaults, and what they refuse."""

import numpy as np
import pytest

from hybrid import Guard, Mode, ModelError, Reset, Transition


def zero(t, x, p):
    return 0.0


GUARD, RESET = Guard(zero), Reset(zero)


def test_defaults():
    assert (GUARD.direction, GUARD.gradient, GUARD.when, GUARD.at_start) == (0, None, None, False)
    assert RESET.jacobian is None
    mode, transition = Mode("a", zero), Transition("a", "b", GUARD)
    assert (mode.jacobian, mode.part_of) == (None, None)
    assert (transition.reset, transition.accumulates_to, transition.part_of) == (None, None, None)


@pytest.mark.parametrize("direction", [-1, 0, 1, np.int64(-1), np.int8(1)])
def test_directions(direction):
    assert Guard(zero, direction).direction == direction


@pytest.mark.parametrize("direction", [-2, 2, 0.0, 1.0, True, False, "up", None])
def test_other_directions_are_refused(direction):
    with pytest.raises(ModelError, match=r"direction must be -1 \(falling\), 0 \(both\) or \+1 \(rising\)"):
        Guard(zero, direction)


@pytest.mark.parametrize("direction", [-1, 1])
def test_a_guard_of_the_start_has_a_side(direction):
    assert Guard(zero, direction, at_start=True).at_start
    with pytest.raises(ModelError, match=r"at_start=True needs direction -1 or \+1"):
        Guard(zero, at_start=True)
    with pytest.raises(ModelError, match="at_start must be True or False; got 1"):
        Guard(zero, direction, at_start=1)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Guard(1.0), "Guard: function must be a function of (t, x, p); got 1.0"),
        (lambda: Guard(zero, gradient=1.0), "Guard: gradient must be a function"),
        (lambda: Guard(zero, when=True), "Guard: when must be a function"),
        (lambda: Reset(None), "Reset: function must be a function"),
        (lambda: Reset(zero, jacobian=0), "Reset: jacobian must be a function"),
        (lambda: Mode("a", None), "Mode: field must be a function"),
        (lambda: Mode("a", zero, jacobian=0), "Mode: jacobian must be a function"),
        (lambda: Mode("", zero), "Mode: name must be a non-empty string; got ''"),
        (lambda: Mode(3, zero), "Mode: name must be a non-empty string; got 3"),
        (lambda: Mode("a", zero, part_of=""), "Mode: part_of must be a non-empty string"),
        (lambda: Transition(None, "a", GUARD), "Transition: source must be a non-empty string; got None"),
        (lambda: Transition("a", "", GUARD), "Transition: target must be a non-empty string; got ''"),
        (lambda: Transition("a", "b", GUARD, name=""), "Transition: name must be a non-empty string"),
        (lambda: Transition("a", "b", GUARD, part_of=1), "Transition: part_of must be a non-empty string"),
        (lambda: Transition("a", "b", zero), "Transition: guard must be a Guard or a clock; got"),
        (lambda: Transition("a", "b", GUARD, zero), "Transition: reset must be a Reset or None"),
    ],
)
def test_what_is_refused(make, text):
    with pytest.raises(ModelError) as caught:
        make()
    assert text in str(caught.value)


def test_an_end_of_the_run_has_neither_reset_nor_limit():
    with pytest.raises(ModelError, match=r"Transition a->\(end\): a reset has no effect without a target"):
        Transition("a", None, GUARD, RESET)
    with pytest.raises(ModelError, match=r"Transition a->\(end\): accumulates_to='b' is for transitions"):
        Transition("a", None, GUARD, accumulates_to="b")
    with pytest.raises(ModelError, match=r"accumulates_to='a' is the mode in which the jumps accumulate"):
        Transition("a", "a", GUARD, RESET, accumulates_to="a")
    other = Transition("a", "b", GUARD, RESET, accumulates_to="c")
    assert (other.reset, other.accumulates_to) == (RESET, "c")


@pytest.mark.parametrize(
    ("target", "options", "name"),
    [("b", {}, "a->b"), (None, {}, "a->(end)"), ("b", {"name": "hit"}, "hit"), ("a", {}, "a->a")],
)
def test_names(target, options, name):
    assert Transition("a", target, GUARD, **options).name == name


@pytest.mark.parametrize(
    ("target", "reset", "marker"),
    [("a", None, True), ("a", RESET, False), ("b", None, False), (None, None, False)],
)
def test_markers(target, reset, marker):
    assert Transition("a", target, GUARD, reset).is_marker == marker
