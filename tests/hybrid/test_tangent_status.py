"""What a grazing does to tangent vectors is said in the status."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate


def parabola(depth):
    """``q = (t - 1)^2 - depth``: a dip of that depth below the guard, kicked there."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0 + 0 * x.v))],
        transitions=[
            Transition(
                "fall", "fall", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (x.q, x.v + 1.0))
            )
        ],
    )
    return system, (1.0 - depth, -2.0)


@pytest.mark.parametrize("depth", [1e-4, 1e-6])
def test_a_transverse_crossing_is_not_remarked_upon(depth):
    system, x0 = parabola(depth)
    arc = simulate(system, x0, (0.0, 1.5), tangent=True)
    assert arc.jumps[0].kind == "transverse"
    assert arc.status.message == "Reached the end."


def test_a_crossing_within_the_tolerances_is():
    system, x0 = parabola(1e-11)
    arc = simulate(system, x0, (0.0, 1.5), tangent=True)
    assert arc.jumps[0].kind == "grazing"
    assert arc.status.ok
    assert "1 of 1 jumps grazed within the tolerances" in arc.status.message


def test_the_saltation_grows_like_the_inverse_root_of_the_depth():
    depths = 10.0 ** np.arange(-8, -1)
    sizes = []
    for depth in depths:
        system, x0 = parabola(depth)
        sizes.append(np.abs(simulate(system, x0, (0.0, 1.5)).jumps[0].saltation).max())
    assert np.polyfit(np.log(depths), np.log(sizes), 1)[0] == pytest.approx(-0.5, abs=0.02)
