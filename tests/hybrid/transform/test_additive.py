"""Sliding along several surfaces whose jumps add up, against the linear system for the shares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid import HybridSystem, Mode, from_equations, simulate
from hybrid.expression.nodes import HALF, ONE, Number
from hybrid.transform.additive import sliding_field
from hybrid.transform.splitter import Splitter


@given(size=st.integers(1, 4), seed=st.integers(0, 10**6))
def test_the_shares_solve_the_linear_system(size, seed):
    """Surfaces ``n_i x + t = 0``, fields ``f + sum_i s_i d_i`` at the corners."""
    rng = np.random.default_rng(seed)
    n = size + 1
    middle = rng.integers(-4, 5, n)
    jumps = rng.integers(-3, 4, (size, n))
    normals = rng.integers(-3, 4, (size, n))

    def vertex_field(sides):
        return [Number(int(middle[i])) + sum(
            Number(int(np.sign(side) * jumps[number, i])) for number, side in sides.items()
        ) for i in range(n)]  # fmt: skip

    matrix = normals @ jumps.T
    gradients = [[*map(Number, map(int, normal)), ONE] for normal in normals]
    found = sliding_field(vertex_field, range(size), gradients)
    if abs(np.linalg.det(matrix)) < 0.5:
        assert found is None
        return
    shares = np.linalg.solve(matrix, -(normals @ middle) - 1.0)
    assert [float(each) for each in found] == pytest.approx(middle + shares @ jumps)


@pytest.mark.parametrize("seed", range(4))
def test_two_switches_of_a_plane_add_up_whatever_the_numbers(seed):
    """Where both heights are held the state is held; no quadratic equation for the shares is needed."""
    rng = np.random.default_rng(seed)
    A, C = rng.normal(size=(2, 2, 2))
    H = np.eye(2) + 0.3 * rng.normal(size=(2, 2))

    def field(t, x, p):
        signs = [np.sign(H[k, 0] * x.a + H[k, 1] * x.b + 0.1 * x.a**2) for k in range(2)]
        linear = (A[i, 0] * x.a + A[i, 1] * x.b + 0.7 * np.cos(t) for i in range(2))
        return tuple(each + C[i, 0] * signs[0] + C[i, 1] * signs[1] for i, each in enumerate(linear))

    [pieces] = Splitter(HybridSystem(state=("a", "b"), modes=[Mode("plain", field)])).pieces
    assert pieces.shares({0: 0, 1: 0}) is None


def test_jumps_that_do_not_add_up_have_no_such_field():
    def vertex_field(sides):
        a, b = (np.sign(side) for side in sides.values())
        return [Number(int(a * b)), Number(int(a)), Number(int(b))]

    gradients = [[Number(int(i == k)) for i in range(4)] for k in (1, 2)]
    assert sliding_field(vertex_field, [0, 1], gradients) is None


def test_contacts_that_share_a_mass_matrix():
    """Two dry contacts on coupled masses stick together; the forces that hold them are not one's own each."""
    M = np.array([[2.0, 0.7], [0.7, 1.0]])
    inverse = np.linalg.inv(M)

    def rates(t, x, p):
        force = np.array([p.A * np.cos(t), 0.5 * p.A * np.sin(t)]) - p.mu * np.sign(x[2:])
        return np.concatenate([x[2:], inverse @ force])

    system = from_equations(rates, state=4, parameters={"A": 0.3, "mu": 1.0})
    arc = simulate(system, [0.0, 0.0, 1.0, -0.5], (0.0, 20.0))
    assert arc.status.ok
    assert arc.x[-1, 2:] == pytest.approx([0.0, 0.0], abs=1e-14)
    assert "=0" in str(arc.mode[-1])


def test_a_field_is_asked_for_on_the_surfaces_with_the_branches_of_their_sides():
    """Of the sides ``a, b`` of two surfaces: ``x' = 1/2 - a``, ``y' = 1/4 - b`` and ``z' = 4 a + 8 b``."""
    asked = []

    def vertex_field(sides):
        asked.append({**sides})
        a, b = (Number(sides[number] // 2) for number in (3, 5))
        return [HALF - a, HALF / 2 - b, 4 * a + 8 * b]

    gradients = [[Number(int(i == k)) for i in range(4)] for k in (0, 1)]
    assert sliding_field(vertex_field, [3, 5], gradients) == [0, 0, 4]
    assert all(sides.keys() == {3, 5} and {*sides.values()} <= {-2, 2} for sides in asked)
