"""Four numbers in a register compute what an array of four does."""

from types import FunctionType

import numpy as np
import pytest
from numba import njit

from hybrid.compiler.statements.code import at, call, do, several
from hybrid.compiler.taylor.coefficients import OUT
from hybrid.kernels.arithmetic.lanes import NARROW, four_times, largest, largest_of_each, load, places, store
from hybrid.kernels.arithmetic.wide import larger, magnitude, square_root
from tests.hybrid import in_python
from tests.hybrid.code import both

EXPRESSIONS = {
    "sum": lambda a, b, s: a + b,
    "difference": lambda a, b, s: a - b,
    "product": lambda a, b, s: a * b,
    "quotient": lambda a, b, s: a / b,
    "negative": lambda a, b, s: -a,
    "numbers on the left": lambda a, b, s: s * a + (s - b),
    "numbers on the right": lambda a, b, s: (a - s) / 2 + b * s,
    "functions": lambda a, b, s: square_root(magnitude(a)) + larger(a, b) * four_times(s),
    "one number": lambda a, b, s: s,
}


def plainly(function):
    """A function whose names stand for the plain definitions on arrays."""
    return FunctionType(function.__code__, function.__globals__ | vars(in_python))


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_arithmetic(name):
    expression = njit(EXPRESSIONS[name])

    @njit
    def compiled(matrix, s):
        store(matrix, 2, 3, expression(load(matrix, 0, 1), load(matrix, 1, 2), s))

    matrix = np.random.default_rng(1).normal(size=(3, 8))
    expected = matrix.copy()
    found = plainly(EXPRESSIONS[name])(expected[0, 1:5], expected[1, 2:6], 0.3)
    expected[2, 3:7] = found
    compiled(matrix, 0.3)
    np.testing.assert_allclose(matrix, expected, rtol=1e-15)


@pytest.mark.parametrize("place", range(NARROW))
def test_the_largest_wherever_it_is(place):
    @njit
    def compiled(matrix):
        return largest(load(matrix, 0, 0))

    numbers = np.array([[-3.0, 1.0, 0.5, -7.0]])
    numbers[0, place] = 2.0
    assert compiled(numbers) == 2.0


def test_the_largest_of_each_of_four_registers():
    def largest_of_rows(matrix):
        rows = load(matrix, 0, 0), load(matrix, 1, 0), load(matrix, 2, 0), load(matrix, 3, 0)
        store(matrix, 4, 0, largest_of_each(*rows) + 10.0 * places())

    for seed in range(20):
        matrix = np.random.default_rng(seed).normal(size=(5, 4))
        plain = matrix.copy()
        njit(largest_of_rows)(matrix)
        plainly(largest_of_rows)(plain)
        np.testing.assert_array_equal(matrix, plain)
        np.testing.assert_array_equal(plain[4], plain[:4].max(axis=1) + 10.0 * np.arange(4))


@pytest.mark.parametrize(
    ("count", "filled"), [(1, 4), (3, 4), (4, 4), (5, 8), (8, 8), (9, 12), (12, 12), (13, 16)]
)
def test_a_row_is_written_in_whole_registers(count, filled):
    """An incomplete register is padded with zeros, and no memory behind it changes."""
    numbers = tuple(1.0 + i for i in range(count))
    expected = np.full((3, 20), np.nan)
    expected[1, 2 : 2 + count], expected[1, 2 + count : 2 + filled] = numbers, 0.0
    for run in both([do("store_row", OUT, 1, 2, several(numbers))]):
        matrix = np.full((3, 20), np.nan)
        run(0, 0.0, np.zeros(1), np.zeros(1), 0, matrix)
        np.testing.assert_array_equal(matrix, expected)


def test_a_register_is_written_down_a_column():
    expected = np.arange(60.0).reshape(3, 20)
    expected[1, [2, 7, 12, 17]] = expected[0, :4]
    for run in both([do("store_down", OUT, 1, 2, 5, call("load", OUT, 0, 0))]):
        matrix = np.arange(60.0).reshape(3, 20)
        run(0, 0.0, np.zeros(1), np.zeros(1), 0, matrix)
        np.testing.assert_array_equal(matrix, expected)


@pytest.mark.parametrize(
    "function",
    [
        *(EXPRESSIONS[name] for name in EXPRESSIONS if name != "functions"),
        lambda a, b, s: call("four_times", s) * a,
    ],
)
def test_arithmetic_of_statements(function):
    a, b = call("load", OUT, 0, 1), call("load", OUT, 1, 2)
    found = []
    for run in both([do("store", OUT, 2, 3, function(a, b, at("p", 0)))]):
        matrix = np.random.default_rng(1).normal(size=(3, 8))
        run(0, 0.0, np.zeros(1), np.array([0.3]), 0, matrix)
        found.append(matrix)
    np.testing.assert_array_equal(*found)
