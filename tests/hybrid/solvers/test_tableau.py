"""Butcher's order conditions for the printed numbers, and the orders themselves."""

import numpy as np
import pytest

import hybrid
from hybrid.solvers.tableau import Tableau, bernstein_from_powers, times_one_minus_theta, times_theta

SOLVERS = (hybrid.DOP853, hybrid.Tsit5)
every_solver = pytest.mark.parametrize("solver", SOLVERS)


def bernstein_value(coefficients, theta):
    from math import comb

    degree = len(coefficients) - 1
    basis = np.array([comb(degree, k) * theta**k * (1 - theta) ** (degree - k) for k in range(degree + 1)])
    return basis @ coefficients


def rooted_trees(order):
    """Rooted trees with up to ``order`` nodes, by size, each the sorted tuple of its branches."""
    trees = {1: [()]}
    for size in range(2, order + 1):
        found = set()

        def grow(branches, left, largest, found=found):
            if left == 0:
                found.add(tuple(sorted(branches)))
            for part in range(min(left, largest), 0, -1):
                for branch in trees[part]:
                    grow([*branches, branch], left - part, part)

        grow([], size - 1, size - 1)
        trees[size] = sorted(found)
    return trees


def nodes(tree):
    return 1 + sum(nodes(branch) for branch in tree)


def density(tree):
    """The factor gamma: the weight of a tree must be 1 / gamma."""
    result = nodes(tree)
    for branch in tree:
        result *= density(branch)
    return result


def stage_weights(tree, a):
    """Product over the branches of what they contribute to each stage."""
    result = np.ones(len(a))
    for branch in tree:
        result = result * (a @ stage_weights(branch, a))
    return result


TREES = rooted_trees(8)


def test_number_of_rooted_trees():
    assert [len(TREES[size]) for size in range(1, 9)] == [1, 1, 2, 4, 9, 20, 48, 115]


@every_solver
def test_rows_sum_to_their_times(solver):
    tableau = solver.tableau
    np.testing.assert_allclose(tableau.a.sum(axis=1), tableau.c, atol=2e-14)
    assert tableau.c[0] == 0.0
    assert np.all(np.triu(tableau.a) == 0.0), "not explicit"


@every_solver
def test_row_of_the_new_point_is_the_step(solver):
    tableau = solver.tableau
    s = len(tableau.b)
    np.testing.assert_array_equal(tableau.a[s, :s], tableau.b)
    assert tableau.c[s] == 1.0


@every_solver
def test_quadrature(solver):
    tableau = solver.tableau
    c = tableau.c[: len(tableau.b)]
    for power in range(tableau.order):
        assert tableau.b @ c**power == pytest.approx(1 / (power + 1), abs=1e-14)
    assert tableau.b @ c**tableau.order != pytest.approx(1 / (tableau.order + 1), abs=1e-9)


@every_solver
def test_all_order_conditions(solver):
    tableau = solver.tableau
    s = len(tableau.b)
    a = tableau.a[:s, :s]
    for size in range(1, tableau.order + 1):
        for tree in TREES[size]:
            assert tableau.b @ stage_weights(tree, a) == pytest.approx(1 / density(tree), abs=5e-13), tree


@every_solver
def test_error_estimates_vanish_to_their_orders(solver):
    """An estimate compares two methods; both are exact for the trees below its order."""
    tableau = solver.tableau
    s = len(tableau.b) + 1
    a = tableau.a[:s, :s]
    orders = (5, 3) if solver is hybrid.DOP853 else (4, 0)
    for weights, order in zip((tableau.error, tableau.second_error), orders, strict=True):
        for size in range(1, order + 1):
            for tree in TREES[size]:
                assert weights @ stage_weights(tree, a) == pytest.approx(0.0, abs=1e-12)
        if order:
            assert max(abs(weights @ stage_weights(tree, a)) for tree in TREES[order + 1]) > 1e-6
        else:
            assert not np.any(weights)


@every_solver
def test_interpolant_joins_the_ends(solver):
    """Value and slope at both ends: Bernstein form shows them in its first and last two rows."""
    tableau = solver.tableau
    s, degree = len(tableau.b), len(tableau.interpolant) - 1
    step = np.zeros(len(tableau.a))
    step[:s] = tableau.b
    np.testing.assert_array_equal(tableau.interpolant[0], 0.0)
    np.testing.assert_allclose(tableau.interpolant[-1], step, atol=2e-14)
    start, end = np.eye(len(step))[0], np.eye(len(step))[s]
    np.testing.assert_allclose(degree * tableau.interpolant[1], start, atol=1e-12)
    np.testing.assert_allclose(degree * (tableau.interpolant[-1] - tableau.interpolant[-2]), end, atol=1e-12)


@every_solver
def test_order_conditions_of_the_interpolant(solver):
    tableau = solver.tableau
    order = 7 if solver is hybrid.DOP853 else 4
    for theta in (0.2, 0.5, 0.83):
        weights = bernstein_value(tableau.interpolant, theta)
        for size in range(1, order + 1):
            for tree in TREES[size]:
                expected = theta**size / density(tree)
                assert weights @ stage_weights(tree, tableau.a) == pytest.approx(expected, abs=1e-11), tree


def test_products_of_bernstein_forms():
    rows = np.array([[1.0, 2.0], [-3.0, 0.5], [2.0, 4.0]])
    for theta in (0.0, 0.3, 1.0):
        value = bernstein_value(rows, theta)
        np.testing.assert_allclose(bernstein_value(times_theta(rows), theta), theta * value)
        np.testing.assert_allclose(bernstein_value(times_one_minus_theta(rows), theta), (1 - theta) * value)


def test_bernstein_from_powers():
    rows = np.array([[1.0], [-2.0], [0.5], [3.0]])
    for theta in (0.0, 0.4, 1.0):
        expected = 1 - 2 * theta + 0.5 * theta**2 + 3 * theta**3
        assert bernstein_value(bernstein_from_powers(rows), theta)[0] == pytest.approx(expected)


def order_of(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def smooth():
    """``x' = x cos t`` and a square: ``x = exp(sin t)``, ``y' = -2 t y^2``, ``y = 1 / (1 + t^2)``."""
    return hybrid.HybridSystem(
        state=("x", "y"),
        modes=[hybrid.Mode("all", lambda t, x, p: (x.x * np.cos(t), -2 * t * x.y**2))],
    )


def smooth_exact(t):
    return np.stack([np.exp(np.sin(t)), 1 / (1 + t**2)], axis=-1)


@pytest.fixture(scope="module")
def fixed_steps():
    """Arcs with fixed steps, by solver and step."""
    system, arcs = smooth(), {}
    steps = {hybrid.DOP853: (1 / 3, 1 / 4, 1 / 6, 1 / 8), hybrid.Tsit5: (1 / 8, 1 / 16, 1 / 32, 1 / 64)}
    for solver in SOLVERS:
        for step in steps[solver]:
            method = solver(rtol=1.0, atol=1.0, max_step=step)
            arcs[solver, step] = hybrid.simulate(system, (1.0, 1.0), (0.0, 4.0), solver=method)
    return arcs


@every_solver
def test_steps_are_fixed(fixed_steps, solver):
    for (kind, step), arc in fixed_steps.items():
        if kind is solver:
            lengths = np.diff(arc.t)
            assert np.mean(np.abs(lengths - step) < 1e-9) > 0.6
            assert lengths.max() < step + 1e-9
            assert arc.rejected == 0


@every_solver
def test_order_of_the_step(fixed_steps, solver):
    errors, steps = [], []
    for (kind, step), arc in fixed_steps.items():
        if kind is solver:
            errors.append(np.abs(arc.x - smooth_exact(arc.t)).max())
            steps.append(step)
    assert -0.3 < order_of(errors, steps) - solver.tableau.order < 1


@every_solver
def test_order_of_the_interpolant(fixed_steps, solver):
    """The error over one step is one order higher, like the local error of a method of that order."""
    t = np.linspace(0.0, 4.0, 1001)
    errors, steps = [], []
    for (kind, step), arc in fixed_steps.items():
        if kind is solver:
            errors.append(np.abs(arc(t) - smooth_exact(t)).max())
            steps.append(step)
    assert order_of(errors, steps) > (8 if solver is hybrid.DOP853 else 5) - 0.5


@every_solver
def test_bad_tolerances(solver):
    name = solver.__name__
    with pytest.raises(hybrid.ArgumentError, match=f"{name}: rtol must be positive; got 0"):
        solver(rtol=0.0)
    with pytest.raises(hybrid.ArgumentError, match=f"{name}: atol must be positive"):
        solver(atol=-1e-9)
    with pytest.raises(hybrid.ArgumentError, match="too small for double precision"):
        solver(rtol=1e-16)
    with pytest.raises(hybrid.ArgumentError, match="allows errors larger than the state"):
        solver(rtol=1.5)
    assert (solver(rtol=1e-15).rtol, solver(rtol=1).rtol) == (1e-15, 1.0)
    with pytest.raises(hybrid.ArgumentError, match="max_step must be positive"):
        solver(max_step=0.0)
    with pytest.raises(hybrid.ArgumentError, match="rtol must be positive; got nan"):
        solver(rtol=float("nan"))


@pytest.mark.parametrize("solver", [hybrid.DOP853, hybrid.Tsit5, hybrid.RadauIIA])
def test_nodes_are_the_ends_and_the_places_of_stages_that_count(solver):
    """A stage counts if the end or one of both estimates of the error has a part of it."""
    tableau = solver().tableau
    weights = [tableau.quadrature, tableau.error, tableau.second_error]
    counted = {
        float(place)
        for place, *parts in zip(tableau.c[: len(weights[0])], *weights, strict=False)
        if any(parts)
    }
    assert tableau.nodes.tolist() == sorted({0.0, 1.0} | counted)


def test_the_nodes_of_a_method_are_those_with_weight_and_the_ends():
    """Places with a weight in the step, in one of its error estimates, or in several of them."""
    places = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    for weighed in ("b", "error", "second_error"):
        weights = {"b": np.zeros(4), "error": np.zeros(5), "second_error": np.zeros(5)}
        for stage, place in enumerate(places[:4]):
            weights[weighed][:] = 0.0
            weights[weighed][stage] = 0.125
            tableau = Tableau(
                order=2,
                error_order=1,
                a=np.zeros((5, 5)),
                c=places,
                interpolant=np.zeros((2, 5)),
                **{name: values.copy() for name, values in weights.items()},
            )
            assert tableau.nodes.tolist() == sorted({0.0, place, 1.0})
