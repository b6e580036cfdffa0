"""The drift of tangent vectors from the last jump of a chatter to its limit."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from hybrid.kernels.jumps import drift
from tests.hybrid.kernels.plain import plain

kernels = plain(drift)


def test_tangent_vectors_are_multiplied_by_the_exponential():
    rng = np.random.default_rng(5)
    matrix, n, tangents = rng.normal(size=(3, 3)), 3, 2
    y = rng.normal(size=n * (1 + tangents) + 2)
    expected = y.copy()
    for c in range(1, 1 + tangents):
        expected[c * n : (c + 1) * n] = expm(0.4 * matrix) @ y[c * n : (c + 1) * n]
    kernels.drift(y, n, tangents, matrix, 0.4, np.empty(n), np.empty(n))
    # The state and what lies behind the tangent vectors stay.
    np.testing.assert_array_equal(y[[0, 1, 2, -2, -1]], expected[[0, 1, 2, -2, -1]])
    np.testing.assert_allclose(y, expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("entries", "n", "most"),
    [
        # A component on itself, two on each other, three in a ring, and none in a row.
        ({(1, 1): -3.0}, 3, 9.0),
        ({(0, 1): 2.0, (1, 0): -8.0}, 2, 8.0),
        ({(0, 1): 2.0, (1, 2): 4.0, (2, 0): -27.0}, 3, 18.0),
        ({(0, 1): 0.5, (1, 2): 0.25, (2, 0): -1.0}, 3, 1.5),
        ({(0, 1): 2.0, (1, 2): 4.0}, 3, 0.0),
        ({(0, 2): 0.5, (2, 0): 0.5, (1, 1): 0.25}, 3, 1.5),
    ],
)
def test_feedback(entries, n, most):
    matrix = np.zeros((n, n + 1))
    for place, value in entries.items():
        matrix[place] = value
    matrix[:, n] = 1e9
    assert kernels.feedback(matrix, n) == pytest.approx(most, rel=1e-14)


@pytest.fixture
def run():
    return SimpleNamespace(
        phase=2.0,
        y=np.array([1.0, -1.0]),
        scale=np.array([2.0, 100.0]),
        trail=np.zeros((5, 3)),
        restitution=0.6,
        mode=4,
    )


@pytest.fixture
def work():
    return SimpleNamespace(
        jacobian=np.zeros((2, 3)), reset_jacobian=np.zeros((2, 3)), settled=np.ones(2), gradient=np.zeros(3)
    )


def model(slopes):
    def field_jacobian(mode, t, x, parameters, out):
        out[:] = slopes(mode, t, x)

    return SimpleNamespace(
        dimension=2,
        parameters=None,
        field_jacobian=field_jacobian,
        guard_gradient=lambda *arguments: None,
    )


def test_the_share_of_tangent_vectors_that_is_rounding(run, work):
    """The band of the guard, divided by the height of the flight ``v T (1 - r) / 4``."""
    stubbed = plain(drift, rounding_band=lambda *arguments: 3e-16)
    run.trail[:] = 0.0
    run.trail[drift.BEFORE, 2] = 0.5
    found = stubbed.rounding_of_tangents(model(None), run, 0, 0.2, work)
    assert found == pytest.approx(3e-16 / (0.25 * 0.5 * 0.2 * 0.4), rel=1e-14, abs=0.0)


@pytest.mark.parametrize(
    ("change", "noise", "straight"),
    [
        (0.0, 0.0, True),
        # To the first component, of size 2, the second, of size 100, adds 50 times the change.
        (3.9e-12, 0.0, True),
        (4.1e-12, 0.0, False),
        (-4.1e-12, 0.0, False),
        (3.9e-6, 1e-4, True),
        (4.1e-6, 1e-4, False),
    ],
)
def test_a_jacobian_that_changes_until_the_limit(run, work, change, noise, straight):
    def slopes(mode, t, x):
        assert mode == 3
        at_limit = t == 2.5 and x[0] == 1.0 and x[1] == 1.0
        assert at_limit or (t == 2.0 and x[1] == -1.0)
        return [[-2.0, change * at_limit, 5.0 * t], [0.0, -1.0, 0.0]]

    assert kernels.is_straight(model(slopes), run, 3, 0.5, noise, work) is straight
    assert work.jacobian[0, 1] == change


@pytest.mark.parametrize(
    ("mode_bends", "rate", "known"), [(None, 0.9, True), (4, 0.9, False), (1, 0.9, False), (None, 1.1, False)]
)
def test_the_drift_is_known_if_nothing_bends_and_nothing_is_fast(run, work, mode_bends, rate, known):
    """Of the flights, mode 4, or of the resting mode 1; feedback counts as often as there are states."""

    def slopes(mode, t, x):
        bend = 1.0 * (mode == mode_bends and t > 2.0)
        # The flights may be fast.
        return [[rate if mode == 1 else 50.0, 0.0, 0.0], [bend, 0.0, 0.0]]

    assert kernels.drift_is_known(model(slopes), run, 1, 0.5, 0.0, work) is known
