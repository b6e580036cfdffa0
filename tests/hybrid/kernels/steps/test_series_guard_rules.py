"""Guards along a series, rule by rule, on polynomials whose roots are known."""

import numpy as np

from hybrid.kernels.events.resolution import UNDERFLOW
from hybrid.kernels.steps import series_guards
from hybrid.kernels.steps.series_guards import TAIL_OF_GUARD
from tests.hybrid.kernels.plain import plain

kernels = plain(series_guards)


def column(*powers):
    """A series in the second of two columns."""
    return np.column_stack([np.full(len(powers), 77.0), powers])


def test_the_last_terms():
    powers = [1.0, -1.0, 3.0, -5.0, 7.0, 11.0, -13.0]
    exact = sum(abs(each) * 2.0**k for k, each in enumerate(powers) if k > 6 - TAIL_OF_GUARD)
    assert kernels.last_terms(column(*powers), 1, 6, 2.0) == exact
    # The value at the start is none of them.
    assert kernels.last_terms(column(*powers), 1, 2, 2.0) == 2.0 + 12.0


def test_how_close_a_guard_comes_to_zero_at_the_ends():
    for first, last, close, tiny in (
        (3.0, -4.0, False, False),
        (-1.5, 4.0, True, False),
        (3.0, 1.5, True, False),
        (UNDERFLOW, 0.5 * UNDERFLOW, True, False),
        (0.5 * UNDERFLOW, -UNDERFLOW, True, False),
        (0.5 * UNDERFLOW, -0.5 * UNDERFLOW, True, True),
        (0.0, 0.0, True, True),
    ):
        series = column(first, 9.0, last, 99.0)
        assert kernels.is_close(series, 1, 1, 2.0) == close
        assert kernels.underflows_on_series(series, 1, 1) == tiny
