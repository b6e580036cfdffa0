"""Curves over two parameters on which a function of ``events=`` is zero, against a closed form."""

import pickle

import cloudpickle
import numpy as np
import pytest

import hybrid
from hybrid import ArgumentError, HybridSystem, Mode, continue_bifurcation, continue_orbit, periodic_orbit
from hybrid.measures import maximum

BOX = {"w": (0.3, 2.0), "A": (0.3, 1.5)}
PEAK = maximum("x")


@pytest.fixture(scope="module")
def branch():
    """A driven linear oscillator, which is 2 wide where ``A^2 = 4 ((1 - w^2)^2 + (c w)^2)``."""
    oscillator = HybridSystem(
        state=("x", "v"),
        parameters={"w": 0.7, "c": 0.2, "A": 1.0},
        modes=[Mode("free", lambda t, x, p: (x.v, p.A * np.cos(p.w * t) - p.c * x.v - x.x))],
        period=lambda p: 2.0 * np.pi / p.w,
    )
    events = {
        "limit": lambda arc: PEAK(arc) - 2.0,
        "jump": lambda arc: 1.0 if PEAK(arc) > 2.0 else -1.0,
    }
    return continue_orbit(periodic_orbit(oscillator, (1.0, 0.0)), "w", BOX["w"], events=events)


def test_the_curve_of_a_limit_in_closed_form(branch):
    curve = continue_bifurcation(branch.of("limit")[0], BOX, outputs={"peak": PEAK})
    assert curve.status.ok
    assert curve.kind == "limit"
    w, A = curve["w"], curve["A"]
    np.testing.assert_allclose(A, 2.0 * np.sqrt((1.0 - w**2) ** 2 + (0.2 * w) ** 2), atol=1e-8)
    np.testing.assert_allclose(curve["peak"], 2.0, atol=1e-9)
    # From one end of the second range past the least force, at the resonance, to the other.
    assert w.min() == pytest.approx(0.5, abs=0.1)
    assert A.max() == pytest.approx(1.5, abs=1e-9)
    assert A.min() == pytest.approx(0.4 * np.sqrt(0.99), abs=1e-2)


def test_a_jump_to_the_other_sign_has_no_curve(branch):
    with pytest.raises(ArgumentError, match=r"place where events\['jump'\] jumps to the other sign"):
        continue_bifurcation(branch.of("jump")[0], BOX)


def test_a_branch_without_its_functions_has_no_curve(branch):
    opened = hybrid.open_branch(branch.system, branch.to_xarray())
    for again in (opened, pickle.loads(cloudpickle.dumps(branch))):
        with pytest.raises(ArgumentError, match=r"zero of events\['limit'\] of a branch that was opened"):
            continue_bifurcation(again.of("limit")[0], BOX)


def test_a_function_that_fails_ends_the_curve(branch):
    def fragile(arc):
        if arc.parameters["A"] > 1.1:
            raise ValueError("too strong")
        return PEAK(arc) - 2.0

    found = continue_orbit(branch.orbit(0), "w", BOX["w"], events={"limit": fragile})
    curve = continue_bifurcation(found.of("limit")[0], BOX)
    assert not curve.status.ok
    assert "events['limit'] raised ValueError (too strong)" in curve.status.message
    assert curve["A"].max() <= 1.1
