"""What rounding of the states hides of the gap between the ends of an orbit."""

import numpy as np
import pytest

from hybrid import DOP853, HybridSystem, Mode, simulate
from hybrid.orbits.hidden import FINEST_GAP, hidden_gap
from hybrid.orbits.newton import EPSILON
from hybrid.simulation.trajectory import start


@pytest.mark.parametrize("t0", [0.0, 0.5, 6.25])
@pytest.mark.parametrize("rate", [1e-17, -1e-17, 1e-14, -1e-14])
def test_it_is_the_mean_rate_times_the_time_as_far_as_rounding_hides_it(rate, t0):
    """The rate swings about its mean; its phase is that of the forcing."""
    system = HybridSystem(
        state=("q", "r"),
        parameters={"rate": 0.0},
        modes=[Mode("on", lambda t, x, p: (p.rate * (1 + 0.5 * np.cos(np.pi * t)), 0 * x.r))],
        period=2.0,
    )
    options = {"parameters": {"rate": rate}, "solver": DOP853()}
    arc = simulate(system, (3.0, 1.0), (t0, t0 + 1.0), **options)
    found = hidden_gap(start(system, (3.0, 1.0), t0, **options), arc, np.array([3.0, 1.0]))
    swing = 0.5 * (np.sin(np.pi * (t0 + 1.0)) - np.sin(np.pi * t0)) / np.pi
    most = FINEST_GAP * EPSILON * 3.0
    np.testing.assert_allclose(found, (np.clip(rate * (1.0 + swing), -most, most), 0.0), rtol=1e-3, atol=0)


def test_a_rate_that_is_no_number_hides_nothing():
    system = HybridSystem(state=("q",), modes=[Mode("on", lambda t, x, p: (0 * x.q,))])
    arc = simulate(system, (1.0,), (0.0, 1.0))
    broken = HybridSystem(state=("q",), modes=[Mode("on", lambda t, x, p: (np.sqrt(x.q - 2.0),))])
    assert hidden_gap(start(broken, (1.0,), 0.0, mode="on"), arc, np.ones(1)).tolist() == [0.0]
