"""Doubled numbers: sums of products and their quotients to twice the digits."""

from fractions import Fraction

import numpy as np
import pytest

from hybrid.compiler.statements.code import at, call, do, get, put, several
from hybrid.compiler.taylor.coefficients import OUT
from tests.hybrid.code import both

# Row 0 holds two times four numbers, row 1 their dot product with a and b, row 2 one of all of these.
a, b, by = (at("p", i) for i in range(3))
first, second, nothing, high, low = map(get, ("first", "second", "nothing", "high", "low"))


def product(factors, highs, lows, by):
    return put(several([high, low]), call("divided_dot_product", *map(several, (factors, highs, lows)), by))


BODY = [
    put(first, call("load", OUT, 0, 0)),
    put(second, call("load", OUT, 0, 4)),
    put(nothing, call("four_times", 0.0)),
    product((a, b), (first, second), (nothing, nothing), 1.0),
    do("store", OUT, 1, 0, high),
    do("store", OUT, 1, 4, low),
    product((b, a), (high, second), (low, nothing), by),
    do("store", OUT, 2, 0, high),
    do("store", OUT, 2, 4, low),
]


@pytest.mark.parametrize("run", both(BODY, fused=True), ids=["plain", "compiled"])
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
