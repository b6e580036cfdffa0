"""Markers change nothing but the list of jumps."""

import numpy as np

import hybrid
import models
from hybrid.transform.markers import with_section


def test_a_marked_system_runs_as_before():
    system = models.stop_oscillator()
    marked = with_section(system, hybrid.Guard(lambda t, x, p: x[1], -1))
    modes = len(system.modes)
    assert marked.transition_names[:modes] == tuple(f"section in {name}" for name in system.mode_names)
    assert marked.transition_names[modes:] == system.transition_names
    assert all(transition.is_marker for transition in marked.transitions[:modes])
    x0, span = (0.0,) * system.dimension, (0.0, 20.0)
    plain, seen = (
        hybrid.simulate(system, x0, span, tangent=True),
        hybrid.simulate(marked, x0, span, tangent=True),
    )
    np.testing.assert_allclose(seen.x[-1], plain.x[-1], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(seen.fundamental, plain.fundamental, rtol=1e-7, atol=1e-9)
    own = [jump for jump in seen.jumps if not jump.transition.startswith("section")]
    assert [jump.transition for jump in own] == plain.jumps.transition.tolist()
    crossings = [jump for jump in seen.jumps if jump.transition.startswith("section")]
    assert crossings
    assert all(abs(jump.x_minus[1]) < 1e-12 for jump in crossings)
