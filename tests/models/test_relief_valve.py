"""The relief valve: its equilibria and Hopf point in closed form, its cycles, and its seat."""

import numpy as np
import pytest
from scipy.optimize import brentq

from hybrid import (
    continue_bifurcation,
    continue_equilibrium,
    continue_orbit,
    equilibrium,
    simulate,
    switch_branch,
)
from hybrid.measures import minimum
from models import relief_valve

VALVE = relief_valve()
KAPPA, BETA, DELTA = 1.25, 20.0, 10.0


def inflow(lift):
    return lift * np.sqrt(lift + DELTA)


def defect(lift, kappa=KAPPA):
    """The condition of Routh and Hurwitz for the cubic of the eigenvalues."""
    root = np.sqrt(lift + DELTA)
    b = BETA * lift / (2 * root)
    return (kappa + b) * (1 + kappa * b) - (b + BETA * root)


def branch():
    return continue_equilibrium(equilibrium(VALVE, (2.5, 0.0, 12.5)), "q", (1.0, 10.0))


def test_equilibria():
    found = branch()
    np.testing.assert_allclose(inflow(found["y"]), found.parameter, rtol=1e-12)
    np.testing.assert_allclose(found["P"], found["y"] + DELTA, rtol=1e-12)
    np.testing.assert_allclose(found["outflow"], found.parameter, rtol=1e-12)
    assert found.admissible.all()


def test_the_hopf_point_and_its_curve():
    [hopf] = branch().bifurcations
    lift = brentq(defect, 0.01, 5.0, xtol=1e-15)
    assert abs(hopf.value - inflow(lift)) < 1e-10
    curve = continue_bifurcation(hopf, {"q": (1.0, 20.0), "kappa": (0.8, 2.0)})
    for lift, q, kappa in zip(curve.x[:, 0], curve["q"], curve["kappa"], strict=True):
        assert abs(inflow(lift) - q) < 1e-9
        assert abs(defect(lift, kappa)) < 1e-9


def test_small_cycles_grow_until_the_plate_touches_its_seat():
    cycle = switch_branch(branch().bifurcations[0])
    cycles = continue_orbit(cycle, "q", (7.0, 9.0))
    grazing = next(each for each in cycles.bifurcations if each.kind == "grazing")
    assert grazing.value == pytest.approx(7.5572, abs=1e-4)
    assert abs(minimum("y")(grazing.orbit.arc())) < 1e-6


def test_the_valve_opens_when_the_pressure_has_reached_the_set_one():
    arc = simulate(VALVE, (0.0, 0.0, 9.0), (0.0, 1.0), mode="closed", parameters={"q": 2.0})
    assert arc.jumps[0].transition == "opens"
    assert arc.jumps[0].t == pytest.approx(1.0 / (BETA * 2.0), rel=1e-12)
