"""Jumps of a field in disguise: tangent vectors pass them unchanged, so the run must say that it met one."""

import numpy as np
import pytest

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, StatusCode, Taylor, Tsit5, simulate
from lyapunov import lyapunov_spectrum

SOLVERS = {
    "Taylor": Taylor(),
    "DOP853": DOP853(),
    "RadauIIA": RadauIIA(rtol=1e-9, atol=1e-11),
    "Tsit5": Tsit5(rtol=1e-6, atol=1e-8),
}
# Values on both sides of zero differ.
JUMPS = {
    "quotient by abs": lambda u: u / np.abs(u),
    "quotient of abs": lambda u: 0.3 * np.abs(u) / u,
    "quotient by a root": lambda u: u / np.sqrt(u**2),
    "quotient of a maximum": lambda u: np.maximum(u, 0) / u,
    "arctan of a quotient": lambda u: np.arctan(1 / u),
    "arctan of a tangent": lambda u: np.arctan(np.tan(u + np.pi / 2)),
    "tanh of a quotient": lambda u: np.tanh(1 / u),
    "steeper than any step": lambda u: np.tanh(1e14 * u),
    "saturation": lambda u: np.clip(1e14 * u, -1, 1),
}
SMOOTH = {
    "kink": np.abs,
    "product of jumps": lambda u: u * u / np.abs(u),
    "steep": lambda u: np.tanh(1e3 * u),
    "contact": lambda u: -30 * np.maximum(-u, 0) ** 1.5,
    "flat": lambda u: u**3,
    "plain": np.sin,
}


def pushed(push, moving=0.0):
    """A driven oscillator with a push that depends on the height over a moving level."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"a": moving},
        modes=[
            Mode(
                "swing",
                lambda t, x, p: (x.v, np.cos(t) - 0.1 * x.v - x.q - push(x.q - 0.1 - p.a * np.sin(t))),
            )
        ],
        period=2 * np.pi,
    )


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("moving", [0.0, 0.3])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("jump", JUMPS)
def test_a_run_with_tangent_vectors_tells_of_a_jump_in_disguise(jump, solver, moving):
    system = pushed(JUMPS[jump], moving)
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0), tangent=True, solver=SOLVERS[solver])
    assert arc.status.code == StatusCode.DISCONTINUOUS_FIELD, arc.status
    assert "'swing'" in arc.status.message
    plain = simulate(system, (1.5, 0.0), (0.0, 5.0), solver=SOLVERS[solver])
    assert plain.status.ok
    spectrum = lyapunov_spectrum(system, (1.5, 0.0), intervals=3, transient=0, solver=SOLVERS[solver])
    assert spectrum.status.code == StatusCode.DISCONTINUOUS_FIELD


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("moving", [0.0, 0.3])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("push", SMOOTH)
def test_tangent_vectors_that_pass_no_jump_are_the_derivative(push, solver, moving):
    system, method = pushed(SMOOTH[push], moving), SOLVERS[solver]
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0), tangent=True, solver=method)
    assert arc.status.code == StatusCode.SUCCESS, arc.status
    fine, step = DOP853(rtol=1e-13, atol=1e-13, max_step=0.01), 1e-5
    ends = [
        [simulate(system, start, (0.0, 5.0), solver=fine).x[-1] for start in starts]
        for starts in (((1.5 + step, 0.0), (1.5 - step, 0.0)), ((1.5, step), (1.5, -step)))
    ]
    derivative = np.transpose([(ahead - behind) / (2 * step) for ahead, behind in ends])
    assert np.allclose(arc.fundamental, derivative, rtol=0, atol=2e-3 if solver == "Tsit5" else 2e-4)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_jump_in_time_changes_no_tangent_vector(solver):
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q + np.abs(np.cos(t)) / np.cos(t)))],
        period=2 * np.pi,
    )
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0), tangent=True, solver=SOLVERS[solver])
    assert arc.status.code == StatusCode.SUCCESS
    assert np.allclose(arc.fundamental, [[np.cos(5), np.sin(5)], [-np.sin(5), np.cos(5)]], atol=1e-4)
