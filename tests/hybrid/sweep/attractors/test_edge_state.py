"""Edge states that are known exactly: equilibria, orbits with and without impacts, chaos."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import Guard, HybridSystem, Mode, Reset, StatusCode, Transition
from tests.hybrid.sweep.attractors.test_attractors import double_well
from tests.hybrid.sweep.attractors.test_fractions import Pressed
from tests.lyapunov.clocked import clocked

TWO = {"parameters": {"w": 2.6}}


def duffing(**options):
    return HybridSystem(
        state=("x", "v"),
        parameters={"c": 0.2},
        modes=[Mode("roll", lambda t, x, p: (x.v, x.x - x.x**3 - p.c * x.v))],
        **options,
    )


def test_the_saddle_between_two_wells():
    edge = hybrid.edge_state(duffing(), (-1.0, 0.2), (1.2, 0.1))
    assert (edge.kind, edge.mode, edge.orbit) == ("equilibrium", "roll", None)
    np.testing.assert_allclose(edge.x, 0.0, atol=1e-9)
    np.testing.assert_allclose(
        edge.equilibrium.eigenvalues, -0.1 + np.array([1, -1]) * np.sqrt(1.01), rtol=1e-9
    )
    assert edge.status.ok
    assert [each.points[0, 0] for each in (edge.one, edge.other)] == pytest.approx([-1.0, 1.0], abs=1e-4)


def test_a_saddle_orbit_of_an_impact_oscillator():
    """Newton's method from a guess finds the same orbit; a start on either side leads to either attractor."""
    system = models.impact_oscillator()
    found = hybrid.attractors(system, {"x": (-4.0, 1.0), "v": (-4.0, 4.0)}, starts=40, **TWO)
    edge = hybrid.edge_state(system, found[1], found[2], **TWO)
    guessed = hybrid.periodic_orbit(system, (-1.4, 0.35), periods=2, **TWO)
    assert edge.kind == "periodic"
    np.testing.assert_allclose(edge.orbit.multipliers, guessed.multipliers, rtol=1e-8)
    assert edge.orbit.forcing_periods == 2
    points = np.array([edge.orbit.x0, edge.orbit.arc()(guessed.period / 2)])
    assert np.abs(points - guessed.x0).max(axis=1).min() < 1e-8
    assert ([edge.one.jumps, edge.other.jumps]) == [0.0, 1.0]
    assert np.abs(edge.bracket[0] - edge.bracket[1]).max() < 1e-7
    back = hybrid.edge_state(system, found[2], found[1], **TWO)
    assert ([back.one.jumps, back.other.jumps]) == [1.0, 0.0]
    np.testing.assert_allclose(back.orbit.multipliers, guessed.multipliers, rtol=1e-8)


def test_an_unstable_cycle():
    """The rate r (r**2 - 1) (4 - r**2) / 5 of the radius has the slope 6/5 at the cycle r = 1."""

    def turn(t, x, p):
        square = x.x**2 + x.y**2
        rate = (square - 1) * (4 - square) / 5
        return rate * x.x - 2 * x.y, rate * x.y + 2 * x.x

    system = HybridSystem(state=("x", "y"), modes=[Mode("turn", turn)])
    edge = hybrid.edge_state(system, (0.2, 0.0), (1.7, 0.0))
    assert edge.kind == "periodic"
    assert edge.orbit.period == pytest.approx(np.pi)
    assert np.hypot(*edge.x) == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(edge.orbit.multipliers, [np.exp(1.2 * np.pi), 1.0], rtol=1e-8)


def test_an_unstable_cycle_with_impacts():
    """The table returns a speed u as u - (u - 1) (u - 2) (u - 3) / 2: 1 and 3 are stable, 2 is not."""

    def kick(t, x, p):
        u = -x.v
        return 0.0, u - (u - 1) * (u - 2) * (u - 3) / 2

    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -1.0))],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: x.q, -1), Reset(kick), name="kick")
        ],
    )
    edge = hybrid.edge_state(system, (0.6, 0.0), (4.6, 0.0), interval=np.sqrt(0.5))
    assert edge.kind == "periodic"
    assert edge.orbit.transitions == ("kick",)
    assert edge.orbit.period == pytest.approx(4.0)
    np.testing.assert_allclose(edge.orbit.multipliers, [1.5, 1.0], rtol=1e-8)
    assert 0.5 * edge.x[1] ** 2 + edge.x[0] == pytest.approx(2.0)


def test_starts_in_different_modes():
    """Wells at -1 and 1 in two outer modes; the saddle is in the mode between."""
    system = HybridSystem(
        state=("x", "v"),
        parameters={"left": -1.0, "right": 1.0},
        modes=[
            Mode("left", lambda t, x, p: (x.v, p.left - x.x - 0.2 * x.v)),
            Mode("middle", lambda t, x, p: (x.v, x.x - 0.2 * x.v)),
            Mode("right", lambda t, x, p: (x.v, p.right - x.x - 0.2 * x.v)),
        ],
        transitions=[
            Transition("left", "middle", Guard(lambda t, x, p: x.x + 0.5, +1)),
            Transition("middle", "left", Guard(lambda t, x, p: x.x + 0.5, -1)),
            Transition("middle", "right", Guard(lambda t, x, p: x.x - 0.5, +1)),
            Transition("right", "middle", Guard(lambda t, x, p: x.x - 0.5, -1)),
        ],
    )
    found = hybrid.attractors(system, {"x": (-2.0, 2.0), "v": (-1.0, 1.0)}, starts=20)
    assert [each.mode[0] for each in found.values()] == ["left", "right"]
    for one, other in ((found[1], found[2]), ((-1.0, 0.1), (1.3, 0.0))):
        edge = hybrid.edge_state(system, one, other)
        assert (edge.kind, edge.mode) == ("equilibrium", "middle")
        np.testing.assert_allclose(edge.x, 0.0, atol=1e-9)


def test_a_third_attractor_between_the_starts():
    """Equilibria at -2, 0 and 2, with boundaries at -1 and 1."""
    system = HybridSystem(
        state=("x",), modes=[Mode("m", lambda t, x, p: (-x.x * (x.x**2 - 1) * (x.x**2 - 4),))]
    )
    for one, place in (((-2.1,), -1.0), ((2.1,), 1.0)):
        edge = hybrid.edge_state(system, one, (-np.array(one) * 0.9).tolist())
        assert edge.kind == "equilibrium"
        assert edge.x == pytest.approx([place])
        assert edge.other.points[0, 0] == pytest.approx(0.0, abs=1e-4)
        assert "there are others that lead to a third attractor" in edge.status.message


@pytest.mark.parametrize("exchanged", [False, True])
def test_runs_that_end_are_a_side(exchanged):
    """Beyond 1 a run of x' = x**2 - 1 escapes."""
    system = HybridSystem(
        state=("x",),
        modes=[Mode("m", lambda t, x, p: (x.x**2 - 1.0,))],
        transitions=[Transition("m", None, Guard(lambda t, x, p: x.x - 50.0, +1), name="escaped")],
    )
    starts = [(-1.5,), (2.0,)]
    edge = hybrid.edge_state(system, *(starts[::-1] if exchanged else starts))
    assert edge.x == pytest.approx([1.0])
    assert edge.equilibrium.eigenvalues == pytest.approx([2.0])
    assert [each is None for each in (edge.one, edge.other)] == [exchanged, not exchanged]
    assert "runs that end" in edge.status.message


def test_a_chaotic_edge_state():
    """On the boundary y = 0 the map of x is the logistic one with 4, on the attractors with 2.8."""
    system = clocked(
        ("x", "y"), lambda t, x, p: ((4 - 1.2 * x.y**2) * x.x * (1 - x.x), 1.5 * x.y - 0.5 * x.y**3)
    )
    edge = hybrid.edge_state(
        system, {"x": 0.3, "y": -0.9, "tau": 0.5}, {"x": 0.3, "y": 1.1, "tau": 0.5}, interval=1.0, rounds=12
    )
    assert (edge.kind, edge.orbit, edge.equilibrium) == ("not periodic", None, None)
    assert edge.status.ok
    x, y, _ = edge.points.T
    assert np.abs(y).max() < 1e-4
    np.testing.assert_allclose(x[6:12], 4 * x[5:11] * (1 - x[5:11]), atol=1e-3)


def test_starts_that_lead_to_one_attractor():
    edge = hybrid.edge_state(double_well(), (0.5,), (1.5,))
    assert (edge.kind, edge.rounds, len(edge.points)) == ("no edge", 0, 0)
    assert edge.status.code == StatusCode.NOT_CONVERGED
    assert "Both starts lead to the same attractor" in edge.status.message
    falls = hybrid.edge_state(models.bouncing_ball(), (1.0, 0.0), (2.0, 0.0), interval=0.5)
    assert "Neither start leads to an attractor" in falls.status.message


def test_a_budget_that_is_too_small():
    edge = hybrid.edge_state(models.impact_oscillator(), (0.0, 0.0), (-1.6, -0.4), rounds=1, **TWO)
    assert (edge.kind, edge.rounds) == ("not settled", 1)
    assert edge.status.code == StatusCode.NOT_CONVERGED
    assert edge.status.remedy == "Raise rounds=."


def test_an_age_is_no_part_of_the_state():
    """A mode that lasts for a time has an age; the saddle is in the other mode."""
    system = HybridSystem(
        state=("x", "v"),
        modes=[
            Mode("roll", lambda t, x, p: (x.v, x.x - x.x**3 - 0.2 * x.v)),
            Mode("held", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition("roll", "held", Guard(lambda t, x, p: x.v - 1.0, +1)),
            Transition("held", "roll", hybrid.After(0.5), Reset(lambda t, x, p: {"v": 0.0})),
        ],
        start="roll",
    )
    edge = hybrid.edge_state(system, (-1.0, 0.2), (1.2, 0.1))
    assert edge.kind == "equilibrium"
    assert edge.x.shape == (2,)
    assert edge.points.shape[1] == edge.bracket.shape[1] == 2


def test_what_is_between_must_be_allowed():
    found = hybrid.attractors(double_well(), {"x": (-2.0, 2.0)}, starts=10)
    split = HybridSystem(
        state=("x",),
        modes=[Mode("left", lambda t, x, p: (-1.0 - x.x,)), Mode("right", lambda t, x, p: (1.0 - x.x,))],
        transitions=[
            Transition("left", "right", Guard(lambda t, x, p: x.x + 0.5, +1), Reset(lambda t, x, p: (1.0,))),
            Transition("right", "left", Guard(lambda t, x, p: x.x - 0.5, -1), Reset(lambda t, x, p: (-1.0,))),
        ],
    )
    with pytest.raises(hybrid.ArgumentError, match=r"the state \[0.0\] violates every mode"):
        hybrid.edge_state(split, (-1.0,), (1.0,))
    with pytest.raises(hybrid.ArgumentError, match="'roll' does not exist"):
        hybrid.edge_state(split, found[1], found[2])


def test_what_depends_on_time_needs_a_period():
    """A run that begins anew at ``t0`` must be one that comes by later."""

    def wells(drive, **options):
        return HybridSystem(
            state=("x",), modes=[Mode("m", lambda t, x, p: (x.x - x.x**3 + drive(t),))], **options
        )

    def driven(t):
        return 0.01 * np.cos(t)

    with pytest.raises(hybrid.ArgumentError, match="mode 'm' may depend on time, and no forcing period"):
        hybrid.edge_state(wells(driven), (-1.5,), (1.6,))
    edge = hybrid.edge_state(wells(driven, period=2 * np.pi), (-1.5,), (1.6,))
    # To first order in the drive: x' = x + drive.
    assert edge.x == pytest.approx([-0.005], abs=1e-5)
    assert edge.orbit.multipliers == pytest.approx([np.exp(2 * np.pi)], rel=1e-3)
    kick = Transition("m", "m", hybrid.Every(1.0), Reset(lambda t, x, p: (0.9 * x.x,)), name="kick")
    with pytest.raises(hybrid.ArgumentError, match="clock of transition 'kick' ticks"):
        hybrid.edge_state(wells(driven, period=2 * np.pi, transitions=[kick]), (-1.5,), (1.6,))


def test_what_comes_back():
    edge = hybrid.edge_state(duffing(units={"x": "m"}), (-1.0, 0.2), (1.2, 0.1))
    assert repr(edge).startswith("<EdgeState equilibrium: <Equilibrium x = 0, v = 0 in 'roll'")
    assert "<td>x (m)</td>" in edge._repr_html_()
    labelled = edge.to_xarray()
    assert labelled.points.dims == ("point", "state")
    assert labelled.attrs["status"] == "SUCCESS"
    assert edge.saddle is edge.equilibrium


def test_ctrl_c_keeps_the_trajectory(monkeypatch, python_hears_interrupts):
    def found():
        return hybrid.edge_state(models.impact_oscillator(), (0.0, 0.0), (-1.6, -0.4), **TWO)

    whole = Pressed(monkeypatch, question=0)
    found()
    monkeypatch.undo()
    for share in (0.1, 0.5, 0.9):
        Pressed(monkeypatch, question=1 + int(share * whole.asked))
        part = found()
        monkeypatch.undo()
        assert part.status.code == StatusCode.INTERRUPTED
        assert part.orbit is None
