"""Compiled arithmetic on columns of series against its plain definition."""

from functools import cache

import numpy as np
import pytest
from numba import float64, int64, njit, void

from hybrid.kernels.columns import (
    combine,
    combine_tangents,
    convolve,
    convolve_pairs,
    evaluate,
    evaluate_with_sizes,
    gather_tangents,
    spread_tangents,
)
from hybrid.kernels.layout import MATRIX


@cache
def compiled_convolve(function, width, widest):
    """The width of a convolution and its registers' are known when it is compiled."""

    @njit(void(MATRIX, int64, int64, int64, int64))
    def compiled(series, order, inset, left, first):
        function(series, order, inset, left, first, width, widest)

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
@pytest.mark.parametrize(("widest", "function"), [(4, convolve), (8, convolve), (8, convolve_pairs)])
def test_convolve(order, width, inset, widest, function):
    series, plain = pair(80)
    compiled_convolve(function, width, widest)(series, order, inset, 3, 43)
    function(plain, order, inset, 3, 43, width, widest)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)


def test_what_was_compiled_for_one_width_does_not_serve_another():
    """Compiled once more, under other options, it is still written for its own width."""

    def wide(series):
        convolve(series, 9, 1, 3, 7, 16, 8)

    def narrow(series):
        convolve(series, 9, 1, 3, 7, 4, 8)

    series, plain = pair()
    for function, fastmath in ((wide, False), (narrow, False), (wide, {"nsz"})):
        series[:] = plain
        njit(void(MATRIX), fastmath=fastmath)(function)(series)
    wide(plain)
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


@pytest.mark.parametrize("width", [4, 8, 12])
@pytest.mark.parametrize("count", [1, 2, 7])
@pytest.mark.parametrize("order", [1, 2, 28])
def test_combine(order, count, width):
    numbers = tuple(np.random.default_rng(count).normal(size=count))

    @njit
    def compiled(series):
        combine(series, order, 14, width, numbers)

    series, plain = pair(100)
    compiled(series)
    combine(plain, order, 14, width, numbers)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
    expected = sum(number * plain[order, 14 + width * c] for c, number in enumerate(numbers))
    assert series[order, 0] == pytest.approx(expected, rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(("n", "width"), [(1, 4), (2, 8), (4, 8), (7, 12)])
def test_combine_tangents(n, width):
    @njit
    def compiled(series):
        combine_tangents(series, 9, 5, width, 100, n)

    series, plain = pair(140)
    compiled(series)
    combine_tangents(plain, 9, 5, width, 100, n)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
    matrix = plain[9, 5 : 5 + width * n].reshape(n, width)[:, :n].T
    vectors = plain[0, 100 : 100 + 4 * n].reshape(n, 4)
    np.testing.assert_allclose(series[9, 100 : 100 + 4 * n].reshape(n, 4), matrix @ vectors, rtol=1e-12)


@pytest.mark.parametrize("count", [1, 4, 6])
def test_tangent_vectors_there_and_back(count):
    y = np.random.default_rng(count).normal(size=3 * (1 + count))
    series, back = np.zeros((2, 60)), y.copy()
    spread_tangents(y, 3, series, 8, 20)
    back[3:] = 0.0
    gather_tangents(series, 0, 3, 8, 20, back)
    np.testing.assert_array_equal(back, y)
    assert series[0, 8 + 4] == y[4]
