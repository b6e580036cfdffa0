"""A guard within rounding of zero fires once for each change of side, wherever a run starts or is cut."""

from functools import cache

import attrs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    Taylor,
    Transition,
    Tsit5,
    simulate,
)
from tests.hybrid.systems import BALL_SYSTEM, OSCILLATOR_SYSTEM, pendulum

SOLVERS = (Taylor(rtol=1e-12, atol=1e-14), DOP853(rtol=1e-12, atol=1e-14))
GUARDS = {
    "affine": lambda t, x, p: x.q - p.c,
    "sine": lambda t, x, p: np.sin(x.q - p.c),
    "difference of sines": lambda t, x, p: np.sin(x.q) - np.sin(p.c),
    "product": lambda t, x, p: (x.q - p.c) * (2 + np.cos(x.q)),
    "kink": lambda t, x, p: np.maximum(x.q - p.c, 3 * (x.q - p.c)),
    "jump": lambda t, x, p: np.sign(x.q - p.c) * (1 + x.q * x.q),
}


def moderate(largest):
    """Zero, or numbers of moderate size, whose products with others keep all their digits."""
    return st.floats(-largest, largest).filter(lambda a: a == 0.0 or abs(a) > 1e-60)


def away(q, ulps):
    for _ in range(abs(ulps)):
        q = np.nextafter(q, np.inf * ulps)
    return float(q)


@cache
def leaving(guard, direction):
    """``q`` leaves ``c`` as the first, second or third power of time; ``n`` counts."""
    return HybridSystem(
        state=("q", "v", "a", "n"),
        parameters={"c": 1.0, "z": 0.0},
        modes=[Mode("move", lambda t, x, p: (x.v, x.a, p.z, 0.0))],
        transitions=[
            Transition(
                "move",
                "move",
                Guard(GUARDS[guard], direction),
                Reset(lambda t, x, p: (x.q, x.v, x.a, x.n + 1)),
            )
        ],
    )


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("guard", GUARDS)
@settings(max_examples=60, deadline=None)
@given(
    direction=st.sampled_from([-1, 0, 1]),
    ulps=st.integers(-8, 8),
    power=st.sampled_from([1, 2, 3]),
    towards=st.sampled_from([-1, 1]),
    c=st.floats(0.55, 0.95),
    split=st.floats(0.1, 0.9),
)
def test_a_start_beside_the_guard(solver, guard, direction, ulps, power, towards, c, split):
    """The start is on the guard up to rounding: only a motion in the guard's direction fires it, once.

    So it is with a guard that jumps, whose plain form does not.
    """
    pushed = [towards if power == i else 0.0 for i in (1, 2, 3)]
    start = (away(c, ulps), pushed[0], pushed[1], 0.0)
    options = {"mode": "move", "solver": solver, "parameters": {"c": c, "z": pushed[2]}}
    system = leaving(guard, direction)
    whole = simulate(system, start, (0.0, 1.0), **options)
    assert whole.status.ok
    fires = direction == towards
    assert len(whole.jumps) == whole.x[-1, 3] == fires
    first = simulate(system, start, (0.0, split), **options)
    second = simulate(system, first.x[-1], (split, 1.0), **options)
    assert len(first.jumps) + len(second.jumps) == len(whole.jumps)


@cache
def cut(name):
    """A system with its start, mode and end, and the jumps of both solvers."""
    guard, _, ways = name.partition(", ")
    systems = {
        "ball": (BALL_SYSTEM, (1.0, 0.0), None, 3.0),
        "oscillator": (OSCILLATOR_SYSTEM, (0.0, 0.0), None, 40.0),
    }
    case = systems.get(name)
    if case is None:
        case = (pendulum(GUARDS[guard], both=ways == "both"), (1.0, 0.5), "right", 20.0)
    system, x0, mode, end = case
    return *case, [simulate(system, x0, (0.0, end), mode=mode, solver=solver).jumps.t for solver in SOLVERS]


@pytest.mark.as_given
@pytest.mark.parametrize("solver", [0, 1], ids=["Taylor", "DOP853"])
@pytest.mark.parametrize("name", ["ball", "oscillator", *GUARDS, *(f"{guard}, both" for guard in GUARDS)])
def test_a_run_cut_beside_a_jump(solver, name):
    system, x0, mode, end, times = cut(name)
    options = {"solver": SOLVERS[solver]}
    for t in times[solver]:
        for ulps in range(-8, 9):
            split = away(t, ulps)
            first = simulate(system, x0, (0.0, split), mode=mode, **options)
            second = simulate(system, first.x[-1], (split, end), mode=first.mode[-1], **options)
            assert len(first.jumps) + len(second.jumps) == len(times[solver]), (t, ulps)


@cache
def riding():
    """``q`` moves with both moving guards and stays on them; ``s`` oscillates to limit the steps."""
    count = Reset(lambda t, x, p: (x.q, x.s, x.n + 1))
    return HybridSystem(
        state=("q", "s", "n"),
        parameters={"c": 0.0, "r": 1.0},
        modes=[Mode("move", lambda t, x, p: (p.r, 1.3 * np.cos(x.s), 0.0))],
        transitions=[
            Transition("move", "move", Guard(lambda t, x, p: x.q - p.r * t - p.c, +1), count, name="rises"),
            Transition("move", "move", Guard(lambda t, x, p: x.q - p.r * t - p.c, -1), count, name="falls"),
            Transition("move", "move", Guard(lambda t, x, p: np.sin(x.s), 0), name="mark"),
        ],
    )


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=repr)
@settings(max_examples=60, deadline=None)
@given(
    r=moderate(4),
    c=moderate(4),
    s=moderate(3),
)
def test_a_state_that_rides_on_its_guard_does_not_fire_it(solver, r, c, s):
    arc = simulate(
        riding(), (c, s, 0.0), (0.0, 30.0), parameters={"r": r, "c": c}, solver=solver, max_jumps=100
    )
    assert arc.status.ok
    assert arc.x[-1, 2] == 0


@pytest.mark.parametrize("solver", [*SOLVERS, RadauIIA(rtol=1e-8)], ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("speed", [1e-9, 1.0, 1e9])
def test_a_rate_that_is_only_rounding_does_not_put_the_start_on_a_guard(length, speed, solver):
    """At the start the force is ``cos(pi / 2)``: it does not tell on what scale the speed changes."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"length": 1.0, "speed": 1.0},
        modes=[Mode("m", lambda t, x, p: (x.v / p.speed * p.length, np.cos(t) * p.speed))],
        transitions=[Transition("m", "m", Guard(lambda t, x, p: x.q / p.length, -1), name="cross")],
    )
    values = {"length": length, "speed": speed}
    solver = attrs.evolve(solver, atol=1e-14 * min(length, speed))
    span = (np.pi / 2, 2.5)
    arc = simulate(system, (0.5 * length, -speed), span, mode="m", parameters=values, solver=solver)
    # The root of 0.5 - cos t - 2 (t - pi / 2), by Newton's method.
    assert arc.jumps.t == pytest.approx([2.05239432969], abs=1e-7)


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()])
@pytest.mark.parametrize("speed", [0.5, 1.0, 3.0])
def test_a_flight_from_the_floor_to_the_floor_lands_at_its_end(speed, solver):
    """A run that begins and ends on its guard, both times to the last digit, fires it at the end."""
    throw = HybridSystem(
        state=("q", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -1.0))],
        transitions=[Transition("flight", None, Guard(lambda t, x, p: x.q, -1), name="land")],
    )
    arc = simulate(throw, (0.0, speed), (0.0, 2.0 * speed), solver=solver)
    assert [jump.transition for jump in arc.jumps] == ["land"]
