"""Plastic impacts: the reset stops the state on the guard, on its near side, and it can be crossed again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    StatusCode,
    Taylor,
    Transition,
    simulate,
)

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "RadauIIA": RadauIIA(rtol=1e-10, atol=1e-10)}


def falling(force, kick=None):
    """A mass with the height ``y`` over a floor that takes all its speed; at ``t = 1/2`` a kick."""
    transitions = [
        Transition("m", "m", Guard(lambda t, x, p: x.y, -1), Reset(lambda t, x, p: (x.y, 0.0)), name="floor")
    ]
    if kick is not None:
        at_half = Guard(lambda t, x, p: t - 0.5, +1)
        transitions.insert(0, Transition("m", "m", at_half, Reset(kick), name="kick"))
    modes = [Mode("m", lambda t, x, p: (x.v, force(t, p)))]
    return HybridSystem(
        state=("y", "v"), parameters={"F": 1.0, "dy": 0.0, "dv": 0.0}, modes=modes, transitions=transitions
    )


KICKED = falling(lambda t, p: 0.0 * t, lambda t, x, p: (x.y + p.dy, x.v + p.dv))


@given(
    height=st.sampled_from((0.0, 0.25)) | st.floats(1e-6, 0.45),
    dy=st.sampled_from((0.0, -2.5, 0.75)),
    dv=st.sampled_from((0.0, -1.0, 1.0)) | st.floats(-3.0, 3.0).filter(lambda v: abs(v) > 1e-6),
    solver=st.sampled_from(sorted(SOLVERS)),
    tangent=st.booleans(),
)
def test_a_mass_at_rest_on_the_floor_is_kicked(height, dy, dv, solver, tangent):
    """Kicked down it hits the floor at once; kicked up it flies on; left alone it rests."""
    arc = simulate(
        KICKED, (height, -1.0), (0.0, 1.0), parameters={"dy": dy, "dv": dv}, solver=SOLVERS[solver],
        mode="m", tangent=tangent,
    )  # fmt: skip
    landed = [("floor", height), ("kick", 0.5)]
    # From above it comes down again before the end if it falls fast enough.
    again = 0.5 if dy < 0.0 or (dy == 0.0 and dv < 0.0) else 0.5 + dy / -dv if dv < 0.0 else np.inf
    if again < 1.0:
        landed.append(("floor", again))
    assert abs(again - 1.0) < 1e-9 or [str(each) for each in arc.jumps.transition] == [
        name for name, _ in landed
    ]
    assert arc.jumps.t == pytest.approx([time for _, time in landed][: len(arc.jumps)], abs=1e-9)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("power", [1, 2, 3])
def test_a_push_that_begins_later_holds_the_mass_on_the_floor(solver, power):
    """No force presses at the impact; one that grows from zero later does not push it through the floor."""
    system = falling(lambda t, p: -p.F * np.maximum(t - 0.5, 0.0) ** power)
    arc = simulate(system, (0.25, -1.0), (0.0, 1.5), mode="m", solver=solver)
    assert arc.status.code == StatusCode.ACCUMULATION
    assert arc.x[-1] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert 0.5 <= arc.t[-1] < 0.52


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_a_pull_that_begins_later_lifts_the_mass(solver):
    system = falling(lambda t, p: p.F * np.maximum(t - 0.5, 0.0))
    arc = simulate(system, (0.25, -1.0), (0.0, 1.5), mode="m", solver=solver)
    assert arc.status.ok
    assert arc.jumps.t == pytest.approx([0.25])
    assert arc.x[-1] == pytest.approx([1 / 6, 1 / 2], rel=1e-6)


def test_a_counter_lets_a_flat_crossing_pass():
    """A reset that leaves the state alone does not stop it, however flat the crossing is."""
    system = HybridSystem(
        state=("q", "n"),
        modes=[Mode("run", lambda t, x, p: (-3.0 * (t - 1.0) ** 2, 0.0 * x.q))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (x.q, x.n + 1.0)))
        ],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 3.0))
    assert arc.status.ok
    assert arc.x[-1] == pytest.approx([-8.0, 1.0])
