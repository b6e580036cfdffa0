"""Errors that break a run are raised by name."""

import numpy as np
import pytest

import models
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import PropertyError, check_system


def told(system, **options):
    with pytest.raises(PropertyError) as caught:
        check_system(system, examples=10, **options)
    return str(caught.value)


def neuron(after):
    """An integrate-and-fire neuron with the threshold 1."""
    return HybridSystem(
        state=("v",),
        modes=[Mode("rest", lambda t, x, p: (2.0 - x.v,))],
        transitions=[
            Transition("rest", "rest", Guard(lambda t, x, p: x.v - 1, +1), Reset(after), name="spike")
        ],
    )


def test_a_reset_far_beyond_its_own_guard():
    message = told(neuron(lambda t, x, p: (102.0,)), states={"v": (0.0, 0.9)}, t_span=(0.0, 3.0))
    assert "spike lands 101 beyond spike" in message
    assert "threshold" in message


def test_a_reset_that_gives_nan():
    message = told(neuron(lambda t, x, p: (np.log(0.5 - x.v),)), states={"v": (0.0, 0.9)}, t_span=(0.0, 3.0))
    assert "the last jump: event 'spike'" in message
    assert "a reset or a field that has no value" in message


def test_modes_that_throw_the_state_back_at_once():
    relay = HybridSystem(
        state=("q",),
        modes=[Mode("on", lambda t, x, p: (1.0,)), Mode("off", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition("on", "off", Guard(lambda t, x, p: x.q - 1, +1)),
            Transition("off", "on", Guard(lambda t, x, p: x.q - 1.5, -1)),
        ],
    )
    message = told(relay, states={"q": (-1.0, 0.5)}, t_span=(0.0, 3.0))
    assert "two modes that each give the state back at once" in message


@pytest.mark.parametrize("name", ["bouncing_ball", "impact_oscillator", "simplest_walker"])
def test_right_models_end_well(name):
    report = check_system(getattr(models, name)(), examples=3)
    assert report.properties[0].examples > 0
