"""Steps into a wall that is not seen from afar."""

import numpy as np
import pytest

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, Tsit5, simulate


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
