"""States that rest on a guard at an instant: which side they are on, and what takes them beyond."""

import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, Taylor, Transition, simulate

SOLVERS = pytest.mark.parametrize("solver", [Taylor(), DOP853()], ids=["Taylor", "DOP853"])


def moved(by=0.0, speed=1.0):
    """A reset that moves ``w`` and changes its speed."""
    return Reset(lambda t, x, p: (x.y, x.w + by, speed * x.v))


def at_half(name, by, target="m"):
    """A transition of ``m`` that moves ``w`` at ``t = 1/2``."""
    return Transition("m", target, Guard(lambda t, x, p: x.y - 0.5, +1), moved(by), name=name)


def fired(transitions, w, v, solver, modes="m"):
    """What fires in one unit of time: ``y`` moves at speed 1, ``w`` at ``v``."""
    fields = [Mode(name, lambda t, x, p: (1.0, x.v, 0.0)) for name in modes]
    system = HybridSystem(state=("y", "w", "v"), modes=fields, transitions=transitions)
    arc = simulate(system, (0.0, w, v), (0.0, 1.0), mode="m", solver=solver)
    assert arc.status.code.name in ("SUCCESS", "AMBIGUOUS_ORDER")
    return [(pytest.approx(jump.t), jump.transition) for jump in arc.jumps]


@SOLVERS
@pytest.mark.parametrize("order", [1, -1])
def test_a_guard_that_rests_keeps_the_near_side_of_each_direction(solver, order):
    """The mode before watches the guard in both directions, the next in one: its own direction counts."""
    both = [
        Transition("m", "m", Guard(lambda t, x, p: x.w, -1), name="marker"),
        Transition("m", "m", Guard(lambda t, x, p: x.w, +1), moved(), name="up"),
    ]
    down = Transition("n", "o", Guard(lambda t, x, p: 3 * x.w, -1), name="down")
    transitions = [*both[::order], at_half("lower", -2.0, "n"), down]
    assert fired(transitions, 0.0, 0.0, solver, "mno") == [(0.5, "lower"), (0.5, "down")]


@SOLVERS
def test_a_reset_onto_the_guard_makes_it_ready_again(solver):
    """A reset takes the state beyond, the transition brings it back onto its guard, another reset beyond."""
    back = Transition("m", "m", Guard(lambda t, x, p: x.w - 1.0, +1), moved(-1.5), name="back")
    found = fired([back, at_half("one", 1.5), at_half("two", 1.5)], 1.0, 0.0, solver)
    assert found == [(0.5, "one"), (0.5, "back"), (0.5, "two"), (0.5, "back")]


@SOLVERS
def test_a_marker_does_not_fire_where_the_state_is_stopped(solver):
    """The flow reaches a guard, and the first transition there takes all of its speed, or a part of it."""
    guard = Guard(lambda t, x, p: x.w - 1.0, +1)
    marker = Transition("m", "m", guard, name="marker")
    for kept, found in ((0.0, ["first"]), (0.5, ["first", "marker"])):
        first = Transition("m", "m", guard, moved(0.0, kept), name="first")
        assert fired([first, marker], 0.0, 2.0, solver) == [(0.5, name) for name in found]
