"""Series with gaps: where small terms are followed by large ones, and say nothing of the step."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, Taylor, Transition, simulate

# The other method has no series.
REFERENCE = DOP853(rtol=1e-12, atol=1e-13, max_step=0.05)
FIELDS = {
    "polynomial": lambda t, x, p: (x.v, p.a * t**6 - x.q**9),
    "in time": lambda t, x, p: (x.v, np.cos(p.a * t**8) - x.q),
    "quotient": lambda t, x, p: (x.v, p.a / (1.0 + x.v**16)),
    "sine": lambda t, x, p: (x.v, p.a * t - np.sin(x.v) ** 7),
    "late": lambda t, x, p: (x.v, p.a * (t / 1.2) ** 30 - x.v),
    "root": lambda t, x, p: (x.v, p.a / np.sqrt(1.0 + x.v**24)),
}


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("rtol", [1e-6, 1e-10, 1e-13])
def test_gaps(name, rtol):
    """Starts at zero, where many terms vanish, and beside it, where they are small."""
    system = HybridSystem(state=("q", "v"), parameters={"a": 1.0}, modes=[Mode("m", FIELDS[name])])
    rng = np.random.default_rng(5)
    for size in (0.0, 1e-12, 1e-6, 1e-4, 1e-3, 1e-2, 0.1):
        start, options = size * rng.uniform(-1.0, 1.0, 2), {"parameters": {"a": rng.uniform(0.5, 1.5)}}
        arc = simulate(system, start, (0.0, 1.6), solver=Taylor(rtol=rtol, atol=rtol), **options)
        wanted = simulate(system, start, (0.0, 1.6), solver=REFERENCE, **options)
        assert arc.status.ok
        assert wanted.status.ok
        np.testing.assert_allclose(arc.x[-1], wanted.x[-1], atol=200 * rtol + 1e-11, rtol=200 * rtol)


@pytest.mark.parametrize("power", range(4, 18))
def test_an_event_behind_a_gap(power):
    """``v' = t - v**n`` from zero: the first terms are ``t**2 / 2`` and one of order ``2 n + 1``."""
    rises = Transition("m", None, Guard(lambda t, x, p: x.v - 1.05, +1))
    system = HybridSystem(
        state=("v",), modes=[Mode("m", lambda t, x, p: (t - x.v**power,))], transitions=[rises]
    )
    arc, wanted = (simulate(system, (0.0,), (0.0, 4.0), solver=each) for each in (Taylor(), REFERENCE))
    assert arc.jumps.t == pytest.approx(wanted.jumps.t, abs=1e-7)
