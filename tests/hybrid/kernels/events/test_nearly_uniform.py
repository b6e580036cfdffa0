"""Motion that hardly changes its speed does not make a guard count as zero from afar."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hybrid import (
    DOP853,
    Guard,
    HybridSystem,
    Mode,
    RadauIIA,
    Reset,
    Taylor,
    Transition,
    simulate,
    simulate_many,
)

SOLVERS = [Taylor(), DOP853(rtol=1e-10, atol=1e-12), RadauIIA()]


def thrown(law):
    """A mass that flies towards a wall at the origin, by a law of its acceleration."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"small": 0.0},
        modes=[Mode("fly", lambda t, x, p: (x.v, law(x, p)))],
        transitions=[
            Transition("fly", "fly", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (0.0, -0.5 * x.v)))
        ],
    )


# Each with the time at which a mass thrown at unit speed has come a distance d.
LAWS = {
    "pull": (thrown(lambda x, p: -p.small), lambda d, g: 2.0 * d / (1.0 + np.sqrt(1.0 + 2.0 * g * d))),
    "damping": (thrown(lambda x, p: -p.small * x.v), lambda d, c: -np.log1p(-c * d) / c),
}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
@given(
    small=st.floats(-18.0, -1.0).map(lambda power: 10.0**power),
    distance=st.floats(-9.0, -0.3).map(lambda power: 10.0**power),
)
def test_weak_forces(law, solver, small, distance):
    """The wall is reached when it is reached, also by a run that is short and by one that ends before."""
    system, time_of = LAWS[law]
    hit = time_of(distance, small)
    options = {"solver": solver, "parameters": {"small": small}}
    for end in (1.5 * hit, 1.0):
        arc = simulate(system, (distance, -1.0), (0.0, end), **options)
        assert arc.status.ok
        assert len(arc.jumps) == 1
        assert arc.jumps[0].t == pytest.approx(hit, rel=1e-9, abs=1e-15)
    assert len(simulate(system, (distance, -1.0), (0.0, 0.999 * hit), **options).jumps) == 0


def test_many_starts_at_once():
    distances = np.array([0.5, 1e-3, 1e-6])
    found = simulate_many(
        LAWS["pull"][0], np.stack([distances, -np.ones(3)], axis=1), (0.0, 0.25), parameters={"small": 1e-15}
    )
    assert found.jumps.values.tolist() == [0, 1, 1]
    np.testing.assert_allclose(found.x_end[0], [0.25, -1.0], rtol=1e-12)


@pytest.mark.parametrize("height", [1e-3, 1e-6, 1e-9, 1e-12])
def test_modes_that_do_not_fit_tell_nothing_of_the_one_that_does(height):
    """In a mode below the table, speeds hardly change, which is none of the flight's business."""
    system = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("below", lambda t, x, p: (1.0 + 1e-15 * x.v, 1e-15 * x.q)),
            Mode("above", lambda t, x, p: (x.v, -1.0)),
        ],
        transitions=[
            Transition("below", "above", Guard(lambda t, x, p: x.q, +1), name="up"),
            Transition(
                "above", "above", Guard(lambda t, x, p: x.q, -1), Reset(lambda t, x, p: (0.0, -0.5 * x.v))
            ),
        ],
    )
    first = simulate(system, (height, -1.0), (0.0, 1e-2)).jumps[0]
    assert first.source == "above"
    assert first.t == pytest.approx(np.sqrt(1.0 + 2.0 * height) - 1.0, rel=1e-3)
