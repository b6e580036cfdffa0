"""Multipliers and exponents do not depend on the units of the states or of the time."""

import numpy as np
import pytest

import hybrid
from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from lyapunov import lyapunov_spectrum

# Restitution, damping, drive: the orbit with one impact a period has these multipliers (Shaw and Holmes).
PAIR = -0.58429531
SPLIT = 0.00560035


def oscillator(length, rate, r=0.8):
    """An impact oscillator with lengths in units of ``1/length`` and times in units of ``1/rate``."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"A": length, "w": rate, "stop": length, "r": r, "c": 0.1 * rate},
        modes=[
            Mode("free", lambda t, x, p: (x.v, p.w**2 * (p.A * np.cos(p.w * t) - x.q) - p.c * x.v)),
        ],
        transitions=[
            Transition(
                "free",
                "free",
                Guard(lambda t, x, p: x.q - p.stop, direction=1),
                Reset(lambda t, x, p: (p.stop, -p.r * x.v)),
            )
        ],
        period=lambda p: 2 * np.pi / p.w,
    )


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("rate", [1e-12, 1e-7, 1.0, 1e7, 1e9, 1e12])
def test_multipliers_in_any_units(length, rate):
    orbit = hybrid.periodic_orbit(oscillator(length, rate), (0.9 * length, 1.0 * length * rate))
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.multipliers.real, [PAIR, PAIR], atol=1e-7)
    np.testing.assert_allclose(orbit.multipliers.imag, [SPLIT, -SPLIT], atol=1e-7)


@pytest.mark.parametrize("r", [1e-3, 1e-7, 1e-9])
@pytest.mark.parametrize("rate", [1.0, 1e9])
def test_an_impact_that_leaves_next_to_nothing_is_not_singular(r, rate):
    """The product of both multipliers is that of the restitution and of the damping, however small."""
    orbit = hybrid.periodic_orbit(oscillator(1.0, rate, r), (0.99, 0.1 * rate))
    assert orbit.status.ok
    impacts = len(orbit.signature) - 1
    expected = impacts * 2 * np.log(r) - 0.2 * np.pi
    assert impacts > 0
    assert np.sum(orbit.log_moduli) == pytest.approx(expected, rel=1e-9)
    spectrum = lyapunov_spectrum(orbit.system, orbit.x0, intervals=4, transient=0)
    assert np.sum(spectrum.exponents) / rate == pytest.approx(expected / (2 * np.pi), rel=1e-6)


@pytest.mark.parametrize("factor", [1e-13, 1e-16, 1e-40, 1e-200])
def test_a_reset_that_shrinks_one_direction_is_not_singular(factor):
    """Each direction has its own exponent: its rate, and the logarithm of its factor every unit of time."""
    system = HybridSystem(
        state=("a", "b"),
        modes=[Mode("decay", lambda t, x, p: (0.1 * x.a, -0.2 * x.b))],
        transitions=[
            Transition(
                "decay",
                "decay",
                Guard(lambda t, x, p: np.sin(2 * np.pi * t), direction=1),
                Reset(lambda t, x, p: (0.9 * x.a, factor * x.b)),
            )
        ],
        period=lambda p: 1.0,
    )
    spectrum = lyapunov_spectrum(system, (1.0, 1.0), intervals=40, transient=5, t0=0.6)
    assert spectrum.status.ok
    np.testing.assert_allclose(
        spectrum.exponents, [0.1 + np.log(0.9), -0.2 + np.log(factor)], rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_what_a_sliding_mode_annihilates_is_annihilated_in_any_units(unit):
    """Both fields push onto a line: the catch annihilates one direction, however long its components are."""
    sliding = hybrid.filippov(
        state=("y", "z"),
        parameters={"u": unit},
        below=lambda t, x, p: (1.0, -x.z),
        above=lambda t, x, p: (-1.0, -x.z),
        switching=lambda t, x, p: x.y + x.z / p.u,
    )
    spectrum = lyapunov_spectrum(sliding, (0.3, 0.5 * unit), intervals=20, interval=1.0, transient=0)
    assert spectrum.status.ok
    assert spectrum.exponents[1] == -np.inf
    assert np.isfinite(spectrum.exponents[0])


@pytest.mark.parametrize("unit", 10.0 ** np.arange(-15, 16, 3))
def test_how_near_to_a_surface_a_start_slides_does_not_depend_on_units(unit):
    """A start half a unit from the surface flies to it, whatever the size of the other state."""
    sliding = hybrid.filippov(
        state=("y", "z"),
        parameters={"u": unit},
        below=lambda t, x, p: (1.0, 0.5 * p.u),
        above=lambda t, x, p: (-1.0, 0.5 * p.u),
        switching=lambda t, x, p: x.y - 0.1,
    )
    arc = hybrid.simulate(sliding, (0.6, 1e3 * unit), (0.0, 1.0))
    assert arc.jumps.t == pytest.approx([0.5], rel=1e-14)
    on = hybrid.simulate(sliding, (0.1, 1e3 * unit), (0.0, 1.0))
    assert on.mode[0] == "sliding"
    assert not len(on.jumps)


@pytest.mark.parametrize("far", [1e15, 1e25, 1e40])
def test_multipliers_of_states_in_units_far_apart(far):
    """A shear in units far apart: ``q' = far v - q``, ``v' = -2 v``, both forced to zero."""
    system = HybridSystem(
        state=("q", "v"),
        parameters={"far": 1.0},
        modes=[Mode("on", lambda t, x, p: (p.far * x.v - x.q, -2.0 * x.v))],
        period=1.0,
    )
    orbit = hybrid.periodic_orbit(system, (0.0, 0.0), parameters={"far": far})
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.multipliers, np.exp([-1.0, -2.0]), rtol=1e-9)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_point_of_an_orbit_nearest_to_the_guess_does_not_depend_on_units(unit):
    """Van der Pol's oscillator with its velocity in other units."""

    def found(unit):
        system = HybridSystem(
            state=("q", "v"),
            parameters={"unit": unit},
            modes=[
                Mode("free", lambda t, x, p: (x.v / p.unit, (1 - x.q**2) * x.v - p.unit * x.q)),
            ],
        )
        solver = hybrid.DOP853(rtol=1e-12, atol=1e-20)
        return hybrid.periodic_orbit(system, (1.0, 1.5 * unit), period=6.6, solver=solver)

    scaled = found(unit)
    assert scaled.status.ok
    np.testing.assert_allclose(scaled.x0 / (1.0, unit), found(1.0).x0, rtol=0.02)
