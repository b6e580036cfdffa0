"""The ball on the table: its orbits and their multipliers in closed form, chatter, locking and release."""

import math

import numpy as np
import pytest

import hybrid
from models import bouncing_table

G, E, A, W = 9.81, 0.5, 0.01, 36.0
PERIOD = 2 * math.pi / W
TIGHT = hybrid.DOP853(rtol=1e-12, atol=1e-15)


def one_bounce_orbit(amplitude, n=1):
    """State and time halfway through the flight, from the ball's parabola; sum of the multipliers."""
    gamma = amplitude * W**2 / G
    phase = math.acos(math.pi * n * (1 - E) / (gamma * (1 + E)))
    flight = n * PERIOD / 2
    t = phase / W + flight
    q = amplitude * math.sin(phase) + (math.pi * n * G / W) * flight - G * flight**2 / 2
    x = (q - amplitude * math.sin(W * t), -amplitude * W * math.cos(W * t))
    return x, t, 1 + E**2 - (1 + E) ** 2 * gamma * math.sin(phase)


@pytest.mark.parametrize(("amplitude", "n"), [(0.009, 1), (0.01, 1), (0.0125, 1), (0.02, 2)])
def test_one_bounce_orbits(amplitude, n):
    x, t, trace = one_bounce_orbit(amplitude, n)
    orbit = hybrid.periodic_orbit(
        bouncing_table(), np.array(x) * 1.001, mode="flight", parameters={"A": amplitude}, t0=t, periods=n
    )
    assert orbit.status.ok
    np.testing.assert_allclose(orbit.x0, x, atol=1e-12)
    exact = np.roots([1.0, -trace, E**2])
    np.testing.assert_allclose(np.sort_complex(orbit.multipliers), np.sort_complex(exact), atol=1e-8)


def test_the_period_doubles_where_the_closed_form_says():
    doubling = math.hypot(math.pi * (1 - E) / (1 + E), 2 * (1 + E**2) / (1 + E) ** 2) * G / W**2
    _, _, trace = one_bounce_orbit(doubling)
    assert trace == pytest.approx(-1 - E**2)
    for amplitude, periods in ((0.995 * doubling, 1), (1.005 * doubling, 2)):
        x, t, _ = one_bounce_orbit(amplitude)
        section = hybrid.stroboscopic_section(
            bouncing_table(),
            np.array(x) * 1.001,
            mode="flight",
            parameters={"A": amplitude},
            t0=t,
            transient=3000,
            periods=4,
        )
        distance = np.abs(section.x - section.x[0]).max(axis=1)
        assert [bool(d < 1e-8) for d in distance[1:]] == [step % periods == 0 for step in (1, 2, 3)]


def test_a_ball_on_a_gentle_table_locks_onto_it():
    """Below one g the ball never lifts off again."""
    arc = hybrid.simulate(bouncing_table(), (0.005, 0.0), (0.0, 5.0), mode="flight", parameters={"A": 0.005})
    assert arc.status.ok
    assert (arc.jumps[-1].kind, arc.mode[-1]) == ("limit", "rest")
    np.testing.assert_allclose(arc.x[-1], 0.0, atol=1e-12)


def test_a_locked_ball_lifts_off_when_the_table_falls_as_fast():
    arc = hybrid.simulate(bouncing_table(), (0.001, 0.0), (0.0, 1.0), mode="flight", solver=TIGHT)
    liftoffs = [jump.t for jump in arc.jumps if jump.transition == "liftoff"]
    assert len(liftoffs) > 3
    # The last bounces of a chatter are no higher than the tolerance.
    assert {jump.kind for jump in arc.jumps} <= {"transverse", "grazing", "limit"}
    assert sum(jump.kind == "limit" for jump in arc.jumps) == len(liftoffs)
    exact = math.asin(G / (A * W**2)) / W
    np.testing.assert_allclose([t % PERIOD for t in liftoffs], exact, rtol=0, atol=1e-10)


def test_a_ball_at_rest_lifts_off_once():
    """The ball leaves with zero speed and acceleration, on the guard of the next bounce."""
    for e in (0.0, E):
        start = math.asin(G / (A * W**2)) / W
        arc = hybrid.simulate(
            bouncing_table(), (0.0, 0.0), (0.0, start + PERIOD / 4), mode="rest", parameters={"e": e}
        )
        assert [jump.transition for jump in arc.jumps] == ["liftoff"]
        flight = PERIOD / 4
        velocity = A * W * (math.cos(W * start) - math.cos(W * start + math.pi / 2)) - G * flight
        assert arc.x[-1, 1] == pytest.approx(velocity, abs=1e-10)


def test_the_gap_of_a_moving_table_gives_the_same_run():
    """There bounces, chatter, rest and lift-off follow; in the model they are written by hand."""
    table = hybrid.mechanics(
        coordinates=("y",),
        velocities=("v",),
        parameters={"g": G, "e": E, "A": A, "w": W},
        mass=lambda t, x, p: (1.0,),
        forces=lambda t, x, p: (-p.g,),
        contacts=[hybrid.Contact("table", gap=lambda t, x, p: x.y - p.A * np.sin(p.w * t), restitution="e")],
        period=lambda p: 2 * np.pi / p.w,
    )
    by_hand = hybrid.simulate(bouncing_table(), (0.001, 0.0), (0.0, 1.0), mode="flight", solver=TIGHT)
    by_gap = hybrid.simulate(table, (0.001, A * W), (0.0, 1.0), solver=TIGHT)
    liftoffs = [jump.t for jump in by_hand.jumps["liftoff"]]
    assert len(liftoffs) > 3
    assert [jump.t for jump in by_gap.jumps["table opens"]] == pytest.approx(liftoffs, abs=1e-10)
    t = np.linspace(0.0, 1.0, 200)
    np.testing.assert_allclose(by_gap(t)[:, 0] - A * np.sin(W * t), by_hand(t)[:, 0], rtol=0, atol=1e-9)
    rests = by_gap.mode == "table"
    force = G - A * W**2 * np.sin(W * by_gap.t[rests])
    np.testing.assert_allclose(by_gap["table.normal"][rests], force, atol=1e-9)


def test_areas_contract_as_the_bounces_say():
    """``det Phi = e^(2 N)`` after N bounces of a chaotic run: a flight preserves areas."""
    parameters = {"A": 0.0125, "e": 0.8}
    arc = hybrid.simulate(
        bouncing_table(),
        (0.01, 0.3),
        (0.0, 1.5),
        mode="flight",
        parameters=parameters,
        tangent=True,
        solver=TIGHT,
    )
    assert len(arc.jumps) > 3
    assert np.linalg.det(arc.fundamental) == pytest.approx(0.8 ** (2 * len(arc.jumps)), rel=1e-7)


def test_the_units_agree_with_each_other():
    units = bouncing_table().units
    assert units["A"] == units["q"] == "m"
    assert units["v"] == f"{units['q']}/{units['t']}"
    assert units["g"] == f"{units['q']}/{units['t']}^2"
    assert units["w"] == f"rad/{units['t']}"
