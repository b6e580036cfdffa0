"""Equilibria and their bifurcations against closed forms."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import (
    ArgumentError,
    Every,
    Guard,
    HybridSystem,
    Mode,
    Transition,
    continue_equilibrium,
    continue_orbit,
    equilibrium,
    from_equations,
    simulate,
    switch_branch,
)


def plain(field, state, parameters, **more):
    return HybridSystem(state=state, parameters=parameters, modes=[Mode("flow", field)], **more)


def block(k=9.0, units=(1.0, 1.0)):
    """A mass on a spring that reaches a second one, of stiffness ``k``, at q = 0."""
    a, b = units

    def free(t, x, p):
        return x.v * b / a, (p.F - x.q * a - 0.2 * x.v * b) / b

    def stop(t, x, p):
        return x.v * b / a, (p.F - x.q * a - 0.2 * x.v * b - p.k * x.q * a) / b

    return HybridSystem(
        state=("q", "v"),
        parameters={"k": k, "F": -1.0},
        modes=[Mode("free", free), Mode("stop", stop)],
        transitions=[
            Transition("free", "stop", Guard(lambda t, x, p: x.q, +1), name="touch"),
            Transition("stop", "free", Guard(lambda t, x, p: x.q, -1), name="leave"),
        ],
    )


RUBBING = from_equations(
    lambda t, x, p: (x.y, -x.x - 0.2 * x.y - np.sign(x.x + 0.3 * x.y) + p.a),
    state=("x", "y"),
    parameters={"a": 0.5},
)


def test_the_equilibrium_of_the_mode_that_holds_it_is_found():
    rest = equilibrium(block(), (-0.4, 0.3), parameters={"F": 2.0})
    assert (rest.mode, rest.admissible, rest.stable) == ("stop", True, True)
    np.testing.assert_allclose(rest.x, (0.2, 0.0), atol=1e-14)
    poly = np.roots([1.0, 0.2, 10.0])
    np.testing.assert_allclose(np.sort_complex(rest.eigenvalues), np.sort_complex(poly), rtol=1e-12)


def test_an_equilibrium_of_a_mode_by_name_may_be_virtual():
    rest = equilibrium(block(), (0.0, 0.0), mode="free", parameters={"F": 2.0})
    assert not rest.admissible
    assert rest.excluded_by == ("touch",)
    np.testing.assert_allclose(rest.x, (2.0, 0.0), atol=1e-14)


def test_a_run_from_a_stable_admissible_equilibrium_stays():
    rest = equilibrium(block(), (0.1, 0.0), parameters={"F": 0.5})
    arc = simulate(block(), rest.x, (0.0, 10.0), mode=rest.mode, parameters={"F": 0.5})
    np.testing.assert_allclose(arc.x[-1], rest.x, atol=1e-12)


def test_a_pseudo_equilibrium_lies_on_its_surface():
    rest = equilibrium(RUBBING, (0.2, 0.1))
    assert rest.mode == "x+0.3*y=0"
    assert rest.admissible
    assert rest.stable
    np.testing.assert_allclose(rest.x, 0.0, atol=1e-14)
    # The flow along x = -0.3 y is x' = y = -x / 0.3.
    np.testing.assert_allclose(rest.eigenvalues, [-1.0 / 0.3], rtol=1e-12)


def test_held_components_stay_and_have_no_eigenvalue():
    system = HybridSystem(
        state=("x",), held=("u",), modes=[Mode("flow", lambda t, x, p: (x.u - x.x**3,))], transitions=[]
    )
    rest = equilibrium(system, {"x": 1.0, "u": 8.0})
    np.testing.assert_allclose(rest.x, (2.0, 8.0), rtol=1e-14)
    np.testing.assert_allclose(rest.eigenvalues, [-12.0])


def test_a_clock_that_leaves_the_mode_makes_no_equilibrium_of_a_run():
    system = HybridSystem(
        state=("x",),
        modes=[Mode("flow", lambda t, x, p: (-x.x,)), Mode("other", lambda t, x, p: (1.0,))],
        transitions=[
            Transition("flow", "other", Every(1.0), name="tick"),
            Transition("other", "flow", Every(1.0, offset=0.5)),
        ],
    )
    rest = equilibrium(system, (0.3,), mode="flow")
    assert not rest.admissible
    assert rest.excluded_by == ("tick",)


def test_a_search_without_success_says_so():
    rest = equilibrium(plain(lambda t, x, p: (1.0 + x.x**2,), ("x",), {}), (0.3,))
    assert rest.status.code.name == "NOT_CONVERGED"
    assert not rest.stable
    assert not rest.admissible
    with pytest.raises(ArgumentError, match="point has not converged"):
        continue_equilibrium(rest, "a", (0.0, 1.0))


def test_what_has_no_equilibrium_is_refused():
    forced = plain(lambda t, x, p: (np.cos(t) - x.x,), ("x",), {}, period=2 * np.pi)
    with pytest.raises(ArgumentError, match=r"reads the time.*periodic_orbit"):
        equilibrium(forced, (0.0,))
    branching = plain(lambda t, x, p: (1.0 if x.x > 0 else -1.0,), ("x",), {})
    with pytest.raises(ArgumentError, match="cannot be traced"):
        equilibrium(branching, (0.0,))
    held_by_friction = plain(lambda t, x, p: (x.v, p.a * x.v), ("q", "v"), {"a": -1.0})
    with pytest.raises(ArgumentError, match="one of a family"):
        continue_equilibrium(equilibrium(held_by_friction, (0.4, 0.0)), "a", (-2.0, 0.0))
    point = equilibrium(block(), (-1.0, 0.0))
    with pytest.raises(ArgumentError, match="Parameter 'G'"):
        continue_equilibrium(point, "G", (-1.0, 1.0))
    with pytest.raises(ArgumentError, match=r"around F = -1\.0"):
        continue_equilibrium(point, "F", (0.0, 1.0))


def test_fold():
    system = plain(lambda t, x, p: (p.a - 2.0 - 3.0 * (x.x - 1.0) ** 2, -x.y), ("x", "y"), {"a": 5.0})
    branch = continue_equilibrium(equilibrium(system, (1.8, 0.0)), "a", (0.0, 6.0))
    [fold] = branch.of("fold")
    assert abs(fold.value - 2.0) < 1e-10
    np.testing.assert_allclose(fold.equilibrium.x, (1.0, 0.0), atol=1e-7)
    assert abs(fold.coefficient) == pytest.approx(3.0)
    assert "larger a" in fold.message
    assert {*fold.stable} == {True, False}
    assert branch.parameter[0] == branch.parameter[-1] == 6.0
    np.testing.assert_allclose(
        branch["x"], 1.0 + np.sign(branch["x"] - 1.0) * np.sqrt((branch.parameter - 2.0) / 3.0)
    )
    with pytest.raises(ArgumentError, match="a fold of equilibria"):
        switch_branch(fold)


@pytest.mark.parametrize("order", [2, 3])
def test_branch_points_lead_to_the_branch_that_crosses(order):
    system = plain(lambda t, x, p: ((p.a - 1.0) * x.x - x.x**order,), ("x",), {"a": 0.0})
    branch = continue_equilibrium(equilibrium(system, (0.1,)), "a", (-1.0, 3.0))
    [crossing] = branch.bifurcations
    assert crossing.kind == "branch point"
    assert abs(crossing.value - 1.0) < 1e-10
    other = switch_branch(crossing)
    assert abs(other.x[0]) > 1e-4
    arms = continue_equilibrium(other, "a", (-1.0, 3.0))
    np.testing.assert_allclose(arms["x"] ** (order - 1), arms.parameter - 1.0, atol=1e-12)
    assert [each.kind for each in arms.bifurcations] == ["branch point"]
    assert abs(arms.bifurcations[0].value - 1.0) < 1e-10


@pytest.mark.parametrize("seed", range(3))
def test_first_lyapunov_coefficients_are_those_of_the_planar_formula(seed):
    """Guckenheimer and Holmes (3.4.11); two more components follow those of the plane, bent."""
    w, (a, b, c, d, e, f, g, h) = 1.7, np.random.default_rng(seed).uniform(-1.0, 1.0, 8)

    def flow(t, x, p):
        r = x.r - 0.3 * x.x * x.y
        one = p.m * x.x - w * x.y + a * x.x**2 + b * x.x * x.y + c * x.y**2 + d * x.x**3
        two = w * x.x + p.m * x.y + e * x.x**2 + f * x.x * x.y + g * x.y**2 + h * x.y**3
        return one, two, 0.3 * (one * x.y + x.x * two) - 2.0 * r, -3.0 * x.s + r

    branch = continue_equilibrium(
        equilibrium(plain(flow, ("x", "y", "r", "s"), {"m": -0.5}), np.zeros(4)), "m", (-0.5, 0.5)
    )
    [hopf] = branch.of("Hopf")
    cubic = (6 * d + 6 * h) / 16
    quadratic = (b * (2 * a + 2 * c) - f * (2 * e + 2 * g) - 2 * a * 2 * e + 2 * c * 2 * g) / (16 * w)
    # A displacement r of x is the modulus sqrt(2) z of an eigenvector of length 1.
    assert hopf.coefficient == pytest.approx(2 * (cubic + quadratic) / w, rel=1e-10)
    assert abs(hopf.value) < 1e-10
    assert hopf.period == pytest.approx(2 * np.pi / w, rel=1e-12)
    assert ("supercritical" in hopf.message) == (hopf.coefficient < 0.0)


def test_hopf_points_of_the_lorenz_equations():
    lorenz = plain(
        lambda t, x, p: (p.s * (x.y - x.x), x.x * (p.r - x.z) - x.y, x.x * x.y - p.b * x.z),
        ("x", "y", "z"),
        {"s": 10.0, "b": 8 / 3, "r": 20.0},
    )
    branch = continue_equilibrium(equilibrium(lorenz, (7.0, 7.0, 20.0)), "r", (0.5, 30.0))
    exact = 10.0 * (10.0 + 8 / 3 + 3.0) / (10.0 - 8 / 3 - 1.0)
    assert [each.kind for each in branch.bifurcations] == ["Hopf", "branch point", "Hopf"]
    for hopf in branch.of("Hopf"):
        assert abs(hopf.value - exact) < 1e-10
        assert hopf.coefficient > 0.0
    assert abs(branch.of("branch point")[0].value - 1.0) < 1e-9


def test_a_neutral_saddle_is_no_hopf_point():
    saddle = plain(lambda t, x, p: (x.x, (p.m - 1.0) * x.y), ("x", "y"), {"m": -0.5})
    branch = continue_equilibrium(equilibrium(saddle, (0.1, 0.1)), "m", (-0.5, 0.5))
    assert branch.bifurcations == ()


def test_small_cycles_begin_at_a_hopf_point():
    """The cycles of the Brusselator have the frequency of the eigenvalues where they begin."""
    brusselator = plain(
        lambda t, x, p: (p.A - (p.B + 1.0) * x.x + x.x**2 * x.y, p.B * x.x - x.x**2 * x.y),
        ("x", "y"),
        {"A": 1.0, "B": 1.5},
    )
    [hopf] = continue_equilibrium(equilibrium(brusselator, (1.0, 1.0)), "B", (1.0, 3.0)).of("Hopf")
    assert abs(hopf.value - 2.0) < 1e-10
    cycle = switch_branch(hopf)
    assert cycle.status.ok
    assert 2.0 < cycle.parameters["B"] < 2.01
    branch = continue_orbit(cycle, "B", (1.5, 2.2))
    assert branch.stable.all()
    assert "a point" in branch.status.message
    [end] = branch.of("Hopf")
    assert abs(end.value - 2.0) < 1e-10
    assert abs(end.orbit.period - hopf.period) < 1e-10
    assert end.coefficient == pytest.approx(hopf.coefficient)
    assert min(branch.parameter) == end.value
    with pytest.raises(hybrid.ArgumentError, match="follow that of the equilibrium"):
        hybrid.continue_bifurcation(end, {"B": (1.5, 2.2), "A": (0.5, 1.5)})


@pytest.mark.parametrize("units", [(1.0, 1.0), (1e-6, 1e4)], ids=["plain", "other units"])
def test_a_boundary_at_which_the_equilibrium_persists(units):
    system = block(9.0, units)
    branch = continue_equilibrium(equilibrium(system, (-0.2 / units[0], 0.0)), "F", (-1.0, 2.0))
    [boundary] = branch.bifurcations
    assert boundary.kind == "boundary"
    assert abs(boundary.value) < 1e-10
    assert boundary.modes == ("stop",)
    assert boundary.message == "persistence: it goes on in mode 'stop' for larger F"
    np.testing.assert_array_equal(branch.admissible, branch.parameter <= 1e-12)
    onward = switch_branch(boundary)
    assert (onward.mode, onward.admissible) == ("stop", True)
    further = continue_equilibrium(onward, "F", (-1.0, 2.0))
    np.testing.assert_allclose(further["q"] * units[0], further.parameter / 10.0, atol=1e-14)
    assert abs(further.bifurcations[0].value) < 1e-10


def test_a_nonsmooth_fold():
    branch = continue_equilibrium(equilibrium(block(-9.0), (-0.2, 0.0)), "F", (-1.0, 2.0))
    [boundary] = branch.bifurcations
    assert boundary.message == (
        "nonsmooth fold: it and one of mode 'stop' meet and vanish, both exist for smaller F"
    )
    other = switch_branch(boundary)
    assert other.mode == "stop"
    assert other.admissible
    assert other.parameters["F"] < 0.0


def test_boundaries_of_a_pseudo_equilibrium():
    branch = continue_equilibrium(equilibrium(RUBBING, (0.2, 0.1)), "a", (-2.0, 2.0))
    assert [round(each.value, 10) for each in branch.bifurcations] == [-1.0, 1.0]
    assert [each.modes for each in branch.bifurcations] == [("x+0.3*y<0",), ("x+0.3*y>0",)]
    assert all("persistence" in each.message for each in branch.bifurcations)
    inside = np.abs(branch.parameter) <= 1.0
    np.testing.assert_array_equal(branch.admissible, inside)
    back = continue_equilibrium(switch_branch(branch.bifurcations[1]), "a", (-2.0, 2.0))
    assert back.bifurcations[0].modes == ("x+0.3*y=0",)
    assert abs(back.bifurcations[0].value - 1.0) < 1e-10


def test_equilibria_of_a_circuit_move_to_the_border_of_their_region():
    """Chua's circuit has three equilibria until the slopes let the outer ones reach the borders."""
    chua = models.chua_circuit()
    outer = equilibrium(chua, (1.5, 0.0, -1.5))
    assert outer.mode == "right"
    mirrored = equilibrium(chua, (-1.5, 0.0, 1.5))
    np.testing.assert_allclose(mirrored.x, -outer.x, atol=1e-14)
    name = next(name for name in chua.parameters if abs(chua.parameters[name]) < 1.0 and name.startswith("m"))
    value = outer.parameters[name]
    branch = continue_equilibrium(outer, name, (value - 0.05, value + 0.05))
    assert branch.status.ok
    for i in (0, -1):
        point = branch.equilibrium(i)
        assert point.residual < 1e-12


def test_results_have_names_outputs_and_datasets():
    system = hybrid.HybridSystem(
        state=("q", "v"),
        parameters={"F": 1.0},
        modes=[Mode("stop", lambda t, x, p: (x.v, p.F - 4.0 * x.q - x.v))],
        outputs={"force": lambda t, x, p: 4.0 * x.q},
        units={"q": "m", "F": "N"},
    )
    rest = equilibrium(system, (0.0, 0.0))
    assert rest["force"] == pytest.approx([1.0])
    assert "stable, admissible" in repr(rest)
    assert "eigenvalue" in rest._repr_html_()
    assert rest.to_xarray()["x"].sel(state="q") == pytest.approx(0.25)
    branch = continue_equilibrium(rest, "F", (0.0, 2.0))
    np.testing.assert_allclose(branch["force"], branch.parameter, atol=1e-12)
    dataset = branch.to_xarray()
    np.testing.assert_allclose(dataset["outputs"].sel(output="force"), branch.parameter, atol=1e-12)
    assert dataset["stable"].all()
    assert "no bifurcations" in repr(branch)
    with pytest.raises(ArgumentError, match="Kind 'flip'"):
        branch.of("flip")


def test_a_closed_branch_comes_back_to_its_start():
    circle = plain(lambda t, x, p: (p.a**2 + x.x**2 - 1.0,), ("x",), {"a": 0.0})
    branch = continue_equilibrium(equilibrium(circle, (0.9,)), "a", (-2.0, 2.0))
    assert "closed" in branch.status.message
    assert sorted(round(each.value, 10) for each in branch.of("fold")) == [-1.0, 1.0]
    np.testing.assert_allclose(branch.parameter**2 + branch["x"] ** 2, 1.0, atol=1e-12)
