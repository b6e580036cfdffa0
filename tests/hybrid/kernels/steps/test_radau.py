"""Tangent vectors of implicit steps up to a landing at zero."""

import numpy as np
import pytest

import hybrid


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("atol", [1e-12, 1e-30])
def test_tangents_of_a_flight_that_begins_and_ends_at_zero(unit, atol):
    """The step is repeated up to the landing, where the height alone gives no tolerance for the equations."""
    ball = hybrid.HybridSystem(
        state=("q", "v"),
        parameters={"unit": 1.0},
        modes=[hybrid.Mode("flight", lambda t, x, p: (x.v * p.unit, -9.81))],
        transitions=[
            hybrid.Transition(
                "flight",
                "flight",
                hybrid.Guard(lambda t, x, p: x.q, -1),
                hybrid.Reset(lambda t, x, p: (x.q, -0.7 * x.v)),
            )
        ],
    )
    solver = hybrid.RadauIIA(rtol=1e-7, atol=atol)
    fundamental = np.eye(2)
    for end in (0.4, 0.8, 1.1):
        arc = hybrid.simulate(
            ball, (0.5 * unit, 0.0), (0.0, end), parameters={"unit": unit}, tangent=True, solver=solver
        )
        assert arc.status.ok
        fundamental, last = np.eye(2), 0.0
        for jump in arc.jumps:
            flight = np.array([[1.0, jump.t - last], [0.0, 1.0]])
            push = 9.81 * 1.7 / abs(jump.x_minus[1])
            fundamental = np.array([[-0.7, 0.0], [push, -0.7]]) @ flight @ fundamental
            last = jump.t
        fundamental = np.array([[1.0, end - last], [0.0, 1.0]]) @ fundamental
        found = arc.fundamental * [[1.0, 1.0 / unit], [unit, 1.0]]
        np.testing.assert_allclose(found, fundamental, rtol=1e-9, atol=1e-9)
