"""Compiled arithmetic on columns of series against its plain definition."""

import numpy as np
import pytest
from numba import boolean, float64, int64, njit, void

from hybrid.kernels.columns import convolve, evaluate
from hybrid.kernels.layout import MATRIX


@njit(void(MATRIX, int64, int64, int64, int64))
def compiled_convolve(series, order, left, first, width):
    convolve(series, order, left, first, width)


@njit(void(MATRIX, int64, float64, int64, boolean))
def compiled_evaluate(series, order, s, width, sizes):
    evaluate(series, order, s, width, sizes)


def pair(columns=40):
    series = np.random.default_rng(columns).normal(size=(32, columns))
    return series, series.copy()


@pytest.mark.parametrize("width", [0, 4, 8, 12, 20, 28])
@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 28])
def test_convolve(order, width):
    series, plain = pair()
    compiled_convolve(series, order, 3, 7, width)
    convolve(plain, order, 3, 7, width)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("width", [0, 4, 8, 12, 20, 28])
@pytest.mark.parametrize("order", [0, 1, 2, 28, 30])
@pytest.mark.parametrize("sizes", [False, True])
def test_evaluate(order, width, sizes):
    series, plain = pair(width + 3)
    compiled_evaluate(series, order, 0.7, width, sizes)
    evaluate(plain, order, 0.7, width, sizes)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
    powers = 0.7 ** np.arange(order + 1)
    terms = abs(plain) if sizes else plain
    np.testing.assert_allclose(
        series[order + 1, :width], powers @ terms[: order + 1, :width], rtol=1e-12, atol=1e-14
    )
