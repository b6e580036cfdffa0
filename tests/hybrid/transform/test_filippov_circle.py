"""Sliding along a circle: the motion and its derivative are known, for every solver."""

import numpy as np
import pytest

from hybrid import DOP853, RadauIIA, Taylor, Tsit5, filippov, simulate

SOLVERS = (Taylor(), DOP853(), Tsit5(), RadauIIA())
SYSTEM = filippov(
    ("x", "y"),
    {},
    lambda t, x, p: (x.x - x.y, x.x + x.y),
    lambda t, x, p: (-x.x - x.y, x.x - x.y),
    lambda t, x, p: x.x**2 + x.y**2 - 1,
)


@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
@pytest.mark.parametrize("end", [1.2, 2.0, 20.0])
def test_the_derivative_of_a_motion_that_slides_along_a_circle(solver, end):
    arc = simulate(SYSTEM, (0.3, 0.1), (0.0, end), solver=solver, tangent=True)
    angle = np.arctan2(0.1, 0.3) + end
    turned = np.array([-np.sin(angle), np.cos(angle)])
    assert arc.status.ok
    assert arc.mode[-1] == "sliding"
    assert np.allclose(arc.x[-1], [np.cos(angle), np.sin(angle)], rtol=0, atol=1e-9)
    assert np.allclose(arc.fundamental, np.outer(turned, [-1.0, 3.0]), rtol=0, atol=1e-8)
