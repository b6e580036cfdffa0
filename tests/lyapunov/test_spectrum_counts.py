"""Steps and jumps that a spectrum counts."""

import pytest

import hybrid
import lyapunov
import models


def test_steps_and_jumps_are_counted_per_interval():
    """As a run of the same length counts them, with the same tangent vectors."""
    system = models.impact_oscillator()
    spectrum = lyapunov.lyapunov_spectrum(system, (0.3, 0.2), intervals=40, transient=0)
    arc = hybrid.simulate(system, (0.3, 0.2), (0.0, 40 * spectrum.interval), tangent=True)
    assert spectrum.jumps_per_interval * 40 == pytest.approx(len(arc.jumps), abs=1e-9)
    # The end of an interval cuts a step in two.
    assert arc.steps <= spectrum.steps_per_interval * 40 <= arc.steps + 40


@pytest.mark.parametrize("transient", [0, 100])
def test_steps_and_jumps_of_the_transient_are_not_counted(transient):
    """A saw with two teeth per period: three exact steps."""
    saw = hybrid.HybridSystem(
        state=("x",),
        modes=[hybrid.Mode("rise", lambda t, x, p: (1.0,))],
        transitions=[
            hybrid.Transition(
                "rise",
                "rise",
                hybrid.Guard(lambda t, x, p: x.x - 0.5, +1),
                hybrid.Reset(lambda t, x, p: (x.x - 0.5,)),
            )
        ],
        period=1.0,
    )
    spectrum = lyapunov.lyapunov_spectrum(saw, (0.25,), intervals=10, transient=transient)
    assert spectrum.jumps_per_interval == 2.0
    # The start of a run may cost a step.
    assert 3.0 <= spectrum.steps_per_interval <= 3.1
