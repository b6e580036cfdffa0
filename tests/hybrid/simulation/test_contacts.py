"""Hertz contacts on their own clock: starts beyond the contact's guard, and walls that move."""

import numpy as np
import pytest

import hybrid
from hybrid import DOP853, Guard, HybridSystem, Mode, Taylor, Tsit5, simulate


def contact(power, stiffness=1.0):
    """A mass with the spring ``stiffness * max(z, 0)**power``, with the mode of the contact listed first."""
    return HybridSystem(
        state=("z", "v"),
        modes=[
            Mode("contact", lambda t, x, p: (x.v, -stiffness * np.maximum(x.z, 0) ** power)),
            Mode("free", lambda t, x, p: (x.v, 0.0)),
        ],
        transitions=[
            hybrid.Transition("contact", "free", Guard(lambda t, x, p: x.z, direction=-1), name="release"),
            hybrid.Transition("free", "contact", Guard(lambda t, x, p: x.z, direction=1), name="touch"),
        ],
    )


@pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5()], ids=repr)
@pytest.mark.parametrize("power", [1.5, 2.5])
@pytest.mark.parametrize("z", [-1e-6, -0.05, -0.5, -2.0])
@pytest.mark.parametrize("v", [-1.0, 0.3, 1.0])
def test_a_start_in_the_contact_that_is_not_in_contact(solver, power, z, v):
    """The mass flies to the contact or away from it; time runs forward, and the energy is kept."""
    tangent = np.eye(2)
    arc = simulate(contact(power), (z, v), (0.0, 4.0), mode="contact", solver=solver, tangent=tangent)
    assert arc.status.ok
    assert np.all(np.diff(arc.t) >= 0.0)
    assert np.all(arc.jumps.t > 0.0)
    energy = arc.x[-1, 1] ** 2 / 2 + np.maximum(arc.x[-1, 0], 0) ** (power + 1) / (power + 1)
    assert energy == pytest.approx(v * v / 2, rel=1e-6)
    if v < 0 or z + 4 * v < 0:
        np.testing.assert_allclose(arc.x[-1], [z + 4 * v, v], rtol=1e-12)
        np.testing.assert_allclose(arc.fundamental, [[1, 4], [0, 1]], rtol=1e-12)


@pytest.mark.parametrize("power", [1.5, 2.5])
@pytest.mark.parametrize("stiffness", [10.0, 1e3])
@pytest.mark.parametrize("seed", range(6))
def test_a_wall_that_moves_with_the_forcing(power, stiffness, seed):
    """State and tangent map beside steps in time at a tight tolerance."""
    w, generator = 1.72, np.random.default_rng(seed)

    def gap(t, x):
        return x.q - 0.05 * np.sin(w * t)

    system = HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("free", lambda t, x, p: (x.v, 2 - 5 * x.q)),
            Mode(
                "contact",
                lambda t, x, p: (x.v, 2 - 5 * x.q - stiffness * np.maximum(gap(t, x), 0) ** power),
            ),
        ],
        transitions=[
            hybrid.Transition("free", "contact", Guard(lambda t, x, p: gap(t, x), direction=1)),
            hybrid.Transition("contact", "free", Guard(lambda t, x, p: gap(t, x), direction=-1)),
        ],
    )
    start = (-generator.uniform(0.2, 1), generator.uniform(-1, 1))
    begin = generator.uniform(0, 3)
    span = (begin, begin + generator.uniform(1, 3))
    arc = simulate(system, start, span, mode="free", tangent=True)
    assert arc.status.ok
    assert "contact" in arc.mode
    reference = simulate(
        system, start, span, mode="free", tangent=True, solver=DOP853(rtol=1e-12, atol=1e-13)
    )
    np.testing.assert_allclose(arc.x[-1], reference.x[-1], atol=1e-8)
    size = np.abs(reference.fundamental).max()
    np.testing.assert_allclose(arc.fundamental, reference.fundamental, atol=1e-7 * size)
