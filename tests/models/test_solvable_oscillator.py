"""The solvable oscillator compared with its exact solution: the map, the flips, the spectrum."""

import numpy as np
import pytest

import hybrid
import lyapunov
from models import solvable_oscillator
from tests.reference.load import reference

EXACT = reference("solvable_oscillator")
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
WHOLE_TIMES = tuple(n for n in EXACT["flips"] if n <= 10)


@pytest.fixture(scope="module")
def arc():
    """Ten time units."""
    return hybrid.simulate(
        solvable_oscillator(), (EXACT["u"][0], 0.0), (0.0, 10.5), mode="plus", solver=TIGHT
    )


def test_flips_come_at_whole_times(arc):
    np.testing.assert_allclose([jump.t for jump in arc.jumps], WHOLE_TIMES, atol=1e-9)


def test_orbit_follows_the_map(arc):
    expected = [EXACT["u"][n] for n in WHOLE_TIMES]
    np.testing.assert_allclose([jump.x_minus[0] for jump in arc.jumps], expected, atol=1e-8)


def test_solution_between_whole_times(arc):
    b, w = EXACT["b"], 2 * np.pi
    t = np.linspace(0.03, 0.97, 7)
    for n, u in enumerate(EXACT["u"][:10]):
        s = np.sign(u)
        exact = s + (u - s) * np.exp(b * t) * (np.cos(w * t) - b / w * np.sin(w * t))
        np.testing.assert_allclose(arc(n + t)[:, 0], exact, atol=1e-8)


def test_saltation(arc):
    for jump, expected in zip(arc.jumps, EXACT["saltation"], strict=False):
        np.testing.assert_allclose(jump.saltation, expected, atol=1e-7)


@pytest.mark.parametrize(("mode", "sign"), [("plus", 1.0), ("minus", -1.0)])
def test_a_start_on_the_guard_neither_fires_nor_is_lost(mode, sign):
    """The start is a turning point where the sign of ``u`` is already that of ``s``."""
    arc = hybrid.simulate(solvable_oscillator(), (0.9 * sign, 0.0), (0.0, 0.9), mode=mode)
    assert not arc.jumps


@pytest.mark.parametrize("b", [0.5, 0.2])
def test_spectrum(b):
    result = lyapunov.lyapunov_spectrum(
        solvable_oscillator(), (0.3, 0.0), mode="plus", parameters={"b": b}, interval=1.0, intervals=400
    )
    np.testing.assert_allclose(result.exponents, [b, 0.0], atol=0.02)
