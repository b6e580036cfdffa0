"""Times on the clock of a forced system, and distances whose squares leave the range of numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

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
    assert distance(one, SimpleNamespace(y=-one.y), 3) == pytest.approx(2 * np.sqrt(26.0) * scale, rel=1e-15)
