"""What docs/architecture.md promises: a solver, a propagator and an analysis are one file each."""

import numpy as np
import pytest

import hybrid
import models
from hybrid.compiler.compiled import CompiledSystem
from hybrid.compiler.emit import emit
from hybrid.compiler.propagators import choice
from tests.additions.toy_analysis import residence
from tests.additions.toy_propagator import at_rest
from tests.additions.toy_solver import BogackiShampine


def test_a_solver():
    """Its error across impacts falls with its order."""
    oscillator, span = models.impact_oscillator(), (0.0, 30.0)
    exact = hybrid.simulate(oscillator, (0.3, 0.2), span)
    assert len(exact.jumps) > 3
    tolerances = 10.0 ** np.arange(-5, -9, -1.0)
    errors, steps = [], []
    for rtol in tolerances:
        arc = hybrid.simulate(
            oscillator, (0.3, 0.2), span, solver=BogackiShampine(rtol=rtol, atol=rtol / 100)
        )
        assert arc.status.ok
        assert arc.jumps.transition.tolist() == exact.jumps.transition.tolist()
        errors.append(np.linalg.norm(arc.x[-1] - exact.x[-1]))
        steps.append(arc.steps)
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-3.0, abs=0.4)
    tangents = hybrid.simulate(oscillator, (0.3, 0.2), span, tangent=True).fundamental
    rough = hybrid.simulate(
        oscillator, (0.3, 0.2), span, tangent=True, solver=BogackiShampine(rtol=1e-7)
    ).fundamental
    np.testing.assert_allclose(rough, tangents, atol=1e-4)


def test_a_propagator(monkeypatch):
    system = models.stick_slip()
    resting = hybrid.HybridSystem(
        state=("q", "v"),
        modes=[
            hybrid.Mode("fall", lambda t, x, p: (x.v, -1.0)),
            hybrid.Mode("rest", lambda t, x, p: (0.0, 0.0)),
        ],
        transitions=[
            hybrid.Transition(
                "fall",
                "rest",
                hybrid.Guard(lambda t, x, p: x.q, -1),
                hybrid.Reset(lambda t, x, p: (0.0, 0.0)),
            )
        ],
    )
    monkeypatch.setattr(choice, "STRATEGIES", [at_rest, *choice.STRATEGIES])
    compiled = CompiledSystem(resting, emit(resting))
    object.__setattr__(resting, "_compiled", compiled)
    assert "mode rest: exact (at rest)" in str(compiled)
    arc = hybrid.simulate(resting, (2.0, 0.0), (0.0, 5.0), mode="fall", tangent=True)
    assert arc.jumps[0].t == pytest.approx(2.0, rel=1e-15)
    assert arc.mode[-1] == "rest"
    np.testing.assert_array_equal(arc.x[-1], [0.0, 0.0])
    np.testing.assert_array_equal(arc.fundamental, np.zeros((2, 2)))
    assert "at rest" not in str(CompiledSystem(system, emit(system)))


def test_an_analysis():
    system = models.stop_oscillator()
    x0, t1 = (0.0,) * system.dimension, 50.0
    shares = residence(system, x0, t1)
    arc = hybrid.simulate(system, x0, (0.0, t1))
    assert len(arc.jumps) > 3
    entered = np.array([0.0, *arc.jumps.t, t1])
    modes = [str(arc.mode[0]), *(jump.target for jump in arc.jumps)]
    for mode in system.mode_names:
        time = sum(np.diff(entered)[[each == mode for each in modes]])
        assert shares[mode] == pytest.approx(time / t1, abs=1e-12)
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-13)
