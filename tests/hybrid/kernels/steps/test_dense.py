"""States between the ends of steps, from polynomials with known values."""

import numpy as np
import pytest

from hybrid.kernels.steps import dense
from tests.hybrid.kernels.plain import plain

kernels = plain(dense)
STARTS = np.array([0.0, 1.0, 1.0, 2.5, 4.0, 4.5, 6.0])


@pytest.mark.parametrize("first", range(len(STARTS)))
def test_the_last_step_that_has_begun(first):
    """Wherever the search begins; before all steps it is the first one."""
    for time in [-1.0, *STARTS, *(STARTS + 0.1), *(STARTS - 0.1), 99.0]:
        expected = max(np.searchsorted(STARTS, time, side="right") - 1, 0)
        assert kernels.step_at(STARTS, time, first) == expected


def test_degrees():
    columns = np.zeros((5, 3))
    assert kernels.degree_of_all(columns) == 1
    columns[4, 1] = 1e-300
    assert kernels.degree_of_all(columns) == 4
    columns[4, 1], columns[2, 2] = 0.0, -1.0
    assert kernels.degree_of_all(columns) == 2
    columns[2, 2], columns[1, 0] = 0.0, 1.0
    assert kernels.degree_of_all(columns) == 1


def test_states_at_times():
    """A step at even pace, then one whose clock runs with the square of the place, after a jump."""
    start, low, span = np.array([1.0, 3.0]), np.array([0.25, 0.0]), np.array([2.0, 4.0])
    coefficients = np.zeros((2, 4, 3))
    coefficients[0, :, 0] = [1.0, 2.0, 0.0, 8.0]
    coefficients[0, :, 1] = [5.0, -1.0, 0.0, 0.0]
    coefficients[0, 1, 2] = 2.0
    coefficients[1, :, 0] = [-3.0, 1.0, 0.0, 0.0]
    # Time since the start: ``3 s + s^2``, up to 4.
    coefficients[1, :, 2] = [0.0, 3.0, 1.0, 0.0]
    times = np.array([1.25, 2.25, 0.5, 3.0, 4.75, 9.0])
    states, steps = np.zeros((6, 2)), np.zeros(6, dtype=np.int64)
    kernels.states_at(times, start, low, span, coefficients, states, steps)
    assert steps.tolist() == [0, 0, 0, 1, 1, 1]
    # Places 0, 1/2, 0 in the first step, and 0, 1/2, 1 in the second.
    assert states[:, 0].tolist() == pytest.approx([1.0, 3.0, 1.0, -3.0, -2.5, -2.0], rel=1e-14)
    assert states[:, 1].tolist() == [5.0, 4.5, 5.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(("time", "place"), [(2.5, 0.25), (6.0, 1.0), (99.0, 1.0)])
def test_a_step_that_comes_first_and_times_beyond_its_end(time, place):
    """The columns of the state have a higher degree than the clock."""
    coefficients = np.zeros((2, 4, 2))
    coefficients[1, :, 0] = [1.0, 0.0, 0.0, 64.0]
    coefficients[1, 1, 1] = 4.0
    states, steps = np.zeros((1, 1)), np.zeros(1, dtype=np.int64)
    start, span = np.array([0.0, 1.5]), np.array([1.5, 4.0])
    kernels.states_at(np.array([time]), start, np.zeros(2), span, coefficients, states, steps)
    assert steps.tolist() == [1]
    assert states[0, 0] == 1.0 + 64.0 * place**3
