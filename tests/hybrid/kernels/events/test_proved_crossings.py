"""Guards that are not affine: each change of sign fires once, at the right place, where the guard is zero."""

from functools import cache

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
    Tsit5,
    compile_system,
    simulate,
    stroboscopic_section,
)

SOLVERS = (Taylor(), DOP853(), RadauIIA(rtol=1e-9, atol=1e-11), Tsit5(rtol=1e-9, atol=1e-11))
END = 10.0
# Where crossings are: no place that differs from zero by 1e-100.
PLACES = st.floats(-1.2, 1.2).map(lambda place: round(place, 12))
# Guards as functions of the position ``q = 1.5 cos t``, with a sharpness and a threshold; each is zero, or
# jumps, where ``q`` equals one of the values given.
FAMILIES = {
    "tanh": (lambda t, x, p: np.tanh(p.k * (x.q - p.c)), lambda k, c: [c]),
    "exp": (lambda t, x, p: np.exp(p.k * (x.q - p.c)) - 1, lambda k, c: [c]),
    "softplus": (
        lambda t, x, p: np.log1p(np.exp(p.k * (x.q - p.c))) / p.k - 0.1,
        lambda k, c: [c + np.log(np.expm1(0.1 * k)) / k],
    ),
    "spike": (
        lambda t, x, p: np.exp(-p.k * (x.q - p.c) ** 2) - 0.5,
        lambda k, c: [c - np.sqrt(np.log(2) / k), c + np.sqrt(np.log(2) / k)],
    ),
    "sign": (lambda t, x, p: np.sign(x.q - p.c), lambda k, c: [c]),
    "where": (lambda t, x, p: np.where(x.q > p.c, 1.0, -p.k), lambda k, c: [c]),
    "cube": (lambda t, x, p: p.k * (x.q - p.c) ** 3, lambda k, c: [c]),
    "fifth": (lambda t, x, p: (x.q - p.c) ** 5, lambda k, c: [c]),
    "signed square": (lambda t, x, p: (x.q - p.c) * np.abs(x.q - p.c), lambda k, c: [c]),
    "cube root": (lambda t, x, p: np.cbrt(x.q - p.c), lambda k, c: [c]),
    "near the tangent": (
        lambda t, x, p: np.cbrt(p.k * (x.q - p.c)) - 1e-3,
        lambda k, c: [c + 1e-9 / k],
    ),
    "dead zone": (lambda t, x, p: np.maximum(np.abs(x.q - p.c) - 0.3, 0) - 1e-3 * p.k / 500, None),
    "quotient": (lambda t, x, p: (x.q - p.c) / (1 + p.k * x.q**2), lambda k, c: [c]),
    "angle": (lambda t, x, p: np.arctan2(x.q - p.c, 2 + x.v), lambda k, c: [c]),
    "product": (lambda t, x, p: (x.q - p.c) * (x.q + 1), lambda k, c: [c, -1.0]),
}


@cache
def oscillator(family, direction):
    return HybridSystem(
        state=("q", "v"),
        parameters={"k": 20.0, "c": 0.1},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[Transition("swing", "swing", Guard(FAMILIES[family][0], direction), name="mark")],
    )


def crossing_times(values):
    """Times at which ``1.5 cos t`` equals one of the values."""
    times = [
        sign * np.arccos(value / 1.5) + 2 * np.pi * turn
        for value in values
        for sign in (-1, 1)
        for turn in range(3)
    ]
    return np.sort([time for time in times if 0 < time < END])


def guard_of(family, k, c, time):
    """The guard of the model, evaluated on the exact solution."""

    class Names:
        pass

    x, p = Names(), Names()
    x.q, x.v, p.k, p.c = 1.5 * np.cos(time), -1.5 * np.sin(time), k, c
    return FAMILIES[family][0](time, x, p)


@pytest.mark.parametrize("family", [name for name, (_, places) in FAMILIES.items() if places])
@pytest.mark.parametrize("direction", [0, 1])
@given(
    k=st.floats(0.5, 4.0).map(lambda exponent: 10.0**exponent),
    c=PLACES,
    solver=st.sampled_from(SOLVERS),
)
def test_each_change_of_sign_fires_once(family, direction, k, c, solver):
    if family in ("exp", "softplus"):
        # A guard must be finite where its mode runs.
        k = min(k, 250.0)
    places = FAMILIES[family][1](k, c)
    if not all(abs(place) < 1.49 for place in places):
        return
    expected = crossing_times(places)
    if np.any(np.diff(expected) < 1e-6):
        return
    if direction:
        # The exact solution shows which crossings lead upwards.
        around = [np.sign(guard_of(family, k, c, expected + shift)) for shift in (-1e-7, 1e-7)]
        expected = expected[(around[0] < 0) & (around[1] > 0)]
    arc = simulate(
        oscillator(family, direction), (1.5, 0.0), (0.0, END), parameters={"k": k, "c": c}, solver=solver
    )
    assert arc.status.code == StatusCode.SUCCESS
    assert len(arc.jumps) == len(expected)
    tolerance = 1e-12 if isinstance(solver, Taylor) else 1e-6
    np.testing.assert_allclose(arc.jumps.t, expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_guard_is_zero_at_its_events(solver):
    for family, (function, places) in FAMILIES.items():
        if places is None or family in ("sign", "where"):
            continue
        system = oscillator(family, 0)
        arc = simulate(system, (1.5, 0.0), (0.0, END), parameters={"k": 30.0, "c": 0.2}, solver=solver)
        for jump in arc.jumps:

            class X:
                q, v = jump.x_minus

            class P:
                k, c = 30.0, 0.2

            # Bound from the rounding of the position.
            scale = abs(function(jump.t, type("X", (), {"q": X.q + 1e-13, "v": X.v}), P)) + 1e-13
            assert abs(function(jump.t, X, P)) <= scale


@pytest.mark.parametrize("solver", SOLVERS[:2])
def test_a_spike_in_time_ends_the_run(solver):
    ramp = HybridSystem(
        state=("q",),
        parameters={"k": 10.0},
        modes=[Mode("ramp", lambda t, x, p: (0.1,))],
        transitions=[
            Transition("ramp", None, Guard(lambda t, x, p: np.exp(-p.k * (t - 5.2) ** 2) - 0.5, +1))
        ],
    )
    for k in (10.0, 1e4, 1e8):
        arc = simulate(ramp, (0.0,), (0.0, 10.0), parameters={"k": k}, solver=solver)
        assert arc.status.code == StatusCode.TERMINAL
        np.testing.assert_allclose(arc.t[-1], 5.2 - np.sqrt(np.log(2) / k), rtol=1e-14)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_bounce_on_a_sharp_guard_is_where_the_guard_is(solver):
    wall = HybridSystem(
        state=("q", "v"),
        parameters={"k": 50.0},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(lambda t, x, p: np.tanh(p.k * x.q), -1),
                Reset(lambda t, x, p: (0.0, -0.5 * x.v)),
                name="bounce",
            )
        ],
    )
    arc = simulate(wall, (1.5, 0.0), (0.0, 9.0), solver=solver)
    np.testing.assert_allclose(arc.jumps.t, np.pi * (np.arange(len(arc.jumps)) + 0.5), atol=1e-6)
    np.testing.assert_allclose(arc.jumps.x_minus[:, 0], 0.0, atol=1e-14)
    np.testing.assert_allclose(arc.jumps.x_minus[:, 1], -1.5 * 0.5 ** np.arange(len(arc.jumps)), rtol=1e-6)


def test_a_guard_that_touches_does_not_fire():
    """``1.5 - q`` is zero at the turning points of the oscillation, and rises again."""
    touch = HybridSystem(
        state=("q", "v"),
        parameters={"depth": 0.0},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition("swing", "swing", Guard(lambda t, x, p: np.exp(1.5 - x.q) - 1 - p.depth), name="top")
        ],
    )
    near = simulate(touch, (-1.5, 0.0), (0.0, 12.0), parameters={"depth": -1e-9})
    assert len(near.jumps) == 0
    over = simulate(touch, (-1.5, 0.0), (0.0, 12.0), parameters={"depth": 1e-9})
    # Two crossings around each of t = pi and 3 pi; at depth d the guard is below zero for 2 sqrt(2 d / 1.5).
    half = np.sqrt(2e-9 / 1.5)
    expected = [np.pi - half, np.pi + half, 3 * np.pi - half, 3 * np.pi + half]
    np.testing.assert_allclose(over.jumps.t, expected, atol=1e-9)


@pytest.mark.parametrize("solver", SOLVERS[:2])
@pytest.mark.parametrize("start", [0.0, 0.25])
def test_a_guard_that_is_zero_at_both_ends_of_a_step(solver, start):
    """In every period each step starts and ends on the guard and crosses it in between."""
    system = HybridSystem(
        state=("x", "n"),
        modes=[Mode("decay", lambda t, x, p: (-x.x, 0.0))],
        transitions=[
            Transition(
                "decay",
                "decay",
                Guard(lambda t, x, p: np.sin(2 * np.pi * (t - 0.5 - p.start)), +1),
                Reset(lambda t, x, p: (x.x, x.n + 1)),
            )
        ],
        parameters={"start": 0.0},
        period=1.0,
    )
    section = stroboscopic_section(
        system, (1.0, 0.0), periods=7, t0=start, parameters={"start": start}, solver=solver
    )
    np.testing.assert_array_equal(np.diff(section.x[:, 1]), 1.0)


def test_a_guard_that_cannot_be_traced_is_said_to_be_sampled():
    def stubborn(t, x, p):
        if x.q > 0.5:
            return x.q - 0.7
        return x.q - 0.7

    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition(
                "swing", "swing", Guard(stubborn, -1, gradient=lambda t, x, p: (1.0, 0.0)), name="mark"
            )
        ],
    )
    assert "not proved" in repr(compile_system(system))
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0))
    assert "'mark' are not proved" in arc.status.message
    np.testing.assert_allclose(arc.jumps.t, [np.arccos(0.7 / 1.5)], rtol=1e-12)
    assert "proved" in repr(compile_system(oscillator("tanh", 0)))
    assert simulate(oscillator("tanh", 0), (1.5, 0.0), (0.0, 5.0)).status.message == "Reached the end."


@pytest.mark.parametrize("solver", SOLVERS[:2])
def test_a_moving_guard_beside_a_steep_one(solver):
    """``x' = 0.25`` against ``1 + x - t / 2``: both move, and they meet only at t = 4."""
    system = HybridSystem(
        state=("x",),
        modes=[Mode("creep", lambda t, x, p: (0.25,))],
        transitions=[Transition("creep", "creep", Guard(lambda t, x, p: 1 + x.x - 0.5 * t, -1), name="met")],
    )
    arc = simulate(system, (0.0,), (0.0, 10.0), solver=solver)
    np.testing.assert_allclose(arc.jumps.t, [4.0], rtol=1e-14)
    np.testing.assert_allclose(arc.jumps.transversality, [-0.25], rtol=1e-14)


# Functions that jump, or have a vertical tangent, where their argument is zero.
STEEP = {"sign": np.sign, "cube root": np.cbrt, "levels": lambda u: np.where(u > 0, 1.0, -0.3)}
ARGUMENTS = (
    lambda t, x, p: np.log1p((x.q + 0.3 * x.v) * (x.q + 0.3 * x.v)) - p.c,
    lambda t, x, p: x.q * np.sin(3 * t) - p.c,
    lambda t, x, p: np.sin(2 * x.q) - p.c,
)


@cache
def marked(guard, direction):
    return HybridSystem(
        state=("q", "v"),
        parameters={"c": 0.1, "a": 0.5, "b": 0.1},
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))],
        transitions=[Transition("swing", "swing", Guard(guard, direction), name="mark")],
    )


@cache
def steep(function, argument):
    return lambda t, x, p: STEEP[function](ARGUMENTS[argument](t, x, p))


@pytest.mark.parametrize("function", STEEP)
@pytest.mark.parametrize("argument", range(len(ARGUMENTS)))
@given(c=st.floats(0.05, 0.8), direction=st.sampled_from([-1, 0, 1]))
def test_a_jump_or_a_vertical_tangent_is_as_sharp_as_its_argument(function, argument, c, direction):
    runs = [
        simulate(marked(guard, direction), (1.5, 0.0), (0.0, END), parameters={"c": c}, max_jumps=100)
        for guard in (ARGUMENTS[argument], steep(function, argument))
    ]
    plain, sharp = (np.asarray(arc.jumps.t) for arc in runs)
    assert len(plain) == len(sharp)
    # Rounding sets the place of a shallow crossing.
    slopes = np.array([abs(jump.transversality) for jump in runs[0].jumps])
    np.testing.assert_array_less(np.abs(sharp - plain) * np.minimum(slopes, 1.0), 2e-14)


def curved_and_jumping(t, x, p):
    return (np.abs(np.abs(x.v) - p.a) ** 1.5 - p.b) * np.sign(x.v - p.c)


@pytest.mark.parametrize("solver", SOLVERS)
@given(
    a=st.floats(0.4, 0.6),
    b=st.floats(0.05, 0.12),
    c=st.floats(-0.1, 0.1),
    direction=st.sampled_from([-1, 0, 1]),
)
def test_a_jump_after_other_crossings_on_one_step(solver, a, b, c, direction):
    system, started = marked(curved_and_jumping, direction), 0.3
    q, v = 1.5 * np.cos(started), -1.5 * np.sin(started)
    arc = simulate(
        system, (q, v), (started, END), parameters={"a": a, "b": b, "c": c}, solver=solver, max_jumps=200
    )
    far = b ** (2 / 3)
    asin = np.arcsin(np.array([c, a + far, a - far, -a - far, far - a]) / 1.5)
    turns = 2 * np.pi * np.arange(-1, 4)[:, None]
    times = np.sort(np.concatenate([turns - asin, turns + np.pi + asin], axis=None))
    times = times[(times > started) & (times < END)]
    first = np.sign((np.abs(np.abs(v) - a) ** 1.5 - b) * np.sign(v - c))
    after = first * np.cumprod(np.full(len(times), -1.0))
    expected = times[after == direction] if direction else times
    assert len(arc.jumps) == len(expected)
    np.testing.assert_allclose(arc.jumps.t, expected, atol=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_fall_behind_a_jump_at_the_start_of_a_step(solver):
    """The guard jumps to its far side and then only falls, which is one more change of sign."""
    system = HybridSystem(
        state=("q",),
        modes=[Mode("ramp", lambda t, x, p: (0.3,))],
        transitions=[
            Transition(
                "ramp",
                "ramp",
                Guard(lambda t, x, p: np.minimum(np.where(x.q > 0.8, 1.0, x.q - 0.8), np.cbrt(1.1 - x.q)), 0),
            )
        ],
    )
    arc = simulate(system, (-1.0,), (0.0, 10.0), solver=solver, max_jumps=50)
    np.testing.assert_allclose(arc.jumps.t, [1.8 / 0.3, 2.1 / 0.3], rtol=1e-14)


@pytest.mark.parametrize("power", [3, 5, 7])
@given(c=st.floats(-0.5, 0.5), a=st.floats(0.2, 0.5))
def test_flat_roots_on_flights_that_are_polynomials(power, c, a):
    """A power of a polynomial has flat roots, whatever rounding its expanded form would have."""
    system = HybridSystem(
        state=("q",),
        parameters={"c": 0.0, "a": 0.4},
        modes=[Mode("ramp", lambda t, x, p: (0.25,))],
        transitions=[
            Transition("ramp", "ramp", Guard(lambda t, x, p: (x.q + p.a * x.q**2 - p.c) ** power, 1))
        ],
    )
    arc = simulate(system, (-0.9,), (0.0, 10.0), parameters={"c": c, "a": a}, max_jumps=50)
    root = (np.sqrt(1 + 4 * a * c) - 1) / (2 * a)
    if root < -0.9:
        return
    np.testing.assert_allclose(arc.jumps.t, [(root + 0.9) / 0.25], rtol=0, atol=1e-13)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("remainder", [np.mod, np.fmod])
def test_a_remainder_rises_through_its_threshold_and_falls_where_it_begins_anew(solver, remainder):
    saw = HybridSystem(
        state=("q", "n"),
        modes=[Mode("run", lambda t, x, p: (1.0 + 0.0 * np.sin(x.q), 0.0))],
        transitions=[
            Transition("run", "run", Guard(lambda t, x, p: remainder(x.q, 1.5) - 0.4, +1), name="rises"),
            Transition("run", "run", Guard(lambda t, x, p: remainder(x.q, 1.5) - 0.4, -1), name="falls"),
        ],
    )
    arc = simulate(saw, (0.1, 0.0), (0.0, 5.0), solver=solver)
    found = {name: [jump.t for jump in arc.jumps if jump.transition == name] for name in ("rises", "falls")}
    np.testing.assert_allclose(found["rises"], [0.3, 1.8, 3.3, 4.8], atol=1e-8)
    np.testing.assert_allclose(found["falls"], [1.4, 2.9, 4.4], atol=1e-8)
