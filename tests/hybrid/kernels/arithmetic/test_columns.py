"""Compiled arithmetic on columns of series against its plain definition."""

import numpy as np
import pytest
from numba import njit

from hybrid.compiler.llvm import lowering
from hybrid.compiler.llvm.registers import Vectors
from hybrid.compiler.statements.code import call, do, get, put, several
from hybrid.compiler.taylor.coefficients import ORDER, OUT
from hybrid.compiler.taylor.loops import VECTORS
from hybrid.kernels.arithmetic.columns import (
    evaluate,
    evaluate_with_sizes,
)
from hybrid.kernels.types.kinds import INTEGER, MATRIX, REAL
from hybrid.kernels.types.numba_door.numba_types import signature_of
from tests.hybrid import in_python
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


def sums_of(series, order, left, first, width, begin, end, pairs=False):
    """The terms of a convolution from row ``begin`` to row ``end`` of the second factor."""
    columns = slice(left, left + (width if pairs else 1))
    terms = [series[order - j, columns] * series[j, first : first + width] for j in range(begin, end + 1)]
    return sum(terms, np.zeros(width))


@pytest.mark.parametrize(("name", "pairs"), [("convolve", False), ("convolve_pairs", True)])
def test_convolve(name, pairs):
    """The width of a convolution is a constant of the code, one case per width."""
    widths = (4, 8, 12, 20, 36, 60, 100)
    runs = both(*([do(name, OUT, ORDER, 3, 103, width)] for width in widths), fused=True)
    for i, width in enumerate(widths):
        for order in (1, 3, 5, 7, 27):
            expected, _ = pair(204)
            for k in (order, order + 1):
                begin, end = 2 + k - order, order - 2
                expected[k, 103 : 103 + width] = sums_of(expected, k, 3, 103, width, begin, end, pairs)
            for run in runs:
                series, _ = pair(204)
                run(i, 0.0, NOTHING, NOTHING, order, series)
                np.testing.assert_allclose(series, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(("name", "pairs"), [("convolved", False), ("convolved_pairs", True)])
@pytest.mark.parametrize("known", [0, 1])
def test_the_sums_of_convolutions_as_registers(name, pairs, known):
    """Several blocks of columns, each with its own factor; with all rows of the factors known, or not."""
    layouts = ([4], [8], [20], [4, 4, 4], [8, 12, 4], [60], [8] * 7)
    bodies, blocks = [], []
    for widths in layouts:
        firsts = [100 + sum(widths[:i]) for i in range(len(widths))]
        lefts = [3 + 9 * i for i in range(len(widths))]
        blocks.append((lefts, firsts, widths))
        count = 2 * sum(widths) // 4
        names = [get(f"r{place}") for place in range(count)]
        sums = call(name, OUT, ORDER, several(lefts), several(firsts), several(widths), known)
        stores = [do("store", OUT, 33, 4 * i, each) for i, each in enumerate(names)]
        bodies.append([put(several(names), sums), *stores])
    runs = both(*bodies, fused=True)
    for i, (lefts, firsts, widths) in enumerate(blocks):
        for order in (1, 3, 5, 7, 27):
            series = np.random.default_rng(order).normal(size=(34, 180))
            expected = [
                sums_of(series, k, left, first, width, 0 if known else 2 + k - order, order - 2, pairs)
                for k in (order, order + 1)
                for left, first, width in zip(lefts, firsts, widths, strict=True)
            ]
            expected = np.concatenate(expected)
            for run in runs:
                out = series.copy()
                run(i, 0.0, NOTHING, NOTHING, order, out)
                np.testing.assert_allclose(out[33, : len(expected)], expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("vectors", [Vectors(4, 6), Vectors(4, 14), Vectors(8, 30)])
def test_a_convolution_in_other_registers(vectors, monkeypatch):
    """The code for a processor with other registers has the same sums."""
    monkeypatch.setattr(lowering, "vectors", lambda: vectors)
    test_convolve("convolve_pairs", pairs=True)
    test_the_sums_of_convolutions_as_registers("convolved", pairs=False, known=1)


@pytest.mark.parametrize(
    ("convolve", "ends", "pairs"),
    [("convolve", "add_ends", False), ("convolve_pairs", "add_ends_of_pairs", True)],
)
def test_a_convolution_in_parts(convolve, ends, pairs):
    """The terms with the two orders before are added to the others later."""
    widths = (4, 8, 12, 20, 36)
    bodies = [
        [
            do(convolve, OUT, ORDER, 3, 43, width),
            *(do(ends, OUT, order, distance, 3, 43, width) for order, distance in parts),
        ]
        for width in widths
        for parts in [((ORDER, 1), (ORDER + 1, 2), (ORDER + 1, 1))]
    ]
    runs = both(*bodies, fused=True)
    for i, width in enumerate(widths):
        for order in (3, 5, 7, 27):
            plain, _ = pair(80)
            for run in runs:
                series = plain.copy()
                run(i, 0.0, NOTHING, NOTHING, order, series)
                # The next order has this order at one of its ends, as it was after the first two parts.
                expected = sums_of(plain, order, 3, 43, width, 1, order - 1, pairs)
                np.testing.assert_allclose(series[order, 43 : 43 + width], expected, rtol=1e-12, atol=1e-13)
                plain_with_it = plain.copy()
                plain_with_it[order, 43 : 43 + width] = expected
                expected = sums_of(plain_with_it, order + 1, 3, 43, width, 1, order, pairs)
                found = series[order + 1, 43 : 43 + width]
                np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("width", [4, 8, 12, 20, 36])
@pytest.mark.parametrize("order", [1, 2, 3, 13, 28, 30])
@pytest.mark.parametrize(
    ("plain_function", "compiled"),
    [(in_python.evaluate, compiled_evaluate), (in_python.evaluate_with_sizes, compiled_evaluate_with_sizes)],
)
def test_evaluate(order, width, plain_function, compiled):
    series, plain = pair(width + 3)
    compiled(series, order, 0.7, 2, width)
    plain_function(plain, order, 0.7, 2, width)
    np.testing.assert_allclose(series, plain, rtol=1e-13, atol=1e-14)
    powers, terms = 0.7 ** np.arange(order + 1), plain[: order + 1, 2 : 2 + width]
    np.testing.assert_allclose(series[order + 1, 2 : 2 + width], powers @ terms, rtol=1e-12, atol=1e-14)
    if plain_function is in_python.evaluate_with_sizes:
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
        in_python.gather_tangents(series, 0, 3, 8, 20, back)
        np.testing.assert_array_equal(back, y)
        assert count == 0 or series[0, 8 + 4] == y[4]
        assert not count % 4 or np.all(series[0, 8 + (count // 4) * 20 :][count % 4 : 12 : 4] == 0.0)
        found.append(series)
    np.testing.assert_array_equal(*found)
