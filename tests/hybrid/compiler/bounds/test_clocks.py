"""Pulses in a component of the state that tells the time: none is stepped over, before or after a reset."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate
from hybrid.compiler.bounds.forcing import times_of
from hybrid.expression.tracing import model_symbols

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-8, atol=1e-10), Tsit5(rtol=1e-8, atol=1e-10))
each_solver = pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
# Pulses of height and width 1 around zero, and their integrals.
SHAPES = {
    "gauss": (lambda u: np.exp(-(u**2)), np.sqrt(np.pi)),
    "sech": (lambda u: 1 / np.cosh(u), np.pi),
    "tanh": (lambda u: (np.tanh(8 * (u + 1)) - np.tanh(8 * (u - 1))) / 2, 2.0),
}
WIDTH = 1e-3


@cache
def pulsed(shape):
    """The phase ``s`` grows at the rate ``w`` and starts again at 4; at ``place`` a pulse passes."""
    pulse, _ = SHAPES[shape]
    return HybridSystem(
        state=("area", "s", "place", "wave"),
        parameters={"w": 0.25},
        modes=[
            Mode(
                "run",
                lambda t, x, p: (pulse((x.s - x.place) / WIDTH) - 0 * x.area, p.w, 0.0, -x.wave),
            )
        ],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.s - 4.0, +1),
                Reset(lambda t, x, p: (x.area, 0.0, x.place + 0.5, 1.0)),
            )
        ],
    )


@each_solver
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("place", [0.7, 2.123])
def test_a_pulse_in_a_phase_is_not_stepped_over(shape, solver, place):
    """Three rounds, one pulse in each; resets move the pulse and the phase."""
    rate = 0.25
    arc = simulate(
        pulsed(shape), (0.0, 0.0, place, 1.0), (0.0, 11.9 / rate), parameters={"w": rate}, solver=solver
    )
    assert arc.status.ok
    assert len(arc.jumps) == 2
    wanted = 3 * SHAPES[shape][1] * WIDTH / rate
    assert arc.x[-1, 0] == pytest.approx(wanted, rel=1e-3 if isinstance(solver, Tsit5) else 1e-6)


def test_components_of_a_constant_rate_tell_the_time():
    symbols = model_symbols(4, 1)
    a, b, c, d = symbols.x
    times = times_of([a * symbols.t, symbols.p[0] + 1, 0 * a, symbols.t], symbols)
    assert times.passing == (symbols.t, b)
    assert times.all == (symbols.t, b, c)
    assert times.state == (a, d)
