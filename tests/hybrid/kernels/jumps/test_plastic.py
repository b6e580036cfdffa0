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
    assert 0.5 - 1e-12 <= arc.t[-1] < 0.52


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


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_a_strike_at_the_instant_of_landing(solver):
    """The floor holds the mass, a strike pushes it down, and the floor holds it again."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("fall", lambda t, x, p: (x.v, -0.5 + 0.0 * x.q)),
            Mode("rest", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "fall",
                "fall",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: (0.0, 0.0)),
                name="land",
                accumulates_to="rest",
            ),
            Transition(
                "fall",
                "fall",
                Guard(lambda t, x, p: t - 2.0, +1),
                Reset(lambda t, x, p: (x.q, x.v - 1.0)),
                name="strike",
            ),
        ],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 4.0), mode="fall", solver=solver)
    assert [str(each) for each in arc.jumps.transition][:3] == ["land", "strike", "land"]
    assert arc.mode[-1] == "rest"
    assert arc.x[-1] == pytest.approx([0.0, 0.0])


def pair_over_a_floor():
    """Two masses above each other over a floor; ``e0`` and ``e1`` are the restitutions."""

    def floor(t, x, p):
        return 0.0, x.b, -p.e0 * x.u, x.v

    def collision(t, x, p):
        mean, jump = (x.u + p.m * x.v) / (1.0 + p.m), p.e1 * (x.v - x.u) / (1.0 + p.m)
        return x.a, x.a, mean + p.m * jump, mean - jump

    return HybridSystem(
        state=("a", "b", "u", "v"),
        parameters={"g": 1.0, "m": 1.0, "e0": 0.0, "e1": 0.0},
        modes=[Mode("fall", lambda t, x, p: (x.u, x.v, -p.g + 0.0 * x.a, -p.g + 0.0 * x.a))],
        transitions=[
            Transition("fall", "fall", Guard(lambda t, x, p: x.a, -1), Reset(floor), name="floor"),
            Transition("fall", "fall", Guard(lambda t, x, p: x.b - x.a, -1), Reset(collision), name="pair"),
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_two_masses_never_fall_through_the_floor(solver):
    """With restitutions from plastic to elastic; wherever the run ends, the order of the masses is kept."""
    system, rng = pair_over_a_floor(), np.random.default_rng(2)
    for _ in range(60):
        e0, e1 = rng.choice([0.0, 0.05, 0.1, 0.2, 0.3, 0.6, 0.9], 2)
        start = (*np.sort(rng.uniform(0.1, 2.0, 2)), *rng.uniform(-1.0, 1.0, 2))
        values = {"e0": e0, "e1": e1, "m": rng.choice([0.3, 1.0, 3.0])}
        arc = simulate(
            system, start, (0.0, 4.0), parameters=values, mode="fall", solver=solver, max_jumps=5000
        )
        assert arc.x[:, 0].min() > -1e-8
        assert (arc.x[:, 1] - arc.x[:, 0]).min() > -1e-8


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("name", ["affine", "sine", "cube"])
def test_bounces_at_the_level_of_rounding(name, solver):
    """The reset leaves the height as the landing has found it; flights may be lower than its rounding."""
    guards = {
        "affine": lambda t, x, p: x.q - p.h,
        "sine": lambda t, x, p: np.sin(x.q - p.h),
        "cube": lambda t, x, p: (x.q - p.h) ** 3 + (x.q - p.h),
    }
    system = HybridSystem(
        state=("q", "v"),
        parameters={"g": 9.81, "e": 0.5, "h": 0.0},
        modes=[Mode("flight", lambda t, x, p: (x.v, -p.g))],
        transitions=[
            Transition("flight", "flight", Guard(guards[name], -1), Reset(lambda t, x, p: (x.q, -p.e * x.v)))
        ],
    )
    rng = np.random.default_rng(3)
    # A Runge-Kutta step lands on a bent guard less exactly than a flight after such a bounce is high.
    least = 9.0 if name != "affine" and not isinstance(solver, Taylor) else 18.0
    for e in 10.0 ** -np.arange(2.0, least):
        for h in (0.0, 1.0):
            start, values = (h + rng.uniform(0.1, 2.0), 0.0), {"e": e, "g": rng.uniform(1.0, 10.0), "h": h}
            arc = simulate(system, start, (0.0, 5.0), parameters=values, mode="flight", solver=solver)
            assert arc.status.code == StatusCode.ACCUMULATION
            assert arc.x[-1] == pytest.approx([h, 0.0], abs=1e-9)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_landings_are_as_exact_late_as_early(solver):
    """The field does not depend on time, so the rounding of a late time does not matter."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"e": 0.8, "d": 0.5},
        modes=[Mode("flight", lambda t, x, p: (x.v, -9.81 - p.d * x.v * np.abs(x.v)))],
        transitions=[
            Transition(
                "flight", "flight", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (x.q, -p.e * x.v))
            )
        ],
    )
    rng = np.random.default_rng(4)
    for t0 in (0.0, 1e11, 1e12, 1e13):
        for _ in range(6):
            values = {"e": rng.uniform(0.01, 0.95), "d": rng.uniform(0.0, 1.0)}
            arc = simulate(
                system,
                (rng.uniform(0.1, 2.0), rng.uniform(-2.0, 2.0)),
                (t0, t0 + 3.0),
                parameters=values,
                mode="flight",
                solver=solver,
            )
            assert np.abs(arc.jumps.x_minus[:, 0]).max() < 1e-13
            assert arc.x[:, 0].min() > -1e-12
