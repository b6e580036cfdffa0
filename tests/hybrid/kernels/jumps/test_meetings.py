"""Tangent maps of rounds whose jumps keep the state: the limit lies where the guards of the round meet."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, StatusCode, Transition, from_equations, simulate


def force(x, friction=0.5, groove=2.0):
    """The force on a block with dry friction in a groove."""
    return -groove * np.sign(x.q) - friction * np.sign(x.v)


def block(rates, state, parameters=None):
    """A block in a groove, and other components that move with it."""
    return from_equations(
        lambda t, x, p: (x.v, force(x), *rates(t, x, p)), state=("q", "v", *state), parameters=parameters
    )


def differences(run, start, step=1e-5):
    """Central differences of the end of a run in its start."""
    moves = step * np.eye(len(start))
    return np.array([(run(start + move) - run(start - move)) / (2 * step) for move in moves]).T


SYSTEMS = {
    "a clock": block(lambda t, x, p: (1.0 + 0.0 * x.q,), ("s",)),
    "reads the position": block(lambda t, x, p: (x.q, x.y), ("y", "z")),
    "pushed by the block": block(
        lambda t, x, p: (3.0 * force(x) - 0.2 * x.y + x.q, 2.0 * x.v + x.y), ("y", "z")
    ),
    "the push turns": block(lambda t, x, p: (np.cos(x.z) * force(x), 1.0 - 0.3 * x.z), ("y", "z")),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_the_tangent_map_is_that_of_differences(name):
    system = SYSTEMS[name]
    start = np.array([1.0, 0.2, 0.3, 0.1][: system.dimension])
    arc = simulate(system, start, (0.0, 12.0), tangent=True)
    assert arc.status.ok, arc.status
    assert any(jump.kind == "limit" for jump in arc.jumps)
    assert "grazed" not in arc.status.message
    expected = differences(lambda x0: simulate(system, x0, (0.0, 12.0)).x[-1], start)
    assert arc.fundamental == pytest.approx(expected, abs=1e-6)
    assert np.all(arc.fundamental[:2] == 0.0)


def test_two_masses_that_come_to_rest_against_each_other_keep_their_momentum():
    def field(t, x, p):
        push = -2.0 * np.sign(x.a - x.b) - 0.5 * np.sign(x.v - x.w)
        return x.v, x.w, push, -push

    system = from_equations(field, state=("a", "b", "v", "w"))
    arc = simulate(system, (1.0, 0.0, 0.3, 0.0), (0.0, 8.0), tangent=True)
    assert arc.status.ok, arc.status
    both = [0.5, 0.5, 4.0, 4.0], [0.0, 0.0, 0.5, 0.5]
    assert arc.fundamental == pytest.approx(np.array([both[0], both[0], both[1], both[1]]), abs=1e-7)


def test_sensitivities_in_the_forces_pass_the_limit():
    system = from_equations(
        lambda t, x, p: (x.v, force(x, p.F, p.g), x.q - x.y),
        state=("q", "v", "y"),
        parameters={"F": 0.5, "g": 2.0},
    )

    def end(F):
        return simulate(system, (1.0, 0.2, 0.3), (0.0, 9.0), parameters={"F": F}).x[-1]

    arc = simulate(system, (1.0, 0.2, 0.3), (0.0, 9.0), sensitivities=("F",))
    assert arc.status.ok, arc.status
    assert arc.sensitivity[:, 0] == pytest.approx((end(0.5 + 1e-5) - end(0.5 - 1e-5)) / 2e-5, abs=1e-8)


def test_two_tanks_that_run_dry_together_forget_where_they_began():
    """The tap that fills them in turn keeps neither from running dry: both levels are zero after it."""
    tanks = HybridSystem(
        state=("a", "b"),
        modes=[
            Mode("fill a", lambda t, x, p: (0.5, -1.0)),
            Mode("fill b", lambda t, x, p: (-1.0, 0.5)),
            Mode("dry", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("fill a", "fill b", Guard(lambda t, x, p: x.b, -1), accumulates_to="dry"),
            Transition("fill b", "fill a", Guard(lambda t, x, p: x.a, -1), accumulates_to="dry"),
        ],
    )
    arc = simulate(tanks, (1.0, 1.3), (0.0, 10.0), mode="fill a", tangent=True)
    assert arc.status.ok, arc.status
    assert np.all(arc.x[-1] == 0.0)
    assert arc.fundamental == pytest.approx(np.zeros((2, 2)), abs=1e-12)


def test_a_map_that_hangs_on_the_whole_way_is_not_given():
    """The third component adds up the ways to and fro, of which the limit alone knows nothing."""
    system = block(lambda t, x, p: (np.abs(x.v),), ("way",))
    arc = simulate(system, (1.0, 0.2, 0.0), (0.0, 12.0), tangent=True)
    assert arc.status.code == StatusCode.SINGULAR_SALTATION
    assert np.isnan(arc.fundamental).any()


def test_the_tangent_map_of_a_spiral_is_that_of_differences():
    system = from_equations(
        lambda t, x, p: (
            -np.sign(x.x) + 2.0 * np.sign(x.y),
            -2.0 * np.sign(x.x) - np.sign(x.y),
            x.x - 0.3 * x.z + 0.5 * np.sign(x.y),
        ),
        state=("x", "y", "z"),
    )
    start = np.array([1.0, 0.2, 0.3])
    arc = simulate(system, start, (0.0, 2.0), tangent=True)
    assert arc.status.ok, arc.status
    expected = differences(lambda x0: simulate(system, x0, (0.0, 2.0)).x[-1], start)
    assert arc.fundamental == pytest.approx(expected, abs=1e-7)
