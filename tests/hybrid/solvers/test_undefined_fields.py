"""Fields that are not defined beyond a surface without a guard: the run ends there, and says so."""

import numpy as np
import pytest

from hybrid import DOP853, HybridSystem, Mode, Taylor, Tsit5, simulate

FIELDS = {
    # The start lies on the sphere outside of which the root is undefined, and moves outwards.
    "sphere": (
        ("x", "y", "u", "v"),
        lambda t, x, p: (x.u, x.v, -x.x + 0.01 * np.sqrt(1 - x.x**2 - x.y**2), -x.y),
        (0.6, 0.8, 0.1, -0.02),
        0.0,
    ),
    # The orbit dips so little below the level that its height does not move by more than its rounding there.
    "dip": (
        ("q", "v", "s"),
        lambda t, x, p: (x.v, -x.q, np.sqrt(x.q + 1 - 1e-9)),
        (1.0, 0.0, 0.0),
        np.arccos(1e-9 - 1),
    ),
}


@pytest.mark.parametrize("solver", [Taylor(), DOP853()])
@pytest.mark.parametrize("name", FIELDS)
def test_a_run_does_not_creep_on_for_ever_beside_a_place_where_the_field_is_undefined(name, solver):
    """Tiny steps that the rounding of the state hides used to follow each other up to ``max_steps``."""
    state, field, start, end = FIELDS[name]
    arc = simulate(HybridSystem(state=state, modes=[Mode("m", field)]), start, (0.0, 4.0), solver=solver)
    assert arc.status.code.name in ("STEP_TOO_SMALL", "NON_FINITE")
    assert np.isclose(arc.t[-1], end, rtol=0, atol=1e-6)
    assert np.all(np.isfinite(arc.x))


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5()])
@pytest.mark.parametrize(
    ("term", "end"),
    [
        (lambda q: np.log(q + 0.9999), np.arccos(-0.9999)),
        (lambda q: np.sqrt(q + 0.99), np.arccos(-0.99)),
        (lambda q: (q + 0.9999) ** 2.5, np.arccos(-0.9999)),
        (lambda q: np.arcsin(1.0001 * (1 - q) / 2), np.arccos(1 - 2 / 1.0001)),
    ],
)
def test_a_run_ends_where_its_field_ceases_to_be_defined(term, end, solver):
    system = HybridSystem(state=("q", "v", "s"), modes=[Mode("m", lambda t, x, p: (x.v, -x.q, term(x.q)))])
    arc = simulate(system, (1.0, 0.0, 0.0), (0.0, 6.0), solver=solver)
    assert arc.status.code.name in ("STEP_TOO_SMALL", "NON_FINITE")
    assert np.isclose(arc.t[-1], end, rtol=0, atol=1e-8)
