"""How a guard bends along the flow decides whether a state at rest on it leaves: tables that move."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Reset, StatusCode, Taylor, Transition, simulate

SOLVERS = {"Taylor": Taylor(), "DOP853": DOP853()}
PERIOD = 2 * np.pi


def on_a_table(height, speed, acceleration, beside=()):
    """A ball over a table; ``beside`` are further states and their rates."""
    names, rates = [name for name, _ in beside], [rate for _, rate in beside]

    def others(x):
        return [getattr(x, name) for name in names]

    def moving(t, x, p):
        return [rate(p) + 0.0 * x.q for rate in rates]

    bounce = Transition(
        "flight",
        "flight",
        Guard(lambda t, x, p: x.q - height(t, x, p), -1),
        Reset(lambda t, x, p: [height(t, x, p), -p.e * x.v + (1.0 + p.e) * speed(t, x, p), *others(x)]),
        accumulates_to="rest",
        name="bounce",
    )
    lift = Transition(
        "rest",
        "flight",
        Guard(lambda t, x, p: 1.0 + acceleration(t, x, p), -1),
        Reset(lambda t, x, p: [height(t, x, p), speed(t, x, p), *others(x)]),
        name="lift",
    )
    return HybridSystem(
        state=("q", "v", *names),
        parameters={"A": 0.01, "e": 0.5, "w": PERIOD},
        modes=[
            Mode("flight", lambda t, x, p: [x.v, -1.0 + 0.0 * x.q, *moving(t, x, p)]),
            Mode("rest", lambda t, x, p: [speed(t, x, p), acceleration(t, x, p), *moving(t, x, p)]),
        ],
        transitions=[bounce, lift],
    )


def sine(angle):
    """Height, speed and acceleration of a table that follows the sine of an angle."""
    return (
        lambda t, x, p: p.A * np.sin(angle(t, x, p)),
        lambda t, x, p: p.A * p.w * np.cos(angle(t, x, p)),
        lambda t, x, p: -p.A * p.w**2 * np.sin(angle(t, x, p)),
    )


IN_TIME = on_a_table(*sine(lambda t, x, p: p.w * t))
BESIDE = on_a_table(*sine(lambda t, x, p: p.w * t), [("z", lambda p: 0.0)])
BY_CRANK = on_a_table(*sine(lambda t, x, p: x.s), [("s", lambda p: p.w)])


def drawn(rng):
    """Parameters and the height and speed over the table; the table may throw the ball or not."""
    gamma = rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 2.0)])
    values = {"A": gamma / PERIOD**2, "e": rng.choice([0.0, rng.uniform(0.0, 0.6)])}
    return values, 10.0 ** rng.uniform(-2.0, -0.5), values["A"] * PERIOD


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
def test_an_inert_state_of_any_size_changes_nothing(solver):
    rng = np.random.default_rng(5)
    for _ in range(60):
        values, q, v = drawn(rng)
        options = {"mode": "flight", "parameters": values, "solver": solver}
        plain = simulate(IN_TIME, (q, v), (0.0, 2.5), **options)
        beside = simulate(BESIDE, (q, v, 10.0 ** rng.integers(0, 13)), (0.0, 2.5), **options)
        assert beside.status.code is plain.status.code is StatusCode.SUCCESS
        np.testing.assert_allclose(beside.x[-1, :2], plain.x[-1], atol=1e-6)


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("turns", [0, 1, 1000, 100_000])
def test_a_crank_that_has_turned_before(solver, turns):
    rng = np.random.default_rng(6)
    for _ in range(30):
        values, q, v = drawn(rng)
        options = {"mode": "flight", "parameters": values, "solver": solver}
        start = (q, v, PERIOD * turns)
        arc = simulate(BY_CRANK, start, (0.0, 3.0), **options)
        assert arc.status.ok
        assert (arc.x[:, 0] - values["A"] * np.sin(arc.x[:, 2])).min() > -1e-8


@pytest.mark.parametrize("solver", SOLVERS.values(), ids=SOLVERS)
@pytest.mark.parametrize("gamma", [1.0005, 1.005, 1.02, 1.1])
@pytest.mark.parametrize("e", [0.0, 0.1, 0.5])
def test_a_table_that_hardly_throws_the_ball(gamma, e, solver):
    """At lift-off the ball's acceleration over the table is zero: the third derivative moves it away."""
    values = {"A": gamma / PERIOD**2, "e": e}
    arc = simulate(IN_TIME, (0.05, 0.0), (0.0, 3.0), mode="flight", parameters=values, solver=solver)
    assert arc.status.ok
    assert "lift" in arc.jumps.transition
