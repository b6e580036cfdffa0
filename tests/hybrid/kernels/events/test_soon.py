"""Starts on a guard that small derivatives leave to one side, and larger ones soon take to the other."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
CROSSED_UP = HybridSystem(
    state=("y", "v"),
    parameters={"a": 0.0, "b": 0.0, "c": 0.0, "start": 3.7},
    modes=[
        Mode("move", lambda t, x, p: (x.v, p.a + p.b * (t - p.start) + p.c * (t - p.start) ** 3)),
    ],
    transitions=[
        Transition("move", "move", Guard(lambda t, x, p: x.y, +1), Reset(lambda t, x, p: (x.y, x.v)))
    ],
)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    ("a", "b", "c"), [(-2.12e-11, 0.0, 0.716), (0.0, -9.9e-12, 0.77), (3e-10, 0.0, -0.7)]
)
def test_a_guard_fires_once_where_its_path_leads_up(solver, a, b, c):
    height = Polynomial([a, b, 0.0, c]).integ(2)
    arc = simulate(
        CROSSED_UP, (0.0, 0.0), (3.7, 5.0), parameters={"a": a, "b": b, "c": c}, solver=SOLVERS[solver]
    )
    assert arc.status.ok
    # In the last case the start itself leads up. Steps do not know heights below their tolerances.
    assert len(arc.jumps) == 1
    assert np.abs(height(arc.jumps.t - 3.7)).max() < (1e-12 if solver == "Taylor" else 1e-9)
