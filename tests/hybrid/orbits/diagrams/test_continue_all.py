"""Diagrams: which branches there are, and that none is followed twice."""

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")

import matplotlib.pyplot as plt

import models
from hybrid import (
    ArgumentError,
    HybridSystem,
    Mode,
    Taylor,
    continue_all,
    continue_orbit,
    equilibrium,
    periodic_orbit,
    switch_branch,
)
from hybrid.measures import amplitude, maximum
from hybrid.orbits.diagrams.same import is_known
from hybrid.plot import plot

SOLVER = Taylor(rtol=1e-12, atol=1e-14)


def scalar(rate):
    return HybridSystem(
        state=("x",), parameters={"a": 0.0}, modes=[Mode("flow", lambda t, x, p: (rate(x.x, p.a),))]
    )


def test_a_circle_that_crosses_a_line_twice_is_one_branch():
    system = scalar(lambda x, a: x * (x**2 + a**2 - 1.0))
    diagram = continue_all(equilibrium(system, (0.01,)), "a", (-2.0, 2.0))
    assert len(diagram) == 2
    line, circle = diagram
    np.testing.assert_allclose(line["x"], 0.0, atol=1e-12)
    np.testing.assert_allclose(circle["x"] ** 2 + circle.parameter**2, 1.0, atol=1e-12)
    assert sorted(round(each.value, 10) for each in line.of("branch point")) == [-1.0, 1.0]
    assert diagram.origins[0] is None
    assert diagram.origins[1].branch == 0
    assert diagram.origins[1].bifurcation.kind == "branch point"


def test_depth_and_number_of_branches():
    system = scalar(lambda x, a: (x - 1.0) * (x + a) * (x - a + 4.0))
    rest = equilibrium(system, (1.0,))
    assert len(continue_all(rest, "a", (-3.0, 9.0), depth=0)) == 1
    whole = continue_all(rest, "a", (-3.0, 9.0))
    assert len(whole) == 3
    assert whole.status.ok
    few = continue_all(rest, "a", (-3.0, 9.0), most=2)
    assert len(few) == 2
    assert not few.status.ok
    assert "Not looked at: 2 more starts." in few.status.message


def test_the_valve_flutters_hits_its_seat_and_doubles_its_period():
    """Where the doubled orbits have no impact any more they are those of the first branch, passed twice."""
    rest = equilibrium(models.relief_valve(), (2.5, 0.0, 12.5))
    diagram = continue_all(rest, "q", (5.0, 10.0), outputs={"top": maximum("y"), "width": amplitude("y")})
    assert [None if each is None else (each.branch, each.bifurcation.kind) for each in diagram.origins] == [
        None,
        (0, "Hopf"),
        (1, "flip"),
    ]
    single, doubled = diagram[1], diagram[2]
    assert max(single.parameter) == pytest.approx(diagram[0].of("Hopf")[0].value, abs=1e-9)
    assert max(doubled.parameter) < single.of("grazing")[0].value
    assert diagram.of("flip")
    dataset = diagram.to_xarray()
    assert dataset.sizes["point"] == sum(len(each) for each in diagram)
    np.testing.assert_allclose(dataset["top"][dataset["branch"] == 1], single["top"])
    assert np.isnan(dataset["top"][dataset["branch"] == 0]).all()
    try:
        ax = plot(diagram, y="top")
        assert ax.get_ylabel() == "top"
        assert sum(line.get_gid() == "branch" for line in ax.lines) == 3
        assert sum(line.get_gid() == "branch" for line in plot(diagram, y="width").lines) == 2
    finally:
        plt.close("all")
    assert "3 branches" in repr(diagram)


def test_orbits_of_a_branch_are_known():
    system = models.impact_oscillator()
    orbit = periodic_orbit(system, (0.9, 1.0))
    branch = continue_orbit(orbit, "w", (0.9, 1.8))
    again = periodic_orbit(system, branch.orbit(3).x0, parameters={"w": 1.02}, mode=branch.orbit(3).mode)
    assert is_known(again, branch, SOLVER)
    free = switch_branch(branch.of("grazing")[-1])
    narrow = continue_orbit(orbit, "w", (0.95, 1.05))
    assert not is_known(free, narrow, SOLVER)


def test_wrong_starts_are_refused():
    with pytest.raises(ArgumentError, match="start must be an orbit of periodic_orbit, an equilibrium"):
        continue_all([1.0], "a", (0.0, 1.0))
    with pytest.raises(ArgumentError, match="start must"):
        continue_all([], "a", (0.0, 1.0))
