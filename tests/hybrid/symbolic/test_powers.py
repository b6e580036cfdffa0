"""Random formulas with powers and roots of sums, traced and differentiated.

SymPy's evaluation of such powers, and of functions of them, ended with a RecursionError in one of eight.
"""

import random

import numpy as np
import pytest

from hybrid.symbolic.derivatives import jacobian_of
from hybrid.symbolic.evaluation import Program
from hybrid.symbolic.tracing import model_symbols, trace

NAMES = ("a", "b")
POINT = (0.3125, -0.71)
STEP = 1e-6


def formula(rng, depth, a, b):
    """A value of a random formula that is smooth almost everywhere."""
    if depth == 0:
        return rng.choice([a, b, 1.5, -2.0, 0.25])
    kind, one = rng.random(), formula(rng, depth - 1, a, b)
    if kind < 0.75:
        other = formula(rng, depth - 1, a, b)
        return one + other if kind < 0.3 else one - other if kind < 0.55 else one * other
    if kind < 0.82:
        return (one / 4.0) ** rng.choice([2, 3, 4])
    if kind < 0.9:
        return rng.choice([np.tanh, np.arctan, np.arcsinh, np.sin, np.sqrt])(one**2)
    return (one**2 * formula(rng, depth - 1, a, b) ** 4 / 3.0) ** rng.choice([0.5, 0.25, 0.75])


@pytest.mark.parametrize("seed", range(150))
def test_random_formulas(seed):
    def function(a, b):
        return formula(random.Random(seed), 5, a, b)

    [expression] = trace(lambda t, x, p: (function(x.a, x.b),), NAMES, ())
    symbols = model_symbols(2, 0)
    [slopes] = jacobian_of([expression], symbols.x)
    value, *found = Program([expression, *slopes]).run(dict(zip(symbols.x, POINT, strict=True)))
    wanted = function(*map(np.float64, POINT))
    assert value == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    for i, slope in enumerate(found):
        moves = STEP * np.eye(2)[i]
        above, below = (function(*(np.array(POINT) + side * moves)) for side in (1, -1))
        rounding = 1e-16 * max(1.0, abs(wanted)) / STEP
        assert slope == pytest.approx((above - below) / (2 * STEP), rel=1e-5, abs=100 * rounding + 1e-7)
