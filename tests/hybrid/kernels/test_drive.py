"""Where runs end: beside a guard, after a long way to it."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate


@cache
def ramp(direction):
    return HybridSystem(
        state=("q",),
        modes=[Mode("run", lambda t, x, p: (float(direction),))],
        transitions=[Transition("run", "run", Guard(lambda t, x, p: x.q, direction))],
    )


@pytest.mark.parametrize("direction", [-1, 1])
@pytest.mark.parametrize("far", [2.0**10, 2.0**20, 3.0**20])
def test_the_size_of_the_state_at_the_end_tells_whether_it_is_on_a_guard(far, direction):
    """A run that starts there does not know how far the state has come. The flight is exact."""
    for ulps in range(-20, 21):
        end = far + ulps * np.spacing(far)
        first = simulate(ramp(direction), (-direction * far,), (0.0, end), solver=Taylor())
        second = simulate(ramp(direction), first.x[-1], (end, end + 1.0), solver=Taylor())
        assert len(first.jumps) + len(second.jumps) == 1, ulps


@pytest.mark.parametrize("solver", [DOP853(), Tsit5(), RadauIIA()], ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("direction", [-1, 1])
def test_no_crossing_is_lost_between_two_runs(direction, solver):
    """Rounding of the last step may take the state beyond the guard without a root on the step."""
    for far in np.linspace(1.0, 40.0, 14):
        for ulps in range(-12, 13):
            end = far + ulps * np.spacing(far)
            first = simulate(ramp(direction), (-direction * far,), (0.0, end), solver=solver)
            second = simulate(ramp(direction), first.x[-1], (end, end + 1.0), solver=solver)
            assert len(first.jumps) + len(second.jumps) >= 1, (far, ulps)
