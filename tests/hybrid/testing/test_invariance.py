"""What counts as the same run: events, final mode, final state and status."""

import numpy as np
import pytest
from hypothesis.errors import UnsatisfiedAssumption

from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.testing import PropertyError
from hybrid.testing.case import Case
from hybrid.testing.elastic import check_elastic, turned
from hybrid.testing.invariance import (
    check_cut,
    check_names,
    check_order,
    check_samples,
    check_scale,
    check_split,
)
from models import bouncing_ball, stick_slip, vibroimpact


def test_time_is_reversed_by_name_or_by_a_function():
    system = vibroimpact()
    turn = turned("flip", system, ["v1", "v2"])
    np.testing.assert_array_equal(turn(np.array([1.0, 2.0, 3.0, 4.0])), [1.0, 2.0, -3.0, -4.0])
    own = turned("flip", system, np.negative)
    np.testing.assert_array_equal(own(np.array([1.0, 2.0, 3.0, 4.0])), [-1.0, -2.0, -3.0, -4.0])


def test_one_transition_has_no_other_order():
    with pytest.raises(UnsatisfiedAssumption):
        check_order(Case(bouncing_ball(), dict(bouncing_ball().parameters), "flight", (1.0, 0.0), 0.0, 1.0))


def test_names_may_be_of_several_words():
    falls = Mode("falls and flies", lambda t, x, p: (x.v, -9.81))
    floor = Transition(
        falls.name, falls.name, Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (0.0, -0.8 * x.v)),
        name="hits the floor",
    )  # fmt: skip
    system = HybridSystem(state=("q", "v"), modes=[falls], transitions=[floor])
    check_names(Case(system, {}, falls.name, (1.0, 0.0), 0.0, 1.0))


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("fraction", [0.2, 0.7])
def test_a_flow_is_cut_in_any_units(unit, fraction):
    """The plane is across the flow; a start is on it if it is so by its share of the sizes of the states."""
    ball = bouncing_ball()
    parameters = {"g": 9.81 * unit, "e": 0.8}
    case = Case(ball, parameters, "flight", (unit, 0.3 * unit), 0.0, 1.2, fraction)
    check_cut(case)


class TestElastic:
    """A ball on an elastic floor: above it falls, below it a spring pushes it back."""

    @staticmethod
    def floor(loss):
        return HybridSystem(
            state=("q", "v"),
            modes=[
                Mode("above", lambda t, x, p: (x.v, -1.0)),
                Mode("below", lambda t, x, p: (x.v, -1.0 - 40.0 * x.q - loss * x.v)),
            ],
            transitions=[
                Transition("above", "below", Guard(lambda t, x, p: x.q, -1)),
                Transition("below", "above", Guard(lambda t, x, p: x.q, +1)),
            ],
        )

    # The ball reaches the floor at 1, and stays below it for less than 0.5.
    @pytest.mark.parametrize("t1", [0.8, 1.2, 2.5, 3.7])
    def test_it_runs_back_from_either_mode(self, t1):
        check_elastic(Case(self.floor(0.0), {}, "above", (0.5, 0.0), 0.0, t1), ["v"])

    # A ball thrown up from the floor with speed 1 is back after 2, and one more jump undoes the start.
    @pytest.mark.parametrize("t1", [0.7, 3.0, 5.2])
    @pytest.mark.parametrize("gravity", [1.0, 0.7, 1 / 3])
    def test_a_start_on_a_guard_is_reached_before_the_jump_there(self, t1, gravity):
        ball = bouncing_ball()
        check_elastic(Case(ball, {"g": gravity, "e": 1.0}, "flight", (0.0, 1.0), 0.0, t1), ["v"])

    @pytest.mark.parametrize("t1", [1.2, 2.5])
    def test_it_does_not_with_damping_or_with_the_wrong_component_turned(self, t1):
        with pytest.raises(PropertyError, match="runs backwards"):
            check_elastic(Case(self.floor(0.1), {}, "above", (0.5, 0.0), 0.0, t1), ["v"])
        with pytest.raises((PropertyError, UnsatisfiedAssumption)):
            check_elastic(Case(self.floor(0.0), {}, "above", (0.5, 0.0), 0.0, t1), ["q"])


@pytest.mark.parametrize(
    "check", [check_cut, check_names, check_order, check_scale, check_split, check_samples]
)
def test_systems_whose_runs_may_end_can_be_checked(check):
    """A transition without a target has no reset that could be changed."""
    block = stick_slip()
    check(Case(block, dict(block.parameters), "sliding", (0.5, 0.2), 0.0, 6.0))
