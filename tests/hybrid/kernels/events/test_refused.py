"""A crossing that its condition refuses has been passed: it is not found again at the same place."""

from functools import cache

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate

SOLVERS = (Taylor(), DOP853())
GUARDS = {
    "affine": lambda t, x, p: x.q - 1,
    "bent": lambda t, x, p: np.sin(x.q - 1),
}


@cache
def pulled(guard="affine", direction=+1, forced=False):
    """``q'' = s - (q - 1)`` with a clock ``s``; from rest, ``q - 1`` grows as the third power of time."""
    pull = (lambda t, x, p: t - (x.q - 1)) if forced else (lambda t, x, p: x.s - (x.q - 1))
    return HybridSystem(
        state=("q", "v", "s", "n"),
        parameters={"open": 1.0},
        modes=[Mode("move", lambda t, x, p: (x.v, pull(t, x, p), 1.0, 0.0))],
        transitions=[
            Transition(
                "move",
                "move",
                Guard(GUARDS[guard], direction, when=lambda t, x, p: p.open - 0.5),
                Reset(lambda t, x, p: (x.q, x.v, x.s, x.n + 1)),
            )
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("forced", [False, True])
@pytest.mark.parametrize("guard", GUARDS)
@pytest.mark.parametrize("direction", [-1, 0, +1])
@pytest.mark.parametrize("rounding", [-1e-16, 0.0, 2.3e-16, 4.5e-16])
@pytest.mark.parametrize("allowed", [0.0, 1.0])
def test_a_guard_left_by_its_third_derivative(solver, forced, guard, direction, rounding, allowed):
    """The acceleration at the start is rounding with either sign and must not decide the result."""
    start = (1.0 + rounding, 0.0, 0.0, 0.0)
    system = pulled(guard, direction, forced)
    arc = simulate(system, start, (0.0, 2.0), mode="move", solver=solver, parameters={"open": allowed})
    assert arc.status.ok
    assert arc.x[-1, 0] == pytest.approx(1 + 2 - np.sin(2), abs=1e-9)
    assert arc.x[-1, 3] == len(arc.jumps) == (allowed if direction == 1 else 0)
    assert not np.any(arc.jumps.transversality * direction < 0)
