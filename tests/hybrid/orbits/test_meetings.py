"""Events that meet at one instant by themselves: phase-locked loops, and samples that meet a crossing."""

import numpy as np
import pytest

from hybrid import (
    Every,
    Guard,
    HybridSystem,
    Mode,
    Reset,
    StatusCode,
    Transition,
    continue_orbit,
    periodic_orbit,
    simulate,
)

IDLE = np.array([[1.0, 1.0 - np.exp(-1.0)], [0.0, np.exp(-1.0)]])
HALF = np.array([[1.0, 0.5], [0.0, 1.0]])


def loop(rates, frames="a", listed_order=False, **parameters):
    """A charge pump that pumps between the edge of a reference and that of an oscillator of phase ``ph``.

    ``rates(x, p, c)`` is the field while it pumps ``c``.
    """

    def pump(name, c):
        return Mode(name, lambda t, x, p: rates(x, p, c))

    edge, back = Guard(lambda t, x, p: x.ph - 1.0, +1), Reset(lambda t, x, p: {"ph": x.ph - 1.0})
    return HybridSystem(
        state=("ph", "v"),
        parameters=parameters,
        modes=[pump("idle", 0.0), pump("up", 1.0), pump("down", -1.0)],
        transitions=[
            Transition("idle", "up", Every(1.0), name="reference"),
            Transition("idle", "down", edge, back, name="edge"),
            Transition("up", "idle", edge, back, name="late edge"),
            Transition("down", "idle", Every(1.0), name="late reference"),
        ],
        start="idle",
        period=lambda p: 1.0,
        listed_order=listed_order,
    )


def filtered(**options):
    """The pump feeds a filter: an edge that is early by ``d`` takes ``I d`` from ``v``, on either side."""
    return loop(lambda x, p, c: (1.0 + x.v, c * p.I - p.a * x.v), I=0.5, a=1.0, **options)


def direct(**options):
    """The pump moves the frequency too, so that early and late edges have derivatives of their own."""
    return loop(lambda x, p, c: (1.0 + x.v + c * p.I * p.R, c * p.I + 0.0 * x.v), I=0.3, R=2.0, **options)


def of_direct(pump, w):
    return np.linalg.eigvals(HALF @ np.array([[1 - 2.0 * pump * w, 0], [-pump * w, 1]]) @ HALF)


def sides_of_direct(pump):
    """The multipliers where the reference comes first, and where the edge does."""
    return {"reference": of_direct(pump, 1 / (1 + 2 * pump)), "edge": of_direct(pump, 1.0)}


def assert_same(found, wanted):
    found, wanted = (np.sort_complex(np.asarray(each, dtype=complex)) for each in (found, wanted))
    np.testing.assert_allclose(found, wanted, atol=1e-9)


def assert_is_a_start(orbit):
    arc = orbit.arc()
    assert tuple(arc.jumps.transition) == orbit.transitions
    assert arc.mode[0] == arc.mode[-1]
    np.testing.assert_allclose(arc.x[-1], arc.x[0], atol=1e-8)


TIMES = [0.3, 0.81, 7.13, 81.77, 302.57, 546.01, 582.51, 801.26]


@pytest.mark.parametrize("t0", TIMES)
@pytest.mark.parametrize("nudge", [-1e-16, 0.0, 1e-16])
def test_a_lock_has_the_multipliers_of_the_closed_loop(t0, nudge):
    orbit = periodic_orbit(filtered(), (round(t0 % 1.0, 2) + nudge, 0.0), t0=t0)
    assert orbit.status.ok
    assert_same(orbit.multipliers, np.linalg.eigvals(IDLE @ [[1.0, 0.0], [-0.5, 1.0]]))
    assert_same(np.linalg.eigvals(orbit.fundamental), orbit.multipliers)
    assert_is_a_start(orbit)


@pytest.mark.parametrize("t0", [0.3, 546.01])
def test_a_branch_of_locks_has_the_multipliers_of_the_closed_loop(t0):
    orbit = periodic_orbit(filtered(), (round(t0 % 1.0, 2), 0.0), t0=t0)
    branch = continue_orbit(orbit, "I", (0.2, 0.9))
    assert branch.status.ok
    assert not branch.bifurcations
    assert np.sort(branch.parameter[[0, -1]]) == pytest.approx([0.2, 0.9])
    for i in range(0, len(branch), 5):
        pump = branch.parameter[i]
        assert_same(branch.multipliers[i], np.linalg.eigvals(IDLE @ [[1.0, 0.0], [-pump, 1.0]]))
        assert_is_a_start(branch.orbit(i))


@pytest.mark.parametrize("t0", TIMES)
def test_a_lock_that_is_a_border_has_the_multipliers_of_the_order_that_it_lists(t0):
    orbit = periodic_orbit(direct(), (round(t0 % 1.0, 2), 0.0), t0=t0)
    assert orbit.status.code == StatusCode.AMBIGUOUS_ORDER
    assert orbit.closes
    assert "reached together" in orbit.status.message
    assert_same(orbit.multipliers, sides_of_direct(0.3)[orbit.transitions[0]])
    assert_is_a_start(orbit)


def test_a_branch_of_borders_says_so():
    orbit = periodic_orbit(direct(), (0.3, 0.0), t0=0.3)
    branch = continue_orbit(orbit, "I", (0.2, 0.4))
    assert branch.status.code == StatusCode.AMBIGUOUS_ORDER
    first = orbit.transitions[0]
    for pump, multipliers in zip(branch.parameter, branch.multipliers, strict=True):
        assert_same(multipliers, sides_of_direct(pump)[first])


def test_an_order_that_is_meant_is_not_told():
    orbit = periodic_orbit(direct(listed_order=True), (0.3, 0.0), t0=0.3)
    assert orbit.status.ok


def two_edges(**parameters):
    """An autonomous loop, whose reference is a state of its own."""

    def pump(name, c):
        return Mode(name, lambda t, x, p: (1.0, 1.0 + x.v + c * p.I * p.R, c * p.I - p.a * x.v))

    ticks, edge = Guard(lambda t, x, p: x.r - 1.0, +1), Guard(lambda t, x, p: x.ph - 1.0, +1)
    restart, back = Reset(lambda t, x, p: {"r": x.r - 1.0}), Reset(lambda t, x, p: {"ph": x.ph - 1.0})
    return HybridSystem(
        state=("r", "ph", "v"),
        parameters={"I": 0.5, "a": 1.0, "R": 0.0} | parameters,
        modes=[pump("idle", 0.0), pump("up", 1.0), pump("down", -1.0)],
        transitions=[
            Transition("idle", "up", ticks, restart, name="reference"),
            Transition("idle", "down", edge, back, name="edge"),
            Transition("up", "idle", edge, back, name="late edge"),
            Transition("down", "idle", ticks, restart, name="late reference"),
        ],
        start="idle",
    )


@pytest.mark.parametrize("guess", [(0.3, 0.3, 0.0), (0.31, 0.3, 0.01), (0.7, 0.7, 0.0)])
def test_an_autonomous_lock_has_the_multipliers_of_the_closed_loop(guess):
    orbit = periodic_orbit(two_edges(), guess, period=1.0)
    assert orbit.status.ok
    assert_same(orbit.multipliers, [1.0, *np.linalg.eigvals(IDLE @ [[1.0, 0.0], [-0.5, 1.0]])])
    assert_is_a_start(orbit)


def test_an_autonomous_lock_that_is_a_border_says_so():
    orbit = periodic_orbit(two_edges(I=0.3, R=2.0, a=0.0), (0.3, 0.3, 0.0), period=1.0)
    assert orbit.status.code == StatusCode.AMBIGUOUS_ORDER
    assert_same(orbit.multipliers, [1.0, *sides_of_direct(0.3)[orbit.transitions[0]]])
    assert_is_a_start(orbit)


@pytest.mark.parametrize("t0", [0.0, 0.4, 3.0])
def test_two_clocks_that_tick_together_have_one_order(t0):
    """``u`` becomes ``2 u`` and then ``u - 1``, at each tick of both, and decays."""
    system = HybridSystem(
        state=("u",),
        modes=[Mode("on", lambda t, x, p: (-x.u,))],
        transitions=[
            Transition("on", "on", Every(1.0), Reset(lambda t, x, p: (2.0 * x.u,)), name="double"),
            Transition("on", "on", Every(0.5), Reset(lambda t, x, p: (x.u - 1.0,)), name="take"),
        ],
        period=1.0,
    )
    orbit = periodic_orbit(system, (0.5,), t0=t0)
    assert orbit.closes
    assert orbit.multipliers == pytest.approx([2.0 * np.exp(-1.0)])
    assert_is_a_start(orbit)


def sampled(delayed):
    """A controller samples ``y`` at each tick and holds its action ``u``; a limit is met at the same time.

    ``y`` falls to its limit exactly at the tick, where it is set back by 1.
    """
    refill = Reset(lambda t, x, p: {"y": x.y + 1.0})
    return HybridSystem(
        state=("y",),
        held=("u",),
        parameters={"k": 0.25},
        modes=[Mode("on", lambda t, x, p: (-1.0 + x.u,))],
        transitions=[
            Transition("on", "on", Guard(lambda t, x, p: x.y, -1), refill, name="refill"),
            Transition("on", "on", Every(1.0), Reset(lambda t, x, p: {"u": delayed(x, p)}), name="sample"),
        ],
        period=1.0,
    )


@pytest.mark.parametrize("t0", [0.25, 5.6])
def test_the_sign_of_a_sample_decides_on_its_derivative(t0):
    """The action is a sine of ``y``, which does not tell before from after the refill."""
    system = sampled(lambda x, p: -p.k * np.sin(2.0 * np.pi * x.y) / (2.0 * np.pi))
    orbit = periodic_orbit(system, (1.0 - t0 % 1.0, 0.0), t0=t0)
    assert orbit.status.ok
    # The state after a tick: y + u at the next one, and u = -k times the new y.
    assert_same(orbit.multipliers, np.linalg.eigvals([[1.0, 1.0], [-0.25, -0.25]]))


def test_neighbours_have_the_derivatives_of_the_two_orders():
    """Runs from starts to both sides of a border show what its status says."""
    system, far = direct(), 1e-4
    found = []
    for side in (-far, far):
        arc = simulate(system, (0.5 + side, 0.0), (0.5, 1.5), tangent=np.eye(2))
        found.append(np.linalg.eigvals(arc.fundamental))
    sides = sides_of_direct(0.3)
    for each, name in zip(found, ("reference", "edge"), strict=True):
        np.testing.assert_allclose(np.sort_complex(each), np.sort_complex(sides[name]), atol=1e-3)


@pytest.mark.parametrize(
    ("listed_order", "code"), [(False, StatusCode.AMBIGUOUS_ORDER), (True, StatusCode.SUCCESS)]
)
def test_an_orbit_is_found_where_the_order_changes_the_state(listed_order, code):
    """Two guards of time alone: 1 is added to ``u``, which is then halved."""

    def due(t, x, p):
        return np.sin(2.0 * np.pi * t)

    add, halve = Reset(lambda t, x, p: {"u": x.u + 1.0}), Reset(lambda t, x, p: {"u": 0.5 * x.u})
    system = HybridSystem(
        state=("u",),
        modes=[Mode("on", lambda t, x, p: (-x.u,))],
        transitions=[
            Transition("on", "on", Guard(due, +1), add, name="add"),
            Transition("on", "on", Guard(lambda t, x, p: 3.0 * due(t, x, p), +1), halve, name="halve"),
        ],
        period=1.0,
        listed_order=listed_order,
    )
    orbit = periodic_orbit(system, (0.7,), t0=0.25)
    assert orbit.status.code == code
    assert orbit.closes
    assert orbit.transitions == ("add", "halve")
    np.testing.assert_allclose(orbit.x0, 0.5 / (1.0 - 0.5 / np.e) * np.exp(-0.25), rtol=1e-9)
    assert_same(orbit.multipliers, [0.5 * np.exp(-1.0)])
    assert_is_a_start(orbit)
