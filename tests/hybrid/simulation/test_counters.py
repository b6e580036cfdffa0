"""Counters have no part in the control of errors: a run that counts is, step by step, the run that does not."""

import numpy as np
import pytest

from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition, simulate
from hybrid import DOP853, RadauIIA, Taylor, Tsit5

SOLVERS = [Taylor(), Tsit5(), DOP853(rtol=1e-9), RadauIIA(rtol=1e-7)]


def pair(field, guard, reset, state=("q", "v"), parameters=None, **others):
    """A system with one transition, and the same with counters of its jumps."""

    def system(counters):
        def counting(t, x, p):
            changed = dict(reset(t, x, p))
            return changed | {name: getattr(x, name) + 1 for name in counters}

        return HybridSystem(
            state=state,
            counters=counters,
            parameters=parameters or {},
            modes=[Mode("run", field)],
            transitions=[Transition("run", "run", guard, Reset(counting), name="jump")],
            **others,
        )

    return system(()), system(("n", "m", "k"))


PAIRS = {
    "forced oscillator with impacts": pair(
        lambda t, x, p: (x.v, p.F * np.cos(t) - x.q - 0.05 * x.v),
        Guard(lambda t, x, p: x.q - 1.0, +1),
        lambda t, x, p: {"v": -0.8 * x.v},
        parameters={"F": 1.2},
        period=2 * np.pi,
    ),
    "pendulum with impacts": pair(
        lambda t, x, p: (x.v, -np.sin(x.q) + 0.3 * np.cos(t)),
        Guard(lambda t, x, p: np.sin(x.q) - 0.4, +1),
        lambda t, x, p: {"v": -0.9 * x.v},
    ),
    "sampled": pair(
        lambda t, x, p: (x.v, 5.0 * (1.0 - x.q**2) * x.v - x.q),
        Every(0.7),
        lambda t, x, p: {"v": x.v + 0.1},
    ),
    "at rest at the origin": pair(lambda t, x, p: (x.v, -x.q), Every(1.0), lambda t, x, p: {"v": x.v + 1e-3}),
}


@pytest.mark.parametrize("count", [0.0, 7.0, 1e9])
@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: type(solver).__name__)
@pytest.mark.parametrize("name", PAIRS)
def test_a_run_that_counts_takes_the_same_steps(name, solver, count):
    plain, counted = PAIRS[name]
    start = (0.0, 0.0) if "rest" in name else (0.3, 0.2)
    for tangent in (None, True):
        arc = simulate(plain, start, (0.0, 20.0), solver=solver, tangent=tangent)
        other = simulate(counted, (*start, *[count] * 3), (0.0, 20.0), solver=solver, tangent=tangent)
        assert arc.status.ok and other.status.code == arc.status.code
        assert (other.steps, other.rejected, len(other.jumps)) == (arc.steps, arc.rejected, len(arc.jumps))
        # A step of more components adds its terms in another order.
        np.testing.assert_allclose(other.t, arc.t, rtol=1e-9)
        np.testing.assert_allclose(other.x[:, :2], arc.x, atol=1e-8)
        np.testing.assert_array_equal(other.x[-1, 2:], count + len(arc.jumps))
        if tangent:
            np.testing.assert_allclose(other.fundamental, arc.fundamental, rtol=1e-8)
