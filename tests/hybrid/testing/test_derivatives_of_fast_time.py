"""A derivative that is right where differences in time are not."""

import numpy as np

from hybrid import HybridSystem, Mode
from hybrid.testing import Case, check_derivatives


def test_a_forcing_that_is_faster_than_the_step_of_the_differences():
    """At 3e5 rad per unit of time the difference spans more than half a period."""
    gyroscope = HybridSystem(
        state=("q", "v"),
        parameters={"w": 3e5},
        modes=[Mode("drive", lambda t, x, p: (x.v, 1e3 * np.cos(p.w * t) - x.q))],
    )
    for t in np.linspace(0.0, 1e-4, 9):
        check_derivatives(Case(gyroscope, gyroscope.parameters, "drive", (1.0, 0.5), float(t), 1.0))
