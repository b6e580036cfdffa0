"""Ranges from which states, parameters and spans are drawn."""

import attrs
import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import cases, parameters, states
from hybrid.testing.strategies import (
    _drawn_parameters,
    _drawn_state,
    _time_span,
    _values,
    default_duration,
)
from tests.hybrid.systems import BALL_SYSTEM, OSCILLATOR_SYSTEM

FAST = settings(phases=(Phase.generate,), max_examples=250)


def extremes(strategy, value):
    """Whether values near both ends of -1 to 1 occur, and none beyond."""
    with pytest.raises(NoSuchExample):
        find(strategy, lambda drawn: not -1.0 - 1e-12 <= value(drawn) <= 1.0 + 1e-12, settings=FAST)
    return all(
        find(strategy, lambda drawn, side=side: side * value(drawn) > 0.8, settings=FAST) is not None
        for side in (-1, 1)
    )


def test_states_are_drawn_from_minus_two_to_two():
    for i in range(2):
        assert extremes(states(BALL_SYSTEM), lambda drawn, i=i: drawn[i] / 2)


def test_states_are_drawn_from_their_ranges():
    strategy = states(BALL_SYSTEM, {"q": (1e-9, 3e-9), "v": 4.0})
    assert extremes(strategy, lambda drawn: drawn[0] * 1e9 - 2.0)
    assert find(strategy, lambda drawn: True, settings=FAST)[1] == 4.0
    chosen = states(BALL_SYSTEM, {"q": st.sampled_from([1, 3])})
    assert find(chosen, lambda drawn: drawn[0] == 3.0, settings=FAST)[0] == 3.0


@pytest.mark.parametrize(
    ("low", "high", "step"),
    [(0.0, 2 * np.pi, 1e-5), (3.0, 11 / 3, 1e-6), (-7e5 / 3, 7e5 / 3, 1.0), (0.0, 2e-9 / 3, 1e-15)],
)
def test_numbers_have_five_digits_after_the_first_of_half_the_range(low, high, step):
    strategy = states(BALL_SYSTEM, {"q": (low, high)})
    middle = 0.5 * (low + high)

    def is_longer(drawn):
        return drawn[0] != middle and abs(drawn[0] / step - round(drawn[0] / step)) > 1e-3

    with pytest.raises(NoSuchExample):
        find(strategy, is_longer, settings=FAST)
    assert find(strategy, lambda drawn: round(drawn[0] / step) % 10 in (3, 7), settings=FAST)


def test_parameters_are_drawn_within_a_fifth_of_what_is_declared():
    strategy = parameters(attrs.evolve(BALL_SYSTEM, parameters={"g": 9.81, "e": 0.5}))
    for name, value in (("g", 9.81), ("e", 0.5)):
        assert extremes(strategy, lambda drawn, name=name, value=value: (drawn[name] / value - 1.0) / 0.2)
    assert extremes(parameters(BALL_SYSTEM, {"e": (0.0, 0.5)}), lambda drawn: 4.0 * drawn["e"] - 1.0)


def test_a_share_stays_a_share():
    """A restitution of 0.9 is drawn from 0.72 to 0.95: one above 1 would be another law."""
    strategy = parameters(attrs.evolve(BALL_SYSTEM, parameters={"g": 9.81, "e": 0.9}))
    assert extremes(strategy, lambda drawn: (drawn["e"] - 0.9) / (0.18 if drawn["e"] < 0.9 else 0.05))


@given(cases(BALL_SYSTEM, states={"q": (0.5, 1.0)}, t_span=(3.0, 5.0)))
def test_runs_start_in_the_first_half_of_the_span_and_last_a_fifth_of_the_rest(case):
    assert 3.0 <= case.t0 <= 4.0
    assert 0.2 * (5.0 - case.t0) - 1e-12 <= case.t1 - case.t0 <= 5.0 - case.t0 + 1e-12
    assert 0.01 <= case.fraction <= 0.99
    assert case.mode == "flight"


def test_the_ends_of_spans_and_fractions_occur():
    strategy = cases(BALL_SYSTEM, states={"q": (0.5, 1.0)}, t_span=(3.0, 5.0))
    assert extremes(strategy, lambda case: 2.0 * (case.t0 - 3.5))
    shares = strategy.map(lambda case: (case.t1 - case.t0) / (5.0 - case.t0))
    assert extremes(shares, lambda share: (share - 0.6) / 0.4)
    assert extremes(strategy, lambda case: (case.fraction - 0.5) / 0.49)


@pytest.mark.parametrize("wrong", [(1.0,), (1.0, 2.0, 3.0), (1.0, np.inf), (np.nan, 1.0), 1.0, ((1.0, 2.0),)])
def test_states_drawn_by_a_strategy_of_the_user_are_checked(wrong):
    assert _drawn_state("x", 2, (1, 2.5)) == (1.0, 2.5)
    with pytest.raises(ArgumentError, match="x must draw states of 2 finite numbers"):
        _drawn_state("x", 2, wrong)


def test_parameters_drawn_by_a_strategy_of_the_user_are_checked():
    declared = {"a": 1.0, "b": 2.0}
    assert _drawn_parameters("p", declared, {}) == declared
    assert _drawn_parameters("p", declared, {"b": 3}) == {"a": 1.0, "b": 3.0}
    for wrong, text in (((1.0,), "draw mappings"), ({"c": 1.0}, "'c' does not exist"), ({"a": "x"}, "'a'")):
        with pytest.raises(ArgumentError, match=text):
            _drawn_parameters("p", declared, wrong)


@pytest.mark.parametrize("wrong", [(1.0, 0.0), (0.0, np.inf), (np.nan, 1.0), (1.0, 2.0, 3.0), (1.0,)])
def test_ranges_are_checked(wrong):
    assert find(_values("q", (2.0, 2.0)), lambda drawn: True, settings=FAST) == 2.0
    with pytest.raises(ArgumentError, match=r"q must be \(low, high\), a number or a strategy"):
        _values("q", wrong)


@pytest.mark.as_given
@pytest.mark.parametrize("wrong", [(1.0, 1.0), (2.0, 1.0)])
def test_spans_are_checked(wrong):
    assert _time_span((1, 2.5)) == (1.0, 2.5)
    with pytest.raises(ArgumentError, match="t_span must"):
        _time_span(wrong)


def test_durations():
    period = 2 * np.pi / OSCILLATOR_SYSTEM.parameters["w"]
    assert default_duration(OSCILLATOR_SYSTEM, dict(OSCILLATOR_SYSTEM.parameters)) == pytest.approx(
        2 * period
    )
    slow = HybridSystem(
        state=("x", "y"), parameters={"k": 4.0}, modes=[Mode("m", lambda t, x, p: (p.k, 0.0))]
    )
    assert default_duration(slow, {"k": 4.0}) == pytest.approx(5.0)
    assert default_duration(slow, {"k": -0.5}) == pytest.approx(40.0)
    still = HybridSystem(state=("x",), modes=[Mode("m", lambda t, x, p: (0.0,))])
    assert default_duration(still, {}) == 10.0


def ladder():
    """Three modes, of which two allow a positive state, and one a negative one."""
    return HybridSystem(
        state=("x",),
        modes=[Mode(name, lambda t, x, p: (1.0,)) for name in ("low", "high", "top")],
        transitions=[
            Transition("low", "high", Guard(lambda t, x, p: x.x, +1)),
            Transition("high", "top", Guard(lambda t, x, p: x.x, -1), Reset(lambda t, x, p: (x.x + 1.0,))),
            Transition("top", "low", Guard(lambda t, x, p: x.x, -1), Reset(lambda t, x, p: (x.x - 1.0,))),
        ],
    )


@pytest.mark.parametrize(("x", "modes"), [(1.0, {"high", "top"}), (-1.0, {"low"}), (0.0, {None})])
def test_modes_are_those_that_allow_the_start(x, modes):
    strategy = cases(ladder(), states={"x": x}, t_span=(0.0, 1.0))
    for mode in modes:
        assert find(strategy, lambda case, mode=mode: case.mode == mode, settings=FAST)
    with pytest.raises(NoSuchExample):
        find(strategy, lambda case: case.mode not in modes, settings=FAST)


RELAY = HybridSystem(
    state=("T",),
    parameters={"low": 19.0, "high": 21.0, "k": -1.0},
    modes=[Mode("on", lambda t, x, p: (p.k * (x.T - p.low - p.high),))],
)


@given(parameters(RELAY))
def test_drawn_parameters_keep_their_order(drawn):
    """With a fifth of each the lower threshold of a relay would be drawn above the upper one."""
    assert drawn["k"] < 0.0 < drawn["low"] <= 20.0 <= drawn["high"]
