"""Time as whole periods and a phase, and a run that goes on from another."""

import math

import pytest

from hybrid.simulation.periods import split_time

PERIODS = [0.1, 1.0 / 3.0, 2 * math.pi / 7.46, 1e-9, 3e5]


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("count", [-1000, -3, -1, 0, 1, 3, 7, 10, 1000, 2**20 + 1])
def test_a_whole_number_of_periods_has_no_phase(period, count):
    """Times one rounding away have a phase next to 0 or to a period, and no other cycle."""
    whole = count * period
    for t in (math.nextafter(whole, -math.inf), whole, math.nextafter(whole, math.inf)):
        cycle, phase = split_time(t, period)
        assert 0.0 <= phase < period
        assert cycle in (count - 1, count)
        rounding = 4e-16 * max(abs(whole), period)
        assert min(phase, period - phase) <= rounding
        assert (cycle - count) * period + phase == pytest.approx(0.0, abs=rounding)


def test_the_phase_is_never_a_whole_period():
    """``5.3 // 0.1`` is 52, and ``5.3 - 53 * 0.1`` is negative: in both cases a new cycle has just begun."""
    cases = [(cycle * 0.1, 0.1) for cycle in range(-2000, 2000)] + [(-1e-20, 1.0), (-5e-324, 0.1)]
    for t, period in cases:
        cycle, phase = split_time(t, period)
        assert 0.0 <= phase < period, (t, period)
        assert cycle * period + phase == pytest.approx(t, abs=1e-13)
    assert split_time(-1e-20, 1.0) == (0, 0.0)
    assert split_time(3.0, 1.0) == (3, 0.0)
    assert split_time(2.75, 1.0) == (2, 0.75)
    assert split_time(-0.25, 1.0) == (-1, 0.75)


def test_without_a_period_all_of_the_time_is_phase():
    assert split_time(-7.5, 0.0) == (0, -7.5)
