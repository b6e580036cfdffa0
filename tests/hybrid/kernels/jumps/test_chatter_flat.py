"""Impacts that accumulate at a guard without a slope at zero: one that jumps, bends or is flat there."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
FLOORS = {
    "choice": lambda t, x, p: np.where(x.q > p.floor, 1.0, -1.0),
    "sign": lambda t, x, p: np.sign(x.q - p.floor),
    "whole part": lambda t, x, p: np.floor(x.q - p.floor) + 0.5,
    "cube": lambda t, x, p: (x.q - p.floor) ** 3,
    "cube root": lambda t, x, p: np.cbrt(x.q - p.floor),
    "kink": lambda t, x, p: (x.q - p.floor) * np.abs(x.q - p.floor),
    "bent": lambda t, x, p: np.expm1(3.0 * (x.q - p.floor)),
}
RESETS = {
    "onto the floor": lambda t, x, p: (p.floor, -p.kept * x.v),
    "where it is": lambda t, x, p: (x.q, -p.kept * x.v),
}


def ball(floor, reset, direction):
    return HybridSystem(
        state=("q", "v"),
        parameters={"floor": 0.0, "kept": 0.5, "pull": 1.0},
        modes=[
            Mode("flight", lambda t, x, p: (x.v, -p.pull)),
            Mode("rest", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("flight", "flight", Guard(floor, direction), Reset(reset), accumulates_to="rest"),
        ],
    )


@pytest.mark.parametrize("direction", [0, -1])
@pytest.mark.parametrize("reset", RESETS.values(), ids=RESETS)
@pytest.mark.parametrize("floor", FLOORS.values(), ids=FLOORS)
def test_the_ball_comes_to_rest_on_the_floor(floor, reset, direction):
    """No ball falls through, however small its last bounces are."""
    system, rng = ball(floor, reset, direction), np.random.default_rng(3)
    for name, solver in SOLVERS.items():
        for tangent in (False, floor is not FLOORS["cube root"]):
            level = float(rng.choice([0.0, 0.3, rng.uniform(-2.0, 2.0)]))
            kept, pull, height = (
                rng.uniform(0.05, 0.9),
                rng.choice([0.3, 1.0, 9.81]),
                10 ** rng.uniform(-2, -0.1),
            )
            limit = np.sqrt(2 * height / pull) * (1 + kept) / (1 - kept)
            arc = simulate(
                system,
                (level + height, 0.0),
                (0.0, 1.3 * limit + 1.0),
                mode="flight",
                parameters={"floor": level, "kept": float(kept), "pull": float(pull)},
                solver=solver,
                tangent=tangent,
                max_jumps=1000,
            )
            drawn = name, tangent, level, kept, pull, height
            assert arc.mode[-1] == "rest", drawn
            assert abs(arc.jumps[-1].t - limit) <= 1e-5 * (1 + limit), drawn
            np.testing.assert_allclose(arc.x[-1], (level, 0.0), rtol=0, atol=1e-6)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("floor", FLOORS.values(), ids=FLOORS)
def test_a_reset_that_turns_nothing_back_fires_once_a_crossing(floor, solver):
    system = HybridSystem(
        state=("q", "v", "n"),
        parameters={"floor": 0.0},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q, 0.0))],
        transitions=[
            Transition("swing", "swing", Guard(floor, -1), Reset(lambda t, x, p: (x.q, x.v, x.n + 1.0))),
        ],
    )
    for level in (0.0, 0.3, -0.41):
        arc = simulate(
            system, (0.8, 0.0, 0.0), (0.0, 14.0), mode="swing", parameters={"floor": level}, solver=solver
        )
        wanted = np.arccos(level / 0.8) + 2 * np.pi * np.arange(3)
        wanted = wanted[wanted < 14.0]
        assert len(arc.jumps) == len(wanted)
        np.testing.assert_allclose(arc.jumps.t, wanted, rtol=0, atol=1e-4)
        assert arc.x[-1, 2] == len(wanted)
