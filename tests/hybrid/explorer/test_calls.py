"""A call runs as it is written down."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hybrid
import models
from hybrid.explorer.calls import Call, Written, script, text_of

NUMBERS = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**9), 10**9)
VALUES = st.recursive(
    NUMBERS | st.text(max_size=5) | st.none() | st.booleans(),
    lambda inside: (
        st.lists(inside, max_size=3)
        | st.lists(inside, max_size=3).map(tuple)
        | st.dictionaries(st.text(max_size=3), inside, max_size=3)
    ),
)


@given(VALUES)
def test_a_text_evaluates_to_its_value(value):
    assert eval(text_of(value)) == value


def test_arrays_are_written_as_tuples():
    assert text_of(np.array([0.1, 2.0])) == "(0.1, 2.0)"
    assert text_of((np.float64(1.5),)) == "(1.5,)"


def test_a_written_value_stands_for_its_text():
    ball = models.bouncing_ball()
    call = Call("arc", hybrid.simulate, (Written(ball, "ball"), (1.0, 0.0), (0.0, 0.5)), {"max_jumps": 3})
    assert str(call) == "arc = hybrid.simulate(ball, (1.0, 0.0), (0.0, 0.5), max_jumps=3)"
    made = {"hybrid": hybrid, "ball": ball}
    exec(str(call), made)
    np.testing.assert_array_equal(made["arc"].x, call.result().x)


def test_keywords_that_are_none_are_left_out():
    call = Call("arc", hybrid.simulate, (), {"mode": None, "max_jumps": 1})
    assert str(call) == "arc = hybrid.simulate(max_jumps=1)"


def test_a_long_call_has_a_line_per_argument():
    call = Call("arc", hybrid.simulate, (tuple(range(40)),), {"max_jumps": 1})
    assert str(call).splitlines()[0] == "arc = hybrid.simulate("
    assert str(call).splitlines()[2] == "    max_jumps=1,"
    compile(str(call), "call", "exec")


def test_a_script_begins_with_the_model():
    assert script("import hybrid\n", ["first", "second"]) == "import hybrid\n\nfirst\nsecond\n"


@pytest.mark.parametrize("changed", [{}, {"max_jumps": 1}])
def test_the_page_may_change_keywords(changed):
    ball = models.bouncing_ball()
    call = Call("arc", hybrid.simulate, (ball, {"q": Written(1.0, "1.0"), "v": 0.0}, (0.0, 1.2)))
    assert call.result(**changed).jump_count == (1 if changed else 2)
