"""Curves of bifurcations of equilibria over two parameters against closed forms."""

import numpy as np
import pytest

from hybrid import (
    ArgumentError,
    HybridSystem,
    Mode,
    continue_bifurcation,
    continue_equilibrium,
    equilibrium,
    from_equations,
)


def plain(field, state, parameters):
    return HybridSystem(state=state, parameters=parameters, modes=[Mode("flow", field)])


def kinds(curve):
    return [each.kind for each in curve.points]


def test_two_curves_of_folds_meet_in_a_cusp():
    system = plain(lambda t, x, p: (p.a + p.b * x.x - x.x**3,), ("x",), {"a": -2.0, "b": 1.0})
    fold = continue_equilibrium(equilibrium(system, (-1.5,)), "a", (-2.0, 2.0)).of("fold")[0]
    curve = continue_bifurcation(fold, {"a": (-2.0, 2.0), "b": (-1.0, 2.0)})
    assert curve.status.ok
    np.testing.assert_allclose(27 * curve["a"] ** 2, 4 * curve["b"] ** 3, atol=1e-10)
    assert kinds(curve) == ["cusp"]
    assert max(abs(value) for value in curve.points[0].values.values()) < 1e-10
    assert len(curve) == len(curve.to_xarray()["x"])
    np.testing.assert_allclose(3 * curve.equilibrium(0).x ** 2, curve["b"][0], rtol=1e-10)


BOGDANOV = plain(
    lambda t, x, p: (x.y, p.a + p.b * x.y + x.x**2 + x.x * x.y), ("x", "y"), {"a": -1.0, "b": 0.5}
)
RANGES = {"a": (-2.0, 1.0), "b": (-1.0, 2.0)}


def test_hopf_points_end_where_their_frequency_is_zero():
    """The equilibrium x = -sqrt(-a) of the normal form of Bogdanov has a Hopf point where b = sqrt(-a)."""
    hopf = continue_equilibrium(equilibrium(BOGDANOV, (-1.0, 0.0)), "b", (-1.0, 2.0)).of("Hopf")[0]
    assert abs(hopf.value - 1.0) < 1e-10
    curve = continue_bifurcation(hopf, RANGES)
    np.testing.assert_allclose(curve["b"], np.sqrt(-curve["a"]), atol=1e-10)
    assert np.all(curve.coefficient > 0.0)
    assert kinds(curve) == ["Bogdanov-Takens"]
    assert "frequency is zero" in curve.status.message


def test_folds_pass_the_point_where_hopf_points_end():
    fold = continue_equilibrium(equilibrium(BOGDANOV, (-1.0, 0.0)), "a", (-2.0, 1.0)).of("fold")[0]
    curve = continue_bifurcation(fold, RANGES)
    np.testing.assert_allclose(curve["a"], 0.0, atol=1e-10)
    assert kinds(curve) == ["Bogdanov-Takens"]
    assert abs(curve.points[0].values["b"]) < 1e-10


def test_the_first_lyapunov_coefficient_passes_zero():
    """In polar form r' = m r + s r^3 - r^5, so that the coefficient is 2 s."""

    def flow(t, x, p):
        square = x.x**2 + x.y**2
        growth = p.m + p.s * square - square**2
        return growth * x.x - x.y, x.x + growth * x.y

    system = plain(flow, ("x", "y"), {"m": -1.0, "s": 0.5})
    hopf = continue_equilibrium(equilibrium(system, (0.1, 0.0)), "m", (-1.0, 2.0)).of("Hopf")[0]
    curve = continue_bifurcation(hopf, {"m": (-1.0, 1.0), "s": (-1.0, 2.0)})
    np.testing.assert_allclose(curve.coefficient, 2.0 * curve["s"], atol=1e-10)
    assert kinds(curve) == ["generalized Hopf"]
    assert abs(curve.points[0].values["s"]) < 1e-10


def test_a_boundary_is_followed():
    rubbing = from_equations(
        lambda t, x, p: (x.y, -x.x - 0.2 * x.y - p.b * np.sign(x.x + 0.3 * x.y) + p.a),
        state=("x", "y"),
        parameters={"a": 0.5, "b": 1.0},
    )
    branch = continue_equilibrium(equilibrium(rubbing, (0.2, 0.1)), "a", (-2.0, 2.0))
    boundary = branch.of("boundary")[1]
    curve = continue_bifurcation(boundary, {"a": (-2.0, 2.0), "b": (0.2, 3.0)})
    np.testing.assert_allclose(curve["a"], curve["b"], atol=1e-10)
    assert sorted(curve["b"][[0, -1]]) == pytest.approx([0.2, 2.0])


def test_a_branch_point_has_no_curve():
    system = plain(lambda t, x, p: (p.a * x.x - p.b * x.x**2,), ("x",), {"a": -1.0, "b": 1.0})
    crossing = continue_equilibrium(equilibrium(system, (0.1,)), "a", (-1.0, 1.0)).of("branch point")[0]
    with pytest.raises(ArgumentError, match="goes away when another parameter changes"):
        continue_bifurcation(crossing, {"a": (-1.0, 1.0), "b": (0.5, 2.0)})
