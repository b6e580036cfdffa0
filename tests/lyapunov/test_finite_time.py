"""Finite-time exponents against singular values in closed form."""

import numpy as np
import pytest

import hybrid
import lyapunov
import models
from tests.lyapunov.clocked import clocked


def test_free_flight_and_one_bounce():
    """In flight the matrix is a shear; the bounce has a saltation matrix in closed form."""
    ball = models.bouncing_ball()
    arc = hybrid.simulate(ball, (1.0, 0.0), (0.0, 0.8), tangent=np.eye(2))
    assert len(arc.jumps) == 1
    found = lyapunov.finite_time_exponents(ball, (1.0, 0.0), interval=0.8)
    expected = np.log(np.linalg.svd(arc.fundamental, compute_uv=False)) / 0.8
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    # Each bounce shrinks areas by the square of the restitution.
    assert found.sum() == pytest.approx(2 * np.log(ball.parameters["e"]) / 0.8, rel=1e-12)


def test_singular_values_out_of_the_range_of_one_matrix():
    """Rates of 3 and -7 over 100 units of time: the ratio of the singular values is 1e434."""
    system = hybrid.HybridSystem(
        state=("a", "b"), modes=[hybrid.Mode("m", lambda t, x, p: (3 * x.a, -7 * x.b))]
    )
    found = lyapunov.finite_time_exponents(system, (0.0, 0.0), interval=100.0)
    np.testing.assert_allclose(found, [3.0, -7.0], rtol=1e-9)


def test_singular_values_that_one_matrix_of_floats_does_not_hold():
    """Rates of 3 and -7 in directions between the axes: the ratio of the singular values is 1e43."""
    c, s = np.cos(0.4), np.sin(0.4)

    def field(t, x, p):
        u, v = 3 * (c * x.a + s * x.b), -7 * (c * x.b - s * x.a)
        return c * u - s * v, s * u + c * v

    system = hybrid.HybridSystem(state=("a", "b"), modes=[hybrid.Mode("m", field)])
    for interval in (0.1, 10.0):
        found = lyapunov.finite_time_exponents(system, (0.0, 0.0), interval=interval)
        np.testing.assert_allclose(found, [3.0, -7.0], rtol=1e-9)


@pytest.mark.parametrize("intervals", [None, 3])
def test_a_start_among_others_is_what_it_is_alone(intervals):
    system = models.vibroimpact()
    starts = (
        np.array((-0.00765806, -0.00411675, 0.05565196, -0.35621583)) * np.linspace(0.9, 1.1, 30)[:, None]
    )
    found = lyapunov.finite_time_exponents(system, starts, intervals=intervals, mode="free")
    alone = [
        lyapunov.finite_time_exponents(system, each, intervals=intervals, mode="free") for each in starts[::7]
    ]
    np.testing.assert_array_equal(found[::7], alone)
    # The sum of the exponents follows from the damping alone, and from the log-determinants of the jumps.
    sums = [
        lyapunov.lyapunov_spectrum(system, each, k=4, intervals=1, transient=0, mode="free").exponents.sum()
        for each in starts[::7]
    ]
    first = found[::7] if intervals is None else found[::7, 0]
    np.testing.assert_allclose(first.sum(axis=1), sums, rtol=1e-8)


def test_a_map_with_a_lost_direction():
    """After one reset that forgets y, (dx, dy) is (4 - 8 x, 1) dx."""
    system = clocked(("x", "y"), lambda t, x, p: (4 * x.x * (1 - x.x), x.x))
    found = lyapunov.finite_time_exponents(system, [(0.1, 0.2, 0.5), (0.4, 0.0, 0.5)], interval=1.0)
    x = np.array([0.1, 0.4])
    # The clock's direction neither grows nor shrinks.
    np.testing.assert_allclose(found[:, 0], np.log(np.hypot(4 - 8 * x, 1.0)), rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], 0.0, atol=1e-12)
    assert found[:, 2].tolist() == [-np.inf, -np.inf]


def test_intervals_along_a_run():
    """Each is that of a start at its beginning; the map shrinks and stretches by known factors."""
    system = clocked(("x",), lambda t, x, p: (4 * x.x * (1 - x.x),))
    found = lyapunov.finite_time_exponents(system, (0.1, 0.5), interval=1.0, intervals=5)
    x = [0.1]
    for _ in range(4):
        x.append(4 * x[-1] * (1 - x[-1]))
    rates = np.log(np.abs(4 - 8 * np.array(x)))
    np.testing.assert_allclose(found, np.sort(np.column_stack([rates, np.zeros(5)]))[:, ::-1], atol=1e-9)
    many = lyapunov.finite_time_exponents(system, [(0.1, 0.5), (0.1, 0.5)], interval=1.0, intervals=5)
    np.testing.assert_array_equal(many, [found, found])


def test_a_start_that_does_not_reach_the_end_has_no_exponents():
    found = lyapunov.finite_time_exponents(models.bouncing_ball(), [(1.0, 0.0), (30.0, 0.0)], interval=4.5)
    assert np.isnan(found[0]).all()
    assert np.isfinite(found[1]).all()
    with pytest.raises(hybrid.ArgumentError, match=r"x0 must be finite; got x0\[1\]"):
        lyapunov.finite_time_exponents(models.bouncing_ball(), [(1.0, 0.0), (np.nan, 0.0)])
