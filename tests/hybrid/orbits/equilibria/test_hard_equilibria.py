"""Equilibria where a careless search goes wrong: against closed forms."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from hybrid import (
    Guard,
    HybridSystem,
    Mode,
    Reset,
    Transition,
    continue_all,
    continue_bifurcation,
    continue_equilibrium,
    equilibrium,
    from_equations,
    switch_branch,
)


def plain(field, state, parameters):
    return HybridSystem(state=state, parameters=parameters, modes=[Mode("flow", field)])


def kinds(found):
    return [each.kind for each in found]


def test_a_branch_point_at_which_an_equation_vanishes():
    """The row of q is zero there, with all its derivatives but one."""
    system = plain(lambda t, x, p: (p.a * x.q - x.q**3, -x.u + x.q**2), ("q", "u"), {"a": -1.0})
    branch = continue_equilibrium(equilibrium(system, (0.0, 0.0)), "a", (-2.0, 2.3))
    assert kinds(branch.bifurcations) == ["branch point"]
    assert abs(branch.bifurcations[0].value) < 1e-10


@pytest.mark.parametrize("r", [0.5, 1.0, 1.7, 2.5])
def test_a_branch_point_is_found_from_every_start(r):
    system = plain(
        lambda t, x, p: (x.x * (1 - x.x - 0.5 * x.y), x.y * (p.r - x.y - 1.5 * x.x)), ("x", "y"), {"r": r}
    )
    branch = continue_equilibrium(equilibrium(system, (0.0, r)), "r", (0.1, 3.0))
    assert kinds(branch.bifurcations) == ["branch point"]
    assert abs(branch.bifurcations[0].value - 2.0) < 1e-10


def brusselators(k):
    """Two that are coupled: Hopf points of motion in phase at 2, of motion in antiphase at 2 + 2 k."""

    def flow(t, x, p):
        return (
            1 - (p.B + 1) * x.u + x.u**2 * x.v,
            p.B * x.u - x.u**2 * x.v + k * (x.z - x.v),
            1 - (p.B + 1) * x.y + x.y**2 * x.z,
            p.B * x.y - x.y**2 * x.z + k * (x.v - x.z),
        )

    return plain(flow, ("u", "v", "y", "z"), {"B": 1.0})


@pytest.mark.parametrize("k", [0.03, 0.1])
def test_two_hopf_points_near_each_other(k):
    start = equilibrium(brusselators(k), np.ones(4))
    branch = continue_equilibrium(start, "B", (0.5, 4.0))
    np.testing.assert_allclose([each.value for each in branch.of("Hopf")], [2.0, 2.0 + 2.0 * k], atol=1e-10)
    first, second = branch.of("Hopf")
    assert "stable cycles" in first.message
    assert "unstable cycles" in second.message


def test_what_passes_the_axis_together_is_told():
    branch = continue_equilibrium(equilibrium(brusselators(0.0), np.ones(4)), "B", (0.5, 4.0))
    assert branch.bifurcations == ()
    assert "several eigenvalues pass the imaginary axis together" in branch.status.message


def test_a_start_on_a_bifurcation():
    hopf = plain(lambda t, x, p: (x.v, -x.q + p.m * x.v - x.v**3), ("q", "v"), {"m": 0.0})
    branch = continue_equilibrium(equilibrium(hopf, (0.0, 0.0)), "m", (-1.0, 1.0))
    assert kinds(branch.bifurcations) == ["Hopf"]
    pitchfork = plain(lambda t, x, p: (p.m * x.x - x.x**3,), ("x",), {"m": 0.0})
    branch = continue_equilibrium(equilibrium(pitchfork, (0.0,)), "m", (-1.0, 1.0))
    assert kinds(branch.bifurcations) == ["branch point"]


def test_a_mass_comes_to_rest_on_its_stop():
    """The spring presses it to the stop for F < 0; there is a mode of rest, in which every state stays."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"F": 1.0, "e": 0.5},
        modes=[
            Mode("free", lambda t, x, p: (x.v, p.F - x.q - 0.1 * x.v)),
            Mode("held", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            Transition(
                "free",
                "free",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: {"v": -p.e * x.v}),
                accumulates_to="held",
                name="hit",
            ),
            Transition("held", "free", Guard(lambda t, x, p: p.F - x.q, +1), name="lift"),
        ],
    )
    [boundary] = continue_equilibrium(equilibrium(system, (1.0, 0.0)), "F", (-1.0, 2.0)).bifurcations
    assert boundary.message == "persistence: it goes on in mode 'held' for smaller F"
    held = switch_branch(boundary)
    assert (held.mode, held.admissible) == ("held", True)


def test_a_linear_mode_has_no_first_lyapunov_coefficient():
    system = plain(lambda t, x, p: (x.v, -x.q + p.c * x.v), ("q", "v"), {"c": -1.0})
    [hopf] = continue_equilibrium(equilibrium(system, (0.0, 0.0)), "c", (-1.0, 1.0)).bifurcations
    assert hopf.coefficient == 0.0
    assert hopf.message.startswith("degenerate")


def test_hopf_points_of_a_predator_and_its_prey_end_at_a_double_zero():
    """Trace and determinant vanish with the rates: four equations, solved by SciPy."""

    def rates(x, y, a, d):
        eaten = x * y / (1 + a * x)
        return x - eaten - 0.01 * x**2, -y + eaten - d * y**2

    def conditions(unknowns):
        x, y, a, d = unknowns
        fx, fy = 1 - y / (1 + a * x) ** 2 - 0.02 * x, -x / (1 + a * x)
        gx, gy = y / (1 + a * x) ** 2, -1 + x / (1 + a * x) - 2 * d * y
        return (*rates(x, y, a, d), fx + gy, fx * gy - fy * gx)

    exact = fsolve(conditions, (6.2, 3.6, 0.45, 0.17), xtol=1e-11)
    system = plain(lambda t, x, p: rates(x.x, x.y, p.a, p.d), ("x", "y"), {"a": 0.5, "d": 0.1})
    hopf = continue_equilibrium(equilibrium(system, (3.0, 2.0)), "a", (0.1, 0.9)).of("Hopf")[0]
    curve = continue_bifurcation(hopf, {"a": (0.1, 0.9), "d": (0.001, 1.0)})
    assert kinds(curve.points) == ["Bogdanov-Takens"]
    np.testing.assert_allclose([*curve.points[0].values.values()], exact[2:], atol=1e-7)


def test_a_cusp_of_a_symmetric_system_is_no_double_zero():
    system = plain(
        lambda t, x, p: (x.v - x.v**3 / 3 - x.w + p.I, 0.5 * (p.b * x.v - x.w)),
        ("v", "w"),
        {"I": -1.0, "b": 0.2},
    )
    fold = continue_equilibrium(equilibrium(system, (-2.0, -0.5)), "I", (-1.0, 1.0)).of("fold")[0]
    curve = continue_bifurcation(fold, {"I": (-1.0, 1.0), "b": (0.0, 1.5)})
    found = {each.kind: each.values["b"] for each in curve.points}
    assert found["cusp"] == pytest.approx(1.0, abs=1e-9)
    assert found["Bogdanov-Takens"] == pytest.approx(0.5, abs=1e-9)
    assert sorted(kinds(curve.points)) == ["Bogdanov-Takens", "Bogdanov-Takens", "cusp"]


def test_a_harvest_above_a_threshold():
    """Pseudo-equilibria lie on T = (1 - x) (0.2 + x) and on x = 0, which cross at T = 0.2."""

    def field(t, x, p):
        eaten = x.x * x.y / (0.2 + x.x)
        harvest = p.h * x.y * np.where(x.y > p.T, 1.0, 0.0)
        return x.x * (1 - x.x) - eaten, 0.8 * eaten - 0.4 * x.y - harvest

    system = from_equations(field, state=("x", "y"), parameters={"h": 0.2, "T": 0.4})
    diagram = continue_all(equilibrium(system, (0.2, 0.3), mode="y<T"), "T", (0.05, 0.5), depth=3)
    assert sorted(each.mode for each in diagram) == ["y<T", "y=T", "y=T", "y>T"]
    curve = next(each for each in diagram if each.mode == "y=T" and each["x"].max() > 0.1)
    np.testing.assert_allclose((1 - curve["x"]) * (0.2 + curve["x"]), curve.parameter, atol=1e-10)
    assert len(diagram.of("fold")) == 1
    assert diagram.of("fold")[0].value == pytest.approx(0.36, abs=1e-10)
    assert len(diagram.of("boundary")) == 4
    again = continue_all(
        equilibrium(system, (0.6, 0.32), mode="y>T", parameters={"T": 0.3}), "T", (0.05, 0.5), depth=3
    )
    assert sorted(each.mode for each in again) == ["y<T", "y=T", "y=T", "y>T"]
