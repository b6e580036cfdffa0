"""Held components and counters: what resets alone change."""

import attrs
import numpy as np
import pytest

import lyapunov
from hybrid import (
    ArgumentError,
    Every,
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Reset,
    Transition,
    periodic_orbit,
    saltation_matrix,
    simulate,
    simulate_many,
    split,
)
from hybrid.testing import check_system

A, B, K, T = 1.0, 2.0, 1.2, 0.125
# Ticks of the clock per period of the forcing.
TICKS = 8


def sampled_loop(*, counters=("n",), forcing=0.0, period=None):
    """X' = a x + b u with u := -k x at every T, by a guard on a clock state."""
    control = {"c": lambda t, x, p: 0.0, "u": lambda t, x, p: -p.k * x.x, "n": lambda t, x, p: x.n + 1}
    written = ("c", "u", *counters)
    return HybridSystem(
        state=("x", "c"),
        held=("u",),
        counters=counters,
        parameters={"a": A, "b": B, "k": K},
        modes=[
            Mode("run", lambda t, x, p: (p.a * x.x + p.b * x.u + forcing * np.cos(2 * np.pi * t), 1.0 / T))
        ],
        transitions=[
            Transition(
                "run",
                "run",
                Guard(lambda t, x, p: x.c - 1.0, +1),
                Reset(lambda t, x, p: {name: control[name](t, x, p) for name in written}),
                name="tick",
            )
        ],
        period=period,
    )


def flow(s):
    """Of x, clock and control over a time without ticks."""
    growth = np.exp(A * s)
    return np.array([[growth, 0.0, (growth - 1.0) * B / A], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def jump(x, u):
    """The saltation matrix of a tick at these values."""
    reset = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-K, 0.0, 0.0]])
    before, after = np.array([A * x + B * u, 1 / T, 0.0]), np.array([A * x - B * K * x, 1 / T, 0.0])
    return reset + np.outer(after - reset @ before, [0.0, 1.0, 0.0]) * T


def test_fundamental_matrix_of_a_sampled_loop():
    arc = simulate(sampled_loop(), {"x": 1.0, "c": 0.0}, (0.0, 10.5 * T), tangent=True)
    wanted, x, u = np.eye(3), 1.0, 0.0
    for _ in range(10):
        x = np.exp(A * T) * x + (np.exp(A * T) - 1.0) * B / A * u
        wanted = jump(x, u) @ flow(T) @ wanted
        u = -K * x
    wanted = flow(0.5 * T) @ wanted
    np.testing.assert_allclose(arc.fundamental, wanted, rtol=0, atol=1e-12)
    assert arc["n"][-1] == 10
    assert arc.x.shape[1] == 4


def discrete_multiplier():
    """Of x over one sampling interval, with the control that was set at its begin."""
    growth = np.exp(A * T)
    return growth - (growth - 1.0) * B / A * K


def test_multipliers_and_exponents_of_a_sampled_loop():
    loop = sampled_loop(forcing=1.0, period=1.0)
    orbit = periodic_orbit(loop, {"x": 0.1, "c": 0.5})
    wanted = [1.0, discrete_multiplier() ** TICKS, 0.0]
    assert orbit.status.ok
    assert orbit.x0.shape == (4,)
    np.testing.assert_allclose(orbit.multipliers, wanted, rtol=0, atol=1e-12)
    assert orbit.arc()["n"][-1] == TICKS
    found = lyapunov.lyapunov_spectrum(loop, {"x": 0.1, "c": 0.5}, intervals=50)
    np.testing.assert_allclose(found.exponents[:2], np.log(wanted[:2]), rtol=0, atol=1e-10)
    assert found.exponents[2] == -np.inf


def test_by_a_clock_the_loop_is_the_discrete_one():
    loop = HybridSystem(
        state=("x",),
        held=("u",),
        parameters={"a": A, "b": B, "k": K},
        modes=[Mode("run", lambda t, x, p: (p.a * x.x + p.b * x.u,))],
        transitions=[Transition("run", "run", Every(T), Reset(lambda t, x, p: {"u": -p.k * x.x}))],
        period=T,
    )
    orbit = periodic_orbit(loop, (0.0, 0.0), t0=0.5 * T)
    np.testing.assert_allclose(orbit.multipliers, [discrete_multiplier(), 0.0], rtol=0, atol=1e-12)
    arc = simulate(loop, (1.0,), (0.0, 20 * T), tangent=True)
    tick = np.array([[1.0, 0.0], [-K, 0.0]]) @ flow(T)[np.ix_([0, 2], [0, 2])]
    np.testing.assert_allclose(arc.fundamental, np.linalg.matrix_power(tick, 20), rtol=0, atol=1e-12)


def ball(*, counters=("n",), restitution=0.8):
    changes = {"v": lambda x, p: -p.e * x.v, "n": lambda x, p: x.n + 1}
    written = ("v", *counters)
    return HybridSystem(
        state=("q", "v"),
        counters=counters,
        parameters={"e": restitution},
        modes=[Mode("flight", lambda t, x, p: (x.v, -1.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: {name: changes[name](x, p) for name in written}),
                name="bounce",
            )
        ],
    )


def test_a_counter_counts_bounces():
    arc = simulate(ball(restitution=1.0), (0.5, 0.0), (0.0, 100.0))
    # The first after 1, the others after 2 each.
    assert arc["n"][-1] == len(arc.jumps) == 50
    assert arc["n"].tolist() == arc.j.tolist()
    again = simulate(ball(restitution=1.0), {"q": 0.5, "v": 0.0, "n": 7}, (0.0, 100.0), samples=[50.0])
    assert again["n"].tolist() == [32.0]


@pytest.mark.parametrize("call", [lyapunov.lyapunov_spectrum, lyapunov.covariant_vectors])
def test_exponents_do_not_know_of_a_counter(call):
    options = {"interval": 1.0, "intervals": 20}
    with_counter, without = (
        call(ball(counters=names, restitution=1.0), (0.5, 0.1), **options) for names in (("n",), ())
    )
    np.testing.assert_allclose(with_counter.exponents, without.exponents, rtol=0, atol=1e-9)
    if call is lyapunov.lyapunov_spectrum:
        assert abs(with_counter.sum_defect) < 1e-9
    else:
        assert with_counter.to_xarray().vectors.shape == (20, 3, 2)


def test_tangents_sensitivities_and_saltation_have_no_counter():
    with_counter, without = (
        simulate(ball(counters=names), (0.5, 0.0), (0.0, 1.7), tangent=True, sensitivities=("e",))
        for names in (("n",), ())
    )
    for name in ("fundamental", "sensitivity"):
        np.testing.assert_allclose(
            getattr(with_counter, name), getattr(without, name), rtol=1e-9, atol=1e-12, err_msg=name
        )
    for name in ("t_gradient", "t_sensitivity", "saltation"):
        np.testing.assert_allclose(
            getattr(with_counter.jumps, name), getattr(without.jumps, name), rtol=1e-9, atol=1e-12
        )
    assert with_counter.to_xarray().fundamental.shape == (3, 2)
    matrix = saltation_matrix(ball(), "bounce", 0.0, (0.0, -1.0))
    np.testing.assert_allclose(matrix, [[-0.8, 0.0], [1.8, -0.8]], rtol=1e-14)
    vectors = simulate(ball(), (0.5, 0.0), (0.0, 1.7), tangent=[1.0, 0.0]).fundamental
    np.testing.assert_allclose(vectors, with_counter.fundamental[:, :1], rtol=1e-9)


def test_an_autonomous_orbit_closes_whatever_it_counts():
    orbit = periodic_orbit(ball(restitution=1.0), {"q": 0.5, "v": 0.0, "n": 3}, period=2.0)
    assert orbit.status.ok
    assert orbit.period == pytest.approx(2.0, abs=1e-10)
    assert orbit.multipliers.shape == (2,)
    assert orbit.fundamental.shape == (2, 2)
    assert orbit.to_xarray().fundamental.shape == (3, 2)


def test_a_held_component_has_a_sensitivity():
    """An unheld control k: x after the first tick is linear in the gain."""
    loop = sampled_loop()
    arc = simulate(loop, {"x": 1.0, "c": 0.0}, (0.0, 1.5 * T), sensitivities=("k",))
    before, after = np.exp(A * T), np.exp(0.5 * A * T) - 1.0
    np.testing.assert_allclose(arc.sensitivity, [[-before * after * B / A], [0.0], [-before]], atol=1e-12)


@pytest.mark.parametrize(
    "x0",
    [
        {"x": 1.0, "c": 0.0},
        {"x": 1.0, "c": 0.0, "n": 0},
        {"u": 0.0, "c": 0.0, "x": 1.0},
        (1.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),
    ],
)
def test_starts(x0):
    arc = simulate(sampled_loop(), x0, (0.0, T / 2))
    assert arc.x[0] == pytest.approx([1.0, 0.0, 0.0, 0.0], rel=1e-14)


def test_many_starts_by_name():
    found = simulate_many(ball(restitution=1.0), {"q": [0.5, 2.0], "v": 0.0}, (0.0, 10.0))
    assert found.x_end.sel(state="n").values.tolist() == [5.0, 3.0]


@pytest.mark.parametrize(
    ("x0", "text"),
    [
        ({"x": 1.0, "c": 0.0, "n": 0.5}, "counter 'n' must be a whole number; got 0.5"),
        ((1.0, 0.0, 0.0, 1e-9), "counter 'n' must be a whole number"),
        ({"x": 1.0}, "lacks c"),
        ((1.0, 0.0, 0.0), "needs shape"),
        ({"x": 1.0, "c": 0.0, "w": 0.0}, "'w' does not exist"),
    ],
)
def test_refused_starts(x0, text):
    with pytest.raises(ArgumentError, match=text):
        simulate(sampled_loop(), x0, (0.0, 1.0))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"state": 2}, "held and counters are read by name"),
        ({"held": ("x",)}, "'x' is the name of a state and of a held component"),
        ({"counters": ("u",)}, "'u' is the name of a held component and of a counter"),
        ({"parameters": {"a": A, "b": B, "k": K, "n": 1.0}}, "'n' is the name of a counter and of a param"),
        ({"held": ("u", "u")}, "held names must differ"),
        ({"counters": ("1n",)}, "counters name '1n'"),
        ({"modes": [Mode("run", lambda t, x, p: (0.0, 1.0, 0.0))]}, "has no field: u, n"),
    ],
)
def test_refused_models(changes, text):
    with pytest.raises(ModelError, match=text):
        attrs.evolve(sampled_loop(), **changes)


@pytest.mark.parametrize(
    ("reset", "text"),
    [
        (lambda t, x, p: {"n": 0.5 * x.n}, "gives counter 'n' the value"),
        (lambda t, x, p: {"n": x.x}, "gives counter 'n' the value"),
        (lambda t, x, p: {"w": 0.0}, "State components: x, c, u, n"),
    ],
)
def test_refused_resets(reset, text):
    loop = sampled_loop()
    wrong = attrs.evolve(loop.transitions[0], reset=Reset(reset))
    with pytest.raises(ModelError, match=text):
        attrs.evolve(loop, transitions=[wrong])


def test_given_derivatives_have_columns_for_all_components():
    loop = sampled_loop()
    tick = loop.transitions[0]
    rows = ((1.0, 0.0, 0.0, 0.0), (0.0,) * 4, (-K, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    given = attrs.evolve(
        loop,
        modes=[
            attrs.evolve(loop.modes[0], jacobian=lambda t, x, p: ((p.a, 0.0, p.b, 0.0), (0.0, 0.0, 0.0, 0.0)))
        ],
        transitions=[
            attrs.evolve(
                tick,
                guard=Guard(tick.guard.function, +1, gradient=lambda t, x, p: (0.0, 1.0, 0.0, 0.0)),
                reset=Reset(tick.reset.function, jacobian=lambda t, x, p: rows),
            )
        ],
    )
    found, wanted = (
        simulate(each, (1.0, 0.0), (0.0, 5.5 * T), tangent=True).fundamental for each in (given, loop)
    )
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13)
    with pytest.raises(ModelError, match="2 rows of 4 or 5 values"):
        attrs.evolve(loop, modes=[attrs.evolve(loop.modes[0], jacobian=lambda t, x, p: ((p.a, 0.0),))])


@pytest.mark.parametrize(
    "after",
    [
        lambda t, x, p: (0.0, x.u + 1, x.n + 1) if p.c > 0 else (0.0, x.u, x.n),
        lambda t, x, p: {"u": x.u + (1 if p.c > 0 else 2), "n": x.n + 1, "q": 0.0},
    ],
)
def test_functions_that_cannot_be_traced(after):
    def system(field, reset):
        return HybridSystem(
            state=("q",),
            held=("u",),
            counters=("n",),
            parameters={"c": 1.0},
            modes=[Mode("run", field)],
            transitions=[Transition("run", "run", Guard(lambda t, x, p: x.q - 1.0, +1), Reset(reset))],
        )

    traced = system(lambda t, x, p: (p.c * x.u,), lambda t, x, p: (0.0, x.u + 1, x.n + 1))
    opaque = system(lambda t, x, p: (p.c * x.u if p.c > 0 else x.u,), after)
    found, wanted = (simulate(each, (0.0, 1.0, 0), (0.0, 2.9), tangent=True) for each in (opaque, traced))
    assert found["n"][-1] == wanted["n"][-1] > 1
    np.testing.assert_allclose(found.fundamental, wanted.fundamental, rtol=0, atol=1e-12)


def test_split_keeps_what_is_held():
    rubbing = HybridSystem(
        state=("x", "v"),
        held=("u",),
        counters=("n",),
        modes=[Mode("block", lambda t, x, p: (x.v, -0.3 * np.sign(x.v) - x.x + x.u))],
        transitions=[
            Transition("block", "block", Every(1.0), Reset(lambda t, x, p: {"u": -0.5 * x.v, "n": x.n + 1}))
        ],
    )
    parts = split(rubbing)
    assert (parts.state, parts.held, parts.counters) == (("x", "v"), ("u",), ("n",))
    arc = simulate(parts, {"x": 1.0, "v": 0.5}, (0.0, 7.5), tangent=True)
    assert arc.status.ok
    assert arc["n"][-1] == 7
    assert arc.fundamental.shape == (3, 3)


@pytest.mark.parametrize("system", [ball(), sampled_loop(counters=())])
def test_check_system(system):
    check_system(system, examples=10)


def test_guards_and_fields_read_counters():
    """A ball that leaves at its fifth bounce; a growth rate that is counted."""
    bouncing = ball(restitution=1.0)
    leaving = Transition("flight", None, Guard(lambda t, x, p: x.n - 4.5, +1), name="enough")
    arc = simulate(
        attrs.evolve(bouncing, transitions=[*bouncing.transitions, leaving]), (0.5, 0.0), (0, 20.0)
    )
    assert arc["n"][-1] == 5
    assert arc.t[-1] == pytest.approx(9.0, abs=1e-12)
    growing = HybridSystem(
        state=("q",),
        counters=("n",),
        modes=[Mode("run", lambda t, x, p: (x.n * x.q,))],
        transitions=[Transition("run", "run", Every(1.0), Reset(lambda t, x, p: {"n": x.n + 1}))],
    )
    arc = simulate(growing, (1.0,), (0.0, 2.5), tangent=True)
    np.testing.assert_allclose([arc["q"][-1], arc.fundamental[0, 0]], np.exp(2.0), rtol=1e-9)


def test_repr_lists_them():
    told = repr(sampled_loop())
    assert "state: x, c\nheld: u\ncounters: n\n" in told
