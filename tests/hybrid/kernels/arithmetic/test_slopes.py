"""Kernels read no cell of a Jacobian that is left alone because it is proved zero."""

import numpy as np
import pytest
from numba import njit

import models
from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, simulate
from hybrid.compiler.cache.loader import load_kernels
from hybrid.compiler.compiled import compile_system
from hybrid.kernels.arithmetic import slopes
from hybrid.simulation.trajectory import start

_opposites, _change, _spread = slopes.jacobian_with_opposites, slopes.change_of_rate, slopes.spread_of_rate


@njit
def opposites(model, mode, t, x, out):
    _opposites(model, mode, t, x, out)


@njit
def changes_and_spreads(model, mode, jacobian, direction, sizes, out):
    for i in range(model.dimension):
        out[i, 0] = _change(model, mode, i, jacobian, direction)
        out[i, 1] = _spread(model, mode, i, jacobian, sizes)


def chain(n, push=0.0, e=0.8):
    """Masses on cubic springs; the last one hits a wall, on which a push makes it come to rest."""

    def field(t, x, p):
        q, v = x[:n], x[n:]
        stretch = np.diff(np.concatenate([[0.0], q]))
        pull = 2.0 * stretch + 0.5 * stretch**3
        return np.concatenate([v, np.append(pull[1:], 0.0) - pull + p.push + 0.3 * np.cos(1.3 * t)])

    def back(t, x, p):
        return [*x[:-1], -p.e * x[-1]]

    wall = Transition("swing", "swing", Guard(lambda t, x, p: x[n - 1] - p.gap, +1), Reset(back))
    return HybridSystem(
        state=2 * n,
        parameters={"gap": 0.5, "e": e, "push": push},
        modes=[Mode("swing", field)],
        transitions=[wall],
    )


def bent_ball():
    """A ball that falls onto a hill, and bounces until it rests."""

    def height(t, x, p):
        return x.y - 0.1 * x.x**2

    def bounce(t, x, p):
        normal = (x.v - 0.2 * x.x * x.u) / (1.0 + 0.04 * x.x**2)
        return x.x, x.y, x.u + 1.4 * 0.2 * x.x * normal, x.v - 1.4 * normal

    return HybridSystem(
        state=("x", "y", "u", "v"),
        modes=[Mode("flight", lambda t, x, p: (x.u, x.v, -0.1 * x.u, -1.0 - 0.1 * x.v))],
        transitions=[Transition("flight", "flight", Guard(height, -1), Reset(bounce))],
    )


CASES = {
    "chain": (lambda: chain(4), [0.05 * (i + 1) for i in range(8)], 6.0),
    "chatter": (lambda: chain(2, push=2.0, e=0.5), [0.1, 0.2, 0.3, 0.4], 9.0),
    "bent": (bent_ball, [0.3, 1.0, 0.1, 0.0], 3.0),
    "contact": (models.vibroimpact, [-0.0077, -0.0041, 0.0557, -0.3562], 4.0),
    "friction": (models.stick_slip, [1.0, 0.2], 12.0),
}


def end_of(system, x0, t_end, solver, tangent, spoil):
    trajectory = start(system, x0, 0.0, solver=solver, tangent=tangent)
    if spoil:
        trajectory.work.jacobian[:] = trajectory.work.reset_jacobian[:] = 1e200
    code = trajectory.advance(t_end, trajectory.no_record())
    return code, trajectory.jumps, trajectory.run.y.copy()


@pytest.mark.parametrize(
    "solver", [Taylor(), DOP853(), RadauIIA(rtol=1e-6)], ids=lambda each: type(each).__name__
)
@pytest.mark.parametrize("tangents", [0, 1])
@pytest.mark.parametrize("name", CASES)
def test_what_the_scratch_memory_held_does_not_matter(name, tangents, solver):
    model, x0, t_end = CASES[name]
    system = model()
    tangent = np.ones((system.dimension, 1)) if tangents else None
    clean = end_of(system, x0, t_end, solver, tangent, False)
    spoiled = end_of(system, x0, t_end, solver, tangent, True)
    assert clean[:2] == spoiled[:2]
    assert clean[1] > 0
    np.testing.assert_array_equal(clean[2], spoiled[2])


@pytest.mark.parametrize("name", CASES)
def test_cells_that_are_left_alone_are_zero(name):
    system = CASES[name][0]()
    compiled, n = compile_system(system), system.dimension
    model = compiled.model()
    kernel = load_kernels("hybrid.kernels.steps.step").jacobian_at
    rng = np.random.default_rng(3)
    for mode, rows in enumerate(compiled.emitted.slope_columns):
        written = np.zeros((n, n + 1), dtype=bool)
        written[:, n] = True
        for i, columns in enumerate(rows):
            written[i, list(columns)] = True
        places = zip(model.first_slope[mode], model.first_slope[mode, 1:], strict=False)
        held = [tuple(model.slope_column[a:b]) for a, b in places]
        assert held == [tuple(columns) for columns in rows]
        for _ in range(5):
            out = np.full((n, n + 1), np.nan)
            kernel(model, mode, 0.3, rng.normal(size=n), out)
            assert not np.any(out[~written])
            assert np.all(np.isfinite(out))


def test_a_hit_of_a_large_system_costs_no_matrix():
    """Of 60 states, each rate depends on a few: so do the cells that a hit evaluates."""
    rows = compile_system(chain(30)).emitted.slope_columns[0]
    assert max(map(len, rows)) == 3
    assert simulate(chain(30), np.linspace(0.0, 0.45, 60), (0.0, 1.0)).status


@pytest.mark.parametrize("name", CASES)
def test_sums_over_the_cells_that_are_not_left_alone(name):
    """They are those over whole rows, and each cell whose opposite is none of them is zero."""
    system = CASES[name][0]()
    compiled, n = compile_system(system), system.dimension
    model = compiled.model()
    kernel = load_kernels("hybrid.kernels.steps.step").jacobian_at
    rng = np.random.default_rng(4)
    for mode, rows in enumerate(compiled.emitted.slope_columns):
        x, direction = rng.normal(size=n), rng.normal(size=n)
        whole, found, sums = np.empty((n, n + 1)), np.full((n, n + 1), np.nan), np.empty((n, 2))
        kernel(model, mode, 0.3, x, whole)
        opposites(model, mode, 0.3, x, found)
        held = np.zeros((n, n), dtype=bool)
        for i, columns in enumerate(rows):
            held[i, list(columns)] = True
        expected = np.where(held | held.T, whole[:, :n], np.nan)
        np.testing.assert_array_equal(found[:, :n], expected)
        changes_and_spreads(model, mode, found, direction, np.abs(direction), sums)
        np.testing.assert_allclose(sums[:, 0], whole[:, :n] @ direction, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(
            sums[:, 1], np.abs(whole[:, :n]) @ np.abs(direction), rtol=1e-14, atol=1e-14
        )
