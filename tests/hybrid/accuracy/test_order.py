"""The global error across twenty impacts falls with the order of the solver, down to 1e-12.

An event or a reset of lower accuracy would limit the error from below.
"""

import math

import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate
from models import bouncing_ball, impact_oscillator
from tests.reference.load import reference

FLIGHT = reference("impact_oscillator")["flight"]
FLOOR = 1e-12


def heated_ball():
    """A ball whose height is the logarithm of a smooth quantity: no polynomial in time, yet exact.

    With ``q = ln y`` and ``y'' = -g``: ``v = q' = y'/y``, ``v' = -g exp(-q) - v^2``. At the ground ``y = 1``.
    """
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 1.0},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.g * np.exp(-x.q) - x.v**2))],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (0.0, -x.v)))
        ],
    )


HEATED, OSCILLATOR, BALL = heated_ball(), impact_oscillator(), bouncing_ball()


def elastic_exact(height, t):
    """``(q, v)`` of the heated ball from rest at ``y = 1 + height``, elastic, after any number of bounces."""
    half = math.sqrt(2 * height)
    phase = (t + half) % (2 * half) - half
    y, rate = 1 + height - phase**2 / 2, -phase
    return np.array([math.log(y), rate / y])


def error_of_the_heated_ball(method):
    height, end = 0.8, 50.0
    arc = simulate(HEATED, (math.log(1 + height), 0.0), (0.0, end), solver=method)
    half = math.sqrt(2 * height)
    times = half * (1 + 2 * np.arange(len(arc.jumps)))
    assert len(arc.jumps) == 20
    # A rounding error of the speed persists, so times drift in proportion to the run's length.
    return max(
        np.abs(arc.jumps.t / times - 1).max(),
        np.abs(arc.jumps.x_minus[:, 1] + half).max(),
        np.abs(arc.x[-1] - elastic_exact(height, end)).max() / end,
    )


def error_of_the_oscillator(method):
    arc = simulate(OSCILLATOR, FLIGHT["x0"], (0.0, FLIGHT["t_end"]), solver=method)
    assert len(arc.jumps) == 20
    return max(
        np.abs(arc.jumps.t - FLIGHT["t"]).max(),
        np.abs(arc.jumps.x_minus[:, 1] - FLIGHT["v_minus"]).max(),
        np.abs(arc.x[-1] - FLIGHT["x_end"]).max(),
    )


CASES = [
    (error_of_the_oscillator, hybrid.DOP853, (1.0, 0.8, 0.6, 0.5, 0.4)),
    (error_of_the_oscillator, hybrid.Tsit5, (0.2, 0.1, 0.05, 0.025)),
    (error_of_the_heated_ball, hybrid.DOP853, (0.25, 0.2, 0.16, 0.125, 0.1)),
    (error_of_the_heated_ball, hybrid.Tsit5, (0.1, 0.05, 0.025, 0.0125)),
]


@pytest.mark.parametrize(("error_of", "solver", "steps"), CASES)
def test_order_across_impacts(error_of, solver, steps):
    errors = [error_of(solver(rtol=1.0, atol=1.0, max_step=step)) for step in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    # The order is higher where errors of fall and rise cancel: the flight is symmetric in time.
    assert solver.tableau.order - 0.3 < slope < solver.tableau.order + 3.0, errors
    assert errors[-1] < 1e-7


@pytest.mark.parametrize("error_of", [error_of_the_oscillator, error_of_the_heated_ball])
def test_errors_go_down_to_rounding(error_of):
    assert error_of(hybrid.DOP853(rtol=1.0, atol=1.0, max_step=0.05)) < FLOOR


@pytest.mark.parametrize("solver", [hybrid.DOP853, hybrid.Tsit5])
def test_a_flight_that_is_a_polynomial_is_exact_at_any_step(solver):
    exact = reference("bouncing_ball")
    arc = simulate(BALL, exact["x0"], (0.0, 4.012), solver=solver(rtol=1.0, atol=1.0))
    np.testing.assert_allclose(arc.jumps.t[:20], exact["t"], atol=FLOOR)


def test_tangents_converge_with_the_state():
    steps, matrices = (0.4, 0.2, 0.1), []
    for step in (*steps, 0.05):
        method = hybrid.DOP853(rtol=1.0, atol=1.0, max_step=step)
        matrices.append(simulate(HEATED, (0.5, 0.0), (0.0, 12.0), solver=method, tangent=True).fundamental)
    errors = [np.abs(matrix - matrices[-1]).max() for matrix in matrices[:-1]]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 7.0
