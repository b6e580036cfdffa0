"""Runs that share all but their start are those of simulate."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import models
from hybrid import ArgumentError, Guard, HybridSystem, Mode, Transition, simulate
from hybrid.simulation.repeated import Repeated
from hybrid.solvers import Taylor

OSCILLATOR = models.bilinear_oscillator()
SOLVER = Taylor(rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("stiffness", [4.0, 10.0])
def test_the_runs_are_those_of_simulate(stiffness):
    given = {"k2": stiffness, "w": 0.7}
    runs = Repeated(OSCILLATOR, given, SOLVER)
    for x, span in (((0.3, -0.2), (0.1, 6.0)), ((0.5, 1.0), (2.0, 2.5))):
        arc = simulate(OSCILLATOR, x, span, mode="stiff", parameters=given, solver=SOLVER, tangent=True)
        led = runs.run("stiff", np.array(x), span, 1000, 1000)
        assert led.ok
        assert led.mode == arc.mode[-1]
        np.testing.assert_allclose(led.x, arc.x[-1], rtol=1e-12)
        np.testing.assert_allclose(led.tangents, arc.fundamental, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(led.arc.jumps.t, arc.jumps.t, rtol=1e-12)
        assert led.arc.parameters == arc.parameters


def test_the_field_at_both_ends():
    led = Repeated(OSCILLATOR, {}, SOLVER).run("stiff", np.array([0.5, 1.0]), (0.0, 0.3), 1000, 1000)
    np.testing.assert_allclose(led.first_rate, [1.0, 1.0 - 0.1 * 1.0 - 10.0 * 0.5], rtol=1e-13)
    x, v = led.x
    np.testing.assert_allclose(led.last_rate, [v, np.cos(0.3) - 0.1 * v - 10.0 * x], rtol=1e-13)


def test_a_run_that_does_not_reach_its_end():
    runs = Repeated(OSCILLATOR, {}, SOLVER)
    assert not runs.run("soft", np.array([-1.0, 0.0]), (0.0, 100.0), 3, 1000).ok
    led = runs.run("soft", np.array([-1.0, 0.0]), (0.0, 100.0), 1000, 2)
    assert not led.ok
    assert len(led.arc.jumps) == 2


def test_a_guard_without_a_value_is_refused():
    system = HybridSystem(
        state=("x",),
        modes=[Mode("m", lambda t, x, p: (1.0,)), Mode("n", lambda t, x, p: (1.0,))],
        transitions=[Transition("m", "n", Guard(lambda t, x, p: np.log(x.x), direction=1))],
    )
    with pytest.raises(ArgumentError, match="must be finite"):
        Repeated(system, {}, SOLVER).run("m", np.array([-1.0]), (0.0, 1.0), 1000, 1000)


def test_they_are_pickled():
    runs = Repeated(OSCILLATOR, {"w": 0.9}, SOLVER)
    before = runs.run("stiff", np.array([0.5, 1.0]), (0.0, 1.0), 1000, 1000)
    after = pickle.loads(pickle.dumps(runs)).run("stiff", np.array([0.5, 1.0]), (0.0, 1.0), 1000, 1000)
    np.testing.assert_array_equal(after.x, before.x)
