"""Two transitions of one clock that are meant as alternatives."""

import numpy as np
import pytest

import hybrid
from hybrid import After, Every, HybridSystem, Mode, Reset, Transition, simulate
from lyapunov import lyapunov_spectrum

SAID = "two transitions of one clock fired whose conditions (when=) exclude each other"


def below(t, x, p):
    return x.x < 0


def above(t, x, p):
    return x.x >= 0


def moved(clock, jump, name):
    return Transition("wait", "wait", clock, Reset(lambda t, x, p: {"x": x.x + jump}), name=name)


def system(*transitions, modes=("wait",), **options):
    field = [Mode(name, lambda t, x, p: (0.0,)) for name in modes]
    return HybridSystem(state=("x",), modes=field, transitions=transitions, period=1.0, **options)


def alternatives(jump, **options):
    return system(
        moved(Every(1.0, when=below), jump, "up"), moved(Every(1.0, when=above), -jump, "down"), **options
    )


def test_both_alternatives_at_one_tick_are_said():
    arc = simulate(alternatives(2.0), (-0.5,), (0.0, 2.5))
    assert list(arc.jumps.transition) == ["up", "down"] * 2
    assert arc.status.ok
    assert f"At 2 ticks {SAID}: the reset of the first one made the condition of 'down' true" in str(
        arc.status
    )


def test_one_alternative_per_tick_is_not_said():
    arc = simulate(alternatives(0.1), (-0.45,), (0.0, 3.5))
    assert list(arc.jumps.transition) == ["up"] * 3
    assert SAID not in str(arc.status)


def test_an_order_that_is_meant_is_not_said():
    assert SAID not in str(simulate(alternatives(2.0, listed_order=True), (-0.5,), (0.0, 2.5)).status)


@pytest.mark.parametrize("when", [None, lambda t, x, p: x.x < 10])
def test_a_condition_that_waits_for_another_reset_is_not_said(when):
    """The first transition counts, the second one acts on the count: both are meant."""
    counting = system(
        moved(Every(1.0, when=when), 1.0, "count"),
        Transition("wait", "wait", Every(1.0, when=lambda t, x, p: x.x >= 3), Reset(lambda t, x, p: (0.0,))),
    )
    arc = simulate(counting, (0.0,), (0.0, 3.5))
    assert len(arc.jumps) == 4
    assert SAID not in str(arc.status)


def test_modes_that_take_turns_are_not_said():
    turns = system(
        Transition("one", "other", Every(1.0, when=below), Reset(lambda t, x, p: (1.0,))),
        Transition("other", "one", Every(1.0, when=above), Reset(lambda t, x, p: (-1.0,))),
        modes=("one", "other"),
    )
    arc = simulate(turns, (-0.5,), (0.0, 3.5), mode="one")
    assert len(arc.jumps) == 3
    assert SAID not in str(arc.status)


def test_a_dwell_time_that_begins_anew_is_not_said():
    """The jump enters the mode anew, and then the other transition has to wait as long again."""
    waiting = system(moved(After(1.0, when=below), 2.0, "up"), moved(After(1.0, when=above), -2.0, "down"))
    arc = simulate(waiting, (-0.5,), (0.0, 1.5))
    assert list(arc.jumps.transition) == ["up"]
    assert SAID not in str(arc.status)


def test_results_over_many_ticks_say_so():
    twice = alternatives(2.0)
    assert SAID in lyapunov_spectrum(twice, (-0.5,), intervals=5).status.message
    many = hybrid.simulate_many(twice, [[-0.5], [0.5]], (0.0, 1.5))
    # From 0.5 the first one is passed over, and the second one fires alone.
    assert [SAID in message for message in many.message.values] == [True, False]
    np.testing.assert_array_equal(many.jumps, [2, 1])
