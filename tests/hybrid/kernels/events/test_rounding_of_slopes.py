"""A ball on a table that bends with a state: what rounding of the state makes of the speed of landing."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
END = 24.0


def height(x, p):
    return p.A * np.sin(p.w * x.s)


def speed(x, p):
    return p.A * p.w * np.cos(p.w * x.s)


TABLE = HybridSystem(
    state=("y", "v", "s"),
    parameters={"A": 3.44, "w": 1.33, "r": 0.5},
    modes=[
        Mode("fly", lambda t, x, p: (x.v, -1.0 + 0.0 * x.y, 1.0)),
        Mode("stick", lambda t, x, p: (speed(x, p), -(p.w**2) * height(x, p), 1.0)),
    ],
    transitions=[
        Transition(
            "fly",
            "fly",
            Guard(lambda t, x, p: x.y - height(x, p), -1),
            Reset(lambda t, x, p: (x.y, -p.r * x.v + (1.0 + p.r) * speed(x, p), x.s)),
            accumulates_to="stick",
            name="hit",
        ),
        Transition("stick", "fly", Guard(lambda t, x, p: 1.0 - p.w**2 * height(x, p), -1), name="lift"),
    ],
)


def flight(restitution, turns, solver, start):
    """Times at which the ball lifts off, and its height over the table at the end."""
    s = 2.0 * np.pi * turns / 1.33
    arc = simulate(
        TABLE, (start, 3.44 * 1.33, s), (0.0, END), mode="fly", parameters={"r": restitution}, solver=solver
    )
    assert arc.status.ok
    y, _, s = arc.x[-1]
    return [jump.t for jump in arc.jumps if jump.transition == "lift"], y - 3.44 * np.sin(1.33 * s)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("restitution", [0.0, 1e-14, 1e-13, 1e-12, 1e-10, 1e-8, 1e-6])
def test_no_ball_falls_through_its_table(restitution, solver):
    """A speed that is lost in the rounding of the slope leaves the ball at rest, after many turns too."""
    for start in (0.3, 0.9, 1.4):
        lifts, gap = flight(0.0, 0, Taylor(), start)
        assert lifts
        for turns in (0, 5, 200, 20_000):
            found, there = flight(restitution, turns, solver, start)
            assert len(found) == len(lifts)
            assert np.allclose(found, lifts, rtol=0, atol=2e-5)
            assert np.isclose(there, gap, rtol=0, atol=5e-4)
