"""Thresholds that only impacts slower than those of the run would meet: the limit of a chatter knows them."""

import math

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate

PULL = 10.0
FIRST = math.sqrt(2 * PULL)


def ball(reset, when=None):
    return HybridSystem(
        state=("q", "v", "u"),
        parameters={"e": 0.6, "slow": 1e-4},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -PULL, 0.0)),
            Mode("rest", lambda t, x, p: (0.0, 0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1, when=when),
                Reset(reset),
                accumulates_to="rest",
            )
        ],
    )


def followed(e, below, slow):
    """Time of the limit if slow impacts have the restitution ``below``, and the number of fast ones."""
    speed, t, fast = FIRST, FIRST / PULL, 0
    while speed > 1e-25:
        fast += speed > slow
        speed *= e if speed > slow else below
        t += 2 * speed / PULL
    return t, fast


@pytest.mark.parametrize("slow", [0.3, 1e-3, 2e-5, 1e-7])
@pytest.mark.parametrize("e", [0.1, 0.5, 0.8, 0.93])
def test_a_condition_lets_slow_balls_pass(e, slow):
    system = ball(lambda t, x, p: (0.0, -p.e * x.v, x.u), when=lambda t, x, p: x.v < -p.slow)
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 60.0), mode="flight", parameters={"e": e, "slow": slow})
    assert arc.status.ok
    _, fast = followed(e, 0.0, slow)
    assert len(arc.jumps) == fast
    assert arc.mode[-1] == "flight"
    assert arc["q"][-1] < -1.0


@pytest.mark.parametrize("slow", [0.3, 1e-3, 2e-5, 1e-6])
@pytest.mark.parametrize("below", [0.0, 0.2, 0.95])
@pytest.mark.parametrize("e", [0.3, 0.6, 0.9])
def test_another_restitution_of_slow_impacts(e, below, slow):
    system = ball(lambda t, x, p: (0.0, -np.where(x.v < -p.slow, p.e, below) * x.v, x.u))
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 60.0), mode="flight", parameters={"e": e, "slow": slow})
    assert arc.mode[-1] == "rest"
    limit, _ = followed(e, below, slow)
    entered = arc.jumps[-1].t
    assert entered == pytest.approx(limit, rel=0, abs=1e-10)


@pytest.mark.parametrize("slow", [1e-3, 2e-5, 1e-7])
def test_another_kick_along_the_floor(slow):
    """Fast impacts push the ball by their speed, slow ones by twice of it."""
    system = ball(lambda t, x, p: (0.0, -p.e * x.v, x.u - np.where(x.v < -p.slow, 1.0, 2.0) * x.v))
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 9.0), mode="flight", parameters={"slow": slow})
    speed, total = FIRST, 0.0
    while speed > 1e-25:
        total += speed if speed > slow else 2.0 * speed
        speed *= 0.6
    assert arc.mode[-1] == "rest"
    assert arc["u"][-1] == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("power", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("slowest", [0.3, 0.9])
def test_a_restitution_that_changes_with_the_speed(slowest, power):
    system = ball(lambda t, x, p: (0.0, -(slowest - 0.2 * np.abs(x.v) ** power * 0.3) * x.v, x.u))
    speed, t = FIRST, FIRST / PULL
    for _ in range(2000):
        speed *= slowest - 0.06 * speed**power
        t += 2 * speed / PULL
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 60.0), mode="flight")
    assert arc.mode[-1] == "rest"
    assert arc.jumps[-1].t == pytest.approx(t, rel=1e-10)
