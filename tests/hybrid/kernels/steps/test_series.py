"""Steps along series: what is recorded of them, and that units of the state do not matter."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate

STAY = 0.4


@cache
def alternating():
    """A spring, whose series is long, and a flight, whose series ends, in turn, each for the same time."""

    def reset(t, x, p):
        return x.q, x.v, 0.0

    return HybridSystem(
        state=("q", "v", "s"),
        parameters={"g": 1.0},
        modes=[
            Mode("spring", lambda t, x, p: (x.v, -x.q, 1.0)),
            Mode("flight", lambda t, x, p: (x.v, -p.g, 1.0)),
        ],
        transitions=[
            Transition("spring", "flight", Guard(lambda t, x, p: x.s - STAY, +1), Reset(reset)),
            Transition("flight", "spring", Guard(lambda t, x, p: x.s - STAY, +1), Reset(reset)),
        ],
    )


def moved(mode, g, state, t):
    """The exact state ``t`` later in the same mode."""
    q, v = state[:2]
    if mode == "flight":
        return q + v * t - 0.5 * g * t * t, v - g * t, state[2] + t
    c, s = np.cos(t), np.sin(t)
    return q * c + v * s, v * c - q * s, state[2] + t


@pytest.mark.parametrize("solver", [Taylor(), DOP853(rtol=1e-11, atol=1e-13)], ids=["Taylor", "DOP853"])
def test_dense_output_of_many_steps_in_modes_of_different_orders(solver):
    """Records are used again and again: no step may keep terms of an earlier one."""
    arc = simulate(
        alternating(), (1.0, 0.0, 0.0), (0.0, 800.0), mode="spring", parameters={"g": 0.01}, solver=solver
    )
    assert len(arc.jumps) == 1999 or len(arc.jumps) == 2000
    rng = np.random.default_rng(0)
    for jump in rng.choice(len(arc.jumps) - 1, 400, replace=False):
        each = arc.jumps[jump]
        later = rng.uniform(0.01, 0.99) * STAY
        expected = moved(each.target, 0.01, each.x_plus, later)
        np.testing.assert_allclose(
            arc(each.t + later), expected, rtol=0, atol=1e-9 * (1.0 + np.abs(expected).max())
        )


@pytest.mark.parametrize("unit", [2.0**-60, 2.0**60])
def test_exact_modes_keep_all_digits_in_any_unit(unit):
    options = {"mode": "spring", "parameters": {"g": 0.01 * unit}}
    arc = simulate(alternating(), (unit, 0.0, 0.0), (0.0, 8.0), **options)
    same = simulate(alternating(), (1.0, 0.0, 0.0), (0.0, 8.0), mode="spring", parameters={"g": 0.01})
    np.testing.assert_allclose(arc.x[-1, :2] / unit, same.x[-1, :2], rtol=1e-14)
    state, mode = (1.0, 0.0, 0.0), "spring"
    for _ in range(20):
        state = (*moved(mode, 0.01, state, STAY)[:2], 0.0)
        mode = "flight" if mode == "spring" else "spring"
    np.testing.assert_allclose(same.x[-1, :2], state[:2], rtol=0, atol=1e-13)
