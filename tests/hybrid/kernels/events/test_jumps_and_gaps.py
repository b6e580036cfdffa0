"""Guards that jump or have gaps, each watched in both directions: every change of side fires once."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
W, END = 1.3, 8.0
JUMPING = {
    "floor": lambda t, x, p: np.floor(p.a * x.q + p.b) + 0.5,
    "floor of a product": lambda t, x, p: np.floor(p.a * x.q * x.v + p.b) - 0.5,
    "sawtooth": lambda t, x, p: np.floor(p.a * t) - p.a * t + 0.5 + 0.4 * x.q,
    "sign": lambda t, x, p: np.sign(x.q - p.b) * (x.v - 0.2),
    "two signs": lambda t, x, p: np.sign(np.sin(p.a * t)) + 0.5 * np.sign(x.q),
    "remainder": lambda t, x, p: np.mod(p.a * t, 1.0) - 0.5 + 0.3 * x.q,
    "two steps": lambda t, x, p: np.heaviside(x.q - p.b, 0.5) - np.heaviside(x.v, 0.5) - 0.5,
    "choice": lambda t, x, p: np.where(x.q > p.b, x.v, np.where(x.v > 0, -1.0, x.q + 0.1)),
}
GAPS = {
    "root": lambda t, x, p: np.sqrt(x.q + 0.4) - 0.5 - 0.2 * p.b,
    "root of a product": lambda t, x, p: np.sqrt(x.q * x.v + 0.2) - 0.3,
    "logarithm": lambda t, x, p: np.log(x.q + 0.3) - p.b,
    "logarithm and speed": lambda t, x, p: np.log(x.q - 0.2) + x.v - p.b,
}


def both_ways(guard, *reset):
    """An oscillator with a counter, and the guard in both directions."""
    return HybridSystem(
        state=("q", "v", "n"),
        parameters={"a": 1.0, "b": 0.0},
        modes=[Mode("swing", lambda t, x, p: (x.v, -(W**2) * x.q, 0.0))],
        transitions=[
            Transition("swing", "swing", Guard(guard, direction), *reset, name=name)
            for name, direction in (("up", +1), ("down", -1))
        ],
    )


def changes(guard, a, b, start):
    """Times at which the guard rises and falls through zero, from samples; None where these do not tell."""
    t = np.linspace(0.0, END, 80_001)
    q = start[0] * np.cos(W * t) + start[1] / W * np.sin(W * t)
    v = start[1] * np.cos(W * t) - W * start[0] * np.sin(W * t)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = guard(t, SimpleNamespace(q=q, v=v), SimpleNamespace(a=a, b=b)) + 0.0 * t
    known = np.flatnonzero(np.isfinite(value) & (value != 0.0))
    sign = np.sign(value[known])
    at = np.flatnonzero(sign[1:] != sign[:-1])
    left, right = known[at], known[at + 1]
    when = 0.5 * (t[left] + t[right])
    small = np.abs(value) < 1e-3
    turns = t[1:-1][small[1:-1] & (np.diff(np.sign(np.diff(value))) != 0)]
    near_turn = any(np.min(np.abs(when - turn), initial=1.0) > 1e-3 for turn in turns)
    close = np.min(np.diff(when, prepend=0.0, append=END)) < 1e-2
    if not np.isfinite(value[0]) or near_turn or close or np.any(right - left > 3):
        return None
    return when[sign[at + 1] > 0], when[sign[at + 1] < 0]


@cache
def with_and_without_reset(guard):
    return both_ways(guard), both_ways(guard, Reset(lambda t, x, p: (x.q, x.v, x.n + 1.0)))


@cache
def runs(guard, seed=4, count=12, least=0.5, most=3.0):
    """Parameters and starts, with the changes that are known there."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        a, b = float(rng.uniform(least, most)), float(rng.uniform(-0.8, 0.8))
        start = tuple(map(float, rng.uniform(-1.2, 1.2, 2)))
        wanted = changes(guard, a, b, start)
        if wanted is not None:
            found.append((a, b, start, wanted))
    return found


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("guard", [*JUMPING.values(), *GAPS.values()], ids=[*JUMPING, *GAPS])
def test_each_change_of_side_fires_once(guard, solver):
    assert runs(guard)
    for a, b, start, wanted in runs(guard):
        for system in with_and_without_reset(guard):
            arc = simulate(system, (*start, 0.0), (0.0, END), parameters={"a": a, "b": b}, solver=solver)
            assert arc.status.ok
            for name, times in zip(("up", "down"), wanted, strict=True):
                found = [jump.t for jump in arc.jumps if jump.transition == name]
                assert len(found) == len(times), (name, a, b, start)
                assert np.allclose(found, times, rtol=0, atol=2e-4), (name, a, b, start)


@pytest.mark.parametrize("solver", ["Taylor", "DOP853"])
@pytest.mark.parametrize("flat_first", [True, False])
@pytest.mark.parametrize("power", [3, 5, 7])
def test_a_flat_root_and_a_jump_at_one_place_fire_once_each(power, flat_first, solver):
    """The crossing of the spike ends a step close to their place, where rounding hides which comes first."""
    flat = Transition("swing", "swing", Guard(lambda t, x, p: x.q**power), name="flat")
    spike = Transition("swing", "swing", Guard(lambda t, x, p: np.exp(-p.k * x.q**2) - 0.5), name="spike")
    switch = Transition("swing", "swing", Guard(lambda t, x, p: np.sign(x.q), +1), name="switch")
    system = HybridSystem(
        state=("q", "v"),
        parameters={"k": 1e4},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[spike, *((flat, switch) if flat_first else (switch, flat))],
    )
    for size in (0.7, 1.0, 1.5, 3.3):
        for k in (1e4, 1e2):
            arc = simulate(system, (size, 0.0), (0.0, 10.0), parameters={"k": k}, solver=SOLVERS[solver])
            fired = list(arc.jumps.transition)
            assert [fired.count(name) for name in ("spike", "flat", "switch")] == [6, 3, 1]


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_crossings_between_two_gaps_are_found(solver):
    """The guard is a number only within 0.07 of each whole time; a step spans several of these."""
    system = HybridSystem(
        state=("s",),
        modes=[Mode("run", lambda t, x, p: (1.0,))],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: np.log(np.cos(2 * np.pi * x.s) - 0.9) + 2.5, direction),
                name=name,
            )
            for name, direction in (("up", +1), ("down", -1))
        ],
    )
    arc = simulate(system, (0.06,), (0.06, 6.5), solver=solver)
    beside = np.arccos(0.9 + np.exp(-2.5)) / (2 * np.pi)
    for name, shift in (("up", -beside), ("down", beside)):
        found = [jump.t for jump in arc.jumps if jump.transition == name]
        np.testing.assert_allclose(found, np.arange(1, 7) + shift, rtol=0, atol=1e-13)


def bounces(wall, start, end):
    """Times at which an oscillator of frequency one hits a wall that reverses its speed."""
    size, phase = np.hypot(*start), np.arctan2(start[1], start[0])
    if not size > abs(wall):
        return []
    half = np.arccos(wall / size)
    t = np.min((phase + np.array([-half, half])) % (2 * np.pi))
    v = size * np.sin(t - phase)
    times = []
    while t < end:
        times.append(float(t))
        t += 2 * np.arctan2(v, wall) % (2 * np.pi)
    return times


SWITCHES = {
    "sign": lambda t, x, p: np.sign(x.q - p.wall),
    "where": lambda t, x, p: np.where(x.q > p.wall, 1.0, -1.0),
    "heaviside": lambda t, x, p: np.heaviside(x.q - p.wall, 0.5) - 0.5,
    "quotient": lambda t, x, p: np.abs(x.q - p.wall) / (x.q - p.wall),
}


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("switch", SWITCHES.values(), ids=SWITCHES)
def test_a_reset_that_turns_back_at_a_jump_fires_once(switch, solver):
    """After the reset rounding leaves the state on either side of the jump; the flow goes back from there."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"wall": 0.0},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition("swing", "swing", Guard(switch), Reset(lambda t, x, p: (x.q, -x.v))),
        ],
    )
    rng = np.random.default_rng(7)
    for _ in range(8):
        wall = float(rng.choice([0.0, 0.3, rng.uniform(-1.2, 1.2)]))
        start = tuple(map(float, rng.uniform(-1.5, 1.5, 2)))
        arc = simulate(system, start, (0.0, END), parameters={"wall": wall}, solver=solver)
        wanted = bounces(wall, start, END)
        assert arc.status.ok
        assert len(arc.jumps) == len(wanted), (wall, start)
        np.testing.assert_allclose(arc.jumps.t, wanted, rtol=0, atol=1e-7)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("sign", [+1, -1])
def test_an_infinite_guard_at_the_end_of_a_run_has_not_crossed(sign, solver):
    """The guard overflows; its rounding, infinite too, tells nothing of its side."""
    system = HybridSystem(
        state=("q",),
        modes=[Mode("rise", lambda t, x, p: (1.0,))],
        transitions=[Transition("rise", "rise", Guard(lambda t, x, p: sign * (np.exp(1e3 * x.q) - 2.0)))],
    )
    for end in (0.5, 1.0, 2.0):
        arc = simulate(system, (-0.5,), (0.0, 0.5 + end), solver=solver)
        assert arc.status.ok
        np.testing.assert_allclose(arc.jumps.t, [0.5 + np.log(2.0) / 1e3], rtol=0, atol=1e-12)
        assert simulate(system, (0.3,), (0.0, 0.2), mode="rise", solver=solver).status.ok


STAIRS = {
    "floor": (lambda q: np.floor(q) - 1.0, +1, 1.0),
    "ceiling": (lambda q: 1.0 + np.ceil(-q), -1, 1.0),
    "half a stair": (lambda q: np.floor(2.0 * q) - 2.0, +1, 0.5),
    "two stairs": (lambda q: np.floor(q) + np.floor(2.0 * q + 0.5) - 3.0, +1, 0.25),
    "sign and stair": (lambda q: (np.floor(q) - 1.0) * np.sign(q), +1, 1.0),
}


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("stair", STAIRS)
def test_a_start_at_the_edge_of_a_stair_at_zero_has_not_crossed(stair, solver):
    """Rounding of the state shows the stair below as well; the guard leaves zero at the end of its own."""
    guard, direction, width = STAIRS[stair]
    for way in (+1.0, -1.0):

        def stairs(t, x, p, way=way):
            return guard(way * x.q)

        count = Transition("go", "go", Guard(stairs, direction), Reset(lambda t, x, p: (x.q, x.n + 1)))
        system = HybridSystem(
            state=("q", "n"),
            modes=[Mode("go", lambda t, x, p, way=way: (way, 0.0))],
            transitions=[count],
        )
        arc = simulate(system, (way, 0.0), (0.0, 1.4), mode="go", solver=solver)
        assert arc.status.ok
        np.testing.assert_allclose(arc.jumps.t, [width], rtol=0, atol=1e-14)


AMID = {
    "larger": lambda t, x, p: np.maximum(np.sign(x.q - p.b), x.v * p.a - 0.6),
    "smaller": lambda t, x, p: np.minimum(np.sign(x.q - 0.4 * np.sin(1.3 * t) - p.b), x.v + 0.3),
    "larger of three": lambda t, x, p: np.maximum(
        np.sign(2 * x.v / (1 + x.v * x.v) - p.b), np.abs(x.q + 0.4 * np.sin(1.3 * t)) - 0.9
    ),
}


@cache
def beside_another(guard):
    other = Guard(lambda t, x, p: (x.q - 0.3) * (x.v + 0.1))
    count = Reset(lambda t, x, p: (x.q, x.v, x.n + 1.0))
    system = both_ways(guard)
    return HybridSystem(
        state=system.state,
        parameters=system.parameters,
        modes=system.modes,
        transitions=[*system.transitions, Transition("swing", "swing", other, count, name="other")],
    )


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("guard", AMID.values(), ids=AMID)
def test_a_guard_that_is_zero_amid_its_jump_fires_once(guard, solver):
    """A landing where the sign is zero: the slope beside the jump says nothing of the side after it.

    Another guard ends a step soon after.
    """
    system, known = beside_another(guard), runs(guard, 8, 40, 0.6, 1.4)
    assert len(known) > 10
    for a, b, start, wanted in known:
        arc = simulate(
            system, (*start, 0.0), (0.0, END), mode="swing", parameters={"a": a, "b": b}, solver=solver
        )
        assert arc.status.ok
        for name, times in zip(("up", "down"), wanted, strict=True):
            found = [jump.t for jump in arc.jumps if jump.transition == name]
            assert len(found) == len(times), (a, b, start, name)
            np.testing.assert_allclose(found, times, rtol=0, atol=2e-4)
