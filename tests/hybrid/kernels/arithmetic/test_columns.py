"""Compiled arithmetic on columns of series against its plain definition."""

import numpy as np
import pytest
from numba import njit

from hybrid.compiler.statements.code import call, do, get, put, several
from hybrid.compiler.taylor.loops import ORDER, VECTORS
from hybrid.compiler.taylor.series import OUT
from hybrid.kernels.arithmetic.columns import (
    evaluate,
    evaluate_with_sizes,
    gather_tangents,
)
from hybrid.kernels.types.kinds import INTEGER, MATRIX, REAL
from hybrid.kernels.types.numba_door.numba_types import signature_of
from tests.hybrid.code import both

NOTHING = np.zeros(1)


@njit(signature_of(None, MATRIX, INTEGER, REAL, INTEGER, INTEGER))
def compiled_evaluate(series, order, s, first, width):
    evaluate(series, order, s, first, width)


@njit(signature_of(None, MATRIX, INTEGER, REAL, INTEGER, INTEGER))
def compiled_evaluate_with_sizes(series, order, s, first, width):
    evaluate_with_sizes(series, order, s, first, width)


def pair(columns=44):
    series = np.random.default_rng(columns).normal(size=(33, columns))
    return series, series.copy()


def test_convolve():
    """The widths of a convolution and of its registers are constants of the code, one case per width."""
    cases = [
        (width, inset, widest, name)
        for width in (4, 8, 12, 20, 36)
        for inset in (1, 2)
        for widest, name in ((4, "convolve"), (8, "convolve"), (8, "convolve_pairs"))
    ]
    bodies = [[do(name, OUT, ORDER, inset, 3, 43, width, widest)] for width, inset, widest, name in cases]
    interpreted, compiled = both(*bodies, fused=True)
    for i in range(len(cases)):
        for order in (1, 2, 3, 4, 7, 28):
            series, plain = pair(80)
            interpreted(i, 0.0, NOTHING, NOTHING, order, plain)
            compiled(i, 0.0, NOTHING, NOTHING, order, series)
            np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)


def test_the_sums_of_a_convolution_as_registers():
    widths = (4, 8, 12, 20, 36, 60)
    bodies = []
    for width in widths:
        names = {place: get(f"r{place}") for place in range(0, width, 4)}
        sums = put(several([*names.values()]), call("convolved", OUT, ORDER, 1, 3, 63, width, 8))
        bodies.append([sums, *(do("store", OUT, ORDER, 63 + place, each) for place, each in names.items())])
    interpreted, compiled = both(*bodies, fused=True)
    for i, width in enumerate(widths):
        for order in (1, 2, 3, 4, 7, 28):
            series, plain = pair(124)
            expected = sum(plain[j, 3] * plain[order - j, 63 : 63 + width] for j in range(1, order))
            interpreted(i, 0.0, NOTHING, NOTHING, order, plain)
            compiled(i, 0.0, NOTHING, NOTHING, order, series)
            np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
            np.testing.assert_allclose(plain[order, 63 : 63 + width], expected, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize(
    ("convolve", "ends"), [("convolve", "add_ends"), ("convolve_pairs", "add_ends_of_pairs")]
)
def test_a_convolution_in_two_parts(convolve, ends):
    """The terms with the order before are added to the others later."""
    widths = (4, 8, 12, 20, 36)
    bodies = [
        [do(convolve, OUT, ORDER, 2, 3, 43, width, 8), do(ends, OUT, ORDER, 3, 43, width, 8)]
        for width in widths
    ]
    whole, _ = both([do(convolve, OUT, ORDER, 1, 3, 43, 36, 8)], fused=True)
    for run in both(*bodies, fused=True):
        for i, width in enumerate(widths):
            for order in (2, 3, 4, 7, 28):
                series, plain = pair(80)
                whole(0, 0.0, NOTHING, NOTHING, order, plain)
                run(i, 0.0, NOTHING, NOTHING, order, series)
                both_parts = series[order, 43 : 43 + width]
                np.testing.assert_allclose(both_parts, plain[order, 43 : 43 + width], rtol=1e-12, atol=1e-13)


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


@pytest.mark.parametrize("count", [1, 2, 7])
def test_combine(count):
    numbers = tuple(np.random.default_rng(count).normal(size=count).tolist())
    widths = (4, 8, 12)
    bodies = [[do("combine", OUT, ORDER, 14, width, several(numbers))] for width in widths]
    interpreted, compiled = both(*bodies, fused=True)
    for i, width in enumerate(widths):
        for order in (1, 2, 28):
            series, plain = pair(100)
            interpreted(i, 0.0, NOTHING, NOTHING, order, plain)
            compiled(i, 0.0, NOTHING, NOTHING, order, series)
            np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
            expected = sum(number * plain[order, 14 + width * c] for c, number in enumerate(numbers))
            assert series[order, 0] == pytest.approx(expected, rel=1e-13, abs=1e-14)


@pytest.mark.parametrize(("n", "width"), [(1, 4), (2, 8), (4, 8), (7, 12)])
def test_combine_tangents(n, width):
    interpreted, compiled = both([do("combine_tangents", OUT, ORDER, 5, width, 100, n)], fused=True)
    series, plain = pair(140)
    interpreted(0, 0.0, NOTHING, NOTHING, 9, plain)
    compiled(0, 0.0, NOTHING, NOTHING, 9, series)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
    matrix = plain[9, 5 : 5 + width * n].reshape(n, width)[:, :n].T
    vectors = plain[0, 100 : 100 + 4 * n].reshape(n, 4)
    np.testing.assert_allclose(series[9, 100 : 100 + 4 * n].reshape(n, 4), matrix @ vectors, rtol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 4, 6])
def test_tangent_vectors_there_and_back(count):
    """Vectors that do not fill a register are padded with zeros."""
    y = np.random.default_rng(count).normal(size=3 * (1 + count))
    runs = both([put(VECTORS, 8), do("spread_tangents", get("x"), 3, OUT, VECTORS, 20)])
    found = []
    for run in runs:
        series, back = np.full((2, 60), 7.0), y.copy()
        run(0, 0.0, y, NOTHING, 1, series)
        back[3:] = 0.0
        gather_tangents(series, 0, 3, 8, 20, back)
        np.testing.assert_array_equal(back, y)
        assert count == 0 or series[0, 8 + 4] == y[4]
        assert not count % 4 or np.all(series[0, 8 + (count // 4) * 20 :][count % 4 : 12 : 4] == 0.0)
        found.append(series)
    np.testing.assert_array_equal(*found)
