"""Doubled numbers: sums of products and their quotients to twice the digits."""

from fractions import Fraction

import numpy as np
import pytest

from tests.hybrid.text import both

# Row 0 holds two times four numbers, row 1 their dot product with a and b, row 2 one of all of these.
TEXT = [
    "a, b, by = p[0], p[1], p[2]",
    "first, second, nothing = load(out, 0, 0), load(out, 0, 4), four_times(0.0)",
    "high, low = divided_dot_product((a, b, ), (first, second, ), (nothing, nothing, ), 1.0)",
    "store(out, 1, 0, high)",
    "store(out, 1, 4, low)",
    "high, low = divided_dot_product((b, a, ), (high, second, ), (low, nothing, ), by)",
    "store(out, 2, 0, high)",
    "store(out, 2, 4, low)",
]


@pytest.mark.parametrize("run", both(TEXT, fused=True), ids=["Python", "compiled"])
@pytest.mark.parametrize("seed", range(20))
def test_twice_the_digits(run, seed):
    rng = np.random.default_rng(seed)
    matrix = np.zeros((3, 8))
    matrix[0] = rng.normal(size=8) * 10.0 ** rng.integers(-5, 5, 8)
    a, b, by = float(rng.normal()), float(rng.normal()), float(rng.integers(1, 40))
    run(0, 0.0, np.zeros(1), np.array([a, b, by]), 0, matrix)
    for lane in range(4):
        first, second = Fraction(matrix[0, lane]), Fraction(matrix[0, 4 + lane])
        once = Fraction(a) * first + Fraction(b) * second
        twice = (Fraction(b) * once + Fraction(a) * second) / int(by)
        size = abs(first) + abs(second)
        for row, exact in enumerate((once, twice), start=1):
            found = Fraction(matrix[row, lane]) + Fraction(matrix[row, 4 + lane])
            assert abs(found - exact) <= size * Fraction(2) ** -96
            # The first part is the rounded sum of both parts.
            assert matrix[row, lane] == float(exact)
