"""Terms that cancel up to the rounding of their numbers are gone; all others stay."""

import math
from itertools import pairwise

import numpy as np
import pytest

from hybrid.expression.nodes import NAN, Symbol, number
from hybrid.expression.operations import Cos, Sin
from hybrid.transform.rounding import combined

X, Y = map(Symbol, ("x", "y"))


def test_what_is_left_by_rounding_is_gone():
    a, b, c = map(number, (0.1, 0.2, 0.3))
    assert a + b - c != 0
    assert combined((1, a + b), (-1, c)) == 0
    assert combined((1, (a + b) * Sin(X) + Y), (-1, c * Sin(X))) == Y


@pytest.mark.parametrize("small", [1e-12, 1e-20, 1e-300])
def test_small_numbers_of_their_own_stay(small):
    left = combined((1, X + number(small) * Y), (-1, X))
    assert math.isclose(float(left / Y), small)


@pytest.mark.parametrize("seed", range(20))
def test_the_order_of_a_sum_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    terms = [number(10.0 ** rng.uniform(-8, 8)) * each for each in (X, Y, X * Y, Cos(X), 1)] * 2
    one, other = (sum((terms[i] for i in rng.permutation(len(terms))), number(0)) for _ in range(2))
    assert combined((1, one), (-1, other)) == 0
    kept = combined((1, one), (-1, other), (1, X**2))
    assert kept == X**2


def test_infinity_stays():
    infinity = number(math.inf)
    assert combined((1, infinity), (-1, infinity)) is NAN
    assert all(combined((1, a), (-1, b)) != 0 for a, b in pairwise([X, Y, infinity]))
