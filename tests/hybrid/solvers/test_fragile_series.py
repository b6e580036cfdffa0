"""Series that are undefined where the field is not: a Runge-Kutta step leads on from there."""

import numpy as np
import pytest

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, Taylor, Tsit5, simulate
from lyapunov import lyapunov_spectrum

SOLVERS = [Taylor(), Taylor(rtol=1e-5), DOP853(), Tsit5(), RadauIIA()]


@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
@pytest.mark.parametrize("width", [0.5, 0.025, 1e-3])
def test_far_from_a_pulse_a_run_with_tangent_vectors_goes_on(solver, width):
    """``cosh`` overflows far from the pulse; the tangent vectors of a linear oscillator do not feel it."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("driven", lambda t, x, p: (x.v, -x.q + 1 / np.cosh((t - 900 * width) / width)))],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 1.0), solver=solver, tangent=True)
    assert arc.status.ok
    c, s = np.cos(1.0), np.sin(1.0)
    np.testing.assert_allclose(arc.fundamental, [[c, s], [-s, c]], atol=1e3 * solver.rtol)
    spectrum = lyapunov_spectrum(system, (1.0, 0.0), interval=1.0, intervals=3, transient=0, solver=solver)
    np.testing.assert_allclose(spectrum.exponents, 0.0, atol=1e3 * solver.rtol)


def drag(length):
    """Free fall with quadratic drag in the plane, from rest: the terminal speed is ``sqrt(g / c)``."""
    return HybridSystem(
        state=("u", "w"),
        parameters={"c": 0.1, "g": 9.81},
        modes=[
            Mode("fall", lambda t, x, p: (-p.c * x.u * length(x.u, x.w), -p.g - p.c * x.w * length(x.u, x.w)))
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS, ids=repr)
@pytest.mark.parametrize("tangent", [None, True])
@pytest.mark.parametrize(
    "length",
    [np.hypot, lambda u, w: np.sqrt(u**2 + w**2), lambda u, w: (u * u + w * w) ** 0.5],
    ids=["hypot", "sqrt", "power"],
)
def test_quadratic_drag_from_rest(solver, tangent, length):
    """The drag has no series at rest, and its slope is 0/0 as written; both are zero."""
    arc = simulate(drag(length), (0.0, 0.0), (0.0, 2.0), solver=solver, tangent=tangent)
    assert arc.status.ok
    terminal = np.sqrt(98.1)
    assert arc.x[-1, 0] == 0.0
    assert arc.x[-1, 1] == pytest.approx(-terminal * np.tanh(2 * 9.81 / terminal), rel=1e4 * solver.rtol)
    if tangent:
        # Along the fall by the field, across it by the integral of the drag.
        angle = 2 * 9.81 / terminal
        expected = np.diag([1 / np.cosh(angle), 1 / np.cosh(angle) ** 2])
        np.testing.assert_allclose(arc.fundamental, expected, rtol=1e5 * solver.rtol, atol=1e3 * solver.rtol)
