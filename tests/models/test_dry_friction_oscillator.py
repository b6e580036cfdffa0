"""Den Hartog's motions: the closed form without stops, and slips between two stops per period."""

import math

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

import hybrid
import lyapunov
from models import dry_friction_oscillator
from models.dry_friction_oscillator import den_hartog_amplitude
from tests.reference.load import complex_pairs, reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
FRICTION = reference("dry_friction_oscillator")
SYSTEM = dry_friction_oscillator()

without_stops = pytest.mark.parametrize(
    "motion", FRICTION["without stops"], ids=lambda motion: f"w = {motion['w']}"
)
two_stops = pytest.mark.parametrize("motion", FRICTION["two stops"], ids=lambda motion: f"w = {motion['w']}")


def parameters_of(motion):
    return {"f": motion["f"], "w": motion["w"]}


def orbit_of(motion):
    return hybrid.periodic_orbit(
        SYSTEM, np.array(motion["x0"]) + 1e-3, parameters=parameters_of(motion), t0=motion["t0"]
    )


@without_stops
def test_amplitude(motion):
    assert den_hartog_amplitude(motion["f"], 1.0, motion["w"]) == pytest.approx(
        motion["amplitude"], rel=1e-13
    )


@two_stops
def test_no_amplitude_where_the_motion_stops(motion):
    assert math.isnan(den_hartog_amplitude(motion["f"], 1.0, motion["w"]))


@without_stops
def test_orbit_without_stops(motion):
    orbit = orbit_of(motion)
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, motion["x0"], atol=1e-10)
    found = sorted(orbit.multipliers, key=lambda m: m.imag)
    np.testing.assert_allclose(found, complex_pairs(motion["multipliers"]), atol=1e-8)
    turning = [jump.x_minus[0] for jump in orbit.arc().jumps]
    np.testing.assert_allclose(turning, [-motion["amplitude"], motion["amplitude"]], atol=1e-10)


@pytest.mark.parametrize("w", [0.62, 0.75, 0.9, 1.2, 2.0])
def test_every_start_comes_to_the_amplitude(w):
    period = 2 * math.pi / w
    arc = hybrid.simulate(SYSTEM, (3.0, 0.0), (0.0, 150 * period), parameters={"f": 0.3, "w": w})
    last = arc.jumps.x_minus[-2:, 0]
    np.testing.assert_allclose(
        np.sort(last), den_hartog_amplitude(0.3, 1.0, w) * np.array([-1, 1]), atol=1e-8
    )


@two_stops
def test_slips_between_two_stops(motion):
    """The block is released again half a period later, on the other side."""
    half = math.pi / motion["w"]
    start = (motion["amplitude"], 0.0)
    span = (0.5 * motion["release"], motion["release"] + 2.5 * half)
    arc = hybrid.simulate(SYSTEM, start, span, parameters=parameters_of(motion), solver=TIGHT)
    expected = np.add.outer([0.0, half, 2 * half], [motion["release"], motion["stop"]]).ravel()
    np.testing.assert_allclose(arc.jumps.t, expected[: len(arc.jumps)], atol=1e-10)
    assert [jump.transition for jump in arc.jumps[:4]] == [
        "sliding->below", "below->sliding", "sliding->above", "above->sliding"
    ]  # fmt: skip
    stops = [jump.x_plus[0] for jump in arc.jumps[1:4:2]]
    np.testing.assert_allclose(stops, [-motion["amplitude"], motion["amplitude"]], atol=1e-10)


@two_stops
def test_multipliers_with_two_stops(motion):
    middle = 0.5 * (motion["stop"] - math.pi / motion["w"] + motion["release"])
    orbit = hybrid.periodic_orbit(
        SYSTEM, (motion["amplitude"], 0.0), parameters=parameters_of(motion), t0=middle
    )
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers)[::-1], motion["multipliers"], atol=1e-8)


@two_stops
def test_a_stop_loses_a_direction(motion):
    result = lyapunov.lyapunov_spectrum(SYSTEM, (1.0, 0.0), parameters=parameters_of(motion), intervals=300)
    exact = math.log(motion["multipliers"][0]) * motion["w"] / (2 * math.pi)
    assert result.exponents[0] == pytest.approx(exact, abs=1e-3)
    assert result.exponents[1] == -math.inf


def test_without_friction_a_linear_resonance():
    """``x = A cos(w t) / (1 - w^2)`` if the friction is only rounding."""
    assert den_hartog_amplitude(0.0, 2.0, 0.5) == pytest.approx(2.0 / 0.75, rel=1e-14)


def test_one_of_a_family_at_half_the_natural_frequency():
    """``X = 4/3`` turns at the forcing's extremes, where the acceleration falls to a quarter of itself."""
    start, parameters = (4 / 3, 0.0), {"f": 0.2, "w": 0.5}
    assert den_hartog_amplitude(0.2, 1.0, 0.5) == pytest.approx(4 / 3, rel=1e-14)
    half = hybrid.simulate(
        SYSTEM, start, (0.0, 2 * math.pi), parameters=parameters, solver=TIGHT, samples=[math.pi]
    ).x[0]
    orbit = hybrid.periodic_orbit(SYSTEM, half, parameters=parameters, t0=math.pi)
    np.testing.assert_allclose(orbit.multipliers, [1.0, 1 / 16], atol=1e-8)


def test_viscous_damping_contracts_with_the_friction():
    """An orbit that crosses contracts areas by ``exp(-c T)`` and by each turn's ratio of accelerations."""
    c, period = 0.2, SYSTEM.forcing_period()
    arc = hybrid.simulate(
        SYSTEM, (2.0, 1.0), (0.0, 3 * period), parameters={"c": c, "f": 0.3}, tangent=True, solver=TIGHT
    )
    assert [jump.transition for jump in arc.jumps[:2]] == ["above->below", "below->above"]
    ratios = 1.0
    for jump in arc.jumps:
        force = math.cos(0.8 * jump.t) - jump.x_minus[0]
        turn = 0.3 if jump.transition == "above->below" else -0.3
        ratios *= (force + turn) / (force - turn)
    assert np.linalg.det(arc.fundamental) == pytest.approx(ratios * math.exp(-3 * c * period), rel=1e-9)


@hypothesis.given(
    f=st.floats(0.05, 0.95),
    w=st.floats(0.3, 2.0),
    size=st.floats(-9, 9).map(lambda power: 10**power),
    start=st.integers(0, 10**6),
)
@hypothesis.example(f=0.75, w=1.25, size=1.0, start=0)
@hypothesis.example(f=0.75, w=1.15, size=1.0, start=0)
def test_a_stop_ends_once(f, w, size, start):
    """A mass that is about to slip is at rest: its speed and acceleration are only rounding."""
    period = 2 * math.pi / w
    arc = hybrid.simulate(
        SYSTEM,
        (0.0, size),
        (start * period, (start + 30) * period),
        parameters={"A": size, "f": f * size, "w": w},
        max_jumps=1000,
    )
    assert arc.status.code is hybrid.StatusCode.SUCCESS
    assert len(set(arc.jumps.t)) == len(arc.jumps)


@pytest.mark.parametrize("size", [1e-300, 1e-160, 1e160, 1e300])
def test_den_hartogs_amplitude_scales_with_the_forces(size):
    """The squares of the amplitudes are beyond the range of floats."""
    assert den_hartog_amplitude(0.5 * size, size, 0.8) == pytest.approx(
        size * den_hartog_amplitude(0.5, 1.0, 0.8), rel=1e-14
    )


def test_a_forcing_too_slow_for_floats():
    with pytest.raises(hybrid.ArgumentError, match="pi / w is inf"):
        den_hartog_amplitude(0.5, 1.0, 5e-324)
