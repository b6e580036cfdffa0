"""Orbits along which a contact is held, on a surface that moves or is curved, and its parameters."""

import numpy as np
import pytest

from hybrid import Contact, continue_orbit, mechanics, periodic_orbit, simulate
from hybrid.errors import ArgumentError

A, W, K, G = 0.02, 15.0, 400.0, 9.81


def table(**given):
    """A mass on a spring that rests on a table at height ``A cos(w t)``."""
    return mechanics(
        coordinates=("q",),
        velocities=("v",),
        parameters={"A": A, "w": W, "e": 0.3},
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-G - K * (x.q + 0.03),),
        contacts=[Contact("table", gap=lambda t, x, p: x.q - p.A * np.cos(p.w * t), restitution="e")],
        period=lambda p: 2 * np.pi / p.w,
        **given,
    )


def track():
    """A bead that a wind drives around a closed track of the height ``0.2 cos(2 x)``, and air brakes."""
    return mechanics(
        coordinates=("x", "y"),
        velocities=("u", "v"),
        parameters={"wind": 3.0},
        mass=lambda t, x, p: (1.0, 1.0),
        forces=lambda t, x, p: (p.wind - x.u, -G - x.v),
        contacts=[Contact("track", gap=lambda t, x, p: x.y - 0.2 * np.cos(2.0 * x.x))],
        angles={"x": np.pi},
    )


def on_the_table(t, w=W):
    return {"q": A * np.cos(w * t), "v": -A * w * np.sin(w * t)}


# The spring and gravity press with k (q + 0.03) + g, the table falls with m A w^2 at its top.
LIFTOFF = np.sqrt((K * (A + 0.03) + G) / A)


@pytest.mark.parametrize("t0", [0.0, 0.05])
def test_sensitivities_follow_the_surface(t0):
    arc = simulate(table(), on_the_table(t0), (t0, 0.4), mode="table", sensitivities=("A", "w"))
    phase = W * 0.4
    expected = [
        [np.cos(phase), -A * 0.4 * np.sin(phase)],
        [-W * np.sin(phase), -A * np.sin(phase) - A * W * 0.4 * np.cos(phase)],
    ]
    np.testing.assert_allclose(arc.sensitivity, expected, atol=1e-9)


@pytest.mark.parametrize("t0", [0.0, 0.05])
def test_a_branch_of_orbits_at_rest_ends_where_the_mass_lifts_off(t0):
    orbit = periodic_orbit(table(), on_the_table(t0), mode="table", t0=t0)
    np.testing.assert_allclose(orbit.multipliers, 0.0, atol=1e-12)
    branch = continue_orbit(orbit, "w", (10.0, 60.0))
    assert branch.status.ok
    assert len(branch) < 200
    [lift] = branch.bifurcations
    assert lift.kind == "grazing"
    assert lift.value == pytest.approx(LIFTOFF, rel=1e-10)


def test_an_orbit_whose_impacts_accumulate_is_found_and_followed():
    """It bounces onto the table, rests there, and lifts off where the force is zero."""
    system, w = table(), 1.05 * LIFTOFF
    period = 2 * np.pi / w
    run = simulate(system, {"q": 0.03, "v": 0.0}, (0.0, 20 * period), parameters={"w": w})
    orbit = periodic_orbit(system, run.x[-1], mode=run.end.mode, t0=run.t[-1], parameters={"w": w})
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.multipliers, 0.0, atol=1e-12)
    branch = continue_orbit(orbit, "w", (LIFTOFF * 1.02, LIFTOFF * 1.1))
    assert branch.status.ok
    assert branch.parameter[[0, -1]] == pytest.approx([LIFTOFF * 1.02, LIFTOFF * 1.1])
    for each in (orbit, branch.orbit(0), branch.orbit(-1)):
        [lift] = each.arc().jumps["table opens"]
        w = each.parameters["w"]
        # The force k (q + 0.03) + g + q'' with q = A cos(phase).
        assert np.cos(w * lift.t) == pytest.approx((K * 0.03 + G) / (A * (w**2 - K)), abs=1e-9)


def test_newton_converges_on_a_curved_surface():
    system = track()
    run = simulate(system, {"x": 0.0, "y": 0.2, "u": 3.0, "v": 0.0}, (0.0, 12.0))
    assert run.end.mode == "track"
    orbit = periodic_orbit(system, run.x[-1], mode="track", period=1.1)
    assert orbit.status.ok
    assert orbit.residual < 1e-10
    # Four directions: two lead off the track, one is along the time.
    sizes = np.sort(np.abs(orbit.multipliers))
    np.testing.assert_allclose(sizes[[0, 1, 3]], [0.0, 0.0, 1.0], atol=1e-8)
    assert 0.0 < sizes[2] < 1.0


@pytest.mark.parametrize("off", [3e-8, -3e-8])
def test_a_run_goes_on_where_a_held_contact_is_a_little_off(off):
    system = table()
    start = {"q": A + off, "v": 0.0}
    arc = simulate(system, start, (0.0, 0.1), mode="table")
    assert set(arc.mode) == {"table"}
    if off < 0.0:
        with pytest.raises(ArgumentError, match="bodies cannot overlap"):
            simulate(system, start, (0.0, 0.1), mode="free")
