"""Fields that change steeply in the state: no step may miss the change, however narrow it is."""

import numpy as np
import pytest

import hybrid
import models
from hybrid import from_equations, simulate
from lyapunov import lyapunov_spectrum

SIGNS = {
    "tanh": lambda u: np.tanh(u),
    "arctan": lambda u: 2 / np.pi * np.arctan(u * 1e3),
    "root": lambda u: u / np.sqrt(u**2 + 1.0),
    "logistic": lambda u: 2 / (1 + np.exp(-2 * u)) - 1,
}
WIDTHS = [1e-1, 1e-2, 1e-3, 1e-5, 1e-8]


def pushed(sign):
    """A spring whose force jumps where the mass passes 0.2, with the jump left to ``sign``."""
    return from_equations(
        lambda t, x, p: (x.v, 1.2 * np.cos(t) - 0.1 * x.v - x.q - 0.5 * sign((x.q - 0.2) / p.width)),
        state=("q", "v"),
        parameters={"width": 1.0},
        period=2 * np.pi,
    )


@pytest.fixture(scope="module")
def jumping():
    return pushed(np.sign)


@pytest.mark.parametrize("name", sorted(SIGNS))
def test_a_smoothed_jump_tends_to_the_jump(name, jumping):
    smooth = pushed(SIGNS[name])
    end = simulate(jumping, (0.3, 0.2), (0.0, 30.0)).x[-1]
    for width in WIDTHS:
        found = simulate(smooth, (0.3, 0.2), (0.0, 30.0), parameters={"width": width})
        assert found.status.ok
        np.testing.assert_allclose(found.x[-1], end, atol=3 * width + 1e-6)


@pytest.mark.parametrize("width", [1e-2, 1e-3, 1e-4])
def test_its_tangent_vectors_tend_to_those_over_the_jump(width, jumping):
    smooth = pushed(SIGNS["tanh"])
    exact = lyapunov_spectrum(jumping, (0.3, 0.2), intervals=100, transient=100)
    found = lyapunov_spectrum(smooth, (0.3, 0.2), intervals=100, transient=100, parameters={"width": width})
    np.testing.assert_allclose(found.exponents, exact.exponents, atol=5 * width)
    run = simulate(smooth, (0.3, 0.2), (0.0, 10.0), parameters={"width": width}, tangent=True)
    step = 1e-3 * width
    ends = [
        [simulate(smooth, x0, (0.0, 10.0), parameters={"width": width}).x[-1] for x0 in pair]
        for pair in (((0.3 + step, 0.2), (0.3 - step, 0.2)), ((0.3, 0.2 + step), (0.3, 0.2 - step)))
    ]
    differences = np.column_stack([(np.array(a) - b) / (2 * step) for a, b in ends])
    np.testing.assert_allclose(run.fundamental, differences, atol=2e-2)


def test_models_without_such_fields_pay_nothing():
    """Nothing is compared in models whose fields are polynomials, or singular where their series ends."""
    for model in ("vibroimpact", "stick_slip", "chua_circuit", "bouncing_ball"):
        emitted = hybrid.compile_system(getattr(models, model)()).emitted
        assert not any(component == -2 for component in emitted.forcing_component), model
