"""Functions whose series goes on beyond a branch point, where the function turns: the integral is exact."""

import numpy as np
import pytest
from scipy.integrate import quad

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, simulate

SOLVERS = (Taylor(), Taylor(rtol=1e-6, atol=1e-8), DOP853(), RadauIIA(rtol=1e-9, atol=1e-11))
TURNING = {
    "arcsin of sin": lambda u: np.arcsin(np.sin(u)),
    "arcsin of a product": lambda u: np.arcsin(2 * np.sin(u) * np.cos(u)),
    "arccos of cos": lambda u: np.arccos(np.cos(u)),
    "arccos of a polynomial": lambda u: np.arccos(1 - u**2 / 8),
    "arccos of a square": lambda u: np.arccos(1 - 2 * np.sin(u) ** 2),
    "sin of arccos": lambda u: np.sin(np.arccos(np.cos(u))),
    "arccosh of cosh": lambda u: np.arccosh(np.cosh(u)),
    "arccosh of a polynomial": lambda u: np.arccosh(1 + u**2),
    "arctan of tan": lambda u: np.arctan(np.tan(u)),
    "angle": lambda u: np.arctan2(np.sin(u), np.cos(u)),
    "root of a square": lambda u: np.sqrt(np.sin(u) ** 2),
    "root of a sum": lambda u: np.sqrt(1 - np.cos(u)),
    "fourth root": lambda u: (u**4) ** 0.25,
    "hypotenuse": lambda u: np.hypot(u, 0 * u),
    "exponential of a logarithm": lambda u: np.exp(0.5 * np.log(u * u)),
    "triangle": lambda u: np.abs(np.mod(u, 2 * np.pi) - np.pi),
}


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
@pytest.mark.parametrize("turning", TURNING)
def test_the_integral_of_a_turning_function(turning, solver):
    function, end = TURNING[turning], 3.0
    system = HybridSystem(
        state=("q", "v", "z"), modes=[Mode("swing", lambda t, x, p: (x.v, -x.q, function(x.q)))]
    )
    arc = simulate(system, (2.3, 0.4, 0.0), (0.0, end), solver=solver)
    assert arc.status.ok

    def along(t):
        return float(function(2.3 * np.cos(t) + 0.4 * np.sin(t)))

    # When the swing passes multiples of pi / 4, where the functions may turn.
    size, first = np.hypot(2.3, 0.4), np.arctan2(0.4, 2.3)
    places = np.arccos(np.pi / 4 * np.array([-2, -1, 0, 1, 2]) / size)
    passed = np.concatenate([first + places, first - places, first - places + 2 * np.pi])
    turns = passed[(passed > 0) & (passed < end)]
    truth, _ = quad(along, 0.0, end, points=turns, limit=1000, epsabs=1e-11, epsrel=1e-11)
    assert arc.x[-1, 2] == pytest.approx(truth, abs=2e-4 if solver.rtol > 1e-8 else 1e-6)
