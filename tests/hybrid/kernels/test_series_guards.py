"""What the leading powers of a guard prove of it holds for the whole guard."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid.load import load_kernels

KERNELS = load_kernels("hybrid.kernels.series_guards")
_judge, _to_bernstein, _leading = KERNELS.judge_leading, KERNELS.to_bernstein, KERNELS.leading_powers
CLEAR, CROSSES, UNKNOWN = KERNELS.CLEAR, KERNELS.CROSSES, KERNELS.UNKNOWN
ORDER = 28


@njit
def _judged(powers, side, band, last, size):
    series = powers.reshape((-1, 1))
    polynomial, stack = np.zeros(40), np.zeros((64, 40))
    degree, rest = _leading(series, 0, len(powers) - 1, 1.0, 0, size, polynomial, 1.0)
    _to_bernstein(polynomial, degree)
    stack[0, 2 : 3 + degree] = polynomial[: degree + 1]
    verdict, start, end, _ = _judge(degree, rest, (len(powers) - 1) * rest, side, band, last, stack)
    return verdict, start, end, degree, rest


def judged(powers, band=0.0):
    side = 1 if powers[0] > 0.0 else -1
    return side, *_judged(np.array(powers), side, band, float(np.sum(powers)), float(np.abs(powers).sum()))


def guards(radius):
    """Powers on the unit interval of a series with about that radius of convergence."""
    entry = st.floats(-1.0, 1.0).filter(lambda v: abs(v) > 1e-6)
    return st.lists(entry, min_size=ORDER + 1, max_size=ORDER + 1).map(
        lambda values: [value * radius**-k for k, value in enumerate(values)]
    )


def on_grid(powers):
    places = np.linspace(0.0, 1.0, 2001)
    return places, np.polynomial.polynomial.polyval(places, powers)


@given(st.sampled_from([1.5, 2.5, 4.0, 8.0]).flatmap(guards), st.sampled_from([0.0, 1e-3]))
def test_verdicts_hold(powers, band):
    side, verdict, start, end, _, _ = judged(powers, band)
    places, values = on_grid(powers)
    values = side * values
    if verdict == CLEAR:
        assert np.all(values > band)
    if verdict == CROSSES:
        assert np.all(values[places < start] > band)
        inside = values[(places >= start) & (places <= end)]
        assert np.polynomial.polynomial.polyval(end, powers) * side < 0.0
        assert np.all(np.diff(inside) < 0.0)


@given(guards(2.5))
def test_what_is_left_out_is_bounded(powers):
    *_, degree, rest = judged(powers)
    assert math.fsum(map(abs, powers[degree + 1 :])) <= rest


@pytest.mark.parametrize(
    ("powers", "verdict"),
    [
        ([1.0, 1.0], CLEAR),
        ([1.0, -2.0], CROSSES),
        ([-1.0, 2.0], CROSSES),
        ([1.0, -4.0, 4.0], UNKNOWN),  # a touch
        ([0.1, -1.0, 1.0], CROSSES),  # the first of two
        ([0.2499, -1.0, 1.0], UNKNOWN),  # two close together
        ([1.0, -1.0], UNKNOWN),  # a zero at the very end
    ],
)
def test_verdicts(powers, verdict):
    assert judged([*powers, *[0.0] * (ORDER + 1 - len(powers))])[1] == verdict


def test_the_share_of_nearly_all_steps_is_decided():
    """Guards that move by their own size over a step: few go on to the whole polynomial."""
    random = np.random.default_rng(5)
    verdicts = []
    for _ in range(400):
        powers = random.uniform(-1.0, 1.0, ORDER + 1) * 3.0 ** -np.arange(ORDER + 1.0)
        powers[0] = random.choice([-1.0, 1.0]) * random.uniform(0.2, 1.0)
        verdicts.append(judged(powers)[1])
    assert np.mean(np.array(verdicts) == UNKNOWN) < 0.1
