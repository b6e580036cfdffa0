"""The mass on a springy leg: hopping in closed form, a stable run, energy."""

import math

import numpy as np
import pytest

import hybrid
from models import slip_hopper
from tests.reference.load import reference

TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-14)
RUN = reference("slip_hopper")
SYSTEM = slip_hopper()
G = 9.81
APEX = hybrid.Guard(lambda t, x, p: x.vy, direction=-1)


def energy(x):
    """Energy per mass in flight."""
    return 0.5 * (x[..., 2] ** 2 + x[..., 3] ** 2) + G * x[..., 1]


@pytest.mark.parametrize("height", [1.02, 1.2, 2.0])
def test_hopping_in_place(height):
    w, v = math.sqrt(20e3 / 80), math.sqrt(2 * G * (height - 1))
    stance, flight = 2 * (math.pi - math.atan(w * v / G)) / w, 2 * v / G
    arc = hybrid.simulate(
        SYSTEM, (0, height, 0, 0), (0.0, 2.2 * (stance + flight)), mode="descent",
        parameters={"alpha": math.pi / 2}, solver=TIGHT,
    )  # fmt: skip
    first = np.array([flight / 2, flight / 2 + stance, flight + stance])
    np.testing.assert_allclose(arc.jumps.t[:6], [*first, *(first + first[2])], atol=1e-10)
    assert [jump.transition for jump in arc.jumps[:3]] == ["touchdown", "takeoff", "apex"]
    np.testing.assert_allclose(arc.jumps[5].x_plus, [0, height, 0, 0], atol=1e-9)
    deepest = G / w**2 + math.hypot(G / w**2, v / w)
    middle = arc(flight / 2 + stance / 2)
    np.testing.assert_allclose(middle, [0, 1 - deepest, 0, 0], atol=1e-9)


def test_energy_is_conserved_over_a_run():
    arc = hybrid.simulate(SYSTEM, (0, 1, 5, 0), (0.0, 20.0), mode="descent", solver=TIGHT)
    apexes = np.array([jump.x_minus for jump in arc.jumps if jump.transition == "apex"])
    assert len(apexes) > 70
    np.testing.assert_allclose(energy(apexes), RUN["energy"], rtol=1e-11)


def test_the_run_is_stable_and_comes_to_its_fixed_point():
    """The apex map contracts by its slope at the fixed point."""
    section = hybrid.poincare_section(SYSTEM, (0, 1, 5, 0), APEX, points=14, mode="descent", solver=TIGHT)
    assert section.x[-1, 1] == pytest.approx(RUN["apex"], abs=1e-11)
    assert section.x[-1, 2] == pytest.approx(RUN["speed"], abs=1e-10)
    assert section.t[-1] - section.t[-2] == pytest.approx(RUN["period"], abs=1e-10)
    misses = section.x[:, 1] - RUN["apex"]
    np.testing.assert_allclose(misses[6:8] / misses[5:7], RUN["multiplier"], atol=2e-4)


def test_multipliers():
    """One for time, one for energy, zero for the lost position, and the slope of the apex map."""
    start = (0, RUN["apex"], RUN["speed"], 0)
    arc = hybrid.simulate(SYSTEM, start, (0.0, RUN["period"]), mode="descent", tangent=True, solver=TIGHT)
    # Compare away from the defective pair at 1, which is accurate only to the square root of rounding.
    found = sorted(np.linalg.eigvals(arc.fundamental), key=lambda m: m.real)
    np.testing.assert_allclose(found[:2], [RUN["multiplier"], 0.0], atol=1e-8)
    np.testing.assert_allclose(found[2:], [1.0, 1.0], atol=1e-4)
