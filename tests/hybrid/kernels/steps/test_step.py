"""Control of the steps' length, compared with its formulas in NumPy."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, Tsit5, simulate
from hybrid.kernels.steps import step
from hybrid.simulation.trajectory import start

_starting, _ratio, _estimate = step.starting_step, step.error_ratio, step.estimate_error
_path, _again = step.interpolant_path, step.interpolation_stages


@njit
def starting_step(model, method, y, tangents, remaining, work):
    return _starting(model, method, 0, 0.0, y, tangents, remaining, work)


@njit
def error_ratio(method, h, y, n, tangents, work):
    _estimate(method, n * (1 + tangents), work)
    return _ratio(method, h, y, n, tangents, work)


@cache
def rotation(period=0.0):
    """``x' = A x + b`` with the tangent vectors ``v' = A v``."""
    return HybridSystem(
        state=("x", "y"),
        parameters={"u": 0.3},
        modes=[Mode("m", lambda t, x, p: (-0.5 * x.x + 2.0 * x.y + p.u, -3.0 * x.x + 0.1 * x.y))],
        period=period or None,
    )


MATRIX = np.array([[-0.5, 2.0], [-3.0, 0.1]])


def rates(y):
    vectors = y.reshape(-1, 2)
    out = vectors @ MATRIX.T
    out[0, 0] += 0.3
    return out.ravel()


def expected_step(solver, y, tangents, remaining, period, order):
    floors = np.r_[np.full(2, solver.atol), np.full(2 * tangents, solver.rtol)]
    scale = solver.rtol * np.abs(y) + floors

    def norm(values):
        return np.sqrt(np.mean((values / scale) ** 2))

    size, speed = norm(y), norm(rates(y))
    horizon = min(period, remaining) if period else remaining
    if speed > 0.0:
        unit = min(max(size, 1e4) / speed, horizon)
    else:
        unit = 1e-4 * horizon
    h = min(0.01 * unit, solver.max_step)
    bend = norm(rates(y + h * rates(y)) - rates(y)) / h
    steepest = max(speed * unit, bend * unit * unit)
    if not steepest > 1e-15:
        return h
    return min(100.0 * h, unit * (0.01 / steepest) ** (1.0 / order), solver.max_step)


@pytest.mark.parametrize("solver", [DOP853(), Tsit5(rtol=1e-4, atol=1e-2), DOP853(max_step=1e-6)], ids=repr)
@pytest.mark.parametrize("period", [0.0, 1e-3])
@pytest.mark.parametrize("remaining", [10.0, 1e-4])
@pytest.mark.parametrize("tangents", [0, 1, 2])
@pytest.mark.parametrize("x0", [(1.0, 0.5), (0.0, 0.0), (1e-9, -1e-9), (1e9, 3.0)])
def test_the_first_step(solver, period, remaining, tangents, x0):
    vectors = np.array([[1.0, 0.0], [0.5, 1e-3]])[:, :tangents]
    run = start(rotation(period), x0, 0.0, solver=solver, tangent=vectors if tangents else None)
    y = run.run.y.copy()
    run.work.stages[0, : y.size] = rates(y)
    found = starting_step(run.model, run.method, y, tangents, remaining, run.work)
    expected = expected_step(solver, y, tangents, remaining, period, 1.0 / run.method.exponent)
    assert found == pytest.approx(expected, rel=1e-12)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 1.0, 1e3]), st.sampled_from([0, 2]))
def test_the_error_ratio(seed, size, tangents):
    solver = DOP853(rtol=1e-6, atol=1e-7)
    run = start(rotation(), (1.0, 0.5), 0.0, solver=solver, tangent=np.eye(2) if tangents else None)
    rng = np.random.default_rng(seed)
    length, work, method = 2 * (1 + tangents), run.work, run.method
    y, h = size * rng.normal(size=length), 0.01
    work.new[:length] = size * rng.normal(size=length)
    count = method.error.shape[0]
    work.stages[:count, :length] = 1e-6 * rng.normal(size=(count, length))
    first = method.error @ work.stages[:count, :length]
    second = method.second_error @ work.stages[:count, :length]
    worst = 0.0
    for block in range(1 + tangents):
        place = slice(2 * block, 2 * block + 2)
        new = work.new[place]
        floor = solver.atol if block == 0 else solver.rtol * np.sqrt(np.mean(new**2))
        scale = floor + solver.rtol * np.maximum(np.abs(y[place]), np.abs(new))
        one, other = np.sum((first[place] / scale) ** 2), np.sum((second[place] / scale) ** 2)
        worst = max(worst, h * one / np.sqrt((one + 0.01 * other) * 2))
    assert error_ratio(method, h, y, 2, tangents, work) == pytest.approx(worst, rel=1e-12)


def test_an_error_that_is_no_number_is_no_ratio():
    run = start(rotation(), (1.0, 0.5), 0.0, solver=DOP853())
    run.work.stages[:, :2] = math.nan
    assert math.isnan(error_ratio(run.method, 0.1, run.run.y, 2, 0, run.work))
    run.work.stages[:, :2] = 0.0
    assert error_ratio(run.method, 0.1, run.run.y, 2, 0, run.work) == 0.0


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("sharpness", [30.0, 1e3, 1e5])
def test_a_step_whose_error_is_infinite_is_rejected(solver, sharpness):
    """A wall that repels exponentially is not seen from afar: a step into it overflows.

    The mass returns with its speed.
    """
    wall = HybridSystem(
        state=("q", "v"),
        parameters={"k": sharpness},
        modes=[Mode("free", lambda t, x, p: (x.v, p.k * np.exp(-p.k * x.q)))],
    )
    arc = simulate(wall, (3.0, -1.0), (0.0, 7.0), solver=solver)
    assert arc.status.ok
    # The exact orbit is 2/k ln cosh(k (t - turn)/2) + lowest.
    lowest = np.log(2.0) / sharpness
    turn = 3.0 - lowest + 2.0 * np.log(2.0) / sharpness
    last = 7.0 - turn - 2.0 * np.log(2.0) / sharpness + lowest
    assert arc.x[-1] == pytest.approx((last, 1.0), rel=1e-6)
