"""The status reports the effect of a grazing on tangent vectors."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition, simulate


def parabola(depth):
    """``q = (t - 1)^2 - depth``: a dip of that depth below the guard, with a kick at the guard."""
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


def parabola_then_corner(depth):
    """The parabola, and a puck in a corner at ``t = 1.5``: one wall doubles ``v``, the other adds one."""

    def kick(name, guard, reset):
        return Transition("fall", "fall", Guard(guard, -1), Reset(reset), name=name)

    system = HybridSystem(
        state=("q", "v", "x", "y", "a", "b"),
        modes=[Mode("fall", lambda t, x, p: (x.v, 2.0, x.a, x.b, 0.0, 0.0))],
        transitions=[
            kick("floor", lambda t, x, p: x.q, lambda t, x, p: (x.q, x.v + 1, x.x, x.y, x.a, x.b)),
            kick("left", lambda t, x, p: x.x, lambda t, x, p: (x.q, x.v * 2, x.x, x.y, -x.a, x.b)),
            kick("bottom", lambda t, x, p: x.y, lambda t, x, p: (x.q, x.v + 1, x.x, x.y, x.a, -x.b)),
        ],
    )
    return system, (1.0 - depth, -2.0, 1.5, 1.5, -1.0, -1.0)


@pytest.mark.parametrize(("depth", "grazed"), [(1e-4, False), (1e-11, True)])
def test_an_order_that_mattered_outranks_a_grazing_and_counts_it(depth, grazed):
    system, x0 = parabola_then_corner(depth)
    arc = simulate(system, x0, (0.0, 2.0), tangent=True)
    assert [jump.kind for jump in arc.jumps] == ["grazing" if grazed else "transverse", *["transverse"] * 2]
    assert arc.status.code == StatusCode.AMBIGUOUS_ORDER
    assert ("Besides, 1 of 3 jumps grazed within the tolerances." in arc.status.message) == grazed
