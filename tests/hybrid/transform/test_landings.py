"""Jumps that lead onto a surface of a mode that is split: the flow there decides which part is entered."""

import numpy as np
import pytest

from hybrid import DOP853, After, Guard, HybridSystem, Mode, Reset, Taylor, Transition, Tsit5, simulate, split

SOLVERS = pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), Tsit5()], ids=lambda each: type(each).__name__
)


def let_go(force, drag=lambda v, p: p.mu * np.sign(v), q=1.0):
    """An arc of a block that is held, at rest, for one second and then let go."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"mu": 0.5, "F": 0.0},
        modes=[
            Mode("held", lambda t, x, p: (0.0, 0.0)),
            Mode("moves", lambda t, x, p: (x.v, p.F - drag(x.v, p))),
        ],
        transitions=[Transition("held", "moves", After(1.0), name="go")],
    )
    return simulate(split(system), (q, 0.0), (0.0, 3.0), mode="held", parameters={"F": force})


@pytest.mark.parametrize(
    ("force", "part", "end"),
    [
        (1.0, "moves: v>0", 2.0),
        (-1.0, "moves: v<0", 0.0),
        (0.3, "moves: v=0", 1.0),
        (0.0, "moves: v=0", 1.0),
    ],
)
def test_a_block_that_is_let_go_moves_or_sticks_at_once(force, part, end):
    arc = let_go(force)
    [jump] = arc.jumps
    assert (jump.t, jump.target, arc.mode[-1]) == (1.0, part, part)
    # Half the acceleration, the force less the friction, times the square of two seconds.
    assert arc.x[-1, 0] == pytest.approx(end)


@pytest.mark.parametrize(("force", "part"), [(1.0, "moves: v>0"), (-1.0, "moves: v<0")])
def test_where_no_state_slides(force, part):
    """Drag that grows with the square of the speed is smooth enough, and has no mode at rest."""
    arc = let_go(force, drag=lambda v, p: p.mu * v * np.abs(v))
    assert [jump.target for jump in arc.jumps] == [part]
    limit = np.sqrt(1.0 / 0.5)
    assert arc.x[-1, 1] == pytest.approx(force * limit * np.tanh(2.0 / limit), rel=1e-8)


def test_the_reset_and_the_parameters_decide():
    """After a reset the state may lie anywhere: off the surface its side decides, whatever the flow."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"kick": 0.0, "F": 1.0},
        modes=[
            Mode("held", lambda t, x, p: (0.0, 0.0)),
            Mode("moves", lambda t, x, p: (x.v, p.F - 0.5 * np.sign(x.v))),
        ],
        transitions=[
            Transition("held", "moves", After(1.0), Reset(lambda t, x, p: {"v": p.kick}), name="go"),
        ],
    )
    parts = {
        kick: simulate(split(system), (0.0, 0.0), (0.0, 1.1), mode="held", parameters={"kick": kick}).mode[-1]
        for kick in (-1.0, 0.0, 1.0)
    }
    assert parts == {-1.0: "moves: v<0", 0.0: "moves: v>0", 1.0: "moves: v>0"}


@SOLVERS
def test_a_stop_that_holds_is_told_by_one_jump(solver):
    """A driven block sticks to a stop, is let go, and rubs: no two jumps follow each other at one instant."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"mu": 0.2},
        modes=[
            Mode("moves", lambda t, x, p: (x.v, 3 * np.cos(t) - x.q - p.mu * np.sign(x.v))),
            Mode("held", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "moves",
                "held",
                Guard(lambda t, x, p: x.q - 1, +1),
                Reset(lambda t, x, p: {"v": 0.0}),
                name="hit",
            ),
            Transition("held", "moves", Guard(lambda t, x, p: 3 * np.cos(t) - x.q + p.mu, -1), name="go"),
        ],
    )
    arc = simulate(split(system), (0.4, 0.0), (0.0, 60.0), mode="moves", solver=solver)
    assert arc.status.ok, arc.status
    assert len(arc.jumps["go"]) > 5
    assert {jump.target for jump in arc.jumps["go"]} == {"moves: v<0"}
    assert np.diff(arc.jumps.t).min() > 0.0


@SOLVERS
def test_a_stop_that_takes_all_speed_lets_the_flow_decide(solver):
    """A reset to a number on a surface: the mass sticks where friction holds it, or rubs on, in one jump."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"A": 3.0, "mu": 0.5},
        modes=[Mode("moves", lambda t, x, p: (x.v, p.A * np.cos(0.7 * t) - x.q - p.mu * np.sign(x.v)))],
        transitions=[
            Transition(
                "moves",
                "moves",
                Guard(lambda t, x, p: x.q - 0.5, +1),
                Reset(lambda t, x, p: (0.4, 0.0)),
                name="hit",
            )
        ],
    )
    arc = simulate(split(system), (0.0, 0.1), (0.0, 40.0), solver=solver)
    assert arc.status.ok, arc.status
    hits = [jump for jump in arc.jumps if jump.transition.startswith("hit")]
    for jump in hits:
        force = 3.0 * np.cos(0.7 * jump.t) - 0.4
        assert jump.target == ("v=0" if abs(force) <= 0.5 else "v>0")
    assert {jump.target for jump in hits} == {"v=0", "v>0"}
    assert np.diff(arc.jumps.t).min() > 0.0
