"""Compiled arithmetic on columns of series against its plain definition."""

from functools import cache

import numpy as np
import pytest
from numba import float64, int64, njit, void

from hybrid.kernels.columns import convolve, evaluate, evaluate_with_sizes
from hybrid.kernels.layout import MATRIX


@cache
def compiled_convolve(width, widest):
    """The width of a convolution and its registers' are known when it is compiled."""

    @njit(void(MATRIX, int64, int64, int64, int64))
    def compiled(series, order, inset, left, first):
        convolve(series, order, inset, left, first, width, widest)

    return compiled


@njit(void(MATRIX, int64, float64, int64, int64))
def compiled_evaluate(series, order, s, first, width):
    evaluate(series, order, s, first, width)


@njit(void(MATRIX, int64, float64, int64, int64))
def compiled_evaluate_with_sizes(series, order, s, first, width):
    evaluate_with_sizes(series, order, s, first, width)


def pair(columns=44):
    series = np.random.default_rng(columns).normal(size=(33, columns))
    return series, series.copy()


@pytest.mark.parametrize("width", [4, 8, 12, 20, 36])
@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 28])
@pytest.mark.parametrize("inset", [1, 2])
@pytest.mark.parametrize("widest", [4, 8])
def test_convolve(order, width, inset, widest):
    series, plain = pair()
    compiled_convolve(width, widest)(series, order, inset, 3, 7)
    convolve(plain, order, inset, 3, 7, width, widest)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("width", [4, 8, 12, 20, 36])
@pytest.mark.parametrize("order", [1, 2, 3, 13, 28, 30])
@pytest.mark.parametrize(
    ("plain_function", "compiled"),
    [(evaluate, compiled_evaluate), (evaluate_with_sizes, compiled_evaluate_with_sizes)],
)
def test_evaluate(order, width, plain_function, compiled):
    series, plain = pair(width + 3)
    compiled(series, order, 0.7, 2, width)
    plain_function(plain, order, 0.7, 2, width)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
    powers, terms = 0.7 ** np.arange(order + 1), plain[: order + 1, 2 : 2 + width]
    np.testing.assert_allclose(series[order + 1, 2 : 2 + width], powers @ terms, rtol=1e-12, atol=1e-14)
    if plain_function is evaluate_with_sizes:
        np.testing.assert_allclose(series[order + 2, 2 : 2 + width], powers @ abs(terms), rtol=1e-12)
