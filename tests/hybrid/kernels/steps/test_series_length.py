"""The length of a step from the last terms of its series."""

import numpy as np
import pytest

from hybrid.kernels.steps import series_length
from hybrid.kernels.steps.series_length import Columns, Tolerance
from tests.hybrid.kernels.plain import plain


def logarithms(numbers):
    return np.log2(np.maximum(numbers, 2.0**-1023))


KERNELS = plain(series_length, binary_logarithms=logarithms, power_of_two=np.exp2)
FIRST, STRIDE = 8, 20


def length_of(series, order, n, groups, rtol, exact, regular=False):
    weights, tolerance = np.zeros((1, series.shape[1])), Tolerance(rtol, 0.0 if exact else rtol / 100, exact)
    length, last, growth = KERNELS.longest_step(
        series, Columns(n, FIRST, STRIDE, groups), order, tolerance, weights
    )
    if regular:
        return KERNELS.is_regular(series, n, order, tolerance, last, growth, weights)
    return length


def expected_length(series, order, n, groups, rtol, exact):
    """The definition, with exact logarithms: the term of each order below a power of the tolerance."""
    size = abs(series[0, :n]).max()
    floor = 1e-3 * rtol * size if exact else rtol / 100
    blocks = [(slice(0, n), floor + rtol * abs(series[0, :n]))]
    share = rtol if exact else min(rtol, max(0.1 * rtol, 1e-14))
    for g in range(groups):
        for lane in range(4):
            columns = slice(FIRST + g * STRIDE + lane, FIRST + g * STRIDE + 4 * n, 4)
            start = series[0, columns]
            least = (1e-3 if exact else 1.0) * share * np.sqrt((start**2).mean())
            blocks.append((columns, least + share * abs(start)))
    steps = []
    for order_of_term in range(order, order - (3 if exact else 8), -1):
        worst = max((abs(series[order_of_term, where]) / tolerance).max() for where, tolerance in blocks)
        fall = 4.0 if exact else -np.log2(rtol) / order
        steps.append((np.log2(worst) - fall * (order - order_of_term)) / order_of_term)
    return (1.0 if exact else 0.9) * 2.0 ** -max(steps)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("groups", [0, 1, 2])
@pytest.mark.parametrize("n", [1, 3, 4])
def test_each_of_the_last_terms_limits_the_step(n, groups, exact):
    """Whichever term, component and tangent vector is the largest."""
    rtol = 1e-17 if exact else 1e-10
    order = 32 if exact else 24
    generator = np.random.default_rng(n + 10 * groups)
    for _ in range(60):
        series = generator.normal(size=(order + 3, FIRST + 2 * STRIDE)) * 0.5 ** np.arange(order + 3)[:, None]
        series[:, n:FIRST] = 0.0
        late = generator.integers(order - (3 if exact else 8), order + 1)
        series[late] *= 10.0 ** generator.uniform(0.0, 9.0)
        found = length_of(series, order, n, groups, rtol, exact)
        assert found == pytest.approx(expected_length(series, order, n, groups, rtol, exact), rel=1e-12)


def test_terms_before_the_last_that_suggest_another_step_are_not_regular():
    order, powers = 24, 0.5 ** np.arange(27.0)[:, None]
    steady = powers * np.ones((27, FIRST))
    assert length_of(steady, order, 1, 0, 1e-10, False, regular=True)
    for place in range(12, 17):
        gap, rise = steady.copy(), steady.copy()
        gap[12:17] = 0.0
        rise[place] *= 1e6
        assert not length_of(gap, order, 1, 0, 1e-10, False, regular=True)
        assert not length_of(rise, order, 1, 0, 1e-10, False, regular=True)
    growing = steady.copy()
    growing[21:25] *= 1e3
    growing[17:21] *= 1e-3
    assert not length_of(growing, order, 1, 0, 1e-10, False, regular=True)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_at_rest_at_the_origin_one_of_the_first_terms_is_the_size(k):
    """The floor is a thousandth of the relative tolerance, of the largest component."""
    series, weights = np.zeros((6, 4)), np.full((1, 4), 9.0)
    series[k], series[4:] = [0.5, -8.0, 2.0, 0.0], 1e9
    KERNELS.weigh_state(series, 4, Tolerance(1e-6, 7.0, True), weights)
    np.testing.assert_allclose(weights[0], 1.0 / (1e-3 * 1e-6 * 8.0), rtol=1e-12)
