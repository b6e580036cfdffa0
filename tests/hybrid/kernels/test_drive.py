"""Where runs end: beside a guard, after a long way to it."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Taylor, Transition, simulate

RAMP = HybridSystem(
    state=("q",),
    modes=[Mode("run", lambda t, x, p: (1.0,))],
    transitions=[Transition("run", "run", Guard(lambda t, x, p: x.q, +1))],
)


@pytest.mark.parametrize("far", [2.0**10, 2.0**20, 3.0**20])
def test_the_size_of_the_state_at_the_end_tells_whether_it_is_on_a_guard(far):
    """A run that starts there does not know how far the state has come. The flight is exact."""
    for ulps in range(-20, 21):
        end = far + ulps * np.spacing(far)
        first = simulate(RAMP, (-far,), (0.0, end), solver=Taylor())
        second = simulate(RAMP, first.x[-1], (end, end + 1.0), solver=Taylor())
        assert len(first.jumps) + len(second.jumps) == 1, ulps
