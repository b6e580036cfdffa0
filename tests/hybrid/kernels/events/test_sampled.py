"""Guards that cannot be traced: what lies at a place where they are sampled is found."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Taylor, Transition, simulate


def dip(t, x, p):
    if t > 1e9:
        return 0.0
    return abs(x.q - p.c) - p.w


def slope(t, x, p):
    return (np.sign(x.q - p.c), 0.0 * t)


# Parts of a step at whose ends a guard that cannot be traced is evaluated.
SAMPLES = 32

SYSTEM = HybridSystem(
    state=("q",),
    parameters={"c": 0.5, "w": 0.01},
    modes=[Mode("run", lambda t, x, p: (1.0,))],
    transitions=[
        Transition("run", "run", Guard(dip, -1, gradient=slope), name="in"),
        Transition("run", "run", Guard(dip, +1, gradient=slope), name="out"),
    ],
)


@pytest.mark.parametrize("place", [1, 2, 3, SAMPLES // 2, SAMPLES - 1])
def test_a_dip_around_each_sample_fires_in_and_out(place):
    """The flight takes one step."""
    c, w = place / SAMPLES, 0.4 / SAMPLES
    arc = simulate(SYSTEM, (0.0,), (0.0, 1.0), parameters={"c": c, "w": w}, solver=Taylor())
    assert list(arc.jumps.transition) == ["in", "out"]
    np.testing.assert_allclose(arc.jumps.t, [c - w, c + w], rtol=0, atol=1e-15)
