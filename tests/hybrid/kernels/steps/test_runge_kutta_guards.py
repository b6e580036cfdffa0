"""Landings of Runge-Kutta steps on guards where Newton's method converges slowly."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Transition, Tsit5, simulate

SOLVERS = {"DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}


@cache
def cubic(direction):
    """The guard is ``s (t - c)**3`` on a surface that moves."""
    return HybridSystem(
        state=("q", "v", "a"),
        parameters={"s": 1.0, "w": 0.0},
        modes=[Mode("move", lambda t, x, p: (x.v, x.a, 6.0 * p.s))],
        transitions=[Transition("move", "move", Guard(lambda t, x, p: x.q - p.w * t, direction))],
    )


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("way", [-1, 1])
def test_a_triple_root_is_crossed_once(way, solver):
    for c in np.linspace(0.3, 1.7, 15):
        for w in (0.0, 3.0, -40.0):
            start = (-way * c**3, way * 3.0 * c**2 + w, -way * 6.0 * c)
            for direction, count in ((0, 1), (way, 1), (-way, 0)):
                arc = simulate(
                    cubic(direction), start, (0.0, 2.3), parameters={"s": float(way), "w": w}, solver=solver
                )
                assert len(arc.jumps) == count, (c, w, direction)
                # The place is known to the cube root of rounding.
                np.testing.assert_allclose(arc.jumps.t, [c] * count, rtol=0, atol=2e-4)
