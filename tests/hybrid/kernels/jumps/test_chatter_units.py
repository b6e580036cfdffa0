"""The limit of chatter, and the tangent map through it, in any units."""

import itertools
import math
from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate


@cache
def counting_ball():
    """The resting ball in any units, with a state that adds up its impact speeds."""
    return HybridSystem(
        state=("q", "v", "s"),
        parameters={"length": 1.0, "speed": 1.0, "time": 1.0, "sum": 1.0},
        modes=[
            Mode("flight", lambda t, x, p: (x.v / p.speed * p.length / p.time, -2.0 * p.speed / p.time, 0.0)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -0.8 * x.v, x.s - x.v / p.speed * p.sum)),
                name="bounce",
                accumulates_to="rest",
            )
        ],
    )


@pytest.mark.parametrize("solver", [Taylor, DOP853, RadauIIA])
@pytest.mark.parametrize("units", list(itertools.product((2.0**-50, 2.0**50), repeat=4)))
def test_chatter_in_any_units(units, solver):
    """From height 1 with g = 2, the impact speeds add up to 10 times the root of the height."""
    length, speed, time, total = units
    values = dict(zip(("length", "speed", "time", "sum"), units, strict=True))
    arc = simulate(
        counting_ball(),
        (length, 0.0, 0.0),
        (0.0, 10.0 * time),
        mode="flight",
        parameters=values,
        tangent=True,
        solver=solver(rtol=1e-9, atol=1e-12 * min(length, speed, total)),
    )
    assert arc.status.ok
    assert len(arc.jumps) == 18
    assert arc.jumps[-1].t == pytest.approx(9.0 * time, rel=1e-9)
    scale = np.array([length, speed, total])
    found = arc.fundamental / scale[:, None] * scale
    np.testing.assert_allclose(found, [[0, 0, 0], [0, 0, 0], [5, 0, 1]], rtol=1e-7, atol=1e-7)


@cache
def growing_ball():
    """The resting ball in any units; while it bounces, ``s`` grows by its cube and ``r`` by its square."""

    def flight(t, x, p):
        rates = (x.v / p.speed, -2.0, (x.s / p.grown) ** 3, (x.s / p.grown) ** 2)
        units = (p.length, p.speed, p.grown, p.added)
        return tuple(rate * unit / p.time for rate, unit in zip(rates, units, strict=True))

    return HybridSystem(
        state=("q", "v", "s", "r"),
        parameters={"length": 1.0, "speed": 1.0, "time": 1.0, "grown": 1.0, "added": 1.0},
        modes=[Mode("flight", flight), Mode("rest", lambda t, x, p: (0.0, 0.0, 0.0, 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, direction=-1),
                Reset(lambda t, x, p: (0.0, -0.5 * x.v, x.s, x.r)),
                name="bounce",
                accumulates_to="rest",
            )
        ],
    )


@pytest.mark.parametrize("solver", [Taylor, DOP853])
@pytest.mark.parametrize("units", list(itertools.product((2.0**-30, 2.0**30), repeat=5)))
def test_what_grows_while_a_ball_chatters_in_any_units(units, solver):
    """From height 1 with g = 2 the chatter takes the time 3; ``s`` is then ``s / sqrt(1 - 6 s^2)``."""
    names = ("length", "speed", "time", "grown", "added")
    values = dict(zip(names, units, strict=True))
    scale = np.array([values[name] for name in names if name != "time"])
    arc = simulate(
        growing_ball(),
        (1.0, 0.0, 0.3, 0.0) * scale,
        (0.0, 4.0 * values["time"]),
        mode="flight",
        parameters=values,
        tangent=True,
        solver=solver(rtol=1e-10, atol=1e-12 * scale.min()),
    )
    assert arc.status.ok
    left = 1 - 6 * 0.3**2
    grown = 0.3 / math.sqrt(left)
    np.testing.assert_allclose(arc.x[-1] / scale, [0, 0, grown, -math.log(left) / 2], rtol=1e-9, atol=1e-15)
    exact = np.zeros((4, 4))
    # A change of height or speed changes the time of the limit by ``3 / 2`` and ``1 / 2`` of itself.
    exact[2:, :2] = np.outer([grown**3, grown**2], [1.5, 0.5])
    exact[2:, 2] = left**-1.5, 6 * 0.3 / left
    exact[3, 3] = 1.0
    found = arc.fundamental / scale[:, None] * scale
    np.testing.assert_allclose(found, exact, rtol=1e-8, atol=1e-8)
