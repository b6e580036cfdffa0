"""Guards whose sign a step may not tell: states below their tolerance, fields with roots at a guard."""

import numpy as np
import pytest

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
from hybrid.status import StatusCode

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5(), "RadauIIA": RadauIIA()}
each_solver = pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)


def watched(state, field, guard, direction=-1):
    return HybridSystem(
        state=state,
        modes=[Mode("m", field)],
        transitions=[Transition("m", None, Guard(guard, direction), name="zero")],
    )


DECAYS = {
    "linear": (("h",), lambda t, x, p: (-x.h,), lambda t, x, p: x.h, (1.0,)),
    "cubic": (("h",), lambda t, x, p: (-x.h - x.h**3,), lambda t, x, p: x.h, (1.0,)),
    "saturating": (("h",), lambda t, x, p: (-np.tanh(x.h),), lambda t, x, p: x.h, (1.0,)),
    "difference": (
        ("h", "k"),
        lambda t, x, p: (-x.h, -3.0 * x.k * (1.0 + 0.1 * np.sin(x.h))),
        lambda t, x, p: x.h - 0.5 * x.k,
        (1.0, 1.0),
    ),
    "overdamped": (
        ("q", "v"),
        lambda t, x, p: (x.v, -np.sin(x.q) - 3 * x.v),
        lambda t, x, p: x.q,
        (1.0, 0.0),
    ),
    "bent guard": (
        ("q", "v"),
        lambda t, x, p: (x.v, -np.sin(x.q) - 3 * x.v),
        lambda t, x, p: x.q * (2.0 + np.cos(x.v)),
        (1.0, 0.0),
    ),
}


@each_solver
@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("name", DECAYS)
def test_a_decay_never_crosses_zero(name, direction, solver):
    """All the way below the absolute tolerance and down to underflow, the state keeps its sign.

    Tsit5 has so few digits that it loses the sign of a difference of two decays near 1e-136.
    """
    state, field, guard, start = DECAYS[name]
    end = 300.0 if isinstance(solver, Tsit5) else 1000.0
    arc = simulate(watched(state, field, guard, direction), start, (0.0, end), mode="m", solver=solver)
    assert arc.status.ok
    assert len(arc.jumps) == 0


ROOTS = {
    "square root": (lambda h: -np.sqrt(np.abs(h)) * np.sign(h), 2.0),
    "square root of the positive part": (lambda h: -np.sqrt(np.maximum(h, 0.0)), 2.0),
    "square root, no level below": (lambda h: -np.sqrt(h), 2.0),
    "cube root": (lambda h: -np.cbrt(h), 1.5),
    "dry friction": (lambda h: -np.sign(h), 1.0),
    "fourth root": (lambda h: -(np.abs(h) ** 0.25) * np.sign(h), 4.0 / 3.0),
}


@each_solver
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
@pytest.mark.parametrize("name", ROOTS)
def test_a_level_with_a_root_in_its_rate_reaches_its_guard(name, unit, solver):
    """The level comes to rest at zero in finite time; that arrival is the event.

    Below the absolute tolerance the level is not known, so the time is known up to the fall from there.
    """
    rate, end = ROOTS[name]
    system = watched(("h",), lambda t, x, p: (unit * rate(x.h / unit),), lambda t, x, p: x.h)
    solver = type(solver)(atol=1e-12 * unit)
    arc = simulate(system, (unit,), (0.0, 3.0), mode="m", solver=solver)
    assert arc.status.code == StatusCode.TERMINAL
    assert abs(arc.jumps.t[0] - end) < 5e-5
    assert abs(arc.x[-1, 0]) < 1e-12 * unit


HELD = {name: ROOTS[name] for name in ("square root", "cube root", "dry friction", "fourth root")}


@each_solver
@pytest.mark.parametrize("reset", [None, lambda t, x, p: (x.h,)], ids=["marker", "identity"])
@pytest.mark.parametrize("name", HELD)
def test_a_state_that_its_field_holds_on_a_guard_arrives_once(name, reset, solver):
    """Transitions that change nothing do not free the state: the run says that it rests there."""
    rate, end = HELD[name]
    for direction in (-1, 0):
        for unit, tolerance in ((1.0, 1e-9), (1.0, 1e-6), (1e6, 1e-4)):
            system = HybridSystem(
                state=("h",),
                modes=[Mode("m", lambda t, x, p, unit=unit: (unit * rate(x.h / unit),))],
                transitions=[
                    Transition(
                        "m",
                        "m",
                        Guard(lambda t, x, p: x.h, direction),
                        Reset(reset) if reset else None,
                        name="zero",
                    )
                ],
            )
            chosen = type(solver)(rtol=1e-6, atol=tolerance)
            arc = simulate(system, (unit,), (0.0, 3.0), mode="m", solver=chosen)
            assert arc.status.code == StatusCode.ACCUMULATION
            assert "'zero'" in arc.status.message
            # Dry friction may bring the state back once, from beyond the guard.
            assert len(arc.jumps) <= (2 if name == "dry friction" else 1)
            assert arc.t[-1] == pytest.approx(end, abs=1e-2)


@each_solver
@pytest.mark.parametrize("name", HELD)
def test_two_modes_with_such_a_field_do_not_toggle_without_end(name, solver):
    rate, end = HELD[name]
    system = HybridSystem(
        state=("h",),
        modes=[Mode(mode, lambda t, x, p: (rate(x.h),)) for mode in "uv"],
        transitions=[Transition(a, b, Guard(lambda t, x, p: x.h), name=a + b) for a, b in ("uv", "vu")],
    )
    arc = simulate(system, (1.0,), (0.0, 3.0), mode="u", solver=solver)
    assert arc.status.code == StatusCode.ACCUMULATION
    assert [jump.transition for jump in arc.jumps] in (["uv"], ["uv", "vu"])
    assert arc.t[-1] == pytest.approx(end, abs=1e-4)


@each_solver
def test_a_mode_for_the_rest_takes_over(solver):
    system = HybridSystem(
        state=("h", "s"),
        modes=[
            Mode("sink", lambda t, x, p: (-np.cbrt(x.h), 0.0)),
            Mode("rest", lambda t, x, p: (0.0, 1.0)),
        ],
        transitions=[
            Transition("sink", "sink", Guard(lambda t, x, p: x.h), name="zero", accumulates_to="rest")
        ],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 4.0), mode="sink", solver=solver)
    assert arc.status.ok
    assert arc.mode[-1] == "rest"
    np.testing.assert_allclose(arc.x[-1], [0.0, 2.5], rtol=0, atol=1e-5)


@each_solver
def test_a_smooth_field_that_attracts_to_a_guard_does_not_hold_the_state(solver):
    """A reset puts the state on the guard ``h``, which both modes watch; the motion along it goes on."""
    system = HybridSystem(
        state=("h", "s"),
        modes=[Mode(mode, lambda t, x, p: (-x.h, 1.0)) for mode in "uv"],
        transitions=[
            *(Transition(a, b, Guard(lambda t, x, p: x.h), name=a + b) for a, b in ("uv", "vu")),
            Transition(
                "u", "v", Guard(lambda t, x, p: x.s - 1.0), Reset(lambda t, x, p: (0.0, x.s)), name="set"
            ),
        ],
    )
    arc = simulate(system, (1.0, 0.0), (0.0, 3.0), mode="u", solver=solver)
    assert arc.status.ok
    assert arc.x[-1, 1] == pytest.approx(3.0)


PASSED = {
    # The guard, and whether it jumps from one sign to the other where the signal passes the level.
    "slopes that meet in a jump": lambda s, p: np.where(s > 0, p.a * s + p.b, s),
    "steps": lambda s, p: np.where(s > 0, p.b, -p.a),
    "a sign": lambda s, p: p.a * np.sign(s),
    "a saw": lambda s, p: s + p.b * np.heaviside(s, 1.0),
    "a cube root": lambda s, p: np.cbrt(s),
    "a fifth power": lambda s, p: p.a * s**5,
    "a steep slope": lambda s, p: 1e4 * p.a * s,
    "a pole": lambda s, p: np.where(s > 0, 1 / (s + 1e-3), s),
}


@each_solver
@pytest.mark.parametrize("name", PASSED)
def test_a_state_that_passes_its_guard_does_not_rest_there(name, solver):
    """Whatever the guard does beside its zero, the signal passes the level twice per period and goes on."""
    guard, level = PASSED[name], -0.37
    first = np.arccos(level)
    passages = np.array([[2 * np.pi * k + first, 2 * np.pi * (k + 1) - first] for k in range(3)])
    for direction, times in ((-1, passages[:, 0]), (0, passages.ravel()), (1, passages[:, 1])):
        system = HybridSystem(
            state=("q", "v"),
            modes=[Mode("m", lambda t, x, p: (x.v, -x.q))],
            transitions=[
                Transition("m", "m", Guard(lambda t, x, p: guard(x.q - level, p), direction), name="passes")
            ],
            parameters={"a": 1.0, "b": 1.0},
        )
        for a, b in ((1.0, 1.0), (0.01, 3.0), (30.0, 1e-6)):
            arc = simulate(system, (1.0, 0.0), (0.0, 6 * np.pi), parameters={"a": a, "b": b}, solver=solver)
            assert arc.status.code == StatusCode.SUCCESS
            assert arc.jumps.t == pytest.approx(times, abs=1e-5)


@each_solver
def test_a_guard_that_jumps_between_slopes_is_passed(solver):
    """The guard is ``arctan`` of a mixed signal, moved apart above its level."""

    def guard(t, x, p):
        s = np.arctan(p.c * (x.q + 0.3 * x.v)) - p.level
        return np.where(s > 0, p.a * s + p.b, s)

    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("m", lambda t, x, p: (x.v, -p.w * p.w * x.q))],
        transitions=[Transition("m", "m", Guard(guard), name="passes")],
        parameters={"a": 1.0, "b": 1.0, "c": 1.0, "level": 0.0, "w": 1.0},
    )
    generator = np.random.default_rng(0)
    times = np.linspace(0.0, 10.0, 20001)
    for _ in range(20):
        a, b, c, level, w = generator.uniform((0.5, 0.1, 0.3, -0.9, 0.5), (5.0, 1.0, 3.0, 0.9, 3.0))
        q = 0.63 * np.cos(w * times) - 0.91 / w * np.sin(w * times)
        v = -0.63 * w * np.sin(w * times) - 0.91 * np.cos(w * times)
        beyond = np.arctan(c * (q + 0.3 * v)) > level
        values = {"a": a, "b": b, "c": c, "level": level, "w": w}
        arc = simulate(system, (0.63, -0.91), (0.0, 10.0), parameters=values, solver=solver)
        assert arc.status.code == StatusCode.SUCCESS
        assert arc.jumps.t == pytest.approx(times[1:][beyond[1:] != beyond[:-1]], abs=5e-4)


@each_solver
@pytest.mark.parametrize("name", PASSED)
@pytest.mark.parametrize("directions", [(-1, 1), (-1, 0, 1), (0, -1), (1, 1, -1, 0)])
def test_every_transition_on_a_guard_fires_once_at_its_passages(name, directions, solver):
    """Markers and counters watch one guard; those in the other direction, or fired before, do not matter."""
    guard, level = PASSED[name], -0.37
    first = np.arccos(level)
    down = np.array([2 * np.pi * k + first for k in range(3)])
    up = np.array([2 * np.pi * (k + 1) - first for k in range(3)])
    times = {-1: down, 0: np.sort([*down, *up]), 1: up}
    system = HybridSystem(
        state=("q", "v", "count"),
        modes=[Mode("m", lambda t, x, p: (x.v, -x.q, 0.0))],
        transitions=[
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: guard(x.q - level, p), direction),
                Reset(lambda t, x, p: (x.q, x.v, x.count + 1)) if place % 2 else None,
                name=f"{place}",
            )
            for place, direction in enumerate(directions)
        ],
        parameters={"a": 1.0, "b": 1.0},
    )
    for a, b in ((1.0, 1.0), (30.0, 1e-6)):
        arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 6 * np.pi), parameters={"a": a, "b": b}, solver=solver)
        assert arc.status.code == StatusCode.SUCCESS
        for place, direction in enumerate(directions):
            found = arc.jumps.t[arc.jumps.transition == f"{place}"]
            assert found == pytest.approx(times[direction], abs=1e-5)
        assert arc.x[-1, 2] == sum(len(times[direction]) for direction in directions[1::2])


@each_solver
@pytest.mark.parametrize("power", [1, 3, 5, 7, 9])
def test_a_flat_root_is_as_exact_as_what_it_is_a_power_of(power, solver):
    """Where value and speed of a guard are rounding, their quotient moves no event, and none comes twice."""
    system = HybridSystem(
        state=("q", "v", "count"),
        modes=[Mode("m", lambda t, x, p: (x.v, -p.w * p.w * x.q, 0.0))],
        transitions=[
            Transition(
                "m",
                "m",
                Guard(lambda t, x, p: (np.sin(2.0 * x.q * x.v) - 0.3) ** power),
                Reset(lambda t, x, p: (x.q, x.v, x.count + 1)),
            )
        ],
        parameters={"w": 2.0},
    )
    for w in (1.3, 2.3, 2.6):
        # q v is -w sin(2 w t)/2, and passes the places where its sine is 0.3.
        span = 8.0 * np.pi / w
        angle = np.arcsin(0.3) + np.array([0.0, 2.0, -2.0]) * np.pi
        levels = np.array([*angle, *(np.pi - angle)]) / 2.0
        levels = levels[abs(levels) < w / 2]
        arc = simulate(system, (1.0, 0.0, 0.0), (0.0, span), parameters={"w": w}, solver=solver)
        assert len(arc.jumps) == 2 * 8 * len(levels)
        product = arc.jumps.x_minus[:, 0] * arc.jumps.x_minus[:, 1]
        assert np.abs(np.sin(2.0 * product) - 0.3).max() < 2e-14
