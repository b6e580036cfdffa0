"""What a guard beside the series of a step is told of the step."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events.onset import BY_ACCELERATION, BY_SPEED, BY_STEP, JUMPING
from hybrid.kernels.steps import beside_series
from hybrid.kernels.types.codes import EXACT, TAYLOR
from tests.hybrid.kernels.plain import plain

TRANSITION, MODE, ORDER = 1, 1, 2


@pytest.mark.parametrize("on_guard", [0, BY_SPEED, BY_ACCELERATION, BY_STEP, JUMPING])
@pytest.mark.parametrize("kind", [TAYLOR, EXACT])
@pytest.mark.parametrize("clock", [-1, 1])
def test_the_value_at_the_end_is_asked_for_if_only_the_step_tells_the_side(on_guard, kind, clock):
    """On the clock ``s`` the time is ``2 s + 4 s^2``."""
    h, later = 0.5, 10.5 if clock < 0 else 12.0
    series = np.array([[1.0, 0.0], [3.0, 2.0], [0.0, 4.0]])
    asked = []

    def guard(transition, t, x, parameters, out):
        assert (transition, t, x.tolist()) == (TRANSITION, later, [7.0])
        out[0] = -0.25

    def crossing_on_path(*given):
        asked.append(given)
        return 0.75, -1, 0.5

    model = SimpleNamespace(parameters=None, guard=guard, propagator=np.array([9, kind]))
    run = SimpleNamespace(mode=MODE, on_guard=np.array([9, on_guard]), rehearsal=np.zeros((4, 2)))
    work = SimpleNamespace(series=series, trial=np.array([7.0]), scalar=np.zeros(1))
    tested = plain(beside_series, crossing_on_path=crossing_on_path).crossing_beside_series
    assert tested(model, None, run, TRANSITION, ORDER, 10.0, h, clock, work) == (0.75, 0.5)
    assert run.rehearsal.tolist() == [[0, 0], [0, 0], [0, 0], [0, -1]]
    [given] = asked
    assert given[3] == TRANSITION
    assert given[4] is series
    end = -0.25 if on_guard == BY_STEP else 0.0
    assert given[5:-1] == (ORDER, clock, 10.0, 1.0, h, end, kind == EXACT)
