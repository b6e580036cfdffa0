"""Accumulated batches are those of the whole series."""

import numba
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hybrid.measures.averages import MAX_BATCHES, standard_error, standard_error_from_batches
from lyapunov.batches import EMPTY, closed_batch_means, push
from tests.hybrid.measures.test_averages import autoregressive


def accumulate(series, batches, add=push):
    # What the sums hold at first does not count.
    sums, state = np.full((batches, series.shape[1]), np.nan), np.array(EMPTY)
    for row in series:
        add(sums, state, row)
    return sums, state


@given(length=st.integers(0, 300), half=st.integers(1, 10))
def test_accumulator_keeps_the_means_of_equal_batches(length, half):
    series = np.random.default_rng(length).standard_normal((length, 2))
    sums, state = accumulate(series, 2 * half)
    closed, size, in_open = state
    assert closed <= 2 * half
    assert closed * size + in_open == length
    expected = series[: closed * size].reshape(closed, size, 2).mean(axis=1)
    np.testing.assert_allclose(closed_batch_means(sums, state), expected, atol=1e-13)


def test_accumulator_gives_the_error_of_the_whole_series():
    series = autoregressive(0.9, 9000, np.random.default_rng(8))[:, :2]
    error = standard_error_from_batches(closed_batch_means(*accumulate(series, MAX_BATCHES)))
    np.testing.assert_allclose(error, standard_error(series), rtol=0.1)


def test_accumulator_compiles_and_agrees_with_itself_in_python():
    series = np.random.default_rng(9).standard_normal((100, 3))
    series[50, 2] = -np.inf
    compiled, in_python = accumulate(series, 16, numba.njit(push)), accumulate(series, 16)
    np.testing.assert_array_equal(compiled[0], in_python[0])
    np.testing.assert_array_equal(compiled[1], in_python[1])
    assert standard_error_from_batches(closed_batch_means(*compiled))[2] == 0.0
