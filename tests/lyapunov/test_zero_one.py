"""The 0-1 test on series whose kind is known: K is 1 for chaos and 0 for regular motion."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import ArgumentError
from lyapunov import zero_one_test
from tests.lyapunov.clocked import clocked


def logistic(mu, count=3000):
    """A logistic map as the law of an impact of a constant field, sampled between the impacts."""
    system = clocked(("x",), lambda t, x, p: (p.mu * x.x * (1 - x.x),), parameters={"mu": mu})
    times = np.arange(1000.0, 1000.0 + count)
    end = float(times[-1])
    return hybrid.simulate(system, (0.3, 0.5), (0.0, end), samples=times, keep_jumps=False).x[:, 0]


@pytest.mark.parametrize(("mu", "expected"), [(4.0, 1.0), (3.97, 1.0), (3.2, 0.0), (3.5, 0.0), (3.83, 0.0)])
def test_logistic_map(mu, expected):
    found = zero_one_test(logistic(mu))
    assert abs(found.K - expected) < 0.02


def test_quasiperiodic_series():
    n = np.arange(4000)
    series = np.cos(2 * np.pi * n * (np.sqrt(5) - 1) / 2) + 0.3 * np.cos(n * np.sqrt(2) + 1) + 5.0
    assert abs(zero_one_test(series).K) < 0.05


def test_a_constant_series_and_one_that_is_constant_up_to_rounding_are_regular():
    assert zero_one_test(np.zeros(500)).K == 0.0
    assert zero_one_test(np.full(500, 0.3)).K == 0.0
    settled = hybrid.stroboscopic_section(models.impact_oscillator(), (0.9, 1.0), periods=500, transient=500)
    assert np.ptp(settled.x[:, 0]) < 1e-10
    assert abs(zero_one_test(settled.x[:, 0]).K) < 0.1


def test_oversampling_hides_chaos():
    """A chaotic oscillator whose turning points are at integer times, sampled there and 50 times as often."""
    system, start = models.solvable_oscillator(), (0.3, 0.0)
    coarse, fine = np.arange(2000.0), np.linspace(0.0, 100.0, 5001)
    at_turns = hybrid.simulate(system, start, (0.0, 2000.0), samples=coarse, keep_jumps=False).x
    between = hybrid.simulate(system, start, (0.0, 100.0), samples=fine, keep_jumps=False).x
    assert zero_one_test(at_turns[:, 0]).K > 0.98
    assert abs(zero_one_test(between[:, 0]).K) < 0.1


def test_scale_does_not_matter():
    series = logistic(4.0, 1000)
    expected = zero_one_test(series).growth
    for size in (1e200, 1e-200):
        np.testing.assert_allclose(zero_one_test(size * series).growth, expected, rtol=1e-9)


def test_what_comes_back():
    found = zero_one_test(logistic(4.0, 500), frequencies=7)
    assert found.growth.shape == found.frequencies.shape == (7,)
    np.testing.assert_array_equal(np.median(found.growth), found.K)
    assert "of 7 frequencies" in repr(found)


def test_a_short_series_is_refused():
    with pytest.raises(ArgumentError, match="series must be 100 numbers or more"):
        zero_one_test([0.0, 1.0])
