"""Times, distances and companions of long runs, as plain Python."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.types.codes import ENTERING, NO_TRANSITION
from lyapunov import kernels

later, distance, rescale = (each.py_func for each in (kernels.later, kernels.distance, kernels.rescale))


class TestLater:
    @pytest.mark.parametrize("seed", range(20))
    def test_the_time_grows_by_the_interval_and_the_phase_stays_within_a_period(self, seed):
        rng = np.random.default_rng(seed)
        period, interval = rng.uniform(0.5, 2.0), rng.uniform(0.0, 8.0)
        cycle, phase = int(rng.integers(-5, 5)), rng.uniform(0.0, period)
        cycle_after, phase_after = later(period, cycle, phase, interval)
        assert 0.0 <= phase_after < period
        grown = (cycle_after - cycle) * period + phase_after - phase
        assert grown == pytest.approx(interval, rel=1e-12, abs=1e-12)

    def test_a_forcing_period_later_is_the_same_phase(self):
        assert later(0.7, 3, 0.1, 0.7) == (4, 0.1)
        assert later(0.5, 3, 0.25, 1.25) == (6, 0.0)

    def test_without_a_period_time_is_one_number(self):
        assert later(0.0, 0, 5.0, 3.0) == (0, 8.0)


@pytest.mark.parametrize("scale", [1.0, 2.0**-900, 2.0**900])
def test_distances_whose_squares_leave_the_range(scale):
    """A side of 3, 4 and 12; the fourth entry belongs to a tangent vector."""
    one = SimpleNamespace(y=scale * np.array([1.0, 0.0, -5.0, 7.0]))
    other = SimpleNamespace(y=scale * np.array([-2.0, 4.0, 7.0, 99.0]))
    assert distance(one, other, 3) == distance(other, one, 3) == 13.0 * scale
    assert distance(one, one, 3) == 0.0


def test_a_companion_is_put_beside_the_orbit():
    run = SimpleNamespace(
        y=np.array([1.0, 2.0, 9.0]),
        side=np.array([1, -1]),
        on_guard=np.array([0, 1]),
        mode=3,
        previous_mode=2,
    )
    other = SimpleNamespace(
        y=np.array([5.0, -2.0, 8.0]),
        side=np.array([-1, 1]),
        on_guard=np.array([1, 1]),
        due=np.array([1, 0]),
        **{"mode": 0, "previous_mode": 1, "stage": -7, "last_fired": 4, "pending": 5},
    )
    rescale(run, other, 2, 0.25)
    np.testing.assert_array_equal(other.y, [2.0, 1.0, 8.0])
    assert distance(run, other, 2) == pytest.approx(0.25 * np.hypot(4.0, 4.0))
    for name, wanted in (("side", [1, -1]), ("on_guard", [0, 1]), ("due", [0, 0])):
        np.testing.assert_array_equal(getattr(other, name), wanted)
    assert (other.mode, other.previous_mode) == (3, 3)
    assert (other.stage, other.last_fired, other.pending) == (ENTERING, NO_TRANSITION, NO_TRANSITION)
    np.testing.assert_array_equal(run.y, [1.0, 2.0, 9.0])
