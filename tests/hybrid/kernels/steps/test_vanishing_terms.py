"""Series of affine modes with coefficients that are exactly zero, beside guards that are no polynomials."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition, simulate


def flight(guard, field=None, unit=1.0, **parameters):
    """A flight over ground of some shape, with time in any unit; what is switched off is zero."""
    given = {"g": 9.81 * unit**2, "c": 0.0, "w": 0.0, "A": 0.2} | parameters
    return HybridSystem(
        state=("x", "y", "u", "v"),
        parameters=given,
        modes=[Mode("fly", field or (lambda t, x, p: (x.u, x.v, -p.c * x.u, -p.g - p.c * x.v)))],
        transitions=[
            Transition("fly", "fly", Guard(guard, -1), Reset(lambda t, x, p: {"v": -x.v}), name="bounce")
        ],
    )


GROUNDS = {
    "sine": lambda t, x, p: x.y - p.A * np.sin(5 * x.x),
    "cosine": lambda t, x, p: x.y - p.A * np.cos(3 * x.x + 1),
    "exponential": lambda t, x, p: x.y - p.A * np.exp(-x.x),
    "moving": lambda t, x, p: x.y - p.A * np.sin(20 * t),
    "tanh": lambda t, x, p: x.y - p.A * np.tanh(x.x - 2),
}


@pytest.mark.parametrize("ground", GROUNDS)
def test_a_coefficient_of_zero_costs_no_more_steps_than_a_small_one(ground):
    system, start = flight(GROUNDS[ground]), (0.0, 1.0, 0.7, 0.0)
    none, little = (simulate(system, start, (0.0, 10.0), parameters={"c": c}) for c in (0.0, 1e-9))
    assert none.propagators == {"fly": "exact"}
    assert len(none.jumps) == len(little.jumps) >= 10
    assert none.steps <= 2 * len(none.jumps) + 2
    np.testing.assert_allclose(none.x[-1], little.x[-1], rtol=1e-6, atol=1e-6)


def test_a_rotation_of_rate_zero_is_a_free_flight():
    def turning(t, x, p):
        return (x.u, x.v, p.w * x.v, -p.g - p.w * x.u)

    arc = simulate(flight(GROUNDS["sine"], turning), (0.0, 1.0, 0.7, 0.0), (0.0, 10.0))
    plain = simulate(flight(GROUNDS["sine"]), (0.0, 1.0, 0.7, 0.0), (0.0, 10.0))
    np.testing.assert_allclose(arc.x[-1], plain.x[-1], rtol=1e-9, atol=1e-9)
    assert arc.steps <= 2 * len(arc.jumps) + 2


@pytest.mark.parametrize("unit", [1e-12, 1e12, 1e-30])
def test_the_number_of_steps_does_not_depend_on_the_unit_of_time(unit):
    arc = simulate(flight(GROUNDS["sine"], unit=unit), (0.0, 1.0, 0.7 * unit, 0.0), (0.0, 10.0 / unit))
    assert len(arc.jumps) == 11
    assert arc.steps <= 2 * len(arc.jumps) + 2
