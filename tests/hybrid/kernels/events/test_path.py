"""Columns of powers along a step, evaluated, and the part of a step that is rounding of its start."""

import numpy as np
import pytest

from hybrid.kernels.events import path
from hybrid.kernels.types.layout import EPSILON, Path
from tests.hybrid.kernels.plain import plain

kernels = plain(path)
# Two components and a clock: 1 + 2 s - 4 s^2, 3 - s and 0.5 s + 2 s^2.
POWERS = np.array([[1.0, 3.0, 0.0], [2.0, -1.0, 0.5], [-4.0, 0.0, 2.0]])


def path_of(powers=POWERS, *, degree=2, clock=-1, start=0.0, pace=1.0):
    return Path(powers, degree, clock, start, pace, 1.0, True)


def test_values():
    assert kernels.value_at(POWERS, 0, 2, 0.5) == 1.0
    assert kernels.value_at(POWERS, 0, 1, 0.5) == 2.0
    assert kernels.value_at(POWERS, 1, 2, 2.0) == 1.0
    assert kernels.value_at(POWERS, 1, 0, 2.0) == 3.0
    out = np.array([7.0, 7.0, 7.0])
    kernels.state_at(path_of(), 2, -1.0, out)
    assert out.tolist() == [-5.0, 4.0, 7.0]


def test_times():
    assert kernels.time_at(path_of(clock=2, start=10.0, pace=99.0), 2.0) == 19.0
    assert kernels.time_at(path_of(clock=0, start=10.0, pace=99.0), 0.5) == 11.0
    assert kernels.time_at(path_of(start=10.0, pace=-3.0), 2.0) == 4.0


@pytest.mark.parametrize(
    ("scale", "time_scale", "clock", "pace", "place"),
    [
        # The largest size divided by the largest speed.
        ([6.0, 5.0], 0.0, -1, 1.0, 3.0),
        ([5.0, 6.0], 0.0, -1, 1.0, 3.0),
        ([0.1, 0.3], 0.0, -1, 1.0, 0.15),
        # Time is rounded too, along a clock or at a pace.
        ([1.0, 1.0], 8.0, 2, 1.0, 16.0),
        ([1.0, 1.0], 8.0, -1, 4.0, 2.0),
        ([1.0, 1.0], 8.0, -1, 0.0, 0.5),
        ([1.0, 1.0], 8.0, -1, 100.0, 0.5),
    ],
)
def test_how_far_along_a_step_its_start_may_lie(scale, time_scale, clock, pace, place):
    found = kernels.rounding_of_start(path_of(clock=clock, pace=pace), 2, np.array(scale), time_scale)
    assert found == path.ROUNDING * EPSILON * place


@pytest.mark.parametrize("clock", [0, 1])
def test_a_clock_may_be_any_column(clock):
    """It runs at the rate 1/2 or 4; the state is exact."""
    series = np.array([[1.0, 2.0], [0.5, 4.0]])
    found = kernels.rounding_of_start(path_of(series, clock=clock, pace=77.0), 2, np.zeros(2), 3.0)
    assert found == path.ROUNDING * EPSILON * 3.0 / series[1, clock]


def test_components_at_rest_do_not_move_the_start():
    still = np.array([[1.0, 2.0], [0.0, 0.5]])
    assert (
        kernels.rounding_of_start(path_of(still), 2, np.array([9.0, 3.0]), 0.0)
        == path.ROUNDING * EPSILON * 6.0
    )
    still[1] = 0.0
    assert kernels.rounding_of_start(path_of(still), 2, np.array([9.0, 3.0]), 0.0) == 0.0
